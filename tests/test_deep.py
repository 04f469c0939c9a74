"""Deep EXR: samples over each other are the weather alone, and each lies where its air is."""

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
from flurries import io
from flurries.io.layers.deep import Deep, read_deep, write_deep
from flurries.scene import deep
from measure import cover

H, W = 36, 48
DISC = (np.hypot(*(np.mgrid[:H, :W] - np.array([[[18.0]], [[24.0]]]))) < 8).astype(np.float32)
FLOOR = np.repeat(np.linspace(60.0, 3.0, H, dtype=np.float32)[:, None], W, axis=1)
SNOW, FOG = fl.Snow("heavy"), fl.Mist("fog", color=0.8)


def scene(*effects: Any, **more: Any) -> fl.Scene:
    return fl.Scene(np.full((H, W, 3), 0.2, np.float32), effects=effects, **more)


def over(samples: Deep) -> np.ndarray:
    """The samples of each pixel over each other, one by one."""
    whole, at = np.zeros((samples.counts.size, 4)), 0
    for pixel, count in enumerate(samples.counts.ravel().tolist()):
        for sample in samples.values[at : at + count, :4]:
            whole[pixel] += (1.0 - whole[pixel, 3]) * sample
        at += count
    return whole.reshape(*samples.counts.shape, 4)


SCENES = {
    "snow": scene(SNOW),
    "fog before a floor": scene(FOG, depth=FLOOR),
    "snow before a floor, behind and before a disc": scene(
        SNOW, depth=FLOOR, foreground=fl.scene.Foreground(DISC, depth=8.0)
    ),
    "rain and the tent's snow": scene(fl.effects.TentSnow("heavy"), depth=20.0),
}


@pytest.mark.parametrize("name", SCENES)
def test_samples_over_each_other_are_the_weather_alone(name: str, tmp_path: Path):
    shown = SCENES[name]
    shown.write(tmp_path / "deep.exr", 3, deep=True, bits="float")
    shown.write(tmp_path / "alone.exr", 3, alone=True, bits="float")
    samples = read_deep(tmp_path / "deep.exr")
    alone = io.read_picture(tmp_path / "alone.exr").rgba()
    assert samples.counts.max() > 1 and samples.counts.sum() == len(samples.values)
    np.testing.assert_allclose(over(samples), alone, atol=1e-3)
    flat = oiio.ImageBufAlgo.flatten(oiio.ImageBuf(str(tmp_path / "deep.exr")))
    np.testing.assert_allclose(flat.get_pixels("float")[..., :4], alone, atol=1e-3)


def test_of_two_effects_the_opacity_is_that_of_both_and_the_nearest_stands_first():
    both = scene(FOG, SNOW)
    samples = deep.deep_of(both, 3)
    np.testing.assert_allclose(over(samples)[..., 3], cover(both, 3), atol=4e-3)
    pixels = np.repeat(np.arange(samples.counts.size), samples.counts.ravel())
    assert (np.diff(samples.values[:, 4])[np.diff(pixels) == 0] >= 0.0).all()


def test_samples_lie_where_their_air_is():
    """Those that end before a wall are what is seen before that wall."""
    shown = scene(SNOW)
    samples = deep.deep_of(shown, 3)
    edge = np.geomspace(deep.FIRST, deep.LAST, deep.SLICES)[18]
    begins, ends = samples.values[:, 4], samples.values[:, 5]
    assert (begins < ends).all()
    pixels = np.repeat(np.arange(samples.counts.size), samples.counts.ravel())
    near = ends <= edge * 1.0001
    through = np.ones(samples.counts.size)
    np.multiply.at(through, pixels[near], 1.0 - samples.values[near, 3])
    before = cover(shown.replace(depth=float(edge)), 3)
    far = cover(shown.replace(depth=float(2.0 * edge)), 3)
    # What is too faint for a sample of its own goes into the next one.
    np.testing.assert_allclose(1.0 - through.reshape(H, W), before, atol=3e-3)
    assert np.abs(1.0 - through.reshape(H, W) - far).max() > 0.05, "another wall would be seen"


def test_a_budget_of_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(deep, "MOST_SAMPLES", 1000)
    with pytest.raises(ValueError, match="frame 3 has more than 1000 samples"):
        scene(SNOW).write(tmp_path / "deep.exr", 3, deep=True)
    assert not list(tmp_path.glob("*.exr"))


def test_what_is_there_stays_and_what_is_damaged_is_refused(tmp_path: Path):
    shown, file = scene(SNOW), tmp_path / "deep.exr"
    assert shown.write(file, 3, deep=True).written == [3]
    before = file.read_bytes()
    assert shown.write(file, 3, deep=True).kept == [3]
    file.write_bytes(before[: len(before) // 2])
    with pytest.raises(ValueError, match=r"deep\.exr .* has been changed since it was written"):
        shown.write(file, 3, deep=True)
    assert shown.write(file, 3, deep=True, overwrite=True).written == [3]
    assert file.read_bytes() == before


def test_what_holds_no_samples_is_refused(tmp_path: Path):
    shown = scene(SNOW)
    with pytest.raises(ValueError, match="deep needs an EXR"):
        shown.write(tmp_path / "deep.png", 3, deep=True)
    with pytest.raises(ValueError, match="deep and eyes must not both be given"):
        shown.write(tmp_path / "deep.exr", 3, deep=True, eyes={"left": fl.Camera(90.0)})
    with pytest.raises(ValueError, match=r"only \.exr holds deep samples"):
        write_deep(tmp_path / "deep.tif", deep.deep_of(shown, 3))
    shown.write(tmp_path / "flat.exr", 3)
    with pytest.raises(ValueError, match="holds no deep samples"):
        read_deep(tmp_path / "flat.exr")
