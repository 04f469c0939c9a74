"""Cryptomatte: mattes by name, from files that OpenImageIO writes with hashes of another make."""

import json
import struct

import numpy as np
import pytest

import flurries as fl
from flurries.cli.main import main
from flurries.io.layers.cryptomatte import hash_of
from stills import write_exr

H, W = 24, 32
HOUSE = np.clip(np.mgrid[:H, :W][1] - 9.5, 0.0, 1.0).astype(np.float32)
TREE = np.where(np.mgrid[:H, :W][0] < 6, 1.0 - HOUSE, 0.0)
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
    """A plate of three things in two ranks of View.Crypto."""
    given = json.dumps({name: f"{number(name).view(np.uint32):08x}" for name in THINGS})
    said = {"name": "View.Crypto", "hash": "MurmurHash3_32", "conversion": "uint32_to_float32"}
    if manifest == "beside":
        said["manif_file"] = "names.json"
        path.with_name("names.json").write_text(given)
    elif manifest is not None:
        said["manifest"] = given if manifest == "embedded" else manifest
    values = np.zeros((H, W, 11), np.float32)
    for k, (name, share) in enumerate(THINGS.items()):
        values[..., 3 + 2 * k], values[..., 4 + 2 * k] = number(name), share
    names = ("R", "G", "B", *(f"View.Crypto0{k}.{c}" for k in "01" for c in "rgba"))
    header = {f"cryptomatte/3f2a1b0/{key}": value for key, value in (said | about).items()}
    then = [(values[2:, 9:, 3:], names[3:], (9, 2))] if apart else []
    colors = (values[..., :3], "RGB") if apart else (values, names)
    write_exr(path, *colors, then=then, kind=kind, header=header, display=(0, 0, W, H))


def matte(source, t=0.0):
    return fl.Scene(size=(W, H), foreground=source)._program.front(t).cover


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
    assert np.array_equal(matte("parts.exr:house"), np.where(np.mgrid[:H, :W][0] < 2, 0.0, HOUSE))
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
        fl.Scene(size=(W, H), foreground=f"{tmp_path / 'plate.exr'}:{names}")
    fl.io.write_picture(tmp_path / "bare.exr", np.zeros((H, W, 3), np.float32))
    with pytest.raises(ValueError, match=r"bare\.exr: no Cryptomatte is in it"):
        fl.Scene(size=(W, H), foreground=str(tmp_path / "bare.exr:house"))
