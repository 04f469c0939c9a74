"""Video: what goes in comes out, any frame in any order, and damage is told."""

import os
import signal
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio

from films import EXTENSIONS, film, write
from flurries.io import VideoWriter, open_background, read_video
from flurries.io.films.codecs import frame_rate


def only(path):
    return [entry.name for entry in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_what_goes_in_comes_out(tmp_path, extension):
    path = write(tmp_path / f"a.{extension}", film(30), 25)
    found = list(read_video(path))
    assert len(found) == 30
    for given, back in zip(film(30), found, strict=True):
        assert (back.dtype, back.shape) == (np.uint8, given.shape)
        if extension == "mkv":
            np.testing.assert_array_equal(back, given)
        else:
            assert peak_signal_noise_ratio(given, back) > 40
    source = open_background(path)
    assert (source.count, source.size, source.fps, source.encoding) == (30, (96, 64), 25, "display")
    assert only(path)


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_colors_are_right(tmp_path, extension):
    patches = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255] * 3, [0] * 3, [18] * 3, [200, 120, 40]]
    frame = np.repeat(np.array(patches, np.uint8)[None], 32, axis=1).repeat(32, axis=0)
    path = write(tmp_path / f"a.{extension}", [frame] * 3)
    back = list(read_video(path))[1].astype(int)
    for number, color in enumerate(patches):
        patch = back[8:24, 32 * number + 8 : 32 * number + 24]
        assert np.abs(patch - color).max() <= 4, color
    # Another program goes by the tags: BT.709, 16 to 235. By BT.601 red would be brighter, 81.
    with av.open(str(path)) as container:
        image = next(container.decode(video=0))
        if extension == "mkv":
            assert container.streams.video[0].codec_context.colorspace == 0, "RGB"
            return
        assert (image.colorspace, image.color_range) == (1, 1)
        red, white, black = (image.to_ndarray()[8:24, 32 * n + 8 : 32 * n + 24] for n in (0, 3, 4))
        assert abs(red.mean() - (16 + 219 * 0.2126)) < 1.5
        assert abs(white.mean() - 235) < 1.5
        assert abs(black.mean() - 16) < 1.5


@pytest.mark.parametrize("size", [(97, 64), (97, 65), (1, 1)])
@pytest.mark.parametrize("extension", ["mp4", "webm", "mkv"])
def test_odd_sizes_get_one_more_row_or_column(tmp_path, size, extension):
    width, height = size
    path = write(tmp_path / f"a.{extension}", film(4, width, height))
    wide, high = (width, height) if extension == "mkv" else (width + width % 2, height + height % 2)
    for given, back in zip(film(4, width, height), read_video(path), strict=True):
        assert back.shape == (high, wide, 3)
        padded = np.pad(given, ((0, high - height), (0, wide - width), (0, 0)), mode="edge")
        # Nothing was resized: the picture is where it was.
        assert np.abs(back.astype(int) - padded).max() <= (0 if extension == "mkv" else 14)


@pytest.mark.parametrize(("given", "fraction"), [
    (24, Fraction(24)), (25.0, Fraction(25)), (23.976, Fraction(24000, 1001)),
    (23.98, Fraction(24000, 1001)), (29.97, Fraction(30000, 1001)), (59.94, Fraction(60000, 1001)),
    (Fraction(30000, 1001), Fraction(30000, 1001)), (12.5, Fraction(25, 2)), (0.5, Fraction(1, 2)),
    (np.float32(24), Fraction(24)), (1000, Fraction(1000)),
])  # fmt: skip
def test_frame_rates(given, fraction):
    assert frame_rate(given) == fraction


def test_a_video_needs_a_frame_and_a_block(tmp_path):
    path = tmp_path / "a.mp4"
    with pytest.raises(ValueError, match=r"\.mp4, \.mov, \.webm, \.mkv, not '\.avi'"):
        VideoWriter(tmp_path / "a.avi", (8, 8), 24)
    with (
        pytest.raises(ValueError, match=r"a\.mp4: .*at least one frame"),
        VideoWriter(path, (8, 8), 24),
    ):
        pass
    video = VideoWriter(path, (8, 8), 24)
    with pytest.raises(RuntimeError, match="inside a 'with' block"):
        video.write(np.zeros((8, 8, 3), np.uint8))
    assert not any(tmp_path.iterdir())
    with video:
        video.write(np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(RuntimeError, match="one video only"), video:
        pass
    assert len(list(read_video(path))) == 1


def codecs():
    tasks = Path("/proc/self/task").glob("*/children")
    children = {child for task in tasks for child in task.read_text().split()}
    return [int(one) for one in children if "films" in Path(f"/proc/{one}/cmdline").read_text()]


def crash_codecs():
    for child in codecs():
        os.kill(child, signal.SIGSEGV)
        os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_a_crash_of_the_codec_is_a_sentence(tmp_path, extension):
    path = tmp_path / f"a.{extension}"
    with (
        pytest.raises(OSError, match=rf"a\.{extension}: the video cannot be written: .*SIGSEGV"),
        VideoWriter(path, (96, 64), 24) as video,
    ):
        for number, frame in enumerate(film(5)):
            video.write(frame)
            if number == 2:
                crash_codecs()
    assert not any(tmp_path.iterdir())
    source = open_background(write(path, film(9)))
    whole = [source.frame(number).pixels.copy() for number in range(3)]
    write(tmp_path / f"b.{extension}", film(2))  # Its codec waits for another film, and ends, too.
    crash_codecs()
    with pytest.raises(OSError, match=rf"a\.{extension}: the video cannot be read: .*SIGSEGV"):
        source.frame(5)
    source.frame(6)
    np.testing.assert_array_equal(source.frame(2).pixels, whole[2])
