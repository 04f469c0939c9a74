"""Frames that are silently wrong, mixed or missing: each case named by its number in issue 16."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import flurries as fl
from flurries.io import read_picture, remove_leftovers, write_picture
from flurries.io.atomic import owner_of_new_files
from flurries.output.journal import check, is_journal

W, H = 1024, 800
SNOW = fl.effects.TentSnow(flakes=50)
SMALL = fl.Scene("#304050", size=(96, 64), effects=fl.effects.TentSnow("heavy", flakes=100))


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files below a folder but its journal, whose lines say who wrote them."""
    found = {p for p in folder.rglob("*") if p.is_file() and not is_journal(p.name)}
    return {str(p.relative_to(folder)): p.read_bytes() for p in found}


def python(code: str, *arguments: Any, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True, text=True, timeout=120, env={**os.environ, **environment},
    )  # fmt: skip


@pytest.fixture
def plate(tmp_path: Path) -> Path:
    """A plate of 2.4 MiB whose middle neither end of a megabyte holds."""
    picture = np.random.default_rng(1).integers(0, 255, (H, W, 3)).astype(np.uint8)
    Image.fromarray(picture).save(tmp_path / "plate.tif")
    return tmp_path / "plate.tif"


def retouch(plate: Path) -> None:
    """Paint some rows black, in place and with the old time."""
    before = plate.stat()
    with plate.open("r+b") as file:
        file.seek(390 * 3 * W)
        file.write(bytes(3 * W * 20))
    os.utime(plate, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_16_1_a_frame_over_another_plate_of_the_same_name_is_refused(plate: Path, tmp_path: Path):
    scene = fl.Scene(plate, effects=SNOW)
    out = tmp_path / "out"
    assert scene.write(out / "%d.png", "1-2").written == [1, 2]
    retouch(plate)
    # The same scene, with what it has kept of the plate.
    with pytest.raises(ValueError, match=r"1\.png .* over other pictures.*with 1 more.*overwrite"):
        scene.write(out / "%d.png", "1-4")
    assert scene.write(out / "%d.png", "1-4", overwrite=True).written == [1, 2, 3, 4]
    for number in (1, 4):
        got = read_picture(out / f"{number}.png").pixels
        assert np.array_equal(got, fl.Scene(plate, effects=SNOW).render(number))
        assert got[393:405].mean() < 0.5 * got[420:440].mean(), "the black rows"


def test_16_1_a_plate_that_changes_meanwhile_ends_the_run(plate: Path, tmp_path: Path):
    def progress(frames: Any) -> Iterator[int]:
        for number in frames:
            if number == 3:
                retouch(plate)
            yield number

    scene = fl.Scene(plate, effects=SNOW)
    with pytest.raises(OSError, match=r"plate\.tif changed"):
        scene.write(tmp_path / "%d.png", "1-4", progress=progress)
    again = scene.write(tmp_path / "%d.png", "1-4", overwrite=True)
    assert again.written == [1, 2, 3, 4]


def test_16_1_of_a_sequence_the_frames_of_the_changed_plate_alone(tmp_path: Path):
    for number in range(4):
        write_picture(tmp_path / f"plate.{number}.png", np.full((20, 30, 3), number, np.uint8))
    scene = fl.Scene(tmp_path / "plate.%d.png", effects=SNOW)
    assert scene.write(tmp_path / "out" / "%d.png").written == [0, 1, 2, 3]
    write_picture(tmp_path / "plate.2.png", np.full((20, 30, 3), 77, np.uint8))
    with pytest.raises(ValueError, match=r"/2\.png is there already and was made over other pict"):
        scene.write(tmp_path / "out" / "%d.png")
    assert scene.write(tmp_path / "out" / "%d.png", [2], overwrite=True).written == [2]
    assert scene.write(tmp_path / "out" / "%d.png").kept == [0, 1, 2, 3]
    # The same plates by other names are the same plates.
    for number in range(4):
        (tmp_path / f"plate.{number}.png").rename(tmp_path / f"moved.{number}.png")
    moved = scene.replace(background=tmp_path / "moved.%d.png")
    assert moved.write(tmp_path / "out" / "%d.png").kept == [0, 1, 2, 3]


VERSION = """
import sys
import flurries
import flurries.scene.fingerprint as fingerprint
version, bits, place = sys.argv[1:]
flurries.__version__ = version
fingerprint.BITS += int(bits)
snow = flurries.effects.TentSnow("heavy", flakes=100)
scene = flurries.Scene("#304050", size=(96, 64), effects=snow)
print(*scene.write(place + "/%d.png", "1-2").kept)
"""


def test_16_2_frames_of_another_version_are_kept_only_with_its_bits(tmp_path: Path):
    assert python(VERSION, "0.0.9", 1, tmp_path).returncode == 0
    before = contents(tmp_path)
    # In a folder with frames of other bits none is added: machines of two versions do not mix.
    for frames in ("1-3", "7-9"):
        with pytest.raises(ValueError, match=r"1\.png .* by flurries 0\.0\.9, .*--overwrite"):
            SMALL.write(tmp_path / "%d.png", frames)
    assert contents(tmp_path) == before
    assert SMALL.write(tmp_path / "%d.png", "1-2", overwrite=True).written == [1, 2]
    assert python(VERSION, "9.9", 0, tmp_path).stdout.split() == ["1", "2"]
    assert check(tmp_path) == (2, [])


def test_16_10_leftovers_of_other_machines_stay_for_an_hour(tmp_path: Path):
    own, dead = owner_of_new_files(), subprocess.Popen(["true"])
    dead.wait()
    gone, other = f"{own[:-6]}{dead.pid:06x}", "0" * 10 + own[-6:]
    for owner in (own, gone, other):
        (tmp_path / f".flurries-{owner}01234567.png").write_bytes(b"x")
    for owner in (gone, other):
        removed = {path.name for path in remove_leftovers(tmp_path)}
        assert removed == {f".flurries-{owner}01234567.png"}
        for path in tmp_path.iterdir():
            os.utime(path, (time.time() - 3700,) * 2)


def test_a_name_that_has_moved_says_where_it_is():
    for home, names in fl._MOVED.items():
        for name in names.split():
            with pytest.raises(AttributeError, match=rf"it is flurries\.{home}\.{name}$"):
                getattr(fl, name)
            assert hasattr(getattr(fl, home), name)
