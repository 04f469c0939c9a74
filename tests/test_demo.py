"""The demo: its files, and a flight whose snow streams out of the right point."""

from pathlib import Path

import numpy as np
import pytest

from flurries.cli import demo, main
from flurries.io import open_background, read_layers, read_picture

SIZE = 128
PICTURE = demo.io.photograph("rocket", size=(SIZE, SIZE))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    folder = tmp_path_factory.mktemp("demo") / "new"
    assert main(["demo", "-q", "-o", str(folder), "--size", str(SIZE), "--frames", "4"]) == 0
    return folder, [path for path in folder.iterdir() if path.suffix != ".jsonl"]


def test_the_films_and_stills(made: tuple[Path, list[Path]]):
    folder, files = made
    names = {"three.mp4", "three.png", "flight.mp4", "flight.png", "flight.exr"}
    assert {p.name for p in files} == names
    scenes = demo.three(PICTURE)
    triple = np.hstack([scene.render(2) for scene in scenes])
    flying = demo.flight(PICTURE)
    for name, still, size in (
        ("three", triple, (3 * SIZE, SIZE)),
        ("flight", flying.render(2), (SIZE, SIZE)),
    ):
        film = open_background(folder / f"{name}.mp4")
        assert (film.count, film.size, film.fps) == (4, size, demo.FPS)
        assert np.array_equal(read_picture(folder / f"{name}.png").pixels, still)
        shown = film.frame(1).pixels.astype(int)  # the second of the film is frame 2
        assert np.abs(shown - still).mean() < 12


def test_the_layers_are_those_of_the_flight(made: tuple[Path, list[Path]]):
    layers = read_layers(made[0] / "flight.exr")
    want = demo.flight(PICTURE).replace(space="linear").layers(2)
    assert {"rgba", "snow", "snow.depth", "snow.forward", "snow.coverage"} <= set(layers)
    assert np.abs(layers["snow"][..., 3] - want.alpha).max() <= 2.0**-11
