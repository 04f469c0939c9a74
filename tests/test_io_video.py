"""Video: what goes in comes out, any frame in any order, by any process, and damage is told."""

import os
import signal
import struct
import threading
from fractions import Fraction
from pathlib import Path
from queue import SimpleQueue

import av
import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio

from films import EXTENSIONS, encode, film, write
from flurries._ahead import Ahead
from flurries.io import VideoWriter, open_background, read_video, write_picture
from flurries.io.films.codecs import frame_rate


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
    assert list(tmp_path.iterdir()) == [path]


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


@pytest.mark.parametrize("extension", ["mp4", "webm"])
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


STREAMS = {
    "open.mp4": ("libx264", {"g": "8", "bf": "3", "x264-params": "open-gop=1"}),
    "open.ts": ("libx264", {"g": "8", "bf": "3", "x264-params": "open-gop=1"}),
    "refresh.mkv": ("libx264", {"g": "8", "x264-params": "intra-refresh=1"}),
    "hidden.webm": ("libvpx-vp9", {"g": "8", "auto-alt-ref": "1", "lag-in-frames": "12"}),
    "old.avi": ("mpeg4", {"g": "8", "b": "4000000"}),
    "reordered.avi": ("libx264", {"g": "8", "bf": "3"}),
    "old.mpg": ("mpeg2video", {"g": "8", "bf": "2", "b": "4000000"}),
}


@pytest.mark.parametrize("name", STREAMS)
def test_random_access_gives_the_frames_of_sequential_access(tmp_path, name):
    codec, options = STREAMS[name]
    path = encode(tmp_path / name, codec, film(45), options=options)
    frames = list(read_video(path))
    assert len(frames) == 45
    # Each frame is its own: waves move by three pixels.
    likeness = [[np.abs(a.astype(int) - b).mean() for b in film(45)] for a in frames[::11]]
    assert np.argmin(likeness, axis=1).tolist() == list(range(0, 45, 11))
    source = open_background(path)
    for number in np.random.default_rng(5).integers(0, 45, 60):
        np.testing.assert_array_equal(source.frame(int(number)).pixels, frames[number])
    halves = [one.reshape(32, 2, 48, 2, 3).mean(axis=(1, 3)) for one in frames[11:13]]
    off = [np.abs(source.smaller(11, 2) - one).mean() for one in halves]
    assert off[0] < 0.5 and off[1] > 3.0 * off[0], off


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_rotation_is_honoured(tmp_path, quarters):
    path = encode(tmp_path / "a.mp4", "libx264", film(2), options={"crf": "10"})
    # The matrix of the track header, as a telephone writes it: 16.16 fixed point, clockwise.
    cosine, sine = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarters]
    data = bytearray(path.read_bytes())
    place = data.index(b"tkhd") + 4 + 40
    assert struct.unpack(">9i", data[place : place + 36])[0] == 0x10000
    one = 0x10000
    matrix = (cosine * one, sine * one, 0, -sine * one, cosine * one, 0, 0, 0, 0x40000000)
    data[place : place + 36] = struct.pack(">9i", *matrix)
    path.write_bytes(data)
    source = open_background(path)
    wanted = np.rot90(next(film(1)), -quarters)
    assert source.size == wanted.shape[1::-1]
    assert np.abs(source.frame(0).pixels.astype(int) - wanted).mean() < 4


def test_children_and_their_parent_read_one_video(tmp_path):
    path = encode(tmp_path / "a.mp4", "libx264", film(30), options={"g": "6"})
    frames, source = list(read_video(path)), open_background(path)
    source.frame(7)
    children = []
    for seed in range(6):
        child = os.fork()
        if child == 0:
            numbers = np.random.default_rng(seed).integers(0, 30, 15)
            good = all(np.array_equal(source.frame(int(n)).pixels, frames[n]) for n in numbers)
            os._exit(0 if good else 1)
        children.append(child)
    for number in range(8, 30):
        np.testing.assert_array_equal(source.frame(number).pixels, frames[number])
    assert [os.waitpid(child, 0)[1] for child in children] == [0] * 6


