"""What the viewer answers: the picture of where the sliders stand, its charts, the scene's text.

How it looks and feels in a browser is judged in `tests/browser`.
"""

from __future__ import annotations

import io
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
import twin
from flurries.effects.kinds import OURS
from flurries.viewer.charts import chart
from flurries.viewer.controls import applied, controls_of
from flurries.viewer.preview import Preview
from flurries.viewer.session import Session, jpeg, packed

SNOW = fl.TentSnow(flakes=300, wind=(0.9, 0.0, 0.0), fall=1.2)
SCENE = fl.Scene((160, 120), "#203040", effects=[SNOW], fps=25.0, seed=5)


def decoded(data: bytes) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(data)))


def slider(scene: fl.Scene, key: str) -> Any:
    return next(control for control in controls_of(scene) if control.key == key)


def test_untouched_sliders_change_nothing():
    same = applied(SCENE, {})
    assert np.array_equal(same.render(7), SCENE.render(7))
    assert same.effects == SCENE.effects


def test_sliders_stand_where_the_scene_does():
    # wind (0.9, 0), fall 1.2: 1.5 m/s, atan2(1.2, 0.9) = 53.13 degrees.
    assert slider(SCENE, "0.direction").value == pytest.approx(53.130102354155980, abs=1e-9)
    assert slider(SCENE, "0.speed").value == pytest.approx(1.5, abs=1e-12)
    # Three octaves, 3 to 24 px at 1024 px; here the shortest is held at 2 px.
    octaves = math.log2(24.0 * SCENE.shape[1] / 1024.0 / 2.0)
    assert slider(SCENE, "0.octaves").value == pytest.approx(octaves, abs=1e-12)


@pytest.mark.parametrize(("values", "wanted"), [
    ({"0.direction": 180.0, "0.speed": 2.0}, {"wind": (-2.0, 0.0, 0.0), "fall": 0.0}),
    ({"0.direction": 90.0}, {"wind": (0.0, 0.0, 0.0), "fall": 1.5}),  # The speed stays.
    ({"0.octaves": 3.0, "0.longest": 32.0}, {"wavelengths": (4.0, 32.0)}),
])  # fmt: skip
def test_what_a_slider_means(values: dict[str, float], wanted: dict[str, Any]):
    changed = applied(SCENE, values).effects[0]
    for name, value in wanted.items():
        assert getattr(changed, name) == pytest.approx(value, abs=1e-12)


def test_a_gusty_wind_keeps_its_gusts():
    scene = SCENE.replace(effects=[fl.TentSnow(wind=fl.Wind((1.0, 0.0, 0.5), gusts=0.7, seed=3))])
    wind = applied(scene, {"0.direction": 0.0, "0.speed": 3.0}).effects[0].wind
    assert wind.mean == pytest.approx((3.0, 0.0, 0.5))
    assert (wind.gusts, wind.seed) == (0.7, 3)


def test_camera_sliders_count_upwards_and_forwards():
    path = applied(SCENE, {"camera.rise": 2.0, "camera.forward": 3.0}).camera
    assert path.velocity == (0.0, -2.0, 3.0)


def test_keys_stay_until_their_slider_is_touched():
    keyed = SCENE.replace(effects=[fl.TentSnow(amount=fl.Keys([(0, 0.25), (9, 1.0)]))])
    assert slider(keyed, "0.amount").value == 0.25
    assert isinstance(applied(keyed, {"0.haze": 0.5}).effects[0].amount, fl.Keys)
    assert applied(keyed, {"0.amount": 0.5}).effects[0].amount == 0.5


@pytest.mark.parametrize("ask", [
    None, {"kind": "run"}, {"t": "0"}, {"t": float("inf")}, {"values": [1]}, {"t": 1.0, "page": 3},
    {"t": 1.0, "page": "x" * 100}, {"t": 1.0, "effect": 1}, {"t": 1.0, "effect": True},
    {"t": 1.0, "charts": True, "at": ["a", 0.0]},
])  # fmt: skip
def test_bad_questions_are_answered_with_a_sentence(ask: Any):
    head, buffers = Session(SCENE).answer(ask)
    assert head["error"] and not buffers


