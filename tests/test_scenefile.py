"""Scene files: what is saved comes back, and every mistake is told with its line."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.io import write_layers, write_picture
from flurries.scene.fingerprint import fingerprint

Keys, Scene, Snow = fl.Keys, fl.Scene, fl.effects.TentSnow
RNG = np.random.default_rng(8)
MAP = {"near": 2.0, "far": 30.0}
PLATE = RNG.integers(0, 255, (40, 60, 3)).astype(np.uint8)
FULL = Snow(
    amount=Keys([(0, 0.5), (9.5, 1.0)]), fall=2.0, wind=Keys([(0, (1, 0, 0)), (5, (0, 0, 1))]),
    color=(0.9, 0.8, 0.7), haze=0.1, shutter=0.25, texture=0.6, mean=0.1, spread=2.2, power=1.5,
    exponent=0.9, wavelengths=(2.5, 5.0), near_depth=7.0, tile=5, overlap=2, blend="linear",
    alias="cut", jitter=True, flakes=200, flake_size=(0.01, 0.02), flake_opacity=0.8,
    sway=(0.01, 3.0), seed=99,
)  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Plates in `sub`, and the working folder elsewhere, so that a wrong base would show."""
    sub = tmp_path / "sub"
    sub.mkdir()
    mask = RNG.integers(0, 2, (40, 60)).astype(np.uint8) * 255
    depth = RNG.uniform(1.0, 50.0, (40, 60)).astype(np.float32)
    for name, pixels in {
        "plate.png": PLATE, "grey.png": PLATE, "mask.png": mask,
        "light.exr": (PLATE / 100.0).astype(np.float32),
        "film.4.png": np.roll(PLATE, 4, axis=0), "film.5.png": np.roll(PLATE, 5, axis=0),
    }.items():  # fmt: skip
        write_picture(sub / name, pixels)
    write_layers(sub / "depth.exr", {"depth": depth})
    monkeypatch.chdir(tmp_path)
    return tmp_path


