"""Flakes near the camera and out of focus: energy, extent, and no pop anywhere."""

import math
from functools import partial
from typing import Any

import numpy as np
import pytest

import flurries as fl
import measure
from flurries import _core
from flurries.camera.optics import Blur
from flurries.effects.air import Air, Class, Closeup, Eye, images_of
from measure import picture, scene

Array = np.ndarray[Any, Any]
SHAPE = (300, 400)
FOCAL = 800.0
KINDS = ("aggregate", "drop", "round")


def drawn(
    diameter: float, depth: float, *, kind: str = "aggregate", blur: Blur | None = None,
    travel: tuple[float, float, float] = (0.0, 0.0, 0.0), seconds: float = 0.0,
    place: tuple[float, float] = (0.0, 0.0), number: int = 7,
) -> Array:  # fmt: skip
    """Return the opacity of one flake, diameters and depths in metres."""
    closeup = Closeup(kind, (2.5, 3.5), blur, 3, seconds, 1.0 / 60.0)
    eye = Eye(np.eye(3).tolist(), (FOCAL, FOCAL), (200.0, 150.0), (0.0, 0.0, 0.0))

    def flakes_at(camera: Array, shown: tuple[float, float, float, float]) -> Any:
        # Of a camera in the air where the shutter is half open, opens and closes.
        ways = [tuple((camera + part * np.array(travel)).tolist()) for part in (0.0, 0.5, -0.5)]
        one = Class(
            number=0, density=0.02, sizes=(diameter, diameter), slope=0.0, shown=shown,
            by_size=False, heights=(-1.0, 1.0), amounts=[1.0], ranks=(0.0, 1.0), at=ways,
            swung=[0.0] * 3, waves=None, depths=(0.0, 1.0), profile=[],
        )  # fmt: skip
        return _core.fall(Air(
            seed=number, opacity=0.9, images=images_of(0.9), classes=[one], eyes=[eye] * 3,
            sway=[0.0] * 3, waves=None, clumps=None, shape=SHAPE, window=(0, SHAPE[0], 0, SHAPE[1]),
            room=2.0, near=0.05, closeup=closeup,
        ))  # fmt: skip

    # A flake of the air, and the camera where that flake lies at the place; no other is as deep.
    known = _core.flake_rows(flakes_at(np.zeros(3), (0.1, 0.1, 60.0, 60.0)))[1][0, :3]
    near, far = depth - 1e-6, depth + 1e-6
    flakes = flakes_at(known - (*place, depth), (near, near, far, far))
    out = np.empty(SHAPE, np.float32)
    _core.particle_draw(out, flakes, (0, *SHAPE[:1], 0, SHAPE[1]), None)
    return out


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("focus", [None, 1.0, 0.6, 8.0])
def test_energy_is_the_flake_s_at_every_size_and_focus(kind: str, focus: float | None):
    lens = None if focus is None else Blur(14.0, 1.0 / focus, 6, 0.3)
    for diameter in (0.004, 0.008, 0.0098, 0.0112, 0.013, 0.03, 0.1):
        for travel in ((0.0, 0.0, 0.0), (0.004, 0.02, 0.0)):
            image = drawn(diameter, 1.0, kind=kind, blur=lens, travel=travel)
            found = float(image.astype(np.float64).sum()) / (FOCAL * diameter) ** 2
            # A sprite's footprint ends at four sigma, and costs .2 % at most.
            assert abs(found / (0.225 * math.pi) - 1.0) < 0.01, (diameter, travel)


# Lace is wider than the ball that covers as much: by 1.385 as shapes are, and rain hardly is.
@pytest.mark.parametrize("kind, widest", [("aggregate", 1.4), ("drop", 1.15)])
def test_the_extent_goes_on_across_the_switch(kind: str, widest: float):
    rows, columns = np.indices(SHAPE)
    spreads = []
    for diameter in np.linspace(0.0075, 0.014, 27).tolist():
        images = [drawn(diameter, 1.0, kind=kind, number=k) for k in range(8)]
        image = np.mean(images, axis=0, dtype=np.float64)
        image /= image.sum()
        x, y = (image * columns).sum(), (image * rows).sum()
        variance = (image * ((columns - x) ** 2 + (rows - y) ** 2)).sum()
        spreads.append(math.sqrt(variance) / (FOCAL * diameter))
    steps = np.abs(np.diff(spreads)) / np.mean(spreads)
    assert steps.max() < 0.05 and max(spreads) / min(spreads) < widest


