"""Video: what goes in comes out, any frame in any order, and damage is told."""

import hashlib
import os
import pickle
import struct
import threading
from fractions import Fraction

import av
import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio

from flurries.io import VideoWriter, open_background, read_video, write_picture
from flurries.io.films.codecs import frame_rate
from flurries.io.films.reader import VideoReader
from flurries.io.structure import check_structure

# Newer Pythons warn when a process with threads is forked, which is what these tests are about.
pytestmark = pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")

EXTENSIONS = ["mp4", "mov", "webm", "mkv"]


def film(count, width=96, height=64):
    """Moving waves whose colors stay within what any video can show."""
    y, x = np.mgrid[:height, :width]
    for n in range(count):
        waves = [np.sin((x + 3 * n) / 17), np.cos((y + 2 * n) / 13), np.sin((x + y - n) / 23)]
        yield np.rint(128 + 70 * np.stack(waves, axis=-1)).astype(np.uint8)


def write(path, frames, fps=24, **options):
    frames = list(frames)
    with VideoWriter(path, frames[0].shape[1::-1], fps, **options) as video:
        for frame in frames:
            video.write(frame)
    return path


def encode(path, codec, frames, *, rate=24, pixels="yuv420p", options=None, rotation=None):
    """A video straight from the library, with settings that our writer does not use."""
    with av.open(str(path), "w") as container:
        stream = None
        for number, frame in enumerate(frames):
            if stream is None:
                if options is None:
                    options = {"mbtree": "0"} if codec == "libx264" else {}
                stream = container.add_stream(codec, rate=rate, options=options)
                stream.codec_context.thread_count = 1
                stream.height, stream.width, stream.pix_fmt = *frame.shape[:2], pixels
                if rotation is not None:
                    stream.set_display_rotation(rotation)
            image = av.VideoFrame.from_ndarray(frame, "rgb24").reformat(format=pixels, threads=1)
            image.pts, image.time_base = number, Fraction(1, rate)
            container.mux(stream.encode(image))
        container.mux(stream.encode())
    return path


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def only(path):
    return [entry.name for entry in path.parent.iterdir()] == [path.name]


# Round trips


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


@pytest.mark.parametrize("extension", ["mp4", "webm", "mkv"])
def test_worse_quality_is_smaller(tmp_path, extension):
    sizes, likeness = [], []
    for quality in ("high", "medium", "draft"):
        path = write(tmp_path / f"{quality}.{extension}", film(12), quality=quality)
        sizes.append(path.stat().st_size)
        pairs = zip(film(12), read_video(path), strict=True)
        likeness.append(min(np.abs(a.astype(int) - b).mean() for a, b in pairs))
    if extension == "mkv":
        assert len(set(sizes)) == 1
        assert likeness == [0, 0, 0]
    else:
        assert sizes == sorted(sizes, reverse=True)
        assert likeness[0] < likeness[2]


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_colors_are_right(tmp_path, extension):
    patches = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255] * 3, [0] * 3, [18] * 3, [200, 120, 40]]
    frame = np.repeat(np.array(patches, np.uint8)[None], 32, axis=1).repeat(32, axis=0)
    path = write(tmp_path / f"a.{extension}", [frame] * 3)
    back = list(read_video(path))[1].astype(int)
    for number, color in enumerate(patches):
        patch = back[8:24, 32 * number + 8 : 32 * number + 24]
        assert np.abs(patch - color).max() <= 4, color
    if extension == "mkv":
        return
    # Another program goes by the tags: BT.709, 16 to 235. By BT.601 red would be brighter, 81.
    with av.open(str(path)) as container:
        image = next(container.decode(video=0))
        assert (image.colorspace, image.color_range) == (1, 1)
        red, white, black = (image.to_ndarray()[8:24, 32 * n + 8 : 32 * n + 24] for n in (0, 3, 4))
        assert abs(red.mean() - (16 + 219 * 0.2126)) < 1.5
        assert abs(white.mean() - 235) < 1.5
        assert abs(black.mean() - 16) < 1.5


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_the_same_frames_make_the_same_bytes(tmp_path, extension):
    (tmp_path / "elsewhere").mkdir()
    paths = [tmp_path / f"a.{extension}", tmp_path / "elsewhere" / f"b.{extension}"]
    for path in paths:
        write(path, film(40))
    assert digest(paths[0]) == digest(paths[1])
    data = paths[1].read_bytes()
    assert not any(word in data for word in (b"elsewhere", tmp_path.name.encode(), b".flurries-"))


def test_x264_goes_without_its_macroblock_tree(tmp_path):
    """With it no two runs need be alike, whatever the number of threads."""
    data = write(tmp_path / "a.mp4", film(3)).read_bytes()
    assert b" mbtree=0 " in data
    # The control: it is on by default.
    assert b" mbtree=1 " in encode(tmp_path / "b.mp4", "libx264", film(3), options={}).read_bytes()