# What only some scenes have; together they have every table of a file.
SCENES: dict[str, dict[str, Any]] = {
    "default": {},
    "color": {"size": (50, 40), "background": "#405060", "effects": [Snow("heavy")]},
    "light color": {"size": (50, 40), "background": (0.1, 0.2, 4.0), "effects": [FULL]},
    "picture": {"background": "sub/plate.png", "foreground": "sub/mask.png", "effects": [FULL],
                "seed": -(2**63), "fps": 23.976, "space": "linear",
                "depth": Path("sub/depth.exr")},
    "path": {"background": Path("sub/light.exr"), "effects": [Snow("paper")]},
    "sequence": {"background": "sub/film.%d.png", "effects": [Snow(flakes=100)]},
    "winds": {"size": (50, 40), "effects": [Snow(flakes=100, fall=0.5, wind=wind) for wind in (
        fl.Wind(Keys([(0, (1, 0, 0)), (9, (2, 0, 0))]), gusts=0.5, swirl=0.25, seed=9),
        fl.Wind(profile=[(12, (1, 0, 0)), (48, (-1.5, 0.4, 0))]),
        fl.Wind((1, 0, 0), profile=[(1, 0.5), (9, 2)]))],
        "camera": fl.CameraPath(fl.camera.Camera(80.0, center=(20.0, 11.0)),
                                velocity=Keys([(0, (0, 0, 1)), (9, (1, 0, 2))]))},
    "places": {"size": (50, 40), "effects": [Snow(flakes=100)], "depth": 3.25,
               "camera": fl.CameraPath(
                   fl.camera.Camera(77.7, offset=(0.1, 0, 0), center_shift=(1, 2),
                                    rotation=(0, 0.1, 0)), position=RNG.normal(size=(4, 3))),
               "sun": fl.scene.Sun((1.0, 2.0, 3.0), (1.0, 0.5, 0.25), 0.0)},
    "zoom": {"size": (60, 40), "effects": [Snow(flakes=100)],
             "camera": fl.CameraPath(fl.camera.Camera(80.0), velocity=(0, 0, 1),
                                     orientation=Keys([(0, (0, 0, 0)), (9, (0.1, 0.2, -0.3))]),
                                     focal=Keys([(0, 70.0), (9, 90.0)])),
             "depth": fl.scene.DepthMap("sub/mask.png", near=1.0, far=np.inf, white="far",
                                        law="inverse")},
    "rain in lights": {
        "size": (50, 40), "light": fl.scene.Light(Keys([(0, 0.4), (9, 0.1)]), ground=(0.1, 0, 0)),
        "effects": [fl.Snow(color="local"), fl.effects.TentRain("downpour", fall=7.0, tile=512,
                    renormalise=False, drop_depth=9.0, gain=5.0)],
        "lights": [fl.scene.Lamp((1, 2, 3), color=(1, 0.5, 0.2), power=Keys([(0, 1.0), (9, 2.0)])),
                   fl.scene.Lamp((0, 0, 0), direction=(0, 0, 1), angle=0.5, carried=True)],
        "lens": fl.camera.Lens(focus=Keys([(0, 1.0), (9, 4.0)]), blades=3)},
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_saved_and_loaded_it_is_the_same_scene(name: str, folder: Path):
    scene = Scene(**SCENES[name])
    (folder / "elsewhere").mkdir()
    for file in (Path("scene.toml"), folder / "elsewhere" / "deep.toml"):
        scene.save(file)
        again = fl.open(file)
        first = 0 if scene._range is None else scene._range[0]
        for t in (0, 0.5 if scene._range else 3.5):
            assert np.array_equal(again.render(first + t), scene.render(first + t))
        assert again.effects == scene.effects and again._sun == scene._sun
        assert (again.size, again.fps, again.seed) == (scene.size, scene.fps, scene.seed)
        assert fingerprint(again) == fingerprint(scene)
        again.save(folder / "elsewhere" / "second.toml")
        assert fingerprint(fl.open(folder / "elsewhere" / "second.toml")) == fingerprint(scene)
    assert {p.name for p in folder.iterdir()} == {"sub", "elsewhere", "scene.toml"}


def test_paths_are_relative_to_the_file(folder: Path):
    Scene(folder / "sub" / "plate.png").save(folder / "sub" / "scene.toml")
    assert str(folder) not in (folder / "sub" / "scene.toml").read_text()
    moved = folder.parent / f"{folder.name}-moved"
    folder.rename(moved)
    assert np.array_equal(fl.open(moved / "sub" / "scene.toml").render(0), PLATE)


def test_what_a_fingerprint_sees(folder: Path):
    base = {"background": "sub/plate.png", "effects": [FULL], "foreground": "sub/mask.png"}
    prints = {fingerprint(Scene(**base))}
    for change in ({"seed": 1}, {"fps": 25.0}, {"space": "linear"}, {"foreground": None},
                   {"size": (30, 20)}, {"effects": []}, {"effects": [FULL, FULL]},
                   {"camera": fl.camera.Camera(50.0)}, {"background": "#000000", "size": (60, 40)},
                   {"effects": [replace(FULL, fall=2.0000001)]}, {"depth": 3.0}, {"depth": 4.0},
                   {"depth": "sub/depth.exr"}, {"depth": np.full((40, 60), 2.0)},
                   {"depth": np.full((40, 60), 3.0)}, {"sun": fl.scene.Sun()},
                   {"light": fl.scene.Light(1.0)}, {"light": fl.scene.Light(Keys([(0, 1.0)]))},
                   {"sun": fl.scene.Sun(ambient=0.5)}, {"depth": fl.scene.DepthMap("sub/mask.png",
                       **MAP)},
                   {"depth": fl.scene.DepthMap("sub/mask.png", white="far", **MAP)},
                   {"depth": fl.scene.DepthMap(PLATE[..., 0], **MAP)}):  # fmt: skip
        prints.add(fingerprint(Scene(**{**base, **change})))
    assert len(prints) == 23
    # One array or the same in a file of another name: the pixels count.
    array = Scene(PLATE.copy(), effects=[FULL])
    assert fingerprint(array) == fingerprint(Scene(PLATE, effects=[FULL]))
    assert fingerprint(array) != fingerprint(Scene(PLATE + 1, effects=[FULL]))


@pytest.mark.parametrize("file", ["plate.png", "mask.png", "film.5.png", "grey.png"])
def test_a_changed_picture_is_another_scene(file: str, folder: Path):
    kinds = {"mask.png": {"background": "sub/plate.png", "foreground": "sub/mask.png"},
             "plate.png": {"background": "sub/plate.png"},
             "grey.png": {"size": (60, 40), "depth": fl.scene.DepthMap("sub/grey.png", **MAP)},
             "film.5.png": {"background": "sub/film.%d.png"}}  # fmt: skip
    before = fingerprint(Scene(**kinds[file]))
    assert fingerprint(Scene(**kinds[file])) == before
    write_picture(folder / "sub" / file, PLATE[::-1, ::-1])
    assert fingerprint(Scene(**kinds[file])) != before


def test_what_a_text_cannot_hold_is_refused(folder: Path):
    for name, scene in {
        "background": Scene(PLATE),
        "foreground": Scene(size=(60, 40), foreground=np.zeros((40, 60), np.float32)),
        "depth": Scene(size=(60, 40), depth=fl.scene.DepthMap(PLATE[..., 0], **MAP)),
        "wind: a field": Scene(effects=[Snow(wind=fl.Wind(field=np.zeros((2, 2, 2, 3))))]),
    }.items():
        with pytest.raises(ValueError, match=name):
            scene.save("scene.toml")
    assert {p.name for p in folder.iterdir()} == {"sub"}


def load(folder: Path, text: str | bytes) -> fl.Scene:
    file = folder / "scene.toml"
    file.write_bytes(b"format = 3\n" + (text if isinstance(text, bytes) else text.encode()))
    return fl.open(file)


def test_a_file_by_hand(folder: Path):
    scene = load(folder, """
        size = [60, 40]
        background = "sub/plate.png"
        fps = 25
        [camera]
        velocity = {keys = [[0, [0, 0, 1]], [10, [0, 0, 2]]]}
        [[effects]]
        kind = "tent_snow"
        preset = "heavy"
        flakes = 50
        amount = {keys = [[0, 0.0], [10, 1.0]]}
    """)  # fmt: skip
    assert scene.effects == (Snow("heavy", flakes=50, amount=Keys([(0, 0.0), (10, 1.0)])),)
    assert scene.camera.velocity == Keys([(0, (0, 0, 1)), (10, (0, 0, 2))])
    assert scene.camera.camera.focal == 72.0
    assert np.array_equal(scene.render(0), PLATE)
    assert load(folder, "").size == Scene().size
    # A file of just a mebibyte is read.
    assert load(folder, "#" * ((1 << 20) - 1 - len("format = 3\n")) + "\n").size == Scene().size


SNOW = "[[effects]]\nkind = 'tent_snow'\n"
GREY = "[depth]\nsource = 'sub/grey.png'\nnear = 1\n"
# The text below its format, the line that the message must name, and words that it must hold.
MISTAKES: list[tuple[str | bytes, int | None, str]] = [
    ("size = [6, 4]\nbackgroud = '#000000'\n", 2, "backgroud.*'background'"),
    ("size = [6, 4]\nzzzzz = 1\n", 2, "zzzzz.*known are background"),
    ("[camera]\nfocal = 9\nfokal = 9\n", 3, "fokal.*camera.*'focal'"),
    (SNOW + "fall = 1\n" + SNOW + "flaks = 5\n", 6, "flaks.*'tent_snow'.*'flakes'"),
    ("[camera]\nfocal = 9\n" + SNOW + "focal = 9\n", 5, "focal.*'tent_snow'"),
    ('"siz" = [6, 4]\n', 1, "siz.*'size'"),
    ("# flaks = 3\n" + SNOW + "flaks = 5\n", 4, "flaks"),
    ("[[effects]]\nkind = 'hail'\n", 2, "kind.*'snow'.*'hail'"),
    ("[[effects]]\nflakes = 5\n", None, "kind"), ("[[effects]]\nkind = ['snow']\n", 2, "kind"),
    (SNOW + "preset = 'hevy'\n", 3, "preset.*'heavy'.*'hevy'"),
    ("fps = inf\n", 1, "fps.*finite"), (SNOW + "wind = [0.0, nan, 0.0]\n", 3, "wind.*finite"),
    (SNOW + "fall = {keys = [[0, nan]]}\n", 3, "fall|keys.*finite"),
    ("[camera]\nfocal = nan\n", 2, "focal.*finite"), ("effects = 'snow'\n", 1, "effects"),
    ("[effects]\nkind = 'snow'\n", 1, "effects"), ("effects = [1]\n", 1, "effects"),
    ("camera = 3\n", 1, "camera"), (SNOW + "fall = {kays = [[0, 1]]}\n", 3, "fall.*keys"),
    (SNOW + "fall = {keys = [[1, 1], [0, 1]]}\n", 3, "keys.*increase"),
    (SNOW + "flakes = {keys = [[0, 1]]}\n", 3, "flakes"),
    ("[camera]\nposition = [[0, 0, 0], [1]]\n", 2, "position"),
    ("[camera]\nvelocity = [0, 0, 0]\nposition = [[0, 0, 0]]\n", 3, "position"),
    (SNOW + "wind = {mean = [1, 0, 0], gust = 0.5}\n", 3, "'gust'.*'gusts'"),
    (SNOW + "wind = {gusts = -1}\n", 3, "gusts"),
    (SNOW + "wind = {profile = {keys = [[1, [0, 1]]]}}\n", 3, "profile"),
    (f"seed = {2**63}\n", 1, "seed"), ("fps = 1979-05-27\n", 1, "fps"),
    ("background = 'nope.png'\n", None, "nope.png"),
    ("size = [6, 4\n", None, "TOML"), ("seed = 1\nseed = 2\n", 2, "TOML.*line 3"),
    (b"background = '\xff'\n", None, "TOML"), ("background = 'a\0b'\n", None, "TOML"),
    ("size = " + "[" * 20000 + "]" * 20000, None, "TOML"),
    ("seed = " + "9" * 5000, None, "TOML"), ("#" * (1 << 20) + "\n", None, "1048576"),
    ("size = [6, 4]\ndepth = 0\n", 2, "depth"), (GREY + "naer = 1\n", 4, "naer.*depth.*'near'"),
    (GREY, 1, "depth needs far"), (GREY + "far = 0.5\n", 4, "far"),
    ("[depth]\nsource = 3\nnear = 1\nfar = 2\n", 2, "source"), ("sun = 3\n", 1, "sun must be a t"),
    ("[sun]\ncolr = 1.0\n", 2, "colr.*sun.*'color'"), ("[sun]\ncolor = 2\n", 2, "color"),
    ("[output]\nbits = 'ten'\n", 2, "bits must be one of 8, 10, 16, half, float, got 'ten'"),
    ("[output]\ncodek = 'h264'\n", 2, "'codek' in output; did you mean 'codec'"),
    ("[output]\nlayers = true\nalone = true\n", 3, "alone and layers must not both be given"),
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(MISTAKES)))
def test_a_mistake_is_told_with_its_place(number: int, folder: Path):
    text, line, words = MISTAKES[number]
    with pytest.raises((ValueError, TypeError, OSError), match=words) as caught:
        load(folder, text)
    message = str(caught.value)
    assert "scene.toml" in message or words == "nope.png"
    assert len(message) < 1000 and "\n" not in message
    assert line is None or f"line {1 + line}" in message


def test_a_file_of_another_format_says_how_to_convert_it(tmp_path: Path):
    file = tmp_path / "scene.toml"
    for text, words in {
        "size = [8, 8]\n": "scene.toml: format must be 3, got none: write format = 3",
        "size = [8, 8]\nformat = 2\n": "scene.toml, line 2: format must be 3, got 2",
        "fromat = 3\n": "line 1: unknown key 'fromat' in the scene; did you mean 'format'",
        "sise = [8, 8]\n": "unknown key 'sise' in the scene; did you mean 'size'",
        "format = 3.0\n": "line 1: format must be 3, got 3.0",
        "colour = 1\n": "format must be 3, .* color for colour",
        SNOW.replace("tent_", ""): "tent_snow and tent_rain for snow",
    }.items():
        file.write_text(text)
        with pytest.raises(ValueError, match=words):
            fl.open(file)
