"""Texture sequences: files that hold the loop, and a description that says what they are."""

import json
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
from flurries.cli import main
from flurries.io import read_picture

FRAMES, SHAPE, VELOCITY = 20, (32, 48), (2.4, 3.2)
OPTIONS = {"seed": 5, "wavelengths": (3.0, 24.0)}


def export(folder: Path, name: str, **options) -> list[Path]:
    return fl.spectral.export_loop(folder / name, FRAMES, SHAPE, VELOCITY, **{**OPTIONS, **options})


def alphas(**options) -> np.ndarray:
    film = fl.spectral.loop(FRAMES, SHAPE, VELOCITY, **OPTIONS)
    return fl.spectral.opacity(film, **options)


@pytest.mark.parametrize(("name", "options", "kind", "error"), [
    ("snow_%04d.png", {}, "uint8", 0.5 / 255),
    ("snow_%04d.png", {"bits": 16}, "uint16", 0.5 / 65535),
    ("snow_%04d.tif", {"bits": 8}, "uint8", 0.5 / 255), ("snow_%04d.tif", {}, "float", 0.0),
    ("snow_%04d.exr", {}, "float", 0.0), ("snow_%04d.exr", {"half": True}, "half", 2.0**-12),
])  # fmt: skip
def test_files_hold_the_opacity_of_the_loop(tmp_path: Path, name, options, kind, error):
    *files, side = export(tmp_path, name, **options)
    assert [file.name for file in files] == [name % t for t in range(FRAMES)]
    assert side == tmp_path / "snow.json"
    want = alphas()
    values = []
    for file, alpha in zip(files, want, strict=True):
        picture = read_picture(file)
        pixels = picture.pixels[..., 0] if picture.pixels.ndim == 3 else picture.pixels
        top = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1.0
        values.append(pixels.astype(np.float64) / top)
        # Rounding of the value, and of the float32 arithmetic around it.
        assert np.abs(values[-1] - alpha).max() <= error * 1.0001 + 1e-7
    described = json.loads(side.read_text())
    assert described["type"] == kind
    assert described["mean_opacity"] == pytest.approx(np.mean(values), abs=1e-9)


def test_the_description_says_how_to_make_them_again(tmp_path: Path):
    changes = {"shutter": 0.5, "alias": "soft", "exponent": 0.8, "mean": 0.2, "spread": 2.0,
               "power": 1.5, "amount": 0.7, "jitter": True}  # fmt: skip
    side = export(tmp_path, "a%d.png", **changes)[-1]
    found = json.loads(side.read_text())
    assert side.name == "a.json"
    assert found["version"] == fl.__version__
    assert (found["size"], found["frames"], found["first"]) == ([48, 32], FRAMES, 0)
    assert found["files"] == "a%d.png"
    assert found["periodic"] == ["x", "y", "t"]
    assert found["velocity"] == pytest.approx(VELOCITY, rel=1e-15)
    assert (found["seed"], found["wavelengths"]) == (5, [3.0, 24.0])
    assert {name: found[name] for name in changes} == changes
    again = fl.spectral.export_loop(
        tmp_path / "b%d.png", found["frames"], found["size"][::-1], found["velocity"],
        seed=found["seed"], wavelengths=found["wavelengths"],
        **{name: found[name] for name in changes},
    )  # fmt: skip
    first = export(tmp_path, "a%d.png", overwrite=True, **changes)
    for a, b in zip(first[:-1], again[:-1], strict=True):
        assert np.array_equal(read_picture(a).pixels, read_picture(b).pixels)


def test_what_is_there_is_not_replaced_unasked(tmp_path: Path):
    files = export(tmp_path, "%d.png")
    before = files[3].read_bytes()
    with pytest.raises(ValueError, match=r"0\.png is there already"):
        export(tmp_path, "%d.png", seed=6)
    assert files[3].read_bytes() == before
    export(tmp_path, "%d.png", seed=6, overwrite=True)
    assert files[3].read_bytes() != before


@pytest.mark.parametrize(("name", "options", "match"), [
    ("%d.jpg", {}, "pattern must end"), ("%d.hdr", {}, "pattern must end"),
    ("%d.mp4", {}, "frame token|pattern"), ("still.png", {}, "frame token"),
    ("%d.png", {"bits": 12}, "bits"), ("%d.exr", {"bits": 8}, "bits"),
    ("%d.png", {"overwrite": 1}, "overwrite"), ("%d.png", {"spread": 0.0}, "spread"),
    ("%d.png", {"amount": 1.5}, "amount"),
])  # fmt: skip
def test_refusals_come_before_any_file(tmp_path: Path, name: str, options: dict, match: str):
    with pytest.raises((ValueError, TypeError), match=match):
        export(tmp_path, name, **options)
    assert list(tmp_path.iterdir()) == []


def test_the_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    pattern = str(tmp_path / "t_%02d.png")
    options = ["--frames", "12", "--size", "64x32", "--velocity", "-2,4", "--band", "2,16"]
    assert main(["texture", "-o", pattern, *options, "--look", "heavy", "--seed", "9"]) == 0
    out, _ = capfd.readouterr()
    assert out.split() == [str(tmp_path / f"t_{t:02d}.png") for t in range(12)] + [
        str(tmp_path / "t.json")
    ]
    found = json.loads((tmp_path / "t.json").read_text())
    heavy = fl.effects.TentSnow("heavy")
    assert found["size"] == [64, 32] and found["wavelengths"] == [2.0, 16.0]
    assert found["velocity"] == pytest.approx([-2.0, 4.0])
    assert (found["mean"], found["amount"]) == (heavy.mean, heavy.texture)
    assert 0.0 < found["mean_opacity"] < 0.3
    assert main(["texture", "-o", pattern, *options]) == 2
    said = capfd.readouterr().err
    assert "is there already" in said and "(--overwrite) replaces it" in said
    assert main(["texture", "-o", pattern, "--band", "4,8,16"]) == 2