def test_the_answer_is_the_scenes_own_frame():
    SCENE.render(12.0)  # What it has resolved is not that of the tuned scene.
    head, buffers = Session(SCENE).answer({"t": 12.0, "values": {"0.amount": 0.5}})
    wanted = applied(SCENE, {"0.amount": 0.5}).render(12.0)
    assert buffers[0] == jpeg(wanted)
    # JPEG at quality 90 keeps a picture of flakes to a few levels.
    assert np.abs(decoded(buffers[0]).astype(int) - wanted).mean() < 4.0
    assert head["t"] == 12.0


def place(session: Session, effect: int = 0) -> np.ndarray:
    """Camera minus air of the page's last picture."""
    return np.array(session._air["p"][1][effect])


def test_the_air_goes_on_from_where_it_is():
    """Another speed at frame 100 must not throw the air to where that speed had brought it."""
    session = Session(SCENE)
    SCENE.render(100.0)
    session.answer({"t": 100.0, "page": "p", "begin": True})
    before = place(session)
    ask = {"t": 101.0, "values": {"0.speed": 3.0, "0.direction": 0.0}, "page": "p"}
    _, buffers = session.answer({**ask, "begin": False})
    # Camera minus air: 3 m/s to the right over one of 25 frames a second.
    assert place(session) - before == pytest.approx((-3.0 / 25.0, 0.0, 0.0), abs=1e-12)
    _, jumped = session.answer({**ask, "begin": True})
    assert buffers[0] != jumped[0]


def test_without_a_change_the_air_is_the_closed_form():
    session = Session(SCENE)
    session.answer({"t": 100.0, "page": "p", "begin": True})
    for t in (101.0, 102.5, 60.0):
        _, buffers = session.answer({"t": t, "page": "p", "begin": False})
        assert buffers[0] == jpeg(SCENE.render(t))


def test_the_effect_under_the_hand_decides_where_the_air_goes_on():
    session = Session(SCENE.replace(effects=[SCENE.effects[0], fl.TentRain(drops=50)]))
    session.answer({"t": 100.0, "page": "p", "begin": True})
    before = place(session, 1)
    values = {"1.speed": 4.0, "1.direction": 90.0}
    session.answer({"t": 101.0, "values": values, "page": "p", "begin": False, "effect": 1})
    moved = place(session, 1) - before
    assert moved == pytest.approx((0.0, -4.0 / 25.0, 0.0), abs=1e-12)


def test_pages_do_not_move_each_others_air_and_old_ones_are_forgotten():
    session = Session(SCENE)
    for page in ("p", "q"):
        session.answer({"t": 10.0, "page": page, "begin": True})
    session.answer({"t": 11.0, "values": {"0.speed": 3.5}, "page": "q", "begin": False})
    _, buffers = session.answer({"t": 12.0, "page": "p", "begin": False})
    assert buffers[0] == jpeg(SCENE.render(12.0))
    for number in range(40):
        session.answer({"t": 1.0, "page": str(number)})
    assert len(session._air) <= 16 and "p" not in session._air


@pytest.mark.parametrize("kind", sorted(OURS))
def test_every_effect_of_scene_files_can_be_tuned(kind: str):
    scene = fl.Scene((64, 48), effects=[OURS[kind]()])
    session = Session(scene)
    about = session.describe()
    # Three requests, each with a third of the controls.
    values: list[dict[str, Any]] = [{}, {}, {}]
    for number, control in enumerate(about["controls"]):
        middle = 0.5 * (control["low"] + control["high"])
        if control["kind"] != "slider":
            middle = control["choices"][-1] if control["choices"] else "#123456"
        if control["key"].endswith((".count", ".flakes", ".drops")):
            middle = control["low"] + 100
        values[number % 3][control["key"]] = middle
    for some in values:
        head, buffers = session.answer({"t": 3.0, "values": some, "charts": True})
        assert "error" not in head, (some, head)
        assert decoded(buffers[0]).shape == (48, 64, 3)
    assert len(about["controls"]) >= 5


