"""Rain as a texture, and snow and rain on a cone: what is kept, how it moves, looks."""

import dataclasses
import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import flurries as fl
from flurries.effects import ConeRain, ConeSnow
from flurries.effects.field import streaks_tile
from flurries.spectral.tables import kept_power
from flurries.spectral.tiles import mean_opacity
from measure import cover, frame_of

Rain, Scene, Camera = fl.effects.TentRain, fl.Scene, fl.camera.Camera
# The texture alone, of a map that keeps the field's shape.
BARE = {"drops": 0, "haze": 0.0, "mean": 0.5, "spread": 4.0, "power": 1.0, "texture": 1.0,
        "color": 1.0}  # fmt: skip


def black(effect: Any, size: tuple[int, int] = (512, 512), **about: Any) -> fl.Scene:
    return Scene(np.zeros((size[1], size[0], 3), np.float32), effects=[effect], **about)


@pytest.mark.parametrize("cycles", [0.2, 0.5, 0.7, 1.0, 2.0, 8.0, 40.0])
@pytest.mark.parametrize(("alias", "shutter"), [("cut", 0.0), ("soft", 0.0), ("cut", 0.5),
                                                ("soft", 1.0), ("keep", 1.0)])  # fmt: skip
def test_kept_power_is_the_mean_over_directions(cycles: float, alias: str, shutter: float):
    def law(angle: float) -> float:
        rate = cycles * math.sin(angle)
        if alias != "keep" and rate >= 0.5:
            return 0.0
        soft = 1.0
        if alias == "soft" and rate > 0.4:
            soft = math.cos(0.5 * math.pi * (rate - 0.4) / 0.1) ** 2
        return (soft * float(np.sinc(rate * shutter))) ** 2

    ends = [math.asin(min(at / cycles, 1.0)) for at in (0.4, 0.5)]
    want = quad(law, 0.0, 0.5 * math.pi, points=ends, limit=500)[0] / (0.5 * math.pi)
    assert kept_power(cycles, alias, shutter=shutter) == pytest.approx(want, rel=2e-6)
    if alias == "cut" and shutter == 0.0 and cycles >= 0.5:
        assert want == pytest.approx(2.0 / math.pi * math.asin(0.5 / cycles), rel=1e-9)


@pytest.mark.parametrize("cycles", [1.0, 4.0])
def test_kept_power_is_that_of_a_large_tile(cycles: float):
    # The kernel's own tables: the sum over the lattice of 512 px.
    amplitude = fl.spectral.band_amplitude((512, 512), wavelengths=(2.0, 12.0))
    speed = 12.0 * cycles * np.array([math.cos(1.5), math.sin(1.5)])
    for alias in ("cut", "soft"):
        kept = fl.spectral.temporal_filter(amplitude, speed, alias=alias, wavelength_max=12.0)
        assert (kept**2).sum() == pytest.approx(kept_power(cycles, alias), rel=0.06)


@pytest.mark.parametrize(
    ("mean", "spread", "power"), [(0.5, 3.0, 2.0), (-0.1, 2.0, 2.0), (0.15, 2.5, 1.5)]
)
def test_mean_opacity_is_the_integral(mean: float, spread: float, power: float):
    variances = np.array([1e-6, 0.04, 0.3, 1.0])
    got = mean_opacity(variances, mean, spread, power)

    def mapped(z: float, s: float) -> float:
        base = np.clip(mean + s * z / (2.0 * spread), 0.0, 1.0) ** power
        return float(base * math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi))

    for variance, value in zip(variances, got, strict=True):
        s = math.sqrt(variance)
        clips = sorted(np.clip((u - mean) * 2.0 * spread / s, -9.0, 9.0) for u in (0.0, 1.0))
        want = quad(mapped, -9.0, 9.0, args=(s,), points=clips, limit=300)[0]
        assert value == pytest.approx(want, rel=2e-4, abs=1e-6)


@pytest.mark.parametrize("cycles", [1.0, 8.0])
def test_what_is_left_has_the_contrast_of_all(cycles: float):
    # c from the fall speed: c = fall f / (30 near_depth longest).
    lens = Camera(600.0)
    fall = cycles * 30.0 * 3.5 * 12.0 / 600.0
    rain = {**BARE, "fall": fall, "wind": (0.07 * fall, 0.0, 0.0), "wavelengths": (2.0, 12.0),
            "shutter": 0.0}  # fmt: skip
    stds = {}
    for renormalise in (True, False):
        scene = black(Rain(**rain, renormalise=renormalise), camera=lens)
        stds[renormalise] = np.mean([scene.render(t)[..., 0].std() for t in (3, 50, 400)])
    assert stds[True] == pytest.approx(1.0 / 8.0, rel=0.06)
    kept = kept_power(math.hypot(1.0, 0.07) * cycles, "cut")
    assert stds[False] / stds[True] == pytest.approx(math.sqrt(kept), rel=0.08)


