"""Which frames and files, numbered backgrounds, and files that appear whole or not at all."""

import copy
import os
import pickle
import stat
from pathlib import Path

import numpy as np
import pytest

from flurries.io import Pattern, frame_range, open_background, replacing, write_picture
from flurries.io.pictures import parts


@pytest.mark.parametrize(("text", "frames"), [
    ("7", [7]), ("0", [0]), ("1-3", [1, 2, 3]), ("5-5", [5]), ("1-10x4", [1, 5, 9]),
    ("1-9x4", [1, 5, 9]), ("1-3x9", [1]), ("0008-0010", [8, 9, 10]),
    ("1-3,10,20-24x2", [1, 2, 3, 10, 20, 22, 24]), ("10, 1-2", [10, 1, 2]),
    ("1-5,3-7", [1, 2, 3, 4, 5, 6, 7]), ("999999999", [999999999]),
])  # fmt: skip
def test_frames_are_read(text, frames):
    assert frame_range(text) == frames


@pytest.mark.parametrize("text", [
    *("", " ", ",", "1,", ",1", "1,,2", "a", "1-", "-1-", "1-2-3", "1x2", "1-9x", "1-9x0"),
    *("1..9", "1:9", "1-9x-2", "1.5", "+1", "1 2", "1-a", "0x10", "1e3", "\uff11-\uff13"),
    *("\u0661", "1\n2", "1\0", "9999999999", "1-10000001", "0-999999999", "1" * 10**6),
    *("1," * 200_000, "1-9000000,1-9000000", "nan", "inf", "$(ls)"),
])  # fmt: skip
def test_frames_that_are_none_are_refused(text):
    with pytest.raises(ValueError, match=r"^frames ") as caught:
        frame_range(text)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(("text", "frame", "path"), [
    ("%04d.exr", 7, "0007.exr"), ("out/snow.%04d.exr", 12345, "out/snow.12345.exr"),
    ("/a/b/f%d.png", 3, "/a/b/f3.png"), ("f_%06d_left.png", 3, "f_000003_left.png"),
    ("../f.%02d.tif", 0, "../f.00.tif"), ("100 %d.png", np.int64(4), "100 4.png"),
    ("snow.mp4", 9, "snow.mp4"), ("out/snow.MOV", 0, "out/snow.MOV"),
])  # fmt: skip
def test_patterns(text, frame, path):
    pattern = Pattern(text)
    assert pattern.path(frame) == Path(path)
    assert pattern.is_video == (Path(path).suffix.lower() in (".mp4", ".mov"))
    assert pattern == Pattern(text) == pickle.loads(pickle.dumps(pattern)) == copy.copy(pattern)


def hostile_patterns():
    """What must not pass: other tokens, tokens elsewhere, folders, control characters."""
    words = """
        %s %n %x %% % %*d %-4d %+d %4d %.4d %#d %ld %1$d %(a)d %04D %0d %00d %0999999999d %013d %04
        {:04d} ##.## @ $F4.$F $FF * ? <UDIM> %V %d%d %d.%d %d_%s %n%04d %%%d %d%%
    """
    for token in [*words.split(), "% d", ""]:
        yield from (f"{token}.exr", f"out/frame.{token}.png", f"{token}/frame.exr")
    for video in (".mp4", ".mkv", ".webm", ".mov"):
        yield f"clip%04d{video}"
        yield f"%d/clip{video}"
        yield f"cl\0ip{video}"
    yield from (f"frame{control}.%04d.exr" for control in "\0\t\n\x1f\x7f")
    yield from ("", " ", "\t", ".", "..", "/", "out/", "out/.", "out/..", "%04d/", "a\\%04d.exr")


def test_hostile_patterns_are_refused():
    for text in hostile_patterns():
        with pytest.raises(ValueError, match="pattern") as caught:
            Pattern(text)
        assert len(str(caught.value)) < 300
    for wrong in (None, 7, b"%04d.exr", ["%d"]):
        with pytest.raises(TypeError):
            Pattern(wrong)