def test_charts_are_the_tiles_own():
    """The tent of the chart is the twin's for the motion that the camera gives that tile."""
    camera = fl.Camera(200.0)
    path = fl.CameraPath(camera, velocity=(0.0, 0.0, 2.0))
    snow = fl.TentSnow(wavelengths=(4.0, 16.0), tile=32, overlap=8, near_depth=10.0, alias="cut")
    scene = fl.Scene((160, 120), camera=path, effects=[snow], fps=25.0)
    found = chart(scene, 10.0, 0, (0.9, 0.2))
    assert found is not None
    left, top, side = found.tile
    x, y = left + side / 2 - 80.0, top + side / 2 - 60.0
    air = np.array([0.36, 1.4, 0.0])
    px, py, pz = (np.array([0.0, 0.0, 2.0]) - air) / 25.0
    wanted = ((pz * x - 200.0 * px) / 10.0, (pz * y - 200.0 * py) / 10.0)
    assert found.velocity == pytest.approx(wanted, abs=1e-12)
    tent = np.fft.fftshift(twin.tent_rate((32, 32), wanted, wavelength_max=16.0))
    assert np.abs(found.rate - tent).max() < 1e-7
    kept = twin.temporal_filter(
        twin.band_amplitude((32, 32), wavelengths=(4.0, 16.0), exponent=0.75),
        wanted,
        shutter=0.5,
        wavelength_max=16.0,
    )
    assert found.kept == pytest.approx(float(np.sum(kept**2)), abs=1e-12)
    inside = np.fft.fftshift(twin.band((32, 32), (4.0, 16.0)))
    assert np.array_equal(~np.isnan(found.power), inside)


def test_an_effect_without_texture_has_no_chart():
    class Veil:
        def render(self, frame: fl.Frame) -> fl.Layer:
            return fl.Layer("veil", np.zeros(frame.shape, np.float32))

    scene = fl.Scene((32, 24), effects=[Veil()])
    head, buffers = Session(scene).answer({"charts": True})
    assert "chart" not in head and len(buffers) == 1


def test_a_preview_is_the_same_view_smaller():
    big = fl.Scene((1024, 768), "#101010", effects=[fl.TentSnow(flakes=0, haze=0.0)])
    small = Preview(big, 256).shown({"effects": big.effects, "camera": big.camera})
    assert small.shape == (192, 256)
    # The mean opacity of a look does not depend on the size; 1 % of it is its own noise.
    means = [s.render(20, layers=True).alpha.mean() for s in (big, small)]
    assert means[1] == pytest.approx(means[0], rel=0.1)
    assert small.camera.camera.focal == pytest.approx(big.camera.camera.focal / 4)


def test_a_preview_takes_arrays_masks_and_depths_along():
    rng = np.random.default_rng(1)
    big = fl.Scene(
        None,
        rng.integers(0, 255, (96, 128, 3), np.uint8),
        effects=[fl.TentSnow(flakes=50, wavelengths=(8.0, 32.0), tile=96, overlap=16)],
        foreground=np.eye(96, 128, dtype=np.float32),
        depth=np.full((96, 128), 30.0, np.float32),
    )
    small = Preview(big, 64).shown({"effects": big.effects, "camera": big.camera})
    assert small.shape == (48, 64)
    assert small.effects[0].wavelengths == (4.0, 16.0)
    assert (small.effects[0].tile, small.effects[0].overlap) == (48, 8)
    assert small.render(3).shape == (48, 64, 3)
    depth = small.depth_at(0)
    assert depth is not None and np.all(depth == 30.0)


def test_light_is_shown_in_display_values():
    scene = fl.Scene((16, 16), (0.214, 0.0, 2.0))
    _, buffers = Session(scene).answer({})
    # sRGB of 0.214 is 0.5; light above 1 is white.
    assert np.abs(decoded(buffers[0])[8, 8].astype(int) - (128, 0, 255)).max() <= 3


def test_two_eyes_are_an_anaglyph_of_both():
    _, buffers = Session(SCENE).answer({"t": 9.0, "values": {"eyes": 80.0}})
    pair = fl.stereo.eyes(SCENE.camera.camera, distance=0.08, convergence=6.0)
    left, right = (SCENE.render(9.0, eye=eye) for eye in pair)
    assert not np.array_equal(left, right)
    assert buffers[0] == jpeg(fl.stereo.anaglyph(left, right))


