"""What the viewer answers: the picture where the sliders stand, its charts, the scene's text."""

import io
import math
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
import twin
from flurries.effects import TentRain, TentSnow
from flurries.effects.kinds import OURS
from flurries.io import write_picture
from flurries.viewer.charts import chart
from flurries.viewer.controls import applied, controls_of, inert
from flurries.viewer.session import Preview, Session, jpeg

SNOW = TentSnow(flakes=300, wind=(0.9, 0.0, 0.0), fall=1.2)
SCENE = fl.Scene("#203040", size=(160, 120), effects=[SNOW], fps=25.0, seed=5)


def decoded(data: bytes) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(data)))


def slider(scene: fl.Scene, key: str) -> Any:
    return next(control for control in controls_of(scene) if control.key == key)


def test_sliders_stand_where_the_scene_does():
    # wind (0.9, 0), fall 1.2: 1.5 m/s, atan2(1.2, 0.9) = 53.13 degrees.
    assert slider(SCENE, "0.direction").value == pytest.approx(53.130102354155980, abs=1e-9)
    assert slider(SCENE, "0.speed").value == pytest.approx(1.5, abs=1e-12)
    # Three octaves, 3 to 24 px at 1024 px; here the shortest is held at 2 px.
    octaves = math.log2(24.0 * SCENE._shape[1] / 1024.0 / 2.0)
    assert slider(SCENE, "0.octaves").value == pytest.approx(octaves, abs=1e-12)


def test_the_answer_is_the_scenes_own_frame():
    SCENE.render(12.0)  # What it has resolved is not that of the tuned scene.
    head, buffers = Session(SCENE).answer({"t": 12.0, "values": {"0.amount": 0.5}})
    wanted = applied(SCENE, {"0.amount": 0.5}).render(12.0)
    assert buffers[0] == jpeg(wanted)
    # JPEG at quality 90 keeps a picture of flakes to a few levels.
    assert np.abs(decoded(buffers[0]).astype(int) - wanted).mean() < 4.0
    assert head["t"] == 12.0


def place(session: Session, effect: int = 0) -> np.ndarray:
    return np.array(session._air["p"][1][effect])


@pytest.mark.parametrize("kind", sorted(OURS))
def test_every_effect_of_scene_files_can_be_tuned(kind: str):
    scene = fl.Scene(size=(64, 48), effects=[OURS[kind]()])
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
    color = slider(scene, "0.color")
    for key, words in (("0.color", color.choices), ("0.preset", tuple(OURS[kind].PRESETS))):
        for word in words:
            assert session.answer({"t": 2.0, "values": {key: word}})[1], word


def test_charts_are_the_tiles_own():
    """The tent of the chart is the twin's for the motion that the camera gives that tile."""
    camera = fl.Camera(200.0)
    path = fl.CameraPath(camera, velocity=(0.0, 0.0, 2.0))
    snow = TentSnow(wavelengths=(4.0, 16.0), tile=32, overlap=8, near_depth=10.0, alias="cut")
    scene = fl.Scene(size=(160, 120), camera=path, effects=[snow], fps=25.0)
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


def test_two_eyes_are_an_anaglyph_of_both():
    _, buffers = Session(SCENE).answer({"t": 9.0, "values": {"eyes": 80.0}})
    pair = fl.stereo.eyes(SCENE.camera.camera, distance=0.08, convergence=6.0)
    left, right = (SCENE.render(9.0, eye=eye) for eye in pair)
    assert not np.array_equal(left, right)
    assert buffers[0] == jpeg(fl.stereo.anaglyph(left, right))


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
    blizzard = fl.Snow("blizzard", seed=4)
    assert rows["0.density"] == blizzard.density and rows["0.preset"] == "blizzard"
    assert applied(scene, values).effects[0] == fl.Snow("blizzard", seed=4, haze=0.3)
    assert applied(scene, {"0.preset": "as given"}).effects == scene.effects
    head, _ = Session(scene).answer({"values": {"0.preset": "storm"}})
    assert "0.preset" in head["error"] and "blizzard" in head["error"]


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
    assert np.array_equal(fl.open(tmp_path / "lit.toml").render(4), tuned.render(4))