def test_nothing_kept_is_no_streak_and_no_nan():
    # Every wave of a small tile is too fast: the cut leaves nothing that could be renormalised.
    rain = Rain(**{**BARE, "mean": 0.3}, fall=9e4, wind=(9e3, 0.0, 0.0), tile=16, jitter=True,
                wavelengths=(2.0, 4.0))  # fmt: skip
    got = black(rain, (64, 64)).layers(7)
    assert np.isfinite(got.image).all()


def share_still(rain: fl.effects.TentRain, seed: int = 0) -> float:
    """Share of the texture's power that stays through many frames at times without a rhythm."""
    scene = black(rain, camera=Camera(600.0), seed=seed)
    times = np.random.default_rng(8).uniform(0.0, 1e5, 24)
    frames = np.array([scene.render(t, region=np.s_[:256, :256])[..., 0] for t in times], float)
    frames -= frames.mean()
    share = (frames.mean(axis=0) ** 2).mean() / (frames**2).mean()
    return float((share - 1.0 / 24) / (1.0 - 1.0 / 24))


@pytest.mark.parametrize(("wavelengths", "near"), [((2.0, 12.0), 3.5), ((4.0, 32.0), 6.0)])
def test_streaks_move_where_the_tile_follows_the_rule(wavelengths: Any, near: float):
    # Straight down is the worst case: waves exactly across the fall never move.
    down = {**BARE, "wind": (0.0, 0.0, 0.0), "wavelengths": wavelengths, "near_depth": near}
    scene = black(Rain(**down), camera=Camera(600.0))
    rain, frame = scene.effects[0], frame_of(scene)
    field = rain.parts.texture.field
    (tile, _), _ = field.layout(frame).tiling
    cycles = field.cycles(frame, field.motion.way(frame))
    needed = streaks_tile(cycles, wavelengths)
    assert tile >= needed and tile % 8 == 0
    if wavelengths == (4.0, 32.0):
        assert needed == pytest.approx(144.0 * cycles, rel=1e-12)
    assert share_still(rain) < 0.11
    # The negative control: a quarter of the tile.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert share_still(dataclasses.replace(rain, tile=tile // 4)) > 0.22


