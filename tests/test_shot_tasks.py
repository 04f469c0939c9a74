"""The six tasks of docs/shot.md run, and make what the page says."""

import sys
from pathlib import Path

import numpy as np
import pytest

from flurries import io

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))

import make_shot

MOST_LINES = 6


def test_the_page_has_six_tasks_of_six_lines_at_most():
    found = make_shot.tasks()
    assert len(found) == 6
    for title, (_, lines) in found.items():
        assert 1 <= lines.count("\n") <= MOST_LINES, title


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small shot, with what the six tasks make of it."""
    made = tmp_path_factory.mktemp("shot")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        make_shot.material((96, 64))
        for kind, lines in make_shot.tasks().values():
            make_shot.run(kind, lines)
        assert make_shot.picture().shape == (128, 288, 3)
    return made


def test_every_frame_is_there_and_the_walker_hides_the_snow_behind(folder: Path):
    for name in ("snow", "aces_snow", "tracked"):
        numbers = sorted(int(file.name.split(".")[-2]) for file in folder.glob(f"{name}.*.exr"))
        assert numbers == list(make_shot.FRAMES)
    for frame in (1001, 1008):
        layers = io.read_layers(folder / f"snow.{frame}.exr")
        walker = io.read_picture(folder / f"roto.{frame}.exr").pixels[..., 0] > 0.99
        before, beside = (layers["alpha"][part].mean() for part in (walker, ~walker))
        assert before < 0.5 * beside
        depth = layers["snow.depth"][walker]
        assert depth[np.isfinite(depth)].max() <= 4.5


def test_the_others_have_what_the_page_says(folder: Path):
    wide = io.read_picture(folder / "aces_snow.1003.exr", overscan=True)
    assert wide.pixels.shape[:2] == (64, 96)
    assert io.read_picture(folder / "aces_snow.1003.exr").pixels.shape[:2] == (58, 88)
    left, right = io.read_views(folder / "pair.1005.exr")
    assert left.shape == right.shape and not np.array_equal(left, right)
    assert (folder / "flakes.usdc").stat().st_size > 10_000
    film = make_shot.over_grey(folder / "snow.mov", 0)
    # Squares of .22 and .32, and flakes in the plate's light: .486 and .274; no veil whitens them.
    assert film.max() > 0.45 and film.min() < 0.3
