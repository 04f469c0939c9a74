"""Films that repeat: the 3-D method, loops in time and space, and their files."""

import json
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
import twin
import twin_volume
from every import every
from flurries.cli import main
from flurries.io import read_picture

C = 0.2  # cycles per frame
FRAMES = 64


def drift(c: float, degrees: float = 63.0, longest: float = 32.0) -> np.ndarray:
    angle = np.radians(degrees)
    return c * longest * np.array([np.cos(angle), np.sin(angle)])


def volume(frames: int = FRAMES, size: int = 64, c: float = C, **options) -> np.ndarray:
    options = {"seed": 1, "dtype": np.float64, **options}
    longest = options.get("wavelengths", (4.0, 32.0))[1]
    return fl.spectral.volume(frames, size, drift(c, longest=longest), **options)


SIZES = [(16, 16, (2.0, 8.0)), (15, 15, (2.0, 8.0)), (9, 14, (3.0, 9.0)), (24, 13, (4.0, 13.0))]


@every("cells", ["one", "overlap"])
@every(("frames", "size", "band"), SIZES)
def test_the_film_is_numpys_inverse_transform(frames: int, size: int, band, cells: str):
    cube = twin_volume.spectrum(
        frames, (size, size), drift(C, longest=band[1]), seed=4, wavelengths=band, cells=cells
    )
    want = twin_volume.film(cube)
    got = volume(frames, size, seed=4, wavelengths=band, cells=cells)
    assert np.abs(got - want).max() < 1e-13
    single = volume(frames, size, seed=4, wavelengths=band, cells=cells, dtype=np.float32)
    assert single.dtype == np.float32
    assert np.abs(single - want).max() < 4e-6


OCTAVES = [(16.0, 32.0), (8.0, 16.0), (4.0, 8.0)]  # coarse first


def octave_powers(film: np.ndarray) -> np.ndarray:
    power = np.mean(np.abs(np.fft.fft2(film)) ** 2, axis=0)
    size = film.shape[1]
    return np.array([power[twin.band((size, size), octave)].sum() for octave in OCTAVES])


@pytest.mark.parametrize(
    ("turns", "most", "least", "powers"),
    [(2.0, 1.6, 1.1, (1.69, 1.19, 1.0)), (32.0, 10.6, 3.2, (3.8, 1.8, 1.0))],
)
def test_overlap_breaks_equal_octaves(turns: float, most: float, least: float, powers):
    # With one cell per column octaves hold what the lattice gives them, 1.139 : 1.048 : 1.019.
    frames = 128
    one = octave_powers(volume(frames, c=turns / frames))
    assert one / one[2] == pytest.approx([1.118, 1.028, 1.0], abs=2e-3)
    film = volume(frames, c=turns / frames, cells="overlap")
    cube, size = np.abs(np.fft.fftn(film, norm="forward")), film.shape[1]
    held = (cube > 1e-9 * cube.max()).sum(axis=0)
    count = [float(held[twin.band((size, size), octave)].mean()) for octave in OCTAVES]
    assert (count[0], count[2]) == pytest.approx((most, least), abs=0.05)
    measured = octave_powers(film)
    assert measured / measured[2] == pytest.approx(powers, abs=0.02)


def test_warnings_say_what_would_disappoint():
    with pytest.warns(UserWarning, match="backwards"):
        volume(16, c=0.6)
    with pytest.warns(UserWarning, match="to rest"):
        volume(4, c=0.1)
    with pytest.warns(UserWarning, match="32 % of the waves to rest"):
        fl.spectral.loop(30, (64, 64), (0.0, 1.1), seed=1)
    with pytest.warns(UserWarning, match="holds none longer"):
        volume(16, 24)
    volume(16, c=0.0)  # still snow is asked for


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_cycle_a_frame_and_a_tile_smaller_than_its_waves_are_refused():
    for size, name, more in ((64, "velocity", {"cells": "overlap"}), (3, "wavelengths", {})):
        with pytest.raises(ValueError, match=name):
            fl.spectral.volume(8, size, (40.0, 0.0), seed=1, **more)


VELOCITY = (1.8, 3.6)
LENGTH = 60
SHAPE = (48, 64)
STILL = {"seed": 3, "dtype": np.float64}