def test_a_pattern_stays_inside_its_folder(tmp_path):
    inside, outside = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    outside.mkdir()
    (inside / "link").symlink_to(outside)
    (inside / "here").symlink_to(inside)
    (inside / "stray.0003.exr").symlink_to(outside / "victim.exr")
    for good in ("%04d.exr", "new/%04d.exr", "here/%04d.exr", "../in/%d.exr", "a.mp4"):
        Pattern(f"{inside}/{good}", str(inside)).path(1)
    for bad in ("../%04d.exr", "link/%04d.exr", "../in2/%d.exr", "new/../../%d.exr", "../a.mp4"):
        with pytest.raises(ValueError, match="leads outside"):
            Pattern(f"{inside}/{bad}", str(inside))
    with pytest.raises(ValueError, match="leads outside"):
        Pattern("/etc/%04d.exr", inside)
    stray = Pattern(f"{inside}/stray.%04d.exr", inside)
    stray.path(2)
    with pytest.raises(ValueError, match="leads outside"):
        stray.path(3)


def test_existing_frames_are_those_that_the_pattern_would_write(tmp_path):
    names = ["a.0001.png", "a.0012.png", "a.12345.png", "a.7.png", "a.00013.png", "a.0003.exr"]
    names += ["b.0001.png", "a.0004.png.bak", "xa.0005.png", "a.-006.png", "a0007.png"]
    for name in names:
        (tmp_path / name).touch()
    assert Pattern(f"{tmp_path}/a.%04d.png").existing() == [-6, 1, 12, 12345]
    assert Pattern(f"{tmp_path}/a.%d.png").existing() == [7, 12345]
    assert Pattern(f"{tmp_path}/none/a.%d.png").existing() == []
    assert Pattern(f"{tmp_path}/a.mp4").existing() == []


def level(number, size=(6, 4)):
    return np.full((size[1], size[0], 3), number, np.uint8)


@pytest.fixture
def sequence(tmp_path):
    for number in range(98, 104):
        write_picture(tmp_path / f"plate.{number:04d}.png", level(number))
    return tmp_path / "plate.%04d.png"


def test_a_still_is_the_same_in_every_frame(tmp_path):
    path = tmp_path / "still.exr"
    write_picture(path, np.random.default_rng(0).random((5, 7, 4)).astype(np.float32) * 3)
    source = open_background(path)
    about = source.size, source.count, source.fps, source.encoding
    assert about == ((7, 5), None, None, "linear")
    first = source.frame(0)
    assert first.alpha is not None
    for number in (-5, 1, 10**9):
        assert source.frame(number) is first


def test_a_sequence_counts_from_its_first_frame(sequence):
    source = open_background(sequence)
    assert (source.size, source.count, source.fps, source.encoding) == ((6, 4), 6, None, "display")
    for number, wanted in [(0, 98), (3, 101), (5, 103), (6, 103), (10**12, 103), (-1, 98)]:
        assert (source.frame(number).pixels == wanted).all()
    assert source.frame(np.int64(2)).path.endswith("plate.0100.png")
    for wrong in (1.0, "1", None):
        with pytest.raises(TypeError):
            source.frame(wrong)


def test_what_cannot_be_opened(tmp_path, sequence):
    for spec, error, words in [
        (tmp_path / "none.png", FileNotFoundError, r"none\.png"),
        (tmp_path / "none.%04d.png", FileNotFoundError, r"No frame .*none\.%04d\.png"),
        (tmp_path / "plate.%s.png", ValueError, "frame token"),
        (tmp_path / "plate.%04d.%04d.png", ValueError, "frame token"),
        (tmp_path, IsADirectoryError, tmp_path.name), ("", ValueError, "^spec must name a file"),
        ("a\0b.png", ValueError, "^spec must name a file"),
    ]:  # fmt: skip
        with pytest.raises(error, match=words):
            open_background(spec)
    (tmp_path / "plate.0098.png").write_bytes(b"")
    with pytest.raises(OSError, match=r"plate\.0098\.png: the file is empty"):
        open_background(sequence)


