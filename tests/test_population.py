"""Snow and rain of one population: laws, drawing, and the texture against every flake drawn."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.particles.population import Population, slabs_of
from flurries.particles.sizes import (
    Sizes,
    drop_mass,
    drop_speed,
    rain_of,
    snow_mass,
    snow_of,
    snow_speed,
)
from measure import cover

LENS = (300.0, 40.0, 30.0, (0.0, 0.0, 0.0), 0.1)
SHAPE = (60, 80)


@pytest.mark.parametrize(
    "law",
    [
        (0.002, 0.004, 0.03),
        (0.002, 0.014, 0.03),
        (0.002, 0.027, 0.03),
        # It ends long before the largest.
        (0.001, 0.0018, 0.04),
    ],
)
def test_sizes_have_their_mean_and_law(law: tuple[float, float, float]):
    sizes = Sizes.with_mean(*law)
    shares = (np.arange(400_000) + 0.5) / 400_000
    diameters = sizes.quantile(shares)
    assert diameters.mean() == pytest.approx(law[1], rel=1e-6)
    # The density falls as exp(-slope D): its logarithm is a line.
    edges = np.linspace(law[0], law[2], 9)
    parts = np.diff(np.searchsorted(diameters, edges) / len(shares))
    falls = np.exp(-sizes.slope * (edges - law[0]))
    np.testing.assert_allclose(parts, np.diff(falls) / (falls[-1] - 1.0), atol=1e-5)
    for power in (1.0, 2.0, 3.078):
        # A midpoint sum over shares errs by the tail of the law.
        assert sizes.moment(power) == pytest.approx((diameters**power).mean(), rel=1e-5)


@pytest.mark.parametrize("rate", [0.3, 1.0, 3.0, 10.0, 40.0])
def test_rates_are_carried_by_the_flakes_and_drops(rate: float):
    """A sum over a million quantiles of mass times speed, kg per square metre and hour."""
    shares = (np.arange(1_000_000) + 0.5) / 1e6
    for effect, mass, speed in (
        (fl.Snow(rate_mm_h=rate), snow_mass, snow_speed),
        (fl.Rain(rate_mm_h=rate), drop_mass, drop_speed),
    ):
        given = effect.flake_size if isinstance(effect, fl.Snow) else effect.drop_size
        at = Sizes.with_mean(*given).quantile(shares)
        carried = 3600.0 * effect.density * float((mass(at) * speed(at)).mean())
        assert carried == pytest.approx(rate, rel=1e-4)


def test_snow_hides_as_far_as_it_was_seen_to():
    """Rasmussen et al. 1999 see 0.5 to 2 km in light, and 100 to 500 m in heavy snow."""
    for rate, (low, high) in {
        1.0: (500.0, 2500.0),
        3.0: (300.0, 1000.0),
        10.0: (80.0, 500.0),
    }.items():
        extinction = Population(*snow_of(rate), 0.9, snow_speed).extinction
        assert low < 3.912 / extinction < high
    assert rain_of(50.0)[1].mean > rain_of(1.0)[1].mean


def test_classes_share_out_all_flakes_and_their_area():
    sizes = Sizes.with_mean(0.003, 0.008, 0.03)
    population = Population(50.0, sizes, 0.9, snow_speed)
    for count in (1, 2, 5):
        classes = population.classes(count)
        assert sum(one.density for one in classes) == pytest.approx(50.0)
        areas = [
            sum(share * at**2)
            for at, share in (sizes.nodes(one.smallest, one.largest) for one in classes)
        ]
        assert areas == pytest.approx([sizes.moment(2.0) / count] * count, rel=1e-3)
        assert [one.fall for one in classes] == sorted(one.fall for one in classes)


def test_slabs_cover_what_the_air_beyond_the_drawn_flakes_does():
    """By a sum over a million flakes in the pyramid behind a tile."""
    sizes = Sizes.with_mean(0.003, 0.008, 0.03)
    population = Population(50.0, sizes, 0.9, snow_speed)
    focal, far = 700.0, 40.0
    rng, fine = np.random.default_rng(3), sizes.quantile(np.linspace(0.0, 1.0, 100_001))
    for one in population.classes(2):
        reach = 200.0 * one.largest
        edges = np.linspace(reach, far, 7)
        slabs = slabs_of(population, one, focal, reach=reach, far=far, edges=edges)
        depth = (rng.random(1_000_000) * (far**3 - reach**3) + reach**3) ** (1 / 3)
        part = np.clip((depth / reach - 1.0) / 0.08, 0.0, 1.0)
        share = part * part * (3.0 - 2.0 * part)
        low, high = np.interp([one.smallest, one.largest], fine, np.linspace(0.0, 1.0, len(fine)))
        size = sizes.quantile(low + rng.random(1_000_000) * (high - low))
        number = one.density / focal**2 * (far**3 - reach**3) / 3.0
        area = number * 0.9 * 0.25 * math.pi * (share * (focal * size / depth) ** 2).mean()
        assert sum(slab.coverage for slab in slabs) == pytest.approx(area, rel=5e-3)
        assert sum(slab.count for slab in slabs) == pytest.approx(number * share.mean(), rel=2e-3)


def _scene(method: str, *, shape: tuple[int, int] = (160, 200), **fields: Any) -> fl.Scene:
    seed = fields.pop("scene_seed", 1)
    options = {name: fields.pop(name) for name in ("depth", "camera") if name in fields}
    snow = fl.Snow(**{"density": 60.0, "method": method, "far": 40.0, **fields})
    return fl.Scene((shape[1], shape[0]), "#000000", effects=[snow], seed=seed, **options)


def _alpha(scene: fl.Scene, t: float = 7.0) -> np.ndarray:
    found: np.ndarray = cover(scene, t)
    return found


def test_the_texture_stands_for_the_flakes_that_it_replaces():
    """Mean, deviation and likeness to the next frame, over two seeds; near flakes are the same."""
    sums = {}
    for method in ("hybrid", "simulated"):
        scenes = [_scene(method, scene_seed=seed, far=20.0) for seed in range(2)]
        first = [_alpha(scene) for scene in scenes]
        after = [_alpha(scene, 8.0) for scene in scenes]
        like = [np.corrcoef(a.ravel(), b.ravel())[0, 1] for a, b in zip(first, after, strict=True)]
        sums[method] = (
            np.mean([a.mean() for a in first]),
            np.mean([a.std() for a in first]),
            np.mean(like),
        )
    ours, all_drawn = sums["hybrid"], sums["simulated"]
    assert ours[0] == pytest.approx(all_drawn[0], rel=0.02)
    assert ours[1] == pytest.approx(all_drawn[1], rel=0.04)
    assert ours[2] == pytest.approx(all_drawn[2], abs=0.03)


def test_both_methods_draw_the_same_near_flakes():
    """What the hybrid draws, faded where the texture takes over, lies within what is simulated."""
    drawn = _scene("hybrid", far=15.0).render(7.0, layers=True).coverages["snow"]
    whole = _alpha(_scene("simulated", far=15.0))
    assert drawn.max() > 0.5
    assert (whole - drawn).min() > -1e-3
    other = _alpha(_scene("simulated", scene_seed=2, far=15.0))
    assert (other - drawn).min() < -0.3


@pytest.mark.parametrize("wall", [20.0, 60.0, 200.0])
def test_extinction_before_a_wall_is_that_of_all_flakes(wall: float):
    """exp(-density * area * depth): flakes near, far and beyond `far` are counted once."""
    means = [
        1.0 - _alpha(_scene("hybrid", scene_seed=seed, depth=wall, near=0.5)).mean()
        for seed in range(5)
    ]
    sizes = Sizes.with_mean(*fl.Snow().flake_size)
    extinction = 60.0 * 0.9 * 0.25 * math.pi * sizes.moment(2.0)
    # From the middle of the fade before the lens on.
    wanted = math.exp(-extinction * (wall - 0.5 * (1.0 + 1.25) / 2.0))
    assert np.mean(means) == pytest.approx(wanted, abs=0.012)


def test_less_snow_is_fewer_flakes_and_not_fainter_ones():
    whole, half = (_alpha(_scene("hybrid", amount=amount)) for amount in (1.0, 0.5))
    assert np.log1p(-half).mean() == pytest.approx(0.5 * np.log1p(-whole).mean(), rel=0.06)
    assert half.max() > 0.8 * whole.max()
    keyed = fl.Keys([(0, 0.5), (100, 0.5)])
    likewise = _alpha(_scene("hybrid", amount=keyed))
    assert likewise.mean() == pytest.approx(half.mean(), rel=0.03)


def test_snow_that_stops_falls_on_and_leaves_from_the_top():
    emission = fl.Keys([(0.0, 1.0), (0.01, 0.0)])
    scene = _scene("hybrid", emission=emission, cloud=2.0, shape=(240, 120))
    frames = [_alpha(scene, t) for t in (0.0, 60.0, 120.0, 1100.0)]
    totals = [frame.mean() for frame in frames]
    assert totals[0] > totals[1] > totals[2] > totals[3]
    assert totals[3] == 0.0
    top, bottom = frames[1][:80].mean(), frames[1][160:].mean()
    assert top < 0.8 * bottom


def test_eyes_see_flakes_by_their_depth():
    left, right = _scene("hybrid", density=200.0).stereo(3.0, distance=0.06)
    assert not np.array_equal(left, right)
    assert left.mean() == pytest.approx(right.mean(), rel=0.05)


def test_a_turning_and_a_zooming_camera_keep_the_amount_of_snow():
    lens = fl.Camera(240.0)

    def mean(camera: Any) -> float:
        return float(_alpha(_scene("hybrid", density=200.0, camera=camera), 5.0).mean())

    still = mean(lens)
    turning = fl.CameraPath(lens, orientation=fl.Keys([(0, (0, 0, 0)), (30, (0.0, 0.4, 0.1))]))
    assert _alpha(_scene("hybrid", density=200.0, camera=turning), 5.0).mean() == pytest.approx(
        still, rel=0.08
    )
    zoom = fl.CameraPath(lens, focal=fl.Keys([(0, 240.0), (30, 300.0)]))
    assert _alpha(_scene("hybrid", density=200.0, camera=zoom), 5.0).mean() == pytest.approx(
        still, rel=0.08
    )


def test_rain_shines_more_than_its_color_and_covers_no_more():
    shown = {}
    for gain in (1.0, 6.0):
        rain = fl.Rain(rate_mm_h=20.0, gain=gain)
        scene = fl.Scene((160, 120), "#303030", effects=[rain], seed=2, space="linear")
        found = scene.render(4.0, layers=True)
        shown[gain] = found.alpha, float(found.image.mean())
    assert np.array_equal(shown[1.0][0], shown[6.0][0])
    assert shown[6.0][1] > shown[1.0][1]


def test_snow_that_stops_wants_one_wind():
    wind = fl.Wind((1.0, 0.0, 0.0), profile=[(5.0, 1.0), (40.0, 2.0)])
    with pytest.raises(ValueError, match=r"emission.*profile"):
        fl.Snow(wind=wind, emission=fl.Keys([(0, 1.0), (50, 0.0)]))


@pytest.mark.parametrize(
    ("fall", "wind", "flight"),
    [(3.0, (0.0, 0.0, 0.0), 0.0), (0.0, (3.0, 0.0, 0.0), 0.0), (0.0, (0.0, 0.0, 0.0), 6.0)],
)
def test_drawn_flakes_never_come_back_alike(
    fall: float, wind: tuple[float, float, float], flight: float
):
    # Their box passes in 15, 18 and 22 frames; flakes at the same places again have .99.
    snow = fl.Snow(
        density=30.0, flake_size=(0.06, 0.06, 0.06), fall=fall, wind=wind, sway=(0.0, 0.0),
        far=4.0, shutter=0.0, shape="round",
    )  # fmt: skip
    path = fl.CameraPath(fl.Camera(200.0), velocity=(0.0, 0.0, flight))
    scene = fl.Scene((48, 36), "#000000", path, [snow], seed=3)

    def seen(t: float) -> np.ndarray:
        return cover(scene, t).ravel()

    first = seen(0.0)
    assert first.std() > 0.2
    assert max(np.corrcoef(first, seen(t))[0, 1] for t in np.arange(10.0, 70.0, 0.25)) < 0.5