GREY: dict[str, list[Any]] = {
    "snow": [fl.Snow("heavy")], "none": [], "mist": [fl.Mist()], "fog": [fl.Mist("fog")],
    "thin": [TentSnow(flakes=0)], "plain": [TentSnow(texture=0.0, flakes=300)],
    "veil": [TentSnow("heavy", flakes=0, texture=0.0)], "calm": [fl.Snow(wind=(0, 0, 0), fall=0)],
    "keyed": [fl.Snow(amount=fl.Keys([(0, 0.0), (9, 1.0)]))],
    "two": [fl.Mist(), fl.Snow(amount=0.0)], "gas": [fl.Mist(count=300)],
}  # fmt: skip


@pytest.mark.parametrize("name", GREY)
def test_rows_are_grey_where_they_change_nothing_and_nowhere_else(name: str):
    scene = fl.Scene(fl.io.photograph(size=(96, 64)), effects=GREY[name], fps=25, seed=3)
    grey, frame = inert(scene, {}), scene.render(7)
    for row in controls_of(scene):
        if row.kind == "color" or row.key.endswith((".preset", "eyes")):
            continue
        some = row.choices or [row.low + part * (row.high - row.low) for part in (0.33, 0.71)]
        same = all(np.array_equal(applied(scene, {row.key: v}).render(7), frame) for v in some)
        assert same == (row.key in grey), (row.key, grey)


GUSTY = SCENE.replace(effects=[TentSnow(wind=fl.Wind((1.0, 0.0, 0.5), gusts=0.7, seed=3))])
SIZED = SCENE.replace(effects=[fl.Snow(flake_size=(0.002, 0.004, 0.01), wind=(2.0, 0.0, 0.0))])
KEYED = SCENE.replace(effects=[TentSnow(amount=fl.Keys([(0, 0.25), (9, 1.0)]))])


@pytest.mark.parametrize(("scene", "values", "wanted"), [
    (SCENE, {"0.direction": 180.0, "0.speed": 2.0}, {"wind": (-2.0, 0.0, 0.0), "fall": 0.0}),
    (SCENE, {"0.direction": 90.0}, {"wind": (0.0, 0.0, 0.0), "fall": 1.5}),  # The speed stays.
    (SCENE, {"0.octaves": 3.0, "0.longest": 32.0}, {"wavelengths": (4.0, 32.0)}),
    (GUSTY, {"0.direction": 0.0, "0.speed": 3.0}, {
        "wind.mean": (3.0, 0.0, 0.5), "wind.gusts": 0.7, "wind.seed": 3,
    }),
    (KEYED, {"0.haze": 0.5}, {"amount.first": 0.25}),  # Keys stay until their slider is touched.
    (KEYED, {"0.amount": 0.5}, {"amount": 0.5}),
    (SIZED, {"0.flake_size": 8.0}, {"flake_size": (0.004, 0.008, 0.02)}),
    (SIZED, {"0.gusts": 1.5, "0.seed": 7}, {"wind.gusts": 1.5, "wind.mean": (2, 0, 0), "seed": 7}),
    (SIZED, {"0.color": "#8080ff"}, {"color": (128 / 255, 128 / 255, 1.0)}),
])  # fmt: skip
def test_what_a_slider_means(scene: fl.Scene, values: dict[str, float], wanted: dict[str, Any]):
    assert applied(scene, {}).effects == scene.effects
    changed = applied(scene, values).effects[0]
    for name, value in wanted.items():
        if name == "amount.first":
            assert changed.amount.at(0.0) == value
        else:
            assert attrgetter(name)(changed) == pytest.approx(value, abs=1e-12)
    path = applied(scene, {"camera.rise": 2.0, "camera.forward": 3.0, "camera.lens": 400}).camera
    assert (path.velocity, path.camera.focal) == ((0.0, -2.0, 3.0), 400.0)