@pytest.mark.parametrize("kind", ["aggregate", "drop"])
def test_no_flake_s_alpha_jumps_in_a_sixtieth_of_a_second(kind: str):
    # It falls at 1 m/s, comes nearer at .3 m/s through the switch, and tumbles.
    sums, shapes = [], []
    for step in range(60):
        t = step / 60.0
        image = drawn(0.012, 1.5 - 0.3 * t, kind=kind, seconds=t, place=(0.0, 0.2 * t - 0.1))
        sums.append(float(image.sum()) * (1.5 - 0.3 * t) ** 2)
        shapes.append(float(image.max()))
    assert np.abs(np.diff(sums)).max() / np.mean(sums) < 0.05
    assert np.abs(np.diff(shapes)).max() < 0.1


def test_aggregates_are_lace_with_a_core_and_discs_are_not():
    def shares(image: Array) -> list[float]:
        inside = image[image > 0.05]
        return [float(part.mean()) for part in ((inside > 0.2) & (inside < 0.7), inside > 0.8)]

    lace, core = np.mean([shares(drawn(0.05, 1.0, number=number)) for number in range(8)], axis=0)
    assert lace > 0.25 and 0.1 < core < 0.6
    assert shares(drawn(0.05, 1.0, kind="round"))[0] < 0.15


@pytest.mark.parametrize("kind, least, most", [("aggregate", 0.55, 0.85), ("round", 0.98, 1.0)])
def test_a_flake_too_small_for_its_crystals_is_no_disc(kind: str, least: float, most: float):
    places = np.indices(SHAPE).reshape(2, -1)
    images = [drawn(0.007, 1.0, kind=kind, number=n) for n in range(8)]
    axes = [np.linalg.eigvalsh(np.cov(places, aweights=image.ravel())) for image in images]
    assert least < np.mean([math.sqrt(short / long) for short, long in axes]) < most


def test_a_streak_has_soft_and_uneven_ends():
    def down(kind: str, number: int) -> tuple[float, float]:
        image = drawn(0.02, 1.0, kind=kind, number=number, travel=(0.0, 0.12, 0.0))
        line = image.sum(axis=1, dtype=np.float64)
        ends = np.ptp(np.flatnonzero(line > 0.05 * line.max()))
        middle = float((np.arange(len(line)) + 0.5) @ line / line.sum()) - 150.0
        return middle, float((line > 0.95 * line.max()).sum() / ends)

    uneven = [down("aggregate", number)[0] for number in range(8)]
    assert -15.0 < min(uneven) < -0.5 and 0.5 < max(uneven) < 15.0
    assert abs(down("drop", 0)[0]) < 0.1 and down("drop", 0)[1] < 0.8


def test_a_circle_of_confusion_is_as_wide_as_a_thin_lens_makes_it():
    lens = fl.camera.Lens(focus=2.0, f_stop=1.4)
    long = 1000.0 * 0.036 / 1000.0
    for depth in (0.4, 1.0, 2.0, 9.0, 1e6):
        wanted = long**2 / 1.4 * abs(depth - 2.0) / (depth * (2.0 - long)) * 1000.0 / 0.036
        assert abs(lens.circle(depth, focal=1000.0, width=1000) - wanted) < 1e-9
    far = fl.camera.Lens(focus=math.inf, f_stop=2.0).circle(3.0, focal=1000.0, width=1000)
    assert abs(far - long**2 / 2.0 / 3.0 * 1000.0 / 0.036) < 1e-9
    with pytest.raises(ValueError, match="focus must be farther than the lens is long"):
        fl.camera.Lens(focus=0.02).circle(1.0, focal=1000.0, width=1000)


@pytest.mark.parametrize("blades", [0, 6])
def test_a_point_out_of_focus_is_an_even_disc_of_the_circle_s_area(blades: int):
    circle = 40.0
    lens = Blur(circle / abs(1.0 / 1.0 - 1.0 / 3.0), 1.0 / 3.0, blades, 0.0)
    image = drawn(0.004, 1.0, kind="round", blur=lens)
    inside = image > 0.5 * np.median(image[image > 0.2 * image.max()])
    assert abs(float(inside.sum()) / (0.25 * math.pi * circle**2) - 1.0) < 0.06
    core = image[141:159, 191:209]
    assert float(core.std() / core.mean()) < (0.05 if blades == 0 else 0.12)


def flakes(**more: Any) -> fl.Scene:
    snow = fl.Snow("heavy", color=1.0, wind=(0.0, 0.0, 0.0))
    return fl.Scene(np.zeros((256, 384, 3), np.float32), effects=[snow], seed=2, **more)