def loop(**options) -> np.ndarray:
    return fl.spectral.loop(LENGTH, SHAPE, VELOCITY, **{**STILL, **options})


def test_frames_are_the_2d_method_with_rates_of_whole_turns():
    film, phase = loop(), twin.random_phase(SHAPE, seed=3)
    for shape in ((9, 15), (8, 8), SHAPE):
        plain = fl.spectral.tent_rate(shape, VELOCITY)
        rate = fl.spectral.tent_rate(shape, VELOCITY, loop=LENGTH)
        assert np.array_equal(rate, twin_volume.nearest(plain, LENGTH) / LENGTH)
        assert np.array_equal(rate, -twin.mirror(rate))  # Odd, so that the film is real.
    for t in (0, 1, 17, 59):
        want = twin.inverse_transform(twin.band_amplitude(SHAPE), phase + t * rate)
        assert np.abs(film[t] - want).max() < 1e-12


@pytest.mark.parametrize("periods", [1, -1, 1000, -(10**9)])
def test_the_loop_is_exact(periods: int):
    film = loop()
    again = loop(time=np.arange(LENGTH) + periods * LENGTH)
    assert np.array_equal(film, again)
    assert np.array_equal(loop(time=3), film[3])
    # Between frames, too, as far as the time itself can say it.
    assert np.abs(loop(time=3.25) - loop(time=3.25 + periods * LENGTH)).max() < 1e-12


def test_shutter_cut_and_jitter_act_on_the_rounded_rates():
    speed = (20.0, 30.0)
    options = {"alias": "cut", "shutter": 0.5}
    film = fl.spectral.loop(LENGTH, (64, 64), speed, time=[7.0], **STILL, **options)
    rate = fl.spectral.tent_rate((64, 64), speed, loop=LENGTH)
    amplitude = twin.without_aliases(twin.band_amplitude((64, 64)), rate, "cut", 0.4)
    amplitude = amplitude * np.sinc(0.5 * rate)
    phase = twin.random_phase((64, 64), seed=3)
    assert film.shape == (1, 64, 64)
    assert np.abs(film[0] - twin.inverse_transform(amplitude, phase + 7 * rate)).max() < 1e-12
    where = twin.jittered_directions((64, 64), 3, (0, 0))
    rate = -(where[1] * VELOCITY[0] + where[0] * VELOCITY[1]) / 32.0
    turned = phase + 7 * np.rint(rate * LENGTH) / LENGTH
    want = twin.inverse_transform(twin.band_amplitude((64, 64)), turned)
    got = fl.spectral.loop(LENGTH, (64, 64), VELOCITY, time=7, jitter=True, **STILL)
    assert np.abs(got - want).max() < 1e-12


COUNT, SIDES, SPEED = 20, (32, 48), (2.4, 3.2)
LOOK = {"seed": 5, "wavelengths": (3.0, 24.0)}


def export(folder: Path, name: str, **options) -> list[Path]:
    return fl.spectral.export_loop(folder / name, COUNT, SIDES, SPEED, **{**LOOK, **options})


def alphas(**options) -> np.ndarray:
    film = fl.spectral.loop(COUNT, SIDES, SPEED, **LOOK)
    return fl.spectral.opacity(film, **options)


@pytest.mark.parametrize(("name", "options", "kind", "error"), [
    ("snow_%04d.png", {}, "uint8", 0.5 / 255),
    ("snow_%04d.png", {"bits": 16}, "uint16", 0.5 / 65535),
    ("snow_%04d.tif", {"bits": 8}, "uint8", 0.5 / 255), ("snow_%04d.tif", {}, "float", 0.0),
    ("snow_%04d.exr", {}, "float", 0.0), ("snow_%04d.exr", {"half": True}, "half", 2.0**-12),
])  # fmt: skip
def test_files_hold_the_opacity_of_the_loop(tmp_path: Path, name, options, kind, error):
    *files, side = export(tmp_path, name, **options)
    assert [file.name for file in files] == [name % t for t in range(COUNT)]
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
    assert (found["size"], found["frames"], found["first"]) == ([48, 32], COUNT, 0)
    assert found["files"] == "a%d.png"
    assert found["periodic"] == ["x", "y", "t"]
    assert found["velocity"] == pytest.approx(SPEED, rel=1e-15)
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
