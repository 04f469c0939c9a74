"""What users see of signatures: types, suggestions, and lines and pages for people."""

from __future__ import annotations

import inspect
import pickle
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
from flurries.output.write import write

PICTURE = np.full((48, 64, 3), 90, np.uint8)
SCENE = fl.Scene(None, PICTURE, effects=[fl.TentSnow.preset("heavy"), fl.Mist()], fps=24)


def test_write_of_a_scene_has_the_options_of_the_function_and_says_them_all():
    own = list(inspect.signature(fl.Scene.write).parameters.values())[1:]
    wanted = list(inspect.signature(write).parameters.values())[1:]
    assert [(p.name, p.kind, p.default) for p in own] == [
        (p.name, p.kind, p.default) for p in wanted
    ]
    doc = inspect.getdoc(fl.Scene.write) or ""
    assert [p.name for p in own if f"\n{p.name} : " not in doc] == []


@pytest.mark.parametrize("name", ["film.mp4", "frames/%04d.png"])
def test_a_number_alone_is_no_film(name: str, tmp_path: Path):
    with pytest.raises(ValueError, match=r"'1-90' for 90 frames, '90' for frame 90 alone; got 90"):
        SCENE.write(tmp_path / name, 90)
    assert list(tmp_path.iterdir()) == []


def test_a_scene_in_one_line():
    assert repr(SCENE) == (
        "Scene(64 x 48 px, 24 fps, background=uint8 array (48, 64, 3), "
        "camera=still, focal 76.8 px, effects=TentSnow, Mist)"
    )
    way = fl.CameraPath(fl.Camera(70.0), velocity=(0, 0, 1))
    assert "camera=moving, focal 70 px, effects=none" in repr(fl.Scene((8, 6), "#000000", way))


def test_a_rendered_frame_in_one_line():
    assert repr(SCENE.render(3, layers=True)) == "Rendered(64 x 48 px, uint8, layers=snow, mist)"


@pytest.mark.parametrize("shown", [SCENE, SCENE.render(3, layers=True)], ids=["scene", "rendered"])
def test_both_have_a_page_in_a_notebook(shown: object):
    page = shown._repr_html_()  # type: ignore[attr-defined]
    assert "<img" in page and "data:image/jpeg;base64," in page and "<table>" in page
    assert "src='http" not in page


def test_what_was_made_of_a_scene_is_not_written_into_its_page():
    odd = fl.Scene((8, 6), "#000000", effects=[fl.TentSnow(color=(0.5, 0.25, 1.0), flakes=3)])
    assert "color (0.5, 0.25, 1), " in odd._repr_html_() or "flakes 3" in odd._repr_html_()


def test_a_scene_survives_a_copy_with_its_new_arguments():
    again = pickle.loads(pickle.dumps(SCENE))
    assert repr(again) == repr(SCENE) and np.array_equal(again.render(2), SCENE.render(2))
    assert SCENE.replace(fps=12).fps == 12.0
