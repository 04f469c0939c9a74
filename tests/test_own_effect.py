"""An effect of somebody's own: the page that says how, and its kind in scene files."""

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
from flurries.effects import kinds
from flurries.scene.fingerprint import fingerprint

PAGE = Path(__file__).parents[1] / "docs" / "your-own-effect.md"

BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a test registers is gone after it."""
    monkeypatch.setattr(kinds, "_registered", {})


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.chdir(tmp_path)
    # A dataclass looks for its module.
    monkeypatch.setitem(sys.modules, "own", type(sys)("own"))
    names: dict[str, Any] = {"__name__": "own", "print": lambda *_: None}
    for number, block in enumerate(BLOCKS):
        exec(compile(block, f"block {number}", "exec"), names)
    vars(sys.modules["own"])["Ash"] = names["Ash"]
    return names


def test_the_page_makes_frames_files_and_eyes(page: dict[str, Any], tmp_path: Path):
    scene = page["scene"]
    assert np.array_equal(page["again"].render(12), page["frame"])
    assert page["again"].effects == scene.effects and page["frame"].min() < 0xC0
    assert fingerprint(page["again"]) == fingerprint(scene)
    steps = str(scene.plan("1-24", probe=False))
    assert all(f"ash: {step}" in steps for step in ("flakes", "veil", "join"))
    spec = oiio.ImageBuf(str(tmp_path / "ash.0002.exr")).spec()
    assert {"ash.R", "ash.A", "ash.depth.Z", "ash.forward.u", "ash.id.lo"} <= set(spec.channelnames)
    assert (page["left"] != page["right"]).any()
    flakes = scene.layers(2)
    assert flakes.layers["ash"].ids.max() > 0 and np.isfinite(flakes.layers["ash"].depth).any()


def test_a_kind_is_strict_about_its_keys(page: dict[str, Any], tmp_path: Path):
    for line, wanted in (("colr = 0.5", "line 4.*color"), ("preset = 'dark'", "line 4.*preset")):
        (tmp_path / "bad.toml").write_text(f"format = 3\n[[effects]]\nkind = 'ash'\n{line}\n")
        with pytest.raises(ValueError, match=wanted):
            fl.open(tmp_path / "bad.toml")


def test_an_unregistered_effect_says_what_to_do(page: dict[str, Any], tmp_path: Path):
    kinds._registered.clear()
    with pytest.raises(ValueError, match=r"a Ash cannot be written.*flurries.effects.register"):
        page["scene"].save(tmp_path / "no.toml")
    with pytest.raises(ValueError, match=r"line \d+: kind must be one of 'snow'.*got 'ash'"):
        fl.open(tmp_path / "ash.toml")
    # Its frames have a name all the same, whatever the effect kept of itself.
    fresh = fl.Scene(
        "#c08050", size=(320, 240), effects=[page["Ash"](flakes=6000)], depth=25.0, seed=3
    )
    assert fingerprint(fresh) == fingerprint(page["scene"])


def test_an_installed_package_names_its_effects(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    code = BLOCKS[0].replace('fl.effects.register("ash", Ash)\n', "")
    (tmp_path / "my_package.py").write_text(code)
    told = tmp_path / "my_package-1.0.dist-info"
    told.mkdir()
    (told / "METADATA").write_text("Name: my_package\nVersion: 1.0\n")
    (told / "entry_points.txt").write_text("[flurries.effects]\nash = my_package:Ash\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "scene.toml").write_text("format = 3\nsize = [64, 48]\n[[effects]]\nkind = 'ash'\n")
    try:
        scene = fl.open(tmp_path / "scene.toml")
        assert scene.effects == (sys.modules["my_package"].Ash(),)
        kinds._registered.clear()
        scene.save(tmp_path / "again.toml")
        assert 'kind = "ash"' in (tmp_path / "again.toml").read_text()
    finally:
        sys.modules.pop("my_package", None)