def test_save_writes_what_the_sliders_say(tmp_path: Path):
    session = Session(SCENE, save=tmp_path / "tuned.toml")
    head, _ = session.answer({"kind": "save", "values": {"0.amount": 0.25, "camera.lateral": 1.5}})
    assert head["saved"] == str(tmp_path / "tuned.toml")
    loaded = fl.Scene.load(tmp_path / "tuned.toml")
    assert loaded.effects[0].amount == 0.25
    assert loaded.camera.velocity == (1.5, 0.0, 0.0)
    assert np.array_equal(loaded.render(9), session.tuned.render(9))


def test_answers_are_packed_as_the_page_unpacks_them():
    data = packed({"t": 1.5}, [b"abc", b"", b"12345"])
    length = int.from_bytes(data[:4], "little")
    head = json.loads(data[4 : 4 + length])
    assert head == {"t": 1.5, "buffers": [3, 0, 5]}
    assert data[4 + length :] == b"abc12345"


def test_bad_arguments():
    with pytest.raises(TypeError, match="scene"):
        Session("scene.toml")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="size"):
        Session(SCENE, size=4)


def test_without_anywidget_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "flurries.viewer.widget", raising=False)
    with pytest.raises(ImportError, match=r"flurries\[view\]"):
        fl.view(SCENE)


def test_size_seed_gusts_color_and_lens_have_rows():
    scene = SCENE.replace(effects=[fl.Snow(flake_size=(0.002, 0.004, 0.01), color=0.9)])
    values = {"0.flake_size": 8.0, "0.seed": 7, "0.gusts": 1.5, "0.color": "#8080ff"}
    assert slider(scene, "0.flake_size").value == pytest.approx(4.0)
    assert slider(scene, "0.seed").value == SCENE.seed
    changed = applied(scene, {**values, "camera.lens": 400.0})
    effect = changed.effects[0]
    assert effect.flake_size == pytest.approx((0.004, 0.008, 0.02))
    assert (effect.seed, effect.wind.gusts) == (7, 1.5)
    assert effect.color == pytest.approx((128 / 255, 128 / 255, 1.0))
    assert effect.wind.mean == scene.effects[0].wind
    assert changed.camera.camera.focal == 400.0
    assert not np.array_equal(changed.render(3), scene.render(3))


def test_a_picture_given_as_an_array_is_saved_beside_the_scene(tmp_path: Path):
    picture = np.random.default_rng(3).integers(0, 255, (120, 160, 3), np.uint8)
    depth = np.full((120, 160), 9.0, np.float32)
    scene = SCENE.replace(background=picture, depth=depth)
    head, _ = Session(scene, save=tmp_path / "mine.toml").answer({"kind": "save", "values": {}})
    assert head["saved"].endswith("mine.toml")
    names = {"mine.toml", "mine-background.png", "mine-depth.exr"}
    assert {path.name for path in tmp_path.iterdir()} == names
    again = fl.Scene.load(tmp_path / "mine.toml")
    assert np.array_equal(again.render(5), scene.render(5))


def test_what_is_copied_as_python_makes_the_scene():
    values = {"0.amount": 0.5, "0.gusts": 1.0, "camera.forward": 2.0}
    head, _ = Session(SCENE).answer({"kind": "python", "values": values})
    made: dict[str, Any] = {}
    exec(head["text"], made)
    assert np.array_equal(made["scene"].render(9), applied(SCENE, values).render(9))


def test_a_film_of_three_seconds_is_written_from_it(tmp_path: Path):
    session = Session(SCENE.replace(fps=4.0), size=64, save=tmp_path / "mine.toml")
    head, _ = session.answer({"kind": "film", "values": {"0.amount": 0.5}})
    film = fl.io.open_background(head["film"])
    assert (film.count, film.size, film.fps) == (12, (64, 48), 4.0)