@pytest.mark.parametrize(("ask", "said"), [
    (None, "object"), ({"kind": "run"}, "kind"), ({"t": "0"}, "t must"), ({"t": math.inf}, "t"),
    ({"values": [1]}, "object"), ({"page": 3}, "page"), ({"page": "x" * 100}, "page"),
    ({"effect": 1}, "effect"), ({"effect": True}, "effect"),
    ({"charts": True, "at": ["a", 0.0]}, "at"),
    *(({"values": {key: value}}, said) for key, value, said in (
        ("0.amount", 1.5, "0 to 1"), ("0.amount", "1", "number"), ("0.amount", True, "number"),
        ("0.amount", math.nan, "finite"), ("7.amount", 0.5, "7.amount"), ("0.sway", 3, "0.sway"),
        ("0.seed", 100, "0 to 99"), ("0.color", "red", "0.color"), ("0.color", "#12", "#rrggbb"),
        ("0.preset", 3, "0.preset"), ("lamp.on", "maybe", "lamp.on"),
        ("scene.depth", "off", "scene.depth"),
    )),
])  # fmt: skip
def test_bad_questions_are_answered_with_a_sentence(ask: Any, said: str):
    head, buffers = Session(SCENE).answer(ask)
    assert said in head["error"] and not buffers
    with pytest.raises(TypeError, match="scene"):
        Session("scene.toml")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="size"):
        Session(SCENE, size=4)


def test_the_air_goes_on_from_where_it_is_for_each_page():
    """Another speed at frame 100 must not throw the air to where that speed had brought it."""
    scene = SCENE.replace(effects=[SNOW, TentRain(drops=50)])
    session = Session(scene)
    for page in ("p", "q"):
        session.answer({"t": 100.0, "page": page, "begin": True})
    before = [place(session, effect) for effect in (0, 1)]
    ask = {"t": 101.0, "values": {"0.speed": 3.0, "0.direction": 0.0}, "page": "p"}
    _, buffers = session.answer({**ask, "begin": False})
    # Camera minus air: 3 m/s to the right over one of 25 frames a second.
    assert place(session) - before[0] == pytest.approx((-3.0 / 25.0, 0.0, 0.0), abs=1e-12)
    _, jumped = session.answer({**ask, "begin": True})
    assert buffers[0] != jumped[0]
    # Nothing was touched in the other page: the closed form.
    for t in (102.5, 60.0):
        _, buffers = session.answer({"t": t, "page": "q", "begin": False})
        assert buffers[0] == jpeg(scene.render(t))
    # The effect under the hand decides.
    session.answer({"t": 100.0, "page": "p", "begin": True})
    values = {"1.speed": 4.0, "1.direction": 90.0}
    session.answer({"t": 101.0, "values": values, "page": "p", "begin": False, "effect": 1})
    moved = place(session, 1) - before[1]
    assert moved == pytest.approx((0.0, -4.0 / 25.0, 0.0), abs=1e-12)
    for number in range(40):
        session.answer({"t": 1.0, "page": str(number)})
    assert len(session._air) <= 16 and "p" not in session._air


def test_a_preview_is_the_same_view_smaller():
    big = fl.Scene(
        np.zeros((768, 1024, 3), np.uint8), foreground=np.zeros((768, 1024), np.float32),
        depth=np.full((768, 1024), 300.0, np.float32),
        effects=[TentSnow(flakes=0, haze=0.0, wavelengths=(8.0, 64.0), tile=96, overlap=16)],
    )  # fmt: skip
    small = Preview(big, 512).shown({"effects": big.effects, "camera": big.camera})
    assert small._shape == (384, 512) == small._depth_at(0).shape
    assert small.camera.camera.focal == pytest.approx(big.camera.camera.focal / 2)
    effect = small.effects[0]
    assert (effect.wavelengths, effect.tile, effect.overlap) == ((4.0, 32.0), 48, 8)
    # The mean opacity of a look does not depend on the size; 1 % of it is its own noise.
    means = [s.layers(20).alpha.mean() for s in (big, small)]
    assert means[1] == pytest.approx(means[0], rel=0.1)


def test_save_and_python_make_the_scene_of_the_sliders(tmp_path: Path):
    picture = np.random.default_rng(3).integers(0, 255, (120, 160, 3), np.uint8)
    scene = SCENE.replace(background=picture, depth=np.full((120, 160), 9.0, np.float32))
    session = Session(scene, save=tmp_path / "mine.toml")
    values = {"0.amount": 0.25, "0.gusts": 1.0, "camera.lateral": 1.5}
    head, _ = session.answer({"kind": "save", "values": values})
    assert head["saved"] == str(tmp_path / "mine.toml")
    names = {"mine.toml", "mine-background.png", "mine-depth.exr"}
    assert {path.name for path in tmp_path.iterdir()} == names
    wanted = applied(scene, values).render(9)
    assert np.array_equal(fl.open(tmp_path / "mine.toml").render(9), wanted)
    assert np.array_equal(session.tuned.render(9), wanted)


