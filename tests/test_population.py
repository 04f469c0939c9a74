"""Snow and rain of one population: laws, drawing, the texture against every flake drawn, keys."""

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.particles import sizes as laws
from flurries.particles.population import Population, slabs_of
from flurries.particles.sizes import Sizes
from measure import cover, same_flakes

SIZES = Sizes.with_mean(0.003, 0.008, 0.03)
DENSE = Population(50.0, SIZES, 0.9, laws.snow_speed)


@pytest.mark.parametrize("rate", [0.3, 1.0, 3.0, 10.0, 40.0])
def test_the_sizes_of_a_rate_melt_to_those_that_were_measured(rate: float):
    """The middle of the mass of melted diameters, whose number falls as exp(-slope D)."""
    d = np.linspace(1e-6, 0.4, 400_001)
    for matter, slope in ((laws.SNOW, 2.55 * rate**-0.48), (laws.RAIN, 4.1 * rate**-0.21)):
        weight = np.exp(-matter.sizes(rate).slope * d) * matter.mass(d)
        middle = matter.mass(np.array((weight * d).sum() / weight.sum()))
        assert (middle * 6e-3 / math.pi) ** (1.0 / 3.0) == pytest.approx(4e-3 / slope, rel=1e-4)


def test_slabs_cover_what_the_air_beyond_the_drawn_flakes_does():
    """By a sum over a million flakes in the pyramid behind a pixel."""
    focal, far, rng = 700.0, 40.0, np.random.default_rng(3)
    fine = SIZES.quantile(np.linspace(0.0, 1.0, 100_001))
    for one in DENSE.classes(2):
        reach = 200.0 * one.largest
        edges = np.linspace(reach, far, 7)
        slabs = slabs_of(DENSE, one, focal, edges)
        depth = (rng.random(1_000_000) * (far**3 - reach**3) + reach**3) ** (1 / 3)
        part = np.clip((depth / reach - 1.0) / 0.08, 0.0, 1.0)
        share = part * part * (3.0 - 2.0 * part)
        low, high = np.interp([one.smallest, one.largest], fine, np.linspace(0.0, 1.0, len(fine)))
        size = SIZES.quantile(low + rng.random(1_000_000) * (high - low))
        number = one.density / focal**2 * (far**3 - reach**3) / 3.0
        area = number * 0.9 * 0.25 * math.pi * (share * (focal * size / depth) ** 2).mean()
        assert sum(slab.coverage for slab in slabs) == pytest.approx(area, rel=5e-3)
        assert sum(slab.count for slab in slabs) == pytest.approx(number * share.mean(), rel=2e-3)


def scene(
    method: str = "flakes", *, shape: tuple[int, int] = (160, 200), seed: int = 1,
    depth: Any = None, camera: Any = None, **fields: Any,
) -> fl.Scene:  # fmt: skip
    snow = fl.Snow(**{"density": 60.0, "method": method, "far": 40.0, **fields})
    return fl.Scene(
        "#000000", size=(shape[1], shape[0]), camera=camera, effects=[snow], seed=seed, depth=depth
    )


def alpha(shown: fl.Scene, t: float = 7.0) -> np.ndarray:
    return cover(shown, t).astype(np.float64)


def memory(film: list[np.ndarray], most: int) -> np.ndarray:
    frames = np.stack(film).reshape(len(film), -1)
    frames -= frames.mean(axis=1, keepdims=True)
    frames /= frames.std(axis=1, keepdims=True)
    both = (frames @ frames.T) / frames.shape[1]
    return np.array([np.diagonal(both, lag)[:20].mean() for lag in range(most + 1)])


def test_pixels_forget_snow_straight_down_as_drawn_flakes_do():
    # No wind and no sway. After 24 frames drawn flakes are gone from where they were: 1.5 m/s at
    # 22 m is .8 px a frame. The texture must not show the same ones again, in any layer.
    hybrid, simulated = (
        scene(method, density=30.0, wind=(0.0, 0.0, 0.0), sway=(0.0, 1.0), near=6.0, far=22.0,
              fall=1.5, shape=(288, 384), camera=fl.Camera(360.0), seed=4)
        for method in ("flakes", "simulated")
    )  # fmt: skip
    drawn = memory([alpha(simulated, t) for t in range(0, 28, 4)], 6)
    ours = memory([alpha(hybrid, t) for t in range(0, 68, 4)], 6)
    assert abs(drawn[6]) < 0.02
    assert np.abs(ours[1:] - drawn[1:]).max() < 0.02, (ours, drawn)
    texture = hybrid.effects[0].parts.texture
    film = [texture.alpha(hybrid._program.views(t)[0][1], 1.0) for t in range(0, 240, 4)]
    assert np.abs(memory(film, 40)[7:]).max() < 0.02


