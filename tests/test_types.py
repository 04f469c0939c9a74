"""What users see of signatures and of the package: types, suggestions, pages, wheels."""

import dataclasses
import inspect
import pydoc
import re
import subprocess
import sys
import typing
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest

import flurries as fl
from flurries.effects import ConeRain, ConeSnow, TentRain, TentSnow
from flurries.scene.output import OutputFields

ROOT = Path(__file__).parents[1]
PICTURE = np.full((48, 64, 3), 90, np.uint8)
SCENE = fl.Scene(PICTURE, effects=[TentSnow("heavy"), fl.Mist()], fps=24)


def test_write_of_a_scene_has_the_options_of_an_output_and_says_them_all():
    own = inspect.signature(fl.Scene.write).parameters
    kinds, options = get_type_hints(OutputFields), get_type_hints(fl.scene.Output)
    assert list(own)[-len(kinds) :] == list(kinds) and set(kinds) == set(options)
    for name, kind in options.items():
        assert kinds[name] == kind | None
        assert own[name].default is None and own[name].kind is own[name].KEYWORD_ONLY
    doc = inspect.getdoc(fl.Scene.write) or ""
    assert [name for name in own if name != "self" and f"\n{name} : " not in doc] == []


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
    moving = fl.Scene(size=(8, 6), camera=fl.CameraPath(fl.Camera(70.0), velocity=(0, 0, 1)))
    assert "camera=moving" in repr(moving) and "effects=none" in repr(moving)


@pytest.mark.parametrize("shown", [SCENE, SCENE.layers(3)], ids=["scene", "rendered"])
def test_both_have_a_page_in_a_notebook(shown: object):
    page = shown._repr_html_()  # type: ignore[attr-defined]
    assert "<img" in page and "data:image/jpeg;base64," in page and "<table>" in page
    assert "src='http" not in page


WEATHER = [fl.Snow, fl.Rain, TentSnow, TentRain, fl.Mist, ConeSnow, ConeRain]


@pytest.mark.parametrize("kind", WEATHER)
def test_an_effect_shows_its_presets_its_fields_and_what_users_call(kind: type[Any]):
    named, _ = typing.get_args(typing.get_type_hints(kind)["preset"].type)
    assert typing.get_args(named) == tuple(kind.PRESETS)
    names = set(dir(kind))
    plain = {f.name for f in dataclasses.fields(kind) if f.default is not dataclasses.MISSING}
    assert plain | {"preset"} <= names
    assert not [name for name in names if name.startswith("_")]
    assert not names & {"needs", "parts", "render", "over"}
    text = pydoc.plain(pydoc.render_doc(kind))
    assert "__post_init__" not in text and "__delattr__" not in text


@pytest.mark.parametrize(("call", "near"), [
    (lambda: fl.Snow(3.0), "preset must be one of 'light'"),
    (lambda: fl.Snow(denisty=3.0), "Snow has no 'denisty'; did you mean 'density'?"),
    (lambda: fl.Mist("fog", visibilty=3), "Mist has no 'visibilty'; did you mean "),
    (lambda: fl.Snow("light", amuont=3), "Snow has no 'amuont'; did you mean 'amount"),
    (lambda: fl.Snow(density=3.0, method="tent"), "TentSnow has no 'density'"),
    (lambda: fl.Scene(efects=()), "Scene has no 'efects'; did you mean 'effects'?"),
    (lambda: fl.Camera(foccal=3.0), "Camera has no 'foccal'; did you mean 'focal'?"),
    (lambda: fl.CameraPath(velocty=3.0), "CameraPath has no 'velocty'; did you mean 'velocity'?"),
    (lambda: fl.augment.Fog(patchs=0.1), "Fog has no 'patchs'; did you mean 'patches'?"),
    (lambda: SCENE.write("frame.png", 1, bitts=8), "write has no 'bitts'; did you mean 'bits'"),
    (lambda: fl.Wind(gust=3.0), "Wind has no 'gust'; did you mean 'gusts'?"),
    (lambda: fl.scene.Sun(directon=3.0), "Sun has no 'directon'; did you mean 'direction'?"),
])  # fmt: skip
def test_a_mistyped_argument_is_answered_with_the_nearest(call: Any, near: str):
    with pytest.raises(TypeError, match=re.escape(near)):
        call()


RIGHT = (
    'fl.Snow("heavy", color="local")', 'fl.Rain(color=0.9)', 'fl.Mist(color=(0.5, 0.6, 0.7))',
    'fl.Snow(color=fl.Keys([(0, 0.5), (9, 1.0)]))', 'fl.Snow(color=fl.effects.Hex("#dfe8ff"))',
    'fl.effects.TentSnow("paper", color="ambient")', 'scene.layers(1, eye=fl.Camera(60.0)).alpha',
    'fl.augment.Snowfall(severity=3)(picture).mean()', 'fl.flakes(scene, 1)["id"].size',
    'scene.render(1).mean() + scene.layers(1).layers["snow"].rgba.mean()',
)  # fmt: skip
WRONG = (
    'fl.nothing', 'fl.Snow(color="ambiant")', 'fl.Rain(color="loacl")', 'fl.Mist(color="white")',
    'fl.effects.TentSnow(color="local")', 'fl.Snow("hevy")', 'fl.Snow(amount="much")',
    'scene.layers(1, nmae=2)', 'scene.render(t=1, regoin=None)', 'fl.Snow("light")(picture)',
    'fl.augment.Snowfall(severty=3)', 'fl.augment.Snowfall(severity=3)(picture).nothing',
)  # fmt: skip