def test_mp4_starts_at_once(tmp_path):
    """The index comes before the frames, so that a browser need not load all of them first."""
    data = write(tmp_path / "a.mp4", film(5)).read_bytes()
    assert data.index(b"moov") < data.index(b"mdat")
    # The control: by default it comes last.
    plain = encode(tmp_path / "b.mp4", "libx264", film(5)).read_bytes()
    assert plain.index(b"moov") > plain.index(b"mdat")


@pytest.mark.parametrize("size", [(97, 64), (96, 65), (97, 65), (1, 1), (3, 200)])
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


@pytest.mark.parametrize(
    ("given", "fraction"),
    [
        (24, Fraction(24)),
        (25.0, Fraction(25)),
        (23.976, Fraction(24000, 1001)),
        (23.98, Fraction(24000, 1001)),
        (29.97, Fraction(30000, 1001)),
        (59.94, Fraction(60000, 1001)),
        (Fraction(30000, 1001), Fraction(30000, 1001)),
        (12.5, Fraction(25, 2)),
        (0.5, Fraction(1, 2)),
        (np.float32(24), Fraction(24)),
        (1000, Fraction(1000)),
    ],
)
def test_frame_rates(given, fraction):
    assert frame_rate(given) == fraction


def test_frame_rates_reach_the_file(tmp_path):
    for fps in (23.976, 12.5, 60):
        path = write(tmp_path / "a.mp4", film(3), fps)
        wanted = float(frame_rate(fps))
        assert abs(open_background(path).fps - wanted) < 1e-9


# What is refused, and what is left behind


@pytest.mark.parametrize("extension", ["mp4", "webm", "mkv"])
def test_an_exception_leaves_the_old_video(tmp_path, extension):
    path = tmp_path / f"a.{extension}"
    path.write_bytes(b"the old video")
    good = next(film(1))
    for error, frame in [
        (KeyboardInterrupt, None),
        (ZeroDivisionError, None),
        (TypeError, good.astype(float)),
        (ValueError, good[:-1]),
        (ValueError, good[..., 0]),
        (ValueError, np.zeros((64, 96, 4), np.uint8)),
    ]:
        with pytest.raises(error), VideoWriter(path, (96, 64), 24) as video:
            for wave in film(5):
                video.write(wave)
            if frame is None:
                raise error
            video.write(frame)
        assert path.read_bytes() == b"the old video"
        assert only(path)


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


def test_odd_targets_are_refused(tmp_path):
    (tmp_path / "folder.mp4").mkdir()
    os.mkfifo(tmp_path / "fifo.mp4")
    for name in ("folder.mp4", "fifo.mp4", "no/such/folder.mp4"):
        with pytest.raises(OSError, match=name), VideoWriter(tmp_path / name, (8, 8), 24):
            pass
    assert len(list(tmp_path.iterdir())) == 2


def test_a_video_that_lacks_frames_is_not_kept(tmp_path, monkeypatch):
    path = tmp_path / "a.mp4"
    original = VideoWriter._finish

    def forgetful(self):
        self.count += 1
        original(self)

    monkeypatch.setattr(VideoWriter, "_finish", forgetful)
    with pytest.raises(OSError, match="4 frames instead of 5"):
        write(path, film(4))
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("leaves_by", ["exit", "exception"])
def test_a_forked_child_does_not_disturb_the_video(tmp_path, leaves_by):
    path = tmp_path / "a.mp4"
    with VideoWriter(path, (96, 64), 24) as video:
        for number, frame in enumerate(film(10)):
            video.write(frame)
            if number == 4:
                child = os.fork()
                if child == 0:
                    if leaves_by == "exception":
                        video.__exit__(ValueError, ValueError(), None)
                    del video
                    os._exit(0)
                assert os.waitpid(child, 0)[1] == 0
    assert len(list(read_video(path))) == 10
    assert only(path)


# Any frame in any order

