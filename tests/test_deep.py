"""Layers of EXR: deep samples of the weather, and mattes by the names of a Cryptomatte."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
from flurries import io
from flurries.cli.main import main
from flurries.io.layers.cryptomatte import hash_of
from flurries.io.layers.planes import Deep, read_deep, write_deep
from flurries.scene import content
from measure import cover
from stills import write_exr

H, W = 36, 48
DISC = (np.hypot(*(np.mgrid[:H, :W] - np.array([[[18.0]], [[24.0]]]))) < 8).astype(np.float32)
FLOOR = np.repeat(np.linspace(60.0, 3.0, H, dtype=np.float32)[:, None], W, axis=1)
SNOW, FOG = fl.Snow("heavy"), fl.Mist("fog", color=0.8)


def scene(*effects: Any, **more: Any) -> fl.Scene:
    return fl.Scene(np.full((H, W, 3), 0.2, np.float32), effects=effects, **more)


def over(samples: Deep) -> np.ndarray:
    whole, at = np.zeros((samples.counts.size, 4)), 0
    for pixel, count in enumerate(samples.counts.ravel().tolist()):
        for sample in samples.values[at : at + count, :4]:
            whole[pixel] += (1.0 - whole[pixel, 3]) * sample
        at += count
    return whole.reshape(*samples.counts.shape, 4)


SCENES = {
    "snow": scene(SNOW),
    "fog before a floor": scene(FOG, depth=FLOOR),
    "snow before a floor, behind and before a disc": scene(
        SNOW, depth=FLOOR, foreground=fl.scene.Foreground(DISC, depth=8.0)
    ),
    "rain and the tent's snow": scene(fl.effects.TentSnow("heavy"), depth=20.0),
}


@pytest.mark.parametrize("name", SCENES)
def test_samples_over_each_other_are_the_weather_alone(name: str, tmp_path: Path):
    shown = SCENES[name]
    shown.write(tmp_path / "deep.exr", 3, deep=True, bits="float")
    shown.write(tmp_path / "alone.exr", 3, alone=True, bits="float")
    samples = read_deep(tmp_path / "deep.exr")
    alone = io.read_picture(tmp_path / "alone.exr").rgba()
    assert samples.counts.max() > 1 and samples.counts.sum() == len(samples.values)
    np.testing.assert_allclose(over(samples), alone, atol=1e-3)
    flat = oiio.ImageBufAlgo.flatten(oiio.ImageBuf(str(tmp_path / "deep.exr")))
    np.testing.assert_allclose(flat.get_pixels("float")[..., :4], alone, atol=1e-3)


def test_of_two_effects_the_opacity_is_that_of_both_and_the_nearest_stands_first():
    both = scene(FOG, SNOW)
    samples = content.deep_of(both, 3)
    np.testing.assert_allclose(over(samples)[..., 3], cover(both, 3), atol=4e-3)
    pixels = np.repeat(np.arange(samples.counts.size), samples.counts.ravel())
    assert (np.diff(samples.values[:, 4])[np.diff(pixels) == 0] >= 0.0).all()


def test_samples_lie_where_their_air_is():
    """Those that end before a wall are what is seen before that wall."""
    shown = scene(SNOW)
    samples = content.deep_of(shown, 3)
    edge = np.geomspace(content.FIRST, content.LAST, content.SLICES)[18]
    begins, ends = samples.values[:, 4], samples.values[:, 5]
    assert (begins < ends).all()
    pixels = np.repeat(np.arange(samples.counts.size), samples.counts.ravel())
    near = ends <= edge * 1.0001
    through = np.ones(samples.counts.size)
    np.multiply.at(through, pixels[near], 1.0 - samples.values[near, 3])
    before = cover(shown.replace(depth=float(edge)), 3)
    far = cover(shown.replace(depth=float(2.0 * edge)), 3)
    # What is too faint for a sample of its own goes into the next one.
    np.testing.assert_allclose(1.0 - through.reshape(H, W), before, atol=3e-3)
    assert np.abs(1.0 - through.reshape(H, W) - far).max() > 0.05, "another wall would be seen"


def test_a_budget_of_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(content, "MOST_SAMPLES", 1000)
    with pytest.raises(ValueError, match="frame 3 has more than 1000 samples"):
        scene(SNOW).write(tmp_path / "deep.exr", 3, deep=True)
    assert not list(tmp_path.glob("*.exr"))


def test_what_is_there_stays_and_what_is_damaged_is_refused(tmp_path: Path):
    shown, file = scene(SNOW), tmp_path / "deep.exr"
    assert shown.write(file, 3, deep=True).written == [3]
    before = file.read_bytes()
    assert shown.write(file, 3, deep=True).kept == [3]
    file.write_bytes(before[: len(before) // 2])
    with pytest.raises(ValueError, match=r"deep\.exr .* has been changed since it was written"):
        shown.write(file, 3, deep=True)
    assert shown.write(file, 3, deep=True, overwrite=True).written == [3]
    assert file.read_bytes() == before


def test_what_holds_no_samples_is_refused(tmp_path: Path):
    shown = scene(SNOW)
    with pytest.raises(ValueError, match="deep needs an EXR"):
        shown.write(tmp_path / "deep.png", 3, deep=True)
    with pytest.raises(ValueError, match="deep and eyes must not both be given"):
        shown.write(tmp_path / "deep.exr", 3, deep=True, eyes={"left": fl.Camera(90.0)})
    with pytest.raises(ValueError, match=r"only \.exr holds deep samples"):
        write_deep(tmp_path / "deep.tif", content.deep_of(shown, 3))
    shown.write(tmp_path / "flat.exr", 3)
    with pytest.raises(ValueError, match="holds no deep samples"):
        read_deep(tmp_path / "flat.exr")


TALL, WIDE = 24, 32
HOUSE = np.clip(np.mgrid[:TALL, :WIDE][1] - 9.5, 0.0, 1.0).astype(np.float32)
TREE = np.where(np.mgrid[:TALL, :WIDE][0] < 6, 1.0 - HOUSE, 0.0)
THINGS = {"house": HOUSE, "tree": TREE, "/lawn/grass": 1.0 - HOUSE - TREE}


def number(name):
    """Austin Appleby's MurmurHash3_x86_32 in NumPy's wrapping integers, as a float of 32 bits."""
    data, u = name.encode(), np.uint32
    words = np.frombuffer(data.ljust(-(-len(data) // 4) * 4, b"\0"), "<u4") * u(0xCC9E2D51)
    words = ((words << u(15)) | (words >> u(17))) * u(0x1B873593)
    h, whole = np.zeros(1, u), len(data) // 4
    for word in words[:whole]:
        h ^= word
        h = ((h << u(13)) | (h >> u(19))) * u(5) + u(0xE6546B64)
    h ^= (words[whole] if len(words) > whole else u(0)) ^ u(len(data))
    h = (h ^ (h >> u(16))) * u(0x85EBCA6B)
    h = (h ^ (h >> u(13))) * u(0xC2B2AE35)
    h ^= h >> u(16)
    return (h ^ u(1 << 23) if (h[0] >> u(23)) & u(255) in (0, 255) else h).view(np.float32)[0]


def plate(path, manifest="embedded", kind="float", apart=False, **about):
    given = json.dumps({name: f"{number(name).view(np.uint32):08x}" for name in THINGS})
    said = {"name": "View.Crypto", "hash": "MurmurHash3_32", "conversion": "uint32_to_float32"}
    if manifest == "beside":
        said["manif_file"] = "names.json"
        path.with_name("names.json").write_text(given)
    elif manifest is not None:
        said["manifest"] = given if manifest == "embedded" else manifest
    values = np.zeros((TALL, WIDE, 11), np.float32)
    for k, (name, share) in enumerate(THINGS.items()):
        values[..., 3 + 2 * k], values[..., 4 + 2 * k] = number(name), share
    names = ("R", "G", "B", *(f"View.Crypto0{k}.{c}" for k in "01" for c in "rgba"))
    header = {f"cryptomatte/3f2a1b0/{key}": value for key, value in (said | about).items()}
    then = [(values[2:, 9:, 3:], names[3:], (9, 2))] if apart else []
    colors = (values[..., :3], "RGB") if apart else (values, names)
    write_exr(path, *colors, then=then, kind=kind, header=header, display=(0, 0, WIDE, TALL))


def matte(source, t=0.0):
    return fl.Scene(size=(WIDE, TALL), foreground=source)._program.front(t).cover


def test_the_hash_is_the_standards():
    # Of Psyop's own tests.
    known = {"hello": 6.07056271024e-17, "равнина": -1.31926312124e-25, "mädchen": 6.23612982116e25}
    for name, value in known.items():
        assert number(name) == pytest.approx(value, rel=1e-7)
    for name in [*known, "", "a", "ab", "abc", *(f"name{k}" for k in range(3000))]:
        assert struct.pack("<I", hash_of(name)) == struct.pack("<f", number(name)), name


@pytest.mark.parametrize("manifest", ["embedded", "beside", None])
def test_names_become_mattes(tmp_path, monkeypatch, manifest):
    monkeypatch.chdir(tmp_path)
    for frame in (3, 4):
        plate(tmp_path / f"plate.{frame}.exr", manifest)
    plate(tmp_path / "parts.exr", manifest, apart=True)
    assert np.array_equal(
        matte("parts.exr:house"), np.where(np.mgrid[:TALL, :WIDE][0] < 2, 0.0, HOUSE)
    )
    assert np.array_equal(matte("plate.3.exr:house"), HOUSE)
    assert np.array_equal(matte("plate.#.exr:house, tree", 3), HOUSE + TREE)
    assert np.array_equal(matte("plate.3.exr:View.Crypto.tree"), TREE)
    deep = fl.scene.Foreground("plate.#.exr:/lawn/grass", depth=4.0)
    scene = fl.Scene("plate.#.exr", foreground=[deep], effects=[fl.Snow()])
    scene.save("shot.toml")
    assert np.array_equal(fl.open("shot.toml").render(4), scene.render(4))
    made = ["render", "plate.#.exr", "--snow", "--matte", "plate.#.exr:/lawn/grass@4", "-q"]
    assert main([*made, "-o", "out.#.exr", "--bits", "float", "--frames", "4"]) == 0
    np.testing.assert_array_equal(fl.io.read_picture("out.4.exr").pixels, scene.render(4))


@pytest.mark.parametrize("about, names, words", [
    ({}, "hose", "'hose'; did you mean 'house'"), ({}, "house,,tree", "wants names"),
    ({"hash": "MD5"}, "house", "View.Crypto wants hash MurmurHash3_32, got MD5"),
    ({"manifest": "{"}, "house", "manifest of View.Crypto is damaged"),
    ({"name": "Other"}, "house", r"Other has no channels Other00\.R"),
    ({"kind": "half"}, "house", "View.Crypto00 must be floats of 32 bits, got half"),
    ({"manifest": None}, "hose", "no Cryptomatte has 'hose'"),
])  # fmt: skip
def test_refusals(tmp_path, about, names, words):
    plate(tmp_path / "plate.exr", **about)
    with pytest.raises(ValueError, match=words):
        fl.Scene(size=(WIDE, TALL), foreground=f"{tmp_path / 'plate.exr'}:{names}")
    fl.io.write_picture(tmp_path / "bare.exr", np.zeros((TALL, WIDE, 3), np.float32))
    with pytest.raises(ValueError, match=r"bare\.exr: no Cryptomatte is in it"):
        fl.Scene(size=(WIDE, TALL), foreground=str(tmp_path / "bare.exr:house"))