def test_a_photograph_has_the_usual_lens_and_a_still_s_exposure(tmp_path: Any):
    fl.io.write_picture(tmp_path / "plate.png", np.full((48, 64, 3), 90, np.uint8))
    still = fl.Scene(tmp_path / "plate.png", effects=[fl.Snow()])
    film = still.replace(fps=still.fps)
    assert still._still and still.replace(seed=3)._still
    assert not (film._still or still.replace(loop=48)._still)
    assert still.lens == fl.camera.Lens(focus=10.0, f_stop=5.6)
    assert fl.Scene("#5a5a5a").lens is None and flakes().lens is None

    def exposure(scene: fl.Scene) -> float:
        frame = scene._program.views(3.0)[0][1]
        return float(scene.effects[0].parts.flakes.motion.exposure(frame)) / scene.fps

    assert exposure(still) == pytest.approx(1 / 250) and exposure(film) == pytest.approx(1 / 60)
    assert exposure(still.replace(effects=[fl.Snow(shutter=0.3)])) == pytest.approx(0.01)
    for made in (still, film, still.replace(lens=None)):
        made.save(tmp_path / "scene.toml")
        again = fl.open(tmp_path / "scene.toml")
        assert (again._still, again.lens) == (made._still, made.lens)


CROWD = {"texture": 0.0, "haze": 0.0, "color": 1.0, "flakes": 2000, "flake_size": (0.03, 0.05),
         "near_depth": 4.0}  # fmt: skip
SOMETIMES = np.random.default_rng(2).uniform(0.0, 500.0, 25)

SHORT = (0.08, 0.04, 0.02)  # In shorter ones those of the kernel's tables show, of .08.


def changes(options: dict, times: np.ndarray = SOMETIMES, **about) -> np.ndarray:
    shown = scene({**CROWD, **options}, 256, **about)
    return measure.largest_changes(partial(picture, shown), times, SHORT)


TURNING = fl.Keys([(0, (0.0, 0.0, 0.0)), (100, (0.4, 1.2, -0.4))])


@pytest.mark.parametrize("z", [5.0, 0.0, -5.0])
def test_no_flake_pops(z: float):
    path = fl.CameraPath(fl.camera.Camera(300.0), velocity=(1.0, -0.3, z))
    shown = scene(CROWD, 256, camera=path)
    assert measure.smooth(changes({}, camera=path))

    # The control: flakes of air that ends at once.
    def cut(t: float) -> np.ndarray:
        flakes = fl.flakes(shown, t)
        near = flakes["place"][flakes["depth"] < 2.0] - path.place(t, fps=30.0)
        return fl.particles.splat((256, 256), near, 0.02, path.camera, opacity=0.9)

    assert z == 0.0 or not measure.smooth(measure.largest_changes(cut, SOMETIMES, SHORT))


@pytest.mark.parametrize("given", [
    {"wind": fl.Wind((1.0, 0.0, 0.0), gusts=1.5, swirl=0.5)},
    {"wind": fl.Wind((1.0, 0.0, 0.0), profile=[(1.0, (1.0, 0.0, 0.0)), (4.0, (-1.5, 0.4, 0.0))])},
    {"camera": fl.CameraPath(fl.Camera(300.0), velocity=(0.6, -0.4, 0.0), orientation=TURNING)},
])  # fmt: skip
def test_no_flake_pops_in_wind_and_turning(given: dict):
    camera = given.get("camera", fl.Camera(300.0))
    options = {name: value for name, value in given.items() if name != "camera"}
    assert measure.smooth(changes(options, np.array([0.0, 17.3, 55.1]), camera=camera))


def test_no_flake_pops_while_the_amount_rises():
    amount = fl.Keys([(0.0, 0.0), (30.0, 1.0)])
    # The first ones come soon after one another, and so do the last.
    times = np.append(np.random.default_rng(3).uniform(6.0, 24.0, 25), 6.0)
    # In still air only the amount changes a pixel.
    still = {"amount": amount, "fall": 0.0, "wind": (0.0, 0.0, 0.0), "sway": (0.0, 0.0)}
    assert measure.smooth(changes(still, times))
    assert measure.smooth(changes({"amount": amount, "texture": 0.8, "haze": 0.1}, times))
    none, all_ = (picture(scene({**CROWD, **still}, 256), t) for t in (0.0, 30.0))
    assert none.max() == 0.0
    assert np.array_equal(all_, picture(scene({**CROWD, **still, "amount": 1.0}, 256), 30.0))

    # The control: the same flakes, each there or not.
    shown = scene({**CROWD, **still}, 256)

    def hard(t: float) -> np.ndarray:
        there = fl.flakes(shown, t)
        there = there[there["opacity"] > 0.0]["place"]
        return fl.particles.splat((256, 256), there, 0.02, shown.camera.camera, opacity=0.9)

    assert not measure.smooth(measure.largest_changes(hard, times, SHORT))
