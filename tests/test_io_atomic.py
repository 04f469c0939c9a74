"""A file appears whole or not at all; the matrix of faults has more."""

import os
import stat
import tempfile
from pathlib import Path

import numpy as np
import pytest

from flurries.io import replacing, write_picture
from flurries.io.pictures import parts

OLD = b"the old file"

# Newer Pythons warn when a process with threads is forked, which is what these tests are about.
pytestmark = pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")


@pytest.fixture
def target(tmp_path):
    """A file that is there already, alone in its folder."""
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


def as_ordinary_user(task):
    """Return what a task raises in a child that may not write everywhere, in words."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.setuid(os.getuid() or 65534)
            task()
        except BaseException as error:
            os.write(writer, f"{type(error).__name__}: {error}".encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as stream:
        said = stream.read().decode()
    os.waitpid(child, 0)
    return said


@pytest.mark.parametrize("name", ["old.png", "new.png"])
def test_what_an_ordinary_user_may_not_write_is_refused_by_name(name):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        Path(folder, "old.png").write_bytes(OLD)
        Path(folder, "old.png").chmod(0o444)
        Path(folder).chmod(0o555)
        said = as_ordinary_user(lambda path=path: replacing(path).__enter__())
        assert said.startswith("PermissionError") and name in said
        assert names(Path(folder)) == ["old.png"]


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


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.tif"])
def test_a_picture_that_reads_back_wrong_is_not_kept(tmp_path, monkeypatch, name):
    path = tmp_path / name
    pixels = np.random.default_rng(2).random((40, 40, 3)).astype(np.float32)
    monkeypatch.setattr(parts, "_write", damaging(parts._write))
    options = {"compression": "none", "half": False}
    with pytest.raises(OSError, match=rf"{name}: (does not|cannot be) read back"):
        write_picture(path, pixels, **options)
    assert names(tmp_path) == []