OLD = b"the old file"


@pytest.fixture
def target(tmp_path):
    path = tmp_path / "frames" / "picture.png"
    path.parent.mkdir()
    path.write_bytes(OLD)
    return path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def alone(path):
    return names(path.parent) == [path.name]


def test_the_new_file_replaces_the_old_one(target):
    with replacing(target) as temporary:
        assert temporary.parent == target.parent
        assert temporary.suffix == target.suffix
        assert temporary.name.startswith(".")
        temporary.write_bytes(b"new")
        assert target.read_bytes() == OLD
    assert target.read_bytes() == b"new"
    assert alone(target)


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_exception_leaves_the_old_file(target, error):
    with pytest.raises(error), replacing(target) as temporary:
        temporary.write_bytes(b"half of the new")
        raise error
    assert target.read_bytes() == OLD
    assert alone(target)


def test_a_new_file_gets_the_permissions_of_any_new_file(target):
    mask = os.umask(0o027)
    try:
        with replacing(target) as temporary:
            temporary.write_bytes(b"new")
    finally:
        os.umask(mask)
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


def test_one_missing_folder_is_made_and_no_more(tmp_path):
    with replacing(tmp_path / "new" / "a.png") as temporary:
        temporary.write_bytes(b"x")
    assert (tmp_path / "new" / "a.png").read_bytes() == b"x"
    with pytest.raises(FileNotFoundError, match=r"b\.png"):
        replacing(tmp_path / "x" / "y" / "b.png").__enter__()
    assert not (tmp_path / "x").exists()


def test_odd_targets_are_refused_by_name(tmp_path):
    file = tmp_path / "file"
    file.write_bytes(OLD)
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "fifo.png")
    (tmp_path / "link.png").symlink_to(file)
    (tmp_path / "dangling.png").symlink_to(tmp_path / "nowhere")
    before = names(tmp_path)
    for name, error in [
        ("folder.png", IsADirectoryError), ("fifo.png", OSError), ("link.png", OSError),
        ("dangling.png", OSError), ("file/under.png", NotADirectoryError),
        ("new/", IsADirectoryError), ("..", IsADirectoryError), ("a" * 300 + ".png", OSError),
    ]:  # fmt: skip
        with pytest.raises(error) as caught, replacing(f"{tmp_path}/{name}"):
            pass
        assert name.rstrip("/") in str(caught.value)
    for name, error in [("", ValueError), ("a\0b.png", ValueError), (b"a.png", TypeError)]:
        with pytest.raises(error), replacing(name):
            pass
    with pytest.raises(OSError, match=r"'/proc/new\.png'"), replacing("/proc/new.png"):
        pass
    assert file.read_bytes() == OLD
    assert names(tmp_path) == before


def damaging(original):
    """A faulty disk: writes, then changes one byte in the middle."""

    def write(target, temporary, *rest):
        checksums = original(target, temporary, *rest)
        data = bytearray(temporary.read_bytes())
        data[len(data) // 2] ^= 255
        temporary.write_bytes(data)
        return checksums

    return write


@pytest.mark.parametrize(("name", "options"), [
    ("a.exr", {"compression": "none"}), ("a.exr", {}), ("a.png", {}), ("a.tif", {"bits": 16}),
])  # fmt: skip
def test_a_picture_that_reads_back_wrong_is_not_kept(tmp_path, monkeypatch, name, options):
    for writer in ("_write", "_pack"):
        monkeypatch.setattr(parts, writer, damaging(getattr(parts, writer)))
    with pytest.raises(OSError, match=rf"{name}: (does not|cannot be) read back"):
        write_picture(tmp_path / name, np.random.default_rng(2).random((40, 40, 3)), **options)
    assert names(tmp_path) == []
