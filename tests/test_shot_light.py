"""The light of a shot: one for all frames and machines, found, saved and keyed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.cli.main import main

Array = np.ndarray[Any, Any]
WEATHERS = {"ambient": fl.Snow("heavy"), "mist": fl.Mist("fog", structure=0.0)}


def street(sky: float) -> Array:
    plate = np.float32(0.4 * sky) * np.random.default_rng(2).uniform(0.5, 1.5, (90, 120, 3))
    plate[:30] = sky
    return plate.astype(np.float32)


def lamp_at(folder: Path, frames: range, lit: range) -> fl.Scene:
    for number in frames:
        plate = street(0.02)
        if number in lit:
            plate[50:85, 80:115] = 3.0
        fl.io.write_picture(folder / f"n.{number:04d}.exr", plate)
    return fl.Scene(str(folder / "n.%04d.exr"), effects=[WEATHERS["ambient"]], fps=24, seed=3)


@pytest.mark.parametrize("name", WEATHERS)
def test_a_lamp_that_enters_a_shot_changes_no_light(name: str, tmp_path: Path):
    shot = lamp_at(tmp_path, range(1, 13), range(8, 13)).replace(effects=[WEATHERS[name]])
    alone = [shot.replace(background=str(tmp_path / f"n.{n:04d}.exr")) for n in (1, 9)]
    shown, dark, bright = (one.render(9)[:30, :30] for one in (shot, *alone))
    np.testing.assert_allclose(shown.mean(), dark.mean(), rtol=0.02)
    assert bright.mean() > 1.2 * dark.mean()


def test_a_machine_with_one_plate_has_the_light_that_was_saved(tmp_path: Path, capsys: Any):
    shot = lamp_at(tmp_path, range(1, 10), range(3, 8))
    shot.save(tmp_path / "shot.toml")
    assert main(["light", str(tmp_path / "shot.toml"), "-o", str(tmp_path / "shot.toml")]) == 0
    printed = capsys.readouterr().out
    assert printed in (tmp_path / "shot.toml").read_text()
    assert main(["light", str(tmp_path / "n.0001.exr"), "-o", str(tmp_path / "shot.toml")]) == 2
    saved = fl.open(tmp_path / "shot.toml")
    assert saved.light == fl.scene.find_light(shot)
    wanted = shot.render(2)
    for number in (1, *range(3, 10)):
        (tmp_path / f"n.{number:04d}.exr").unlink()
    # The plates that are left say another light, and the shot's is in the file.
    assert not np.array_equal(shot.replace().render(2), wanted)
    assert np.array_equal(fl.open(tmp_path / "shot.toml").render(2), wanted)


def test_frames_of_another_light_do_not_go_on(tmp_path: Path):
    shot, frames = lamp_at(tmp_path, range(1, 10), range(3, 6)), str(tmp_path / "out/%04d.png")
    shot.write(frames, "1-2")
    assert len(shot.replace().write(frames, "1-2").kept) == 2
    lamp_at(tmp_path, range(3, 10), range(3, 10))
    with pytest.raises(ValueError, match="another"):
        shot.replace().write(frames, "1-2")
    shot.replace(light=fl.scene.Light(0.5)).write(frames, "1-2", overwrite=True)


def test_keys_follow_a_sky_that_changes_and_no_lamp(tmp_path: Path):
    for number in range(1, 10):
        plate = street(1.0 - 0.1 * number)
        plate[50:85, 80:115] = 3.0 if number > 4 else 0.1
        fl.io.write_picture(tmp_path / f"n.{number}.exr", plate)
    light = fl.scene.find_light(fl.Scene(str(tmp_path / "n.%d.exr")), keyed=True)
    skies = [light.at(t)[0].mean() for t in range(1, 10)]
    np.testing.assert_allclose(np.divide(skies, skies[4]), (1 - 0.1 * np.arange(1, 10)) / 0.5, 0.02)
    white = fl.Scene(size=(96, 64), effects=[fl.Snow("heavy")], fps=24)
    keyed = white.replace(light=fl.scene.Light(fl.Keys([(0, 0.1), (10, 0.3)])))
    plain = white.replace(light=fl.scene.Light(np.float64(0.2)))
    assert np.array_equal(keyed.render(5), plain.render(5))


def test_a_light_without_sides_has_those_of_snow():
    snow, sky, ground = fl.scene.Light((0.9, 0.45, 0.0)).at(3.0)
    np.testing.assert_allclose((sky, ground), (snow / 0.9, 0.2 * snow))
