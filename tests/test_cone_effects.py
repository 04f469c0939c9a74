"""Rain and snow on a cone in a scene: purity, parts, eyes, depth, files, and their motion."""

import math
from dataclasses import replace

import numpy as np
import pytest

import flurries as fl
from flurries.effects import ConeRain, ConeSnow
from measure import cover, frame_of

SIZE = (120, 90)
FLYING = fl.CameraPath(
    fl.Camera(140.0),
    velocity=fl.Keys([(0, (0.0, 0.0, 0.0)), (20, (1.0, 0.0, 8.0)), (40, (0.0, -3.0, -4.0))]),
)


def scene(effect, **about):
    return fl.Scene("#102030", size=SIZE, effects=[effect], **about)


@pytest.mark.parametrize("camera", [None, FLYING], ids=["still", "flying"])
def test_a_keyed_shutter(camera, tmp_path):
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
    # And it comes back from a file.
    shown.save(tmp_path / "scene.toml")
    assert fl.open(tmp_path / "scene.toml").effects == shown.effects


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
    keyed = replace(rain, amount=fl.Keys([(0, 0.0), (6, 1.0)]))
    half = cover(scene(replace(rain, amount=0.5)), 3)
    np.testing.assert_array_equal(cover(scene(keyed), 3), half)
    red = fl.Scene("#000000", size=SIZE, effects=[ConeRain(color=(1.0, 0.0, 0.0))]).render(3)
    assert red[..., 0].max() > 20 and red[..., 1:].max() == 0
    assert scene(rain, seed=1).render(3).tobytes() != scene(rain, seed=2).render(3).tobytes()
    for kind in (ConeRain, ConeSnow):
        looks = [cover(scene(kind(name, tile=64)), 4).mean() for name in kind.PRESETS]
        assert looks == sorted(looks)
