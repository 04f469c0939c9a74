"""Films are read in any order, by any process, and what is damaged is told."""

import os
import struct

import av
import numpy as np
import pytest

from films import EXTENSIONS, encode, film, write
from flurries.io import open_background, read_video, write_picture

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
    # The control: the library by itself follows the script.
    with av.open(str(tmp_path / "a.mkv")) as container:
        assert container.streams.video[0].width == 96
    assert victim.exists()
