"""The weather alone as RGBA: put over its background elsewhere, it is the composite."""

from pathlib import Path

import numpy as np
import pytest

import flurries as fl
from flurries.io import read_picture

LIGHT = np.random.default_rng(5).random((48, 64, 3), np.float32)
SNOW = fl.effects.TentSnow("heavy", color=(0.9, 0.8, 1.0), flakes=300)


def test_over_its_background_it_is_the_composite(tmp_path: Path):
    scene = fl.Scene(LIGHT, effects=[SNOW, fl.effects.TentSnow("light")])
    scene.write(tmp_path / "%d.exr", "7", alone=True, bits="float")
    layer = read_picture(tmp_path / "7.exr")
    assert layer.alpha is not None and layer.premultiplied
    whole = layer.pixels + (1.0 - layer.alpha[..., None]) * LIGHT
    assert np.abs(whole - scene.render(7)).max() < 1e-6
    assert 0.0 < layer.alpha.mean() < 1.0


def test_a_png_holds_straight_display_values(tmp_path: Path):
    scene = fl.Scene("#204060", size=(64, 48), effects=[SNOW])
    scene.write(tmp_path / "snow.png", 7, alone=True)
    layer = read_picture(tmp_path / "snow.png")
    assert layer.alpha is not None and not layer.premultiplied
    seen = layer.alpha > 0.15
    color = layer.pixels[seen].mean(axis=0) / 255.0
    assert np.abs(color - (0.9, 0.8, 1.0)).max() < 0.01
    assert np.abs(layer.alpha - scene.layers(7).alpha).max() <= 0.5 / 255 + 1e-6


@pytest.mark.parametrize("name", ["film.mp4", "%d.jpg"])
def test_what_has_no_alpha_is_refused(name: str, tmp_path: Path):
    with pytest.raises(ValueError, match="alone"):
        fl.Scene(LIGHT, effects=[SNOW]).write(tmp_path / name, "1", alone=True)
    assert not list(tmp_path.iterdir())


def test_an_exr_is_packed_as_asked(tmp_path: Path):
    scene = fl.Scene("#203040", size=(300, 200), effects=fl.Snow("heavy"))
    sizes = {}
    for packing in ("none", "zip", "dwaa"):
        path = tmp_path / f"{packing}.exr"
        scene.write(path, 1, compression=packing)
        sizes[packing] = path.stat().st_size
        difference = read_picture(path).pixels - read_picture(tmp_path / "none.exr").pixels
        assert np.abs(difference).max() <= (0.05 if packing == "dwaa" else 0.0)
    assert sizes["dwaa"] < 0.5 * sizes["zip"] < 0.5 * sizes["none"]
    for path, more in (("a.png", {}), ("a.exr", {"layers": True})):
        with pytest.raises(ValueError, match="compression is for a composite"):
            scene.write(tmp_path / path, 1, compression="dwaa", **more)