def test_a_look_by_name_comes_first_and_what_is_tuned_after_it():
    scene = SCENE.replace(effects=[fl.Snow(seed=4, wind=(2.0, 0.0, 0.0))])
    assert slider(scene, "0.preset").choices == ("as given", *fl.Snow.PRESETS)
    values = {"0.preset": "blizzard", "0.haze": 0.3}
    # The sliders stand where the look does.
    shown, _ = Session(scene).answer({"kind": "describe", "values": {"0.preset": "blizzard"}})
    rows = {row["key"]: row["value"] for row in shown["controls"]}
    blizzard = fl.Snow.preset("blizzard", seed=4)
    assert rows["0.density"] == blizzard.density and rows["0.preset"] == "blizzard"
    assert applied(scene, values).effects[0] == fl.Snow.preset("blizzard", seed=4, haze=0.3)
    assert applied(scene, {"0.preset": "as given"}).effects == scene.effects
    head, _ = Session(scene).answer({"values": {"0.preset": "storm"}})
    assert "0.preset" in head["error"] and "blizzard" in head["error"]


@pytest.mark.parametrize(
    "effect", [kind() for kind in OURS.values()], ids=lambda e: type(e).__name__
)
def test_every_look_and_color_of_every_effect_is_shown(effect: Any):
    scene = fl.Scene((48, 32), "#203040", effects=[effect])
    session = Session(scene)
    color = slider(scene, "0.color")
    for word in ("#ff8000", *color.choices):
        _, buffers = session.answer({"t": 2.0, "values": {"0.color": word}})
        assert buffers and session.tuned.effects[0].color is not None
    for look in type(effect).PRESETS:
        _, buffers = session.answer({"t": 2.0, "values": {"0.preset": look}})
        assert buffers, look


def test_a_lamp_a_lens_and_a_depth_are_turned_on_and_off(tmp_path: Path):
    depth = np.full((120, 160), 3.0, np.float32)
    scene = SCENE.replace(effects=[fl.Snow(density=200.0)], depth=depth)
    session = Session(scene, save=tmp_path / "lit.toml")
    plain = session.answer({"t": 5.0})[1][0]
    for key, value in (("lamp.on", "on"), ("lens.on", "on"), ("scene.depth", "off")):
        assert session.answer({"t": 5.0, "values": {key: value}})[1][0] != plain, key
        assert session.answer({"t": 5.0, "values": {}})[1][0] == plain
    values = {
        "lamp.on": "on", "lamp.x": -2.0, "lamp.power": 90.0, "lamp.color": "#ff0000",
        "lens.on": "on", "lens.focus": 2.0, "scene.depth": "off",
    }  # fmt: skip
    tuned = applied(scene, values)
    (lamp,) = tuned.lights
    assert lamp.place[0] == -2.0 and lamp.power == 90.0 and lamp.color == (1.0, 0.0, 0.0)
    assert tuned.lens is not None and tuned.lens.focus == 2.0 and tuned.depth is None
    session.answer({"kind": "save", "values": values})
    assert np.array_equal(fl.Scene.load(tmp_path / "lit.toml").render(4), tuned.render(4))
    made: dict[str, Any] = {"picture": scene.background}
    exec(session.answer({"kind": "python", "values": values})[0]["text"], made)
    assert np.array_equal(made["scene"].render(4), tuned.render(4))


@pytest.mark.parametrize(("key", "value", "said"), [
    ("0.amount", 1.5, "0 to 1"), ("0.amount", "1", "number"), ("0.amount", True, "number"),
    ("0.amount", float("nan"), "finite"), ("7.amount", 0.5, "7.amount"), ("0.sway", 3, "0.sway"),
    ("0.seed", 100, "0 to 99"), ("0.color", "red", "0.color"), ("0.color", "#12", "#rrggbb"),
    ("0.preset", 3, "0.preset"), ("lamp.on", "maybe", "lamp.on"),
    ("scene.depth", "off", "scene.depth"),
])  # fmt: skip
def test_what_no_row_says_is_refused(key: str, value: Any, said: str):
    head, buffers = Session(SCENE).answer({"t": 0.0, "values": {key: value}})
    assert said in head["error"] and not buffers