@pytest.mark.parametrize("checker", ["mypy", "basedpyright"])
def test_types_tell_wrong_calls_from_right_ones(checker: str, tmp_path: Path):
    setting = "import numpy as np; import flurries as fl; picture = np.zeros((8, 8, 3), np.uint8)"
    lines = [setting, "scene = fl.Scene(picture)", *(f"print({call})" for call in RIGHT)]
    first = len(lines) + 1
    file = tmp_path / "calls.py"
    file.write_text("\n".join([*lines, *(f"print({call})" for call in WRONG)]) + "\n")
    command = [sys.executable, "-m", checker, *(["--strict"] if checker == "mypy" else [])]
    ran = subprocess.run([*command, str(file)], capture_output=True, text=True, cwd=ROOT)
    told = {int(line) for line in re.findall(r"calls\.py:(\d+):.*error", ran.stdout)}
    assert told == set(range(first, first + len(WRONG))), ran.stdout + ran.stderr


def test_a_newcomer_reads_few_names():
    assert len([name for name in dir(fl) if not name.startswith("_")]) <= 25
    first = [*inspect.signature(fl.Scene).parameters][:4]
    assert first == ["background", "size", "camera", "effects"]


def test_the_example_of_a_film_runs(tmp_path: Path):
    words = [sys.executable, str(ROOT / "examples" / "film.py"), str(tmp_path)]
    ran = subprocess.run(words, capture_output=True, text=True, check=True)
    assert "Rendered(320 x 214 px, uint8, layers=snow)" in ran.stdout
    numbers = {f"snow_{number:04d}.png" for number in range(1, 5)}
    made = numbers | {"snow.exr", "anaglyph.png", "texture.png", "flurries.jsonl"}
    assert {path.name for path in tmp_path.iterdir()} == made


PROJECT = (ROOT / "pyproject.toml").read_text()
CORE = {"numpy", "openimageio", "pillow", "click", "deflate", "fileseq", "tqdm", "tomli", "tomli-w"}


@pytest.mark.parametrize("call", [
    "fl.io.VideoWriter('new.mp4', (32, 24), 24)",
    "fl.Scene(size=(32, 24)).write('new.mp4', '1-2')",
    "fl.io.open_background('film.mkv')",
])  # fmt: skip
def test_without_the_library_for_films_the_error_names_the_extra(call: str, tmp_path: Path):
    with fl.io.VideoWriter(tmp_path / "film.mkv", (32, 24), 24) as film:
        film.write(np.zeros((24, 32, 3), np.uint8))
    code = f"import sys; sys.modules['av'] = None\nimport flurries as fl\ntry:\n    {call}\n"
    code += "except ImportError as error:\n    print(error)\n"
    code += "fl.Scene(size=(32, 24)).write('still.png', 1)"
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert "pip install 'flurries[video]'" in ran.stdout
    left = {"film.mkv", "still.png", "flurries.jsonl"}
    assert {file.name for file in tmp_path.iterdir()} == left


def test_the_wheel_carries_the_notices_of_its_crates():
    lock = (ROOT / "Cargo.lock").read_text()
    crates = dict(re.findall(r'^name = "(.*)"\nversion = "(.*)"$', lock, re.M))
    notices = (ROOT / "LICENSE-CRATES").read_text()
    told = re.findall(r"^={8} (\S+) v(\S+) \((.+)\)\n\n(.+)", notices, re.M)
    # Ours, and what only builds: it leaves nothing in the extension.
    others = {"autocfg", "pyo3-build-config", "target-lexicon"}
    others |= {"flurries", "flurries-dispatch", "flurries-fft"}
    assert {name for name, *_ in told} == set(crates) - others
    assert all(crates[name] == version or name == "syn" for name, version, *_ in told)
    assert "LICENSE-CRATES" in re.findall(r"^license-files = .*", PROJECT, re.M)[0]


def test_the_citation_is_of_this_version_and_names_the_four_papers():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    cargo = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    (stands,) = re.findall(r'^version = "(.*)"$', cargo, re.M)[:1]
    assert f"\nversion: {stands}\n" in text
    assert re.findall(r"^    year: (\d+)$", text, re.M) == ["2004", "2003", "2005", "2004"]


def test_16_15_a_free_threaded_python_is_refused_with_a_sentence():
    code = "import sys; sys.abiflags = 't'\ntry:\n    import flurries\n"
    code += "except ImportError as error:\n    print(error)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.startswith("flurries does not run on a free-threaded Python: ")
    assert len(ran.stdout.splitlines()) == 1


def test_16_15_lowest_versions_are_those_that_the_project_names():
    done = subprocess.run(
        [sys.executable, ROOT / "tests" / "packages.py"], capture_output=True, text=True, check=True
    )
    lowest = dict(line.split("==") for line in done.stdout.split())
    assert CORE - {"tomli"} <= {name.lower() for name in lowest} and lowest["numpy"] == "2.0"
    assert all(re.fullmatch(r"[0-9.]+", version) for version in lowest.values())