STREAMS = {
    "groups.mp4": ("libx264", {"g": "8", "bf": "3"}),
    "open.mp4": ("libx264", {"g": "8", "bf": "3", "x264-params": "open-gop=1"}),
    "open.ts": ("libx264", {"g": "8", "bf": "3", "x264-params": "open-gop=1"}),
    "refresh.mkv": ("libx264", {"g": "8", "x264-params": "intra-refresh=1"}),
    "hidden.webm": ("libvpx-vp9", {"g": "8", "auto-alt-ref": "1", "lag-in-frames": "12"}),
    "old.avi": ("mpeg4", {"g": "8", "b": "4000000"}),
    "reordered.avi": ("libx264", {"g": "8", "bf": "3"}),
    "old.mpg": ("mpeg2video", {"g": "8", "bf": "2", "b": "4000000"}),
    "intra.mp4": ("libx264", {"g": "1"}),
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


def test_seeking_to_where_the_decoder_is_not_matters(tmp_path):
    """The control: a decoder that starts within a group gives other pixels."""
    path = encode(tmp_path / "a.mp4", "libx264", film(40), options={"g": "40", "bf": "0"})
    frames = list(read_video(path))
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        packets = [packet for packet in container.demux(stream) if packet.size]
        images = [image for packet in packets[20:] for image in packet.decode()]
    found = images[0].to_ndarray(format="rgb24") if images else np.zeros_like(frames[20])
    assert not np.array_equal(found, frames[20])


def test_reading_in_order_does_not_seek(tmp_path, monkeypatch):
    path = encode(tmp_path / "a.mp4", "libx264", film(40), options={"g": "8", "bf": "3"})
    jumps = []
    original = VideoReader._go_to
    monkeypatch.setattr(
        VideoReader, "_go_to", lambda self, key: jumps.append(key) or original(self, key)
    )
    source = open_background(path)
    for number in range(40):
        source.frame(number)
        source.frame(number)
    assert jumps == []
    # Forwards within a group neither, and beyond it to the last key frame before the target.
    source.frame(0)
    source.frame(5)
    source.frame(37)
    assert jumps == [0, 32]


def test_before_and_behind_the_film(tmp_path):
    path = write(tmp_path / "a.mkv", film(6))
    source = open_background(path)
    frames = list(film(6))
    for number, wanted in [(-3, 0), (0, 0), (5, 5), (6, 5), (10**9, 5)]:
        np.testing.assert_array_equal(source.frame(number).pixels, frames[wanted])
    with pytest.raises(TypeError):
        source.frame(1.5)
    with pytest.raises(ValueError, match="read-only"):
        source.frame(0).pixels[:] = 0


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


def test_sources_pickle_and_come_back(tmp_path):
    path = write(tmp_path / "a.mp4", film(12))
    source = open_background(path)
    third = source.frame(3).pixels
    data = pickle.dumps(source)
    assert len(data) < 1024
    other = pickle.loads(data)
    assert (other.size, other.count, other.fps) == (source.size, 12, 24)
    np.testing.assert_array_equal(other.frame(3).pixels, third)
    source.close()
    np.testing.assert_array_equal(source.frame(3).pixels, third)


def test_threads_share_a_video(tmp_path):
    path = encode(tmp_path / "a.mp4", "libx264", film(30), options={"g": "6"})
    frames, source, wrong = list(read_video(path)), open_background(path), []

    def look(seed):
        for number in np.random.default_rng(seed).integers(0, 30, 20):
            if not np.array_equal(source.frame(int(number)).pixels, frames[number]):
                wrong.append(number)

    threads = [threading.Thread(target=look, args=(seed,)) for seed in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


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


# Damage


@pytest.mark.parametrize("extension", [*EXTENSIONS, "avi"])
def test_a_video_that_broke_off_is_an_error(tmp_path, extension):
    path = tmp_path / f"a.{extension}"
    if extension == "avi":
        encode(path, "mpeg4", film(12))
    else:
        write(path, film(12))
    data = path.read_bytes()
    cut = tmp_path / f"cut.{extension}"
    for length in [0, 1, 9, *(len(data) * n // 12 for n in range(1, 12)), len(data) - 1]:
        cut.write_bytes(data[:length])
        with pytest.raises(OSError, match=r"cut\."):
            list(read_video(cut))
        with pytest.raises(OSError, match=r"cut\."):
            open_background(cut)


def test_without_the_guard_half_a_webm_is_a_shorter_film(tmp_path):
    """The control: the library calls it a success."""
    path = write(tmp_path / "a.webm", film(12))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 3 // 4])
    with av.open(str(path)) as container:
        assert 0 < sum(1 for _ in container.decode(video=0)) < 12
    with pytest.raises(OSError, match="cut short"):
        check_structure(path)


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
    (tmp_path / "folder.mp4").mkdir()
    os.mkfifo(tmp_path / "fifo.mp4")
    for name, error in [
        ("missing.mp4", FileNotFoundError),
        ("picture.mp4", OSError),
        ("text.mp4", OSError),
        ("text.dat", ValueError),
        ("folder.mp4", IsADirectoryError),
        ("fifo.mp4", OSError),
    ]:
        with pytest.raises(error, match=name):
            list(read_video(tmp_path / name))
    with pytest.raises(ValueError, match="path must name a file"):
        list(read_video(""))


def test_sound_alone_is_no_video(tmp_path):
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 4096), np.float32), "fltp", "mono")
        sound.sample_rate = 44100
        container.mux(stream.encode(sound))
        container.mux(stream.encode())
    with pytest.raises(ValueError, match=r"sound\.mp4: the file holds no video"):
        open_background(path)


def test_scripts_that_name_other_files_are_not_followed(tmp_path):
    victim = write(tmp_path / "victim.mkv", film(3))
    script = "ffconcat version 1.0\nfile victim.mkv\n"
    playlist = "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nvictim.ts\n#EXT-X-ENDLIST\n"
    encode(tmp_path / "victim.ts", "libx264", film(3))
    for name, text in [("a.mkv", script), ("b.mkv", playlist), ("c.m3u8", playlist)]:
        (tmp_path / name).write_text(text)
        with pytest.raises((OSError, ValueError), match=name):
            open_background(tmp_path / name)
    # The control: the library by itself follows the script.
    with av.open(str(tmp_path / "a.mkv")) as container:
        assert container.streams.video[0].width == 96
    assert victim.exists()
