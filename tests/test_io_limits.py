"""Files that would hang, or take all memory: refused by name, before anything is decoded."""

import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries import io
from flurries.camera import importers
from flurries.io.files import read_bytes
from flurries.io.stores import Store
from flurries.output.journal import MOST_BYTES, NAME, Journal
from stills import noise, png_chunk, write_exr

# What one process may take: the interpreter and its libraries need a quarter of it.
MOST_MEMORY = 2 << 30
LONGEST = 20


def said(code: str, *words: object) -> str:
    """Run a line of code under a limit of memory and time; return the sentence it is refused by."""
    program = (
        f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({MOST_MEMORY},) * 2)\n"
        "import sys, flurries as fl, flurries.io as io\n"
        f"try:\n    {code}\n    print('read')\n"
        "except (OSError, ValueError) as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, words)], text=True, capture_output=True,
        timeout=LONGEST, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, (done.returncode, done.stderr[-1000:])
    return done.stdout.strip()


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile")
    side = 23_000
    rows = zlib.compress(bytes(side * (1 + side // 8)), 9)
    head = struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0)
    parts = [(b"IHDR", head), (b"IDAT", rows), (b"IEND", b"")]
    data = b"\x89PNG\r\n\x1a\n" + b"".join(png_chunk(*part) for part in parts)
    (folder / "huge.png").write_bytes(data)
    write_exr(folder / "window.exr", noise((64, 64, 3)), "RGB", display=(0, 0, 20_000, 20_000))
    return folder


@pytest.mark.parametrize(
    "code", ["io.read_picture(sys.argv[1])", "fl.Scene(sys.argv[1], size=(64, 48)).render(0)"]
)
@pytest.mark.parametrize(
    ("name", "size"), [("huge.png", "23000 x 23000"), ("window.exr", "20000 x 20000")]
)
def test_16_8_a_small_file_that_claims_many_pixels(hostile: Path, name: str, size: str, code: str):
    words = said(code, hostile / name)
    assert name in words and size in words and f"{2**28}" in words
    assert "FLURRIES_MAX_PIXELS" in words


@pytest.mark.parametrize("text", ["a." * 20_000 + "a = 1", "x = {" + "'a b' . " * 5_000 + "a = 1}"])
def test_16_8_a_key_of_40_kb_of_dots(tmp_path: Path, text: str):
    (tmp_path / "a.toml").write_text(f"size = [64, 48]\n{text}\n")
    words = said("fl.open(sys.argv[1])", tmp_path / "a.toml")
    assert "a.toml, line 2: a key has at most 32 dots, got 33 or more" in words


def test_16_8_twenty_thousand_effects(tmp_path: Path):
    effect = '[[effects]]\nkind = "snow"\n'
    (tmp_path / "a.toml").write_text("format = 3\n" + effect * 20_000)
    words = said("fl.open(sys.argv[1])", tmp_path / "a.toml")
    assert "a.toml, line 2: effects must be at most 1000, got 20000" in words
    with pytest.raises(ValueError, match="effects must be at most 1000, got 1001"):
        fl.Scene(size=(64, 48), effects=[fl.effects.TentRain()] * 1001)


def journal_of(path: Path) -> Any:
    return Journal(Store(), path.parent)


READERS: list[tuple[str, Callable[[Path], Any]]] = [
    ("a.png", io.read_picture), ("a.png", io.read_slate), ("a.png", io.open_background),
    ("a.exr", io.read_layers), ("a.exr", io.read_views), ("a.exr", io.read_depth),
    ("a.exr", io.open_depth), ("a.mp4", io.open_background),
    ("a.mp4", lambda path: next(io.read_video(path))),
    ("a.csv", lambda path: importers.load(path, (48, 64))),
    ("a.chan", lambda path: importers.load(path, (48, 64))),
    ("a.txt", lambda path: importers.load(path, (48, 64))),
    ("images.txt", lambda path: importers.load(path.parent, (48, 64))),
    ("a.toml", fl.open), (NAME, journal_of),
    ("a.png", lambda path: fl.Scene(path)),
    ("a.png", lambda path: fl.Scene(size=(64, 48), foreground=path)),
    ("a.exr", lambda path: fl.Scene(size=(64, 48), depth=path)),
]  # fmt: skip


@pytest.mark.parametrize("kind", ["fifo", "link to a device", "folder"])
@pytest.mark.parametrize(("name", "read"), READERS)
def test_16_8_what_is_no_plain_file_is_not_read(
    tmp_path: Path, name: str, read: Callable[[Path], Any], kind: str
):
    path = tmp_path / name
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 64 48 50 50 32 24\n")
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "link to a device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()
    with pytest.raises(OSError, match=name):
        read(path)


def test_16_8_text_files_have_a_largest_size(tmp_path: Path):
    for name, read, size in [
        ("a.toml", fl.open, 1 << 20),
        ("a.csv", lambda path: importers.load(path, (48, 64)), 1 << 25),
        ("a.chan", lambda path: importers.load(path, (48, 64)), 1 << 25),
        (NAME, journal_of, MOST_BYTES),
    ]:  # fmt: skip
        with (tmp_path / name).open("wb") as file:
            file.truncate(size + 1)
        with pytest.raises(ValueError, match=f"{name}: a .* has at most {size} bytes, got"):
            read(tmp_path / name)
    # Some files have more bytes than they say.
    with pytest.raises(ValueError, match="status: a scene file has at most 3 bytes, got more"):
        read_bytes("/proc/self/status", 3, "scene file")


def test_16_8_a_budget_of_pixels_and_of_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    light = np.random.default_rng(3).random((30, 40, 4)).astype(np.float32)
    io.write_picture(tmp_path / "a.exr", light)
    io.write_layers(tmp_path / "b.exr", {"rgba": light, "depth": light[..., 0] + 1.0})
    io.write_layer_views(tmp_path / "c.exr", {e: {"rgba": light} for e in ("left", "right")})
    with io.VideoWriter(tmp_path / "a.mp4", (40, 30), 24) as film:
        film.write(np.zeros((30, 40, 3), np.uint8))
    cases: list[tuple[str, Callable[..., Any], int]] = [
        ("a.exr", io.read_picture, 16), ("b.exr", io.read_layers, 20),
        ("b.exr", io.read_depth, 4), ("c.exr", io.read_views, 16),
        ("b.exr", lambda path, **given: io.open_depth(path, **given).frame(0), 4),
        ("a.exr", lambda path, **given: io.open_background(path, **given).frame(0), 16),
        ("a.mp4", io.open_background, 3),
        ("a.mp4", lambda path, **given: next(io.read_video(path, **given)), 3),
    ]  # fmt: skip
    for name, read, size in cases:
        path = tmp_path / name
        read(path)
        read(path, budget=io.Budget(pixels=1200, bytes=1200 * size))
        with pytest.raises(OSError, match=rf"{name}: .* 40 x 30 px, more than the 1199 that"):
            read(path, budget=io.Budget(pixels=1199))
        too_few = io.Budget(bytes=1200 * size - 1)
        with pytest.raises(OSError, match=rf"{name}: .*{1200 * size} in all and more than the"):
            read(path, budget=too_few)
        with monkeypatch.context() as around:
            around.setenv("FLURRIES_MAX_PIXELS", "1199")
            with pytest.raises(OSError, match="40 x 30 px, more than the 1199"):
                read(path)
            around.setenv("FLURRIES_MAX_PIXELS", "")
            around.setenv("FLURRIES_MAX_BYTES", "5")
            with pytest.raises(OSError, match="FLURRIES_MAX_BYTES raises the limit"):
                read(path)


@pytest.mark.parametrize("name", ["FLURRIES_MAX_PIXELS", "FLURRIES_MAX_BYTES"])
@pytest.mark.parametrize("value", ["0", "-1", "1e9", "9" * 400])
def test_16_8_a_limit_that_is_no_number_is_refused_by_name(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str
):
    monkeypatch.setenv(name, value)
    with pytest.raises(ValueError, match=f"{name} must be a whole number above 0, got"):
        io.Budget()