@pytest.mark.parametrize("extension", [*EXTENSIONS, "avi"])
def test_a_video_that_broke_off_is_an_error(tmp_path, extension):
    path = tmp_path / f"a.{extension}"
    if extension == "avi":
        encode(path, "mpeg4", film(12))
    else:
        write(path, film(12))
    data = path.read_bytes()
    cut = tmp_path / f"cut.{extension}"
    for length in [0, 9, *(len(data) * n // 6 for n in range(1, 6)), len(data) - 1]:
        cut.write_bytes(data[:length])
        with pytest.raises(OSError, match=r"cut\."):
            list(read_video(cut))
        with pytest.raises(OSError, match=r"cut\."):
            open_background(cut)


def test_damage_in_h264_is_told_for_the_same_frames_in_any_order(tmp_path):
    options = {"g": "8", "bf": "3", "mbtree": "0"}
    path = encode(tmp_path / "a.mp4", "libx264", film(40), options=options)
    frames, data = list(read_video(path)), path.read_bytes()
    start, told, random = data.index(b"mdat") + 1000, 0, np.random.default_rng(8)
    for place in random.integers(start, len(data) - 4000, 6):
        bad = bytearray(data)
        bad[place : place + 50] = random.bytes(50)
        path.write_bytes(bad)
        source = open_background(path)

        def look(number, source=source):
            try:
                return source.frame(number).pixels
            except OSError as error:
                assert "is damaged" in str(error)
                return None

        ordered = [look(number) for number in range(40)]
        damaged = [number for number, found in enumerate(ordered) if found is None]
        told += bool(damaged)
        # Frames before the damage, and those of the groups behind it, are whole.
        if damaged:
            spared = [n for n in range(40) if n // 8 not in {d // 8 for d in damaged}]
            assert all(np.array_equal(ordered[n], frames[n]) for n in spared[:8])
        source.close()
        for number in np.random.default_rng(9).permutation(40):
            found = look(int(number))
            assert (found is None) == (ordered[number] is None)
            assert found is None or np.array_equal(found, ordered[number])
        held = open_background(path, damaged="hold")
        for number in damaged[:3]:
            earlier = max(n for n in range(number) if ordered[n] is not None)
            np.testing.assert_array_equal(held.frame(number).pixels, ordered[earlier])
    assert told >= 4


def test_files_that_are_no_videos(tmp_path):
    write_picture(tmp_path / "picture.png", np.zeros((8, 8, 3), np.uint8))
    (tmp_path / "picture.mp4").write_bytes((tmp_path / "picture.png").read_bytes())
    (tmp_path / "text.mp4").write_text("no film\n" * 50)
    (tmp_path / "text.dat").write_text("no film\n" * 50)
    for name, error in [
        ("missing.mp4", FileNotFoundError), ("picture.mp4", OSError), ("text.mp4", OSError),
        ("text.dat", ValueError),
    ]:  # fmt: skip
        with pytest.raises(error, match=name):
            list(read_video(tmp_path / name))
    with pytest.raises(ValueError, match="path must name a file"):
        list(read_video(""))


def test_scripts_that_name_other_files_are_not_followed(tmp_path):
    victim = write(tmp_path / "victim.mkv", film(3))
    script = "ffconcat version 1.0\nfile victim.mkv\n"
    playlist = "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nvictim.ts\n#EXT-X-ENDLIST\n"
    encode(tmp_path / "victim.ts", "libx264", film(3))
    for name, text in [("a.mkv", script), ("b.mkv", playlist), ("c.m3u8", playlist)]:
        (tmp_path / name).write_text(text)
        with pytest.raises((OSError, ValueError), match=name):
            open_background(tmp_path / name)
    assert victim.exists()


def test_who_drops_what_is_made_ahead_does_not_wait_for_it():
    """Garbage is collected in any thread, also in one that holds what the maker waits for."""
    late, seen = threading.Event(), SimpleQueue[bool]()
    ahead = Ahead(one() for one in (lambda: 1, lambda: seen.put(late.wait(60.0)) or 2))
    assert next(ahead) == 1
    del ahead
    late.set()
    assert seen.get()