def test_a_tile_that_freezes_the_streaks_is_told():
    small = Rain(tile=64)
    with pytest.warns(UserWarning, match=r"rain: .*64 px .*stands still; take tile=\d+"):
        Scene(size=(512, 300), effects=[small]).render(1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Scene(size=(512, 300), effects=[Rain()]).render(1)
        Scene(size=(512, 300), effects=[Rain(tile=64, jitter=True)]).render(1)
        Scene(size=(512, 300), effects=[Rain(tile=64, alias="keep", renormalise=False)]).render(1)
        Scene(size=(512, 300), effects=[Rain(tile=64, fall=0.2, wind=(0.0, 0.0, 0.0))]).render(1)


def test_the_tile_is_one_for_the_film():
    keyed = Rain(
        fall=fl.Keys([(0, 2.0), (50, 9.0)]), wind=fl.Keys([(0, (0, 0, 0)), (9, (3, 0, 0))])
    )
    scene = Scene(size=(512, 300), effects=[keyed])
    parts = keyed.parts
    layouts = [parts.texture.field.layout(frame_of(scene, t)) for t in (-5, 0, 9, 30, 50, 500)]
    tiles = {layout.tiling for layout in layouts}
    assert len(tiles) == 1
    fastest = parts.motion.fastest(scene.camera, 30.0)
    assert fastest * 30.0 == pytest.approx(math.hypot(3.0, 9.0), rel=1e-12)
    flying = scene.replace(camera=fl.CameraPath(Camera(600.0), velocity=(0.0, 0.0, 20.0)))
    assert parts.motion.fastest(flying.camera, 30.0) * 30.0 > 20.0


@pytest.mark.parametrize("shutter", [0.5, 1.0])
def test_drops_are_streaks_as_long_as_the_shutter(shutter: float):
    rain = Rain(texture=0.0, haze=0.0, drops=400, shutter=shutter, wind=(0.0, 0.0, 0.0), color=1.0)
    scene = black(rain, (640, 640), camera=Camera(700.0))
    drops, alpha = fl.flakes(scene, 3.0), scene.render(3.0)[..., 0].astype(float)
    inside = (drops["opacity"] > 0.3) & (np.abs(drops["depth"] - 6.0) < 1.5)
    px, lengths = drops["pixel"], []
    for i in np.flatnonzero(inside & (np.abs(px - 320.0) < 240.0).all(axis=1)):
        x, y = px[i]
        wanted = shutter * 8.0 / 30.0 * 700.0 / drops["depth"][i]
        near = (np.abs(px[:, 0] - x) < 4.0) & (np.abs(px[:, 1] - y) < 1.5 * wanted)
        if near.sum() > 1:
            continue
        half = round(wanted) + 6
        line = alpha[round(y) - half : round(y) + half, round(x) - 3 : round(x) + 3].sum(axis=1)
        middle = line[half - 4 : half + 4].mean()
        lengths.append(line.sum() / middle / wanted)
    assert len(lengths) > 5
    assert np.median(lengths) == pytest.approx(1.0, abs=0.05)


def test_the_gain_is_light():
    means = [
        black(Rain(texture=0.0, haze=0.0, gain=gain, drops=3000), camera=Camera(600.0))
        .layers(2).alpha.mean(dtype=float)
        for gain in (0.25, 1.0, 4.0, 0.0)
    ]  # fmt: skip
    # Each drop is faint; those near enough to be drawn wide fade out.
    assert means[1] / means[0] == pytest.approx(4.0, rel=0.1)
    assert means[2] / means[1] == pytest.approx(4.0, rel=0.1) and means[3] == 0.0


SIZE = (120, 90)
FLYING = fl.CameraPath(
    fl.Camera(140.0),
    velocity=fl.Keys([(0, (0.0, 0.0, 0.0)), (20, (1.0, 0.0, 8.0)), (40, (0.0, -3.0, -4.0))]),
)


def scene(effect, **about):
    return fl.Scene("#102030", size=SIZE, effects=[effect], **about)


@pytest.mark.parametrize("camera", [None, FLYING], ids=["still", "flying"])
def test_a_keyed_shutter(camera):
    keys = fl.Keys([(0, 0.2), (10, 0.2), (20.5, 1.5), (33, 0.0)])
    effect = ConeSnow(tile=64, texture_flakes=120, flakes=40)
    keyed = replace(effect, shutter=keys)
    shown = scene(keyed, camera=camera)
    # At every time the axis, speed and length of streaks are those of the number there.
    for t in (-5.0, 0.0, 7.5, 15.0, 20.5, 25.0, 33.0, 50.0):
        number = scene(replace(effect, shutter=keys.at(t)), camera=camera)
        got, want = (s.effects[0].parts.texture.state(frame_of(s, t)) for s in (shown, number))
        np.testing.assert_allclose(got.axis, want.axis, atol=1e-12)
        assert got.speed == pytest.approx(want.speed, abs=1e-9)
        assert got.stretch == pytest.approx(want.stretch, rel=1e-9)
    # The phase is the sum of small steps, from the first time of the film on.
    times = np.linspace(0.0, 25.0, 25 * 80 + 1)
    states = [keyed.parts.texture.state(frame_of(shown, t)) for t in 0.5 * (times[1:] + times[:-1])]
    tile = 2.0 * math.pi * effect.radius / effect.repeats
    gone = sum(s.speed / (tile * s.stretch) for s in states) * (times[1] - times[0]) / shown.fps
    first, last = (keyed.parts.texture.state(frame_of(shown, t)).phase for t in (0.0, 25.0))
    assert abs((last - first - gone + 0.5) % 1.0 - 0.5) < 1e-6


def test_the_cone_moves_as_the_flakes_do():
    effect = ConeRain(wind=(1.0, 0.0, -2.0), fall=6.0)
    shown = scene(effect, camera=FLYING)
    for t in (0.0, 7.3, 20.0, 33.0, 60.0):
        frame = frame_of(shown, t)
        state = effect.parts.texture.state(frame)
        # Camera minus flake per frame, the other way and per second.
        velocity = -effect.parts.motion.way(frame).rate * shown.fps
        np.testing.assert_allclose(np.array(state.axis) * state.speed, velocity, atol=1e-9)


def test_amounts_looks_and_colors():
    rain = ConeRain(tile=64, haze=0.0)
    none = scene(replace(rain, amount=0.0)).render(3)
    np.testing.assert_array_equal(none, scene(replace(rain, gain=0.0)).render(3))
    more = [cover(scene(replace(rain, amount=a)), 3).mean() for a in (0.25, 0.5, 1.0)]
    assert more == sorted(more) and more[0] > 0
    red = fl.Scene("#000000", size=SIZE, effects=[ConeRain(color=(1.0, 0.0, 0.0))]).render(3)
    assert red[..., 0].max() > 20 and red[..., 1:].max() == 0
    assert scene(rain, seed=1).render(3).tobytes() != scene(rain, seed=2).render(3).tobytes()
    for kind in (ConeRain, ConeSnow):
        looks = [cover(scene(kind(name, tile=64)), 4).mean() for name in kind.PRESETS]
        assert looks == sorted(looks)
