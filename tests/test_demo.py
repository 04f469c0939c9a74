"""The demo: its files, and a flight whose snow streams out of the right point."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import flurries as fl
from flurries.cli import demo
from flurries.io import open_background, read_layers, read_picture
from measure import cover

SIZE = 128
PICTURE = demo.io.photograph("rocket", size=(SIZE, SIZE))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    folder = tmp_path_factory.mktemp("demo") / "new"
    return folder, demo.run(folder, size=SIZE, frames=4)


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


def test_the_three_looks_differ_as_their_names_say():
    few, textured, heavy = (scene.layers(5) for scene in demo.three(PICTURE))
    assert 0 < few.alpha.mean() < min(textured.alpha.mean(), heavy.alpha.mean())
    # The same flakes under the texture: nowhere is it clearer.
    assert (textured.alpha >= few.alpha - 1e-6).all()


FALL = 1.0


def focus(scene: fl.Scene) -> np.ndarray:
    """f T / T_z from the principal point, written out: the camera flies, the flakes fall."""
    width, height = scene.size or (0, 0)
    x, y, z = np.array(demo.FLIGHT) - [0.0, FALL, 0.0]
    focal = scene.camera.camera.focal
    return np.array([width / 2 + focal * x / z, height / 2 + focal * y / z])


def test_the_pictures_flow_away_from_the_focus():
    # Least squares over the whole picture: the brightness of snow, near and far, small steps, and
    # the flow of Eq. 8: growth times the way from the focus, one unknown growth for all depths.
    scene = demo.flight(demo.io.photograph("rocket", size=(256, 256)))
    assert 0 < focus(scene)[1] < 100 and focus(scene)[0] == 128.0, "it lies in the sky"
    snow = replace(scene.effects[0], fall=FALL, shutter=0.0, sway=(0.0, 1.0))
    scene = scene.replace(effects=[snow])
    normal, target = np.zeros((3, 3)), np.zeros(3)
    rows, cols = np.mgrid[0:256, 0:256] + 0.5
    for t in range(1, 13):
        planes = [gaussian_filter(cover(scene, t + s).astype(float), 2.0) for s in (-0.05, 0.05)]
        change = (planes[1] - planes[0]) / 0.1
        dy, dx = np.gradient(0.5 * (planes[0] + planes[1]))
        # dI/dt = -g ((x - px) I_x + (y - py) I_y): linear in g, g px and g py.
        terms = np.stack([-(cols * dx + rows * dy), dx, dy], axis=-1)[8:-8, 8:-8].reshape(-1, 3)
        normal += terms.T @ terms
        target += terms.T @ change[8:-8, 8:-8].ravel()
    growth, *way = np.linalg.solve(normal, target)
    assert growth > 0.0, "it streams away, not in"
    found = np.array(way) / growth
    assert np.linalg.norm(found - focus(scene)) < 12.0
    assert np.linalg.norm(found - 128.0) > 30.0, "and not from the middle of the picture"


@pytest.mark.parametrize(("name", "bad"), [("size", 63), ("size", "64"), ("frames", 1.5)])
def test_refusals_make_nothing(name: str, bad: object, tmp_path: Path):
    with pytest.raises((TypeError, ValueError), match=name):
        demo.run(tmp_path / "new", **{name: bad})
    assert not list(tmp_path.iterdir())
