"""Scenes that begin again: to the bit, without a jump, and with as much weather at all times."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.cli.main import main
from flurries.frame.view import Lap
from flurries.scene.loop import closed
from measure import cover

FRAMES = 24
SIZE = (80, 60)
FOCAL = 96.0


TURNS = fl.Keys([(0, (0.0, 0.0, 0.0)), (10, (0.0, 0.2, 0.0)), (24, (0.0, 0.05, 0.0))])
CAMERAS: dict[str, Any] = {
    "still": None,
    "turning": fl.CameraPath(fl.Camera(FOCAL), orientation=TURNS),
    "flying": fl.CameraPath(fl.Camera(FOCAL), velocity=(0.0, 0.0, 3.0)),
}
WEATHERS: dict[str, Any] = {
    "snow": fl.Snow(density=20.0, fall=1.4, haze=0.2, far=30.0), "rain": fl.Rain(far=20.0),
    "mist": fl.Mist("fog", method="particles", wind=(1.5, 0.0, 0.3)),
    "valley": fl.Mist("valley", visibility=250.0, wind=(1.5, 0.0, 0.3), color=0.9),
    "tent snow": fl.effects.TentSnow(flakes=300), "tent rain": fl.effects.TentRain(),
    "cone snow": fl.effects.ConeSnow("heavy"), "cone rain": fl.effects.ConeRain(),
}  # fmt: skip


def made(weather: Any, camera: Any = None, frames: int = FRAMES, **more: Any) -> fl.Scene:
    given = {"background": "#405060", "space": "linear", "seed": 3, **more}
    return fl.Scene(size=SIZE, effects=[weather], camera=camera, loop=frames, **given)


def step(one: Any, other: Any) -> float:
    return float(np.sqrt(np.mean((one.astype(float) - other.astype(float)) ** 2)))


# Each weather stands still and moves one way.
MOVES = [(w, c) for i, w in enumerate(WEATHERS) for c in {"still", ["turning", "flying"][i % 2]}]


@pytest.mark.parametrize("weather, camera", sorted(MOVES))
def test_the_last_and_the_first_frame_differ_as_others_do(weather: str, camera: str):
    scene = made(WEATHERS[weather], CAMERAS[camera])
    film = [scene.render(t) for t in range(FRAMES + 1)]
    assert np.array_equal(film[0], film[FRAMES])
    assert np.array_equal(scene.render(-3), film[FRAMES - 3])
    steps = [step(*pair) for pair in pairwise(film)]
    others = np.array(steps[:-1])
    assert others.min() > 0.0
    assert abs(steps[-1] - others.mean()) <= 4.0 * others.std()


def test_without_a_period_the_film_goes_on():
    # What the loop is for: the frame after the last is none like the first.
    snow = fl.effects.TentSnow(flakes=0, haze=0.0, near_depth=40.0)
    film = [made(snow).replace(loop=None).render(t) for t in range(FRAMES)]
    others = np.array([step(*pair) for pair in pairwise(film)])
    assert step(film[-1], film[0]) - others.mean() > 10.0 * others.std()


def test_as_much_is_there_at_all_times():
    scene = made(WEATHERS["snow"])
    means = [cover(scene, t).mean() for t in range(0, FRAMES, 3)]
    assert np.ptp(means) < 0.02 * np.mean(means)
    # An even veil is there once, not in parts: at any time what it is without a loop.
    veil = made(fl.Snow(density=0.0, haze=0.3))
    assert np.array_equal(veil.render(7), veil.replace(loop=None).render(7))


def test_waves_turn_by_whole_cycles():
    # The texture alone: each wave's rate is bent by half a turn of the film at most, so that a film
    # of few frames differs from the plain one by little, and less of a longer film.
    snow = fl.effects.TentSnow(flakes=0, haze=0.0, near_depth=40.0)
    worst = []
    for frames in (50, 200):
        looped = made(snow, frames=frames, background=(0.05, 0.1, 0.15))
        early = [looped.render(2), looped.replace(loop=None).render(2)]
        worst.append(step(*early) / step(looped.render(2), looped.render(frames // 2)))
    assert worst[1] < 0.3 * worst[0] < 0.3


def test_what_does_not_end_as_it_began_goes_back_and_is_said():
    snow = fl.Snow(density=fl.Keys([(0, 5.0), (10, 20.0)]), amount=fl.Keys([(0, 1.0), (24, 1.0)]))
    scene = made(snow, CAMERAS["turning"])
    assert len(scene.plan(probe=False).bent) == 2
    assert scene.plan(probe=False).bent[0] == (
        "effects[0] (snow): density does not end as it begins: from frame 18 on it goes back"
    )
    assert "its turning is changed by 3.58 degrees a second" in scene.plan(probe=False).bent[1]
    assert made(fl.effects.ConeRain()).plan(probe=False).bent == (
        "effects[0] (cone_rain): 0.463 tiles of its cone pass, 1 in the loop",
    )
    assert "by up to 0.021 cycles a frame" in made(fl.effects.TentSnow()).plan(probe=False).bent[0]
    assert made(fl.Snow()).plan(probe=False).bent == ()
    assert fl.Scene("#000000", size=SIZE).plan(probe=False).bent == ()


def test_keys_are_closed():
    lap = Lap(0, 40)
    keys, back = closed(fl.Keys([(0, 1.0), (10, 3.0), (35, 7.0)]), lap)
    assert back == 30.0
    for t in (-40.0, -39.5, -11.0, 0.0, 7.0, 29.0, 35.0, 39.0):
        value = np.interp(t % 40, [0, 10, 30, 40], [1.0, 3.0, 6.2, 1.0])
        assert keys.at(t) == pytest.approx(value, abs=1e-12)
    assert closed(fl.Keys([(0, 1.0), (100, 1.0)]), lap) == (1.0, None)
    same, back = closed(fl.Keys([(0, 1.0), (20, 2.0), (40, 1.0)]), lap)
    assert back is None
    assert same.at(-20.0) == 2.0


def test_a_camera_ends_where_lamps_stand():
    lamp = fl.scene.Lamp(place=(2.0, 0.0, 10.0), power=20.0)
    scene = made(fl.Snow(density=20.0, color="local"), CAMERAS["flying"], lights=[lamp])
    assert "its velocity is changed by 3 a second" in scene.plan(probe=False).bent[0]
    assert np.array_equal(scene.render(0), scene.render(FRAMES))


def test_a_loop_is_saved_and_counts_its_own_frames(tmp_path: Any):
    scene = made(fl.Snow(density=2.0, far=12.0))
    scene.save(tmp_path / "scene.toml")
    assert "loop = 24" in (tmp_path / "scene.toml").read_text()
    again = fl.open(tmp_path / "scene.toml")
    assert np.array_equal(again.render(5), scene.render(5))
    summary = scene.write(str(tmp_path / "%04d.png"))
    assert summary.written == list(range(FRAMES))


def test_the_command_line_loops(tmp_path: Any, capsys: Any):
    given = ["render", "#405060", "--size", "64x48", "--mist", "valley", "--loop", "4"]
    assert main([*given, "-o", str(tmp_path / "%d.png"), "--frames", "0,1,4"]) == 0
    first, again = (fl.io.read_picture(tmp_path / f"{n}.png").pixels for n in (0, 4))
    assert np.array_equal(first, again)
    assert "nearest whole number of cycles" in capsys.readouterr().err