def test_far_flakes_sway_and_each_layer_by_itself():
    def texture(t: float, width: float) -> np.ndarray:
        shown = scene(wind=(0.0, 0.0, 0.0), fall=0.0, sway=(width, math.tau), near=6.0, far=22.0)
        return shown.effects[0].parts.texture.alpha(shown._program.views(t)[0][1], 1.0).ravel()

    rest, there, back = (texture(t * scene().fps, 0.05) for t in (0.0, 0.5, 1.0))
    assert np.abs(back - rest).max() < 1e-6
    assert max(np.corrcoef(rest, np.roll(there, x))[0, 1] for x in range(-12, 13)) < 0.6


def test_both_methods_draw_the_same_near_flakes():
    """What the hybrid draws, faded where the texture takes over, lies within what is simulated."""
    drawn = scene("flakes", far=15.0).layers(7.0).layers["snow"].coverage
    assert drawn.max() > 0.5
    assert (alpha(scene("simulated", far=15.0)) - drawn).min() > -1e-3
    assert (alpha(scene("simulated", seed=2, far=15.0)) - drawn).min() < -0.3


@pytest.mark.parametrize("method", ["flakes", "simulated"])
def test_nothing_is_nearer_than_the_near_depth(method: str):
    # Also where flakes at that depth are the texture's: by the extinction of those beyond.
    for near in (0.5, 12.0):
        shown = scene(
            method, near=near, far=25.0, shape=(120, 160), camera=fl.Camera(190.0), seed=2
        )
        extinction = shown.effects[0].parts.texture.weather.population.extinction
        # Flakes fade in over a quarter of the near depth.
        wanted = extinction * (25.0 - 0.9 * near)
        assert -np.log1p(-alpha(shown, 8.0).mean()) == pytest.approx(wanted, rel=0.05)


def test_a_small_picture_is_a_large_one_made_smaller():
    means, deviations = [], []
    for seed in range(2):
        small, large = (
            alpha(scene(near=5.0, far=25.0, flake_size=(0.002, 0.005, 0.015), seed=seed,
                        shape=(w, w), camera=fl.Camera(1.2 * w)), 8.0)
            for w in (256, 2048)
        )  # fmt: skip
        made = large.reshape(256, 8, 256, 8).mean(axis=(1, 3))
        means.append(small.mean() / made.mean())
        deviations.append(small[4:-4, 4:-4].std() / made[4:-4, 4:-4].std())
    assert np.mean(means) == pytest.approx(1.0, abs=0.01), means
    assert np.mean(deviations) == pytest.approx(1.0, abs=0.03), deviations


def test_snow_that_stops_falls_on_and_leaves_from_the_top():
    emission = fl.Keys([(0.0, 1.0), (0.01, 0.0)])
    shown = scene(emission=emission, cloud=2.0, shape=(240, 120))
    frames = [alpha(shown, t) for t in (0.0, 60.0, 120.0, 1100.0)]
    totals = [frame.mean() for frame in frames]
    assert totals[0] > totals[1] > totals[2] > totals[3] == 0.0
    assert frames[1][:80].mean() < 0.8 * frames[1][160:].mean()
    wind = fl.Wind((1.0, 0.0, 0.0), profile=[(5.0, 1.0), (40.0, 2.0)])
    with pytest.raises(ValueError, match=r"emission.*profile"):
        fl.Snow(wind=wind, emission=emission)


def test_a_turning_and_a_zooming_camera_keep_the_amount_of_snow():
    lens = fl.Camera(240.0)
    turn = fl.Keys([(0, (0.0, 0.0, 0.0)), (30, (0.0, 0.4, 0.1))])
    zoom = fl.Keys([(0, 1200.0), (4, 240.0), (6, 240.0), (30, 1200.0)])
    cameras = (lens, fl.CameraPath(lens, orientation=turn), fl.CameraPath(lens, focal=zoom))
    still, *moving = (alpha(scene(density=200.0, camera=camera), 5.0) for camera in cameras)
    assert [one.mean() for one in moving] == pytest.approx([still.mean()] * 2, rel=0.08)
    # Where a zoom stands it is as sharp as a still one.
    assert moving[1].std() == pytest.approx(still.std(), rel=0.05)
    # One that turns past half a round (at 10.6) sees on what it saw.
    past = fl.Keys([(0, (0.0, 3.0, 0.0)), (30, (0.0, 3.4, 0.0))])
    shown = scene(density=200.0, camera=fl.CameraPath(lens, orientation=past))
    films = [memory([alpha(shown, t), alpha(shown, t + 0.1)], 1) for t in (8.0, 10.57)]
    assert films[1][1] == pytest.approx(films[0][1], abs=0.05)