def random_scene(seed: int) -> fl.Scene:
    """A scene with whatever one may have: keys, arrays, files, a way, lamps, two mattes."""
    rng = np.random.default_rng(seed)

    def maybe(value: Any, other: Any = None) -> Any:
        return value if rng.random() < 0.4 else other

    picture = rng.integers(0, 255, (30, 44, 3), np.uint8)
    background: Any = [picture, (picture / 255.0).astype(np.float32), "#304050", (0.1, 0.2, 0.3),
                       "plate.png"][seed % 5]  # fmt: skip
    keys = fl.Keys([(0, 0.2), (9, 1.0)])
    wind = fl.Wind((1.0, 0.0, 0.2), gusts=0.5) if rng.random() < 0.5 else (0.1 + seed / 7, 0.0, 0.0)
    effects: list[Any] = [
        fl.Snow("heavy", density=30.0, far=12.0, wind=wind, amount=maybe(keys, 1.0)),
        fl.Rain("drizzle", far=12.0, seed=maybe(4)),
        fl.Mist("fog", color=maybe("ambient", (0.1, 0.2, 0.3))),
        fl.effects.TentSnow(
            flakes=40, flake_size=(0.003, 1 / 300), color=maybe((0.3, 0.4, 1.0), 1.0)
        ),
        fl.effects.ConeRain(amount=0.7),
    ]
    picked = [one for one in effects if rng.random() < 0.5]
    ways = ({"velocity": (1 / 3, 0.0, 2.0)}, {"position": rng.normal(size=(30, 3)).cumsum(axis=0)})
    camera = fl.Camera(50.0 + 1.0 / 3.0, rotation=maybe((0.01, 0.0, 0.1), (0.0, 0.0, 0.0)))
    return fl.Scene(
        background, size=(44, 30), effects=picked, seed=int(rng.integers(0, 99)), fps=24,
        camera=maybe(camera, fl.CameraPath(camera, **ways[seed % 2])), loop=maybe(20),
        foreground=maybe([fl.scene.Foreground(rng.random((30, 44)), depth=3.0), "plate.png"]),
        depth=maybe(rng.uniform(2, 40, (30, 44)).astype(np.float32), maybe(9.5)),
        light=maybe(fl.scene.Light(0.5, sky=(0.6, 1 / 3, 0.7))),
        sun=maybe(fl.scene.Sun((0.2, 1.0, 0.3), ambient=1 / 3)),
        lights=maybe([fl.scene.Lamp((0.0, -1.0, 5.0), power=keys)], []),
        lens=maybe(fl.camera.Lens(focus=float("inf"), f_stop=2.8)),
        space=maybe("linear", "auto"), output=fl.scene.Output(bits=maybe(16)),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(15))
def test_what_is_copied_makes_the_same_picture(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    write_picture("plate.png", np.full((30, 44, 4), 90 + seed, np.uint8))
    scene = random_scene(seed)
    session = Session(scene, save=tmp_path / "mine.toml")
    asked = {"kind": "python", "values": {} if seed % 3 else {"camera.rise": 0.5}}
    text = session.answer(asked)[0]["text"]
    want = session.tuned.render(7)
    monkeypatch.chdir("/")
    exec(text, made := dict[str, Any]())
    assert np.array_equal(made["scene"].render(7), want)
    assert made["scene"]._output == scene._output


@pytest.mark.parametrize("kind", ["a list", "at a depth"])
def test_mattes_that_are_arrays_are_made_small(kind: str):
    mask = np.zeros((480, 640), np.float32)
    mask[200:] = 1.0
    front = (
        [mask] if kind == "a list" else fl.scene.Foreground(mask, depth=np.where(mask, 4.0, 9.0))
    )
    small = Preview(fl.Scene(size=(640, 480), foreground=front), 200).scene
    assert small.layers(0).image.shape == (150, 200, 3)