@pytest.mark.parametrize("kind", [fl.Snow, fl.Rain])
def test_a_keyed_density_is_that_density(kind: Any):
    def depth(density: Any, frames: range) -> float:
        shown = fl.Scene(size=(192, 128), effects=[kind(density=density, wind=(0, 0, 0))], seed=3)
        return float(np.mean([-np.log1p(-np.minimum(alpha(shown, t), 0.999)).mean()
                              for t in frames]))  # fmt: skip

    keyed = fl.Keys([(60, 40.0), (100, 10.0)])
    for density, frames in ((40.0, range(0, 60, 12)), (10.0, range(100, 160, 12))):
        assert depth(keyed, frames) == pytest.approx(depth(density, frames), rel=0.15)


PROFILE = [(2.0, (1.0, 0.0, 0.0)), (9.0, (-3.0, 0.5, 0.0)), (25.0, (4.0, -0.3, 0.0))]


def windy(mean: tuple[float, float, float], profile: Any, **fields: Any) -> fl.Scene:
    given = {"density": 30.0, "sway": (0.0, 1.0), "far": 30.0, **fields}
    wind = fl.Wind(mean, profile=profile)
    return scene(wind=wind, shape=(288, 384), camera=fl.Camera(300.0), seed=0, **given)


def test_flakes_move_with_the_wind_of_their_depth():
    shown = windy((0.3, 0.0, 0.2), PROFILE, fall=1.5, flake_size=(0.008, 0.008, 0.008))
    early, late = same_flakes(fl.flakes(shown, 30.0), fl.flakes(shown, 30.5))
    moved, depth = (late["place"] - early["place"]) * 60.0, early["depth"]
    for axis, mean in enumerate((0.3, 1.5)):
        want = mean + np.interp(depth, *zip(*((z, v[axis]) for z, v in PROFILE), strict=True))
        # The air comes nearer at .2 m/s: what a flake felt on its way was other depths' wind.
        assert moved[:, axis] == pytest.approx(want, abs=0.35)
        assert np.median(np.abs(moved[:, axis] - want)) < 0.05
    assert moved[:, 2] == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize("t", [3000.0, -400.0])
def test_a_profile_leaves_as_many_flakes_in_view(t: float):
    # However far it has carried them.
    shown = windy((0.3, 0.0, 0.0), PROFILE)

    def seen(t: float) -> np.ndarray:
        found = fl.flakes(shown, t)
        inside = ((found["pixel"] > 0.0) & (found["pixel"] < (384, 288))).all(axis=1)
        return np.histogram(found["depth"][inside], [1.0, 2.0, 3.0, 4.0])[0]

    still, later = seen(0.0), seen(t)
    assert still.sum() > 140
    assert np.abs(later - still).max() < 4.0 * np.sqrt(2.0 * still.max())


def test_all_flakes_drawn_and_the_texture_feel_one_profile():
    # A wind that grows with depth: pixels forget their flakes as fast in both, and faster than
    # in the wind of the nearest air.
    wind = fl.Wind((0.2, 0.0, 0.0), profile=[(4.0, 1.0), (24.0, 30.0)])
    lags = (1, 4)

    def remembered(method: str, wind: Any) -> tuple[np.ndarray, float]:
        rows, means = [], []
        for seed in range(4):
            shown = scene(method, wind=wind, density=25.0, far=22.0, fall=0.2, sway=(0.0, 1.0),
                          shape=(120, 160), camera=fl.Camera(150.0), seed=seed)  # fmt: skip
            film = [alpha(shown, 20 + lag) for lag in (0, *lags)]
            rows.append([np.corrcoef(film[0].ravel(), one.ravel())[0, 1] for one in film[1:]])
            means.append(film[0].mean())
        return np.mean(rows, axis=0), float(np.mean(means))

    ours, mean = remembered("flakes", wind)
    drawn, wanted = remembered("simulated", wind)
    steady, _ = remembered("flakes", (0.2, 0.0, 0.0))
    assert mean == pytest.approx(wanted, rel=0.02)
    assert np.abs(ours - drawn).max() < 0.04, (ours, drawn)
    assert steady[0] - ours[0] > 0.1, (steady, ours)


def test_the_texture_s_motion_is_that_of_its_layers():
    # Of one depth's wind alone it would be 30 times as much or as little.
    profile = [(4.0, 1.0), (24.0, 30.0)]
    shown = windy((0.2, 0.0, 0.0), profile, density=60.0, fall=0.0, flake_size=(0.008,) * 3)
    texture = shown.effects[0].parts.texture
    views = [shown._program.views(t)[0][1] for t in (5.0, 6.0)]
    (moved, *_), _ = texture.passes(views[0], [views[1]])
    film = texture.weather.film(views[0])
    factor = np.interp(film.depths, *zip(*profile, strict=True))
    want = 300.0 * 0.2 / 30.0 * (film.covers / film.depths * factor).sum() / film.covers.sum()
    assert moved[90, 120] == pytest.approx([want, 0.0], rel=1e-5)
