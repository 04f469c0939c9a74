"""The studies measure what they say: errors against references that are checked here."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
import twin

sys.path.insert(0, str(Path(__file__).parents[1] / "benches"))

import accuracy
from accuracy_texture import continuum, lattice, torus
from accuracy_ways import Way, largest, rms


def errors(axis: str) -> dict[str, float]:
    """The error of each way, without timing."""
    return {way.setting: way.error(way.make()) for way in accuracy.AXES[axis].ways()}


def test_the_reference_of_the_texture_is_the_twins():
    drift = np.array([3.5, -20.25])
    about = {"seed": 4, "tile": 32, "overlap": 0, "wavelengths": (4.0, 16.0)}
    want = twin.field((32, 32), drift=drift, **about)
    assert np.abs(torus(32, 4, drift, (4.0, 16.0)) - want).max() < 1e-12


def test_the_continuum_is_the_mean_of_bessel_functions():
    from scipy.integrate import quad
    from scipy.special import j0

    for lag, value in zip((1, 7, 32), continuum(4.0, 32.0)[[0, 6, 31]], strict=True):
        exact = quad(lambda u, lag=lag: j0(2.0 * np.pi * lag * np.exp(u)),
                     -math.log(32.0), -math.log(4.0))[0]  # fmt: skip
        assert value == pytest.approx(exact / math.log(8.0), abs=2e-6)


def test_the_lattice_is_the_autocorrelation_of_a_tile():
    z = fl.spectral.field((64, 64), drift=(0, 0), seed=3, overlap=0, dtype=np.float64)
    power = np.abs(np.fft.fft2(z)) ** 2
    found = np.fft.ifft2(power).real[0, 1:33] / 64**2
    assert np.abs(found - lattice(64, (4.0, 32.0))).max() < 1e-12


def test_precision_orders_float32_and_float64():
    found = errors("precision")
    assert found["field, float64"] < 1e-12 < 1e-8 < found["field, float32"] < 3e-6
    # The reader's phases in float32: eps of 400 px over 32 px, times what 5.5 sigma turn.
    assert found["plain NumPy, float32"] > 5.0 * found["field, float32"]
    for name in ("field, float32", "field, float64"):
        same_bits = found[name.replace("field", "field, reproducible")]
        assert same_bits <= 3.0 * found[name] and same_bits != found[name]
    assert len(found) == 8 and not fl.reproducible()


def test_subframes_converge_to_the_sinc():
    found = errors("shutter")
    assert found["sinc, float64"] < 1e-12
    # The midpoint rule is of order 2.
    for few, many in ((4, 8), (8, 16)):
        ratio = found[f"{few} sub-frames"] / found[f"{many} sub-frames"]
        assert ratio == pytest.approx(4.0, rel=0.02)


def test_the_film_of_the_3d_method_has_the_error_of_its_rounding():
    found = errors("film")
    assert found["2-D, float64"] < 1e-12
    assert found["3-D, 32 frames"] > 1.5 * found["3-D, 64 frames"] > 1.5 * found["3-D, 128 frames"]


def test_eight_bits_lose_levels_and_floats_do_not():
    found = errors("composite")
    # Half a level for each of six layers, at most; the first ones are covered.
    assert 0.5 < found["uint8 each"] <= 3.0
    assert found["joined, then uint8, float32"] <= 0.5 + 1e-4
    assert found["float64"] < 1e-10


def test_footprints_agree_with_the_line_integral():
    found = errors("footprint")
    assert found["volume, float64"] < 1e-12 and found["volume, float32"] < 1e-6
    assert found["viewpoint, float32"] < found["viewplane_c, float32"] < found["viewplane, float32"]


def test_stopping_early_keeps_its_promise():
    found = errors("stop")
    for setting, error in found.items():
        if setting.startswith("until"):
            assert error <= float(setting.split()[1]) * 1.02


def test_the_box_filter_is_near_what_many_samples_say():
    found = errors("cone")
    assert found["box x 3 x 3, float32"] < found["box x 1 x 1, float32"] < 0.01
    assert found["nearest texel, NumPy"] > 5.0 * found["box x 1 x 1, float32"]


def test_linear_blending_and_butt_joints_are_worse():
    found = errors("blend")
    assert found["power, overlap 10"] < 0.5 * found["linear, overlap 10"]
    assert found["power, overlap 10"] < 0.5 * found["power, overlap 0"]


def test_what_nothing_beats_is_marked():
    costs = [(1.0, 1.0), (0.1, 2.0), (0.1, 3.0), (2.0, 0.5), (0.1, 2.0)]
    assert accuracy.unbeaten(costs) == [True, True, False, True, True]


def test_every_way_is_called_in_turn():
    said: list[str] = []
    ways = [Way(name, lambda name=name: said.append(name), lambda _: 1.0) for name in "ab"]
    points = accuracy.measure(ways, 20)
    assert said[2:] == list("ab") * 20
    assert all(point.fastest <= point.median for point in points)


def test_errors_are_what_they_are_called():
    reference = np.array([1.0, 2.0, 4.0])
    assert largest(reference)([1.0, 2.5, 4.0]) == 0.5
    assert rms(reference)([1.0, 2.0, 1.0]) == pytest.approx(math.sqrt(3.0))


def test_the_bench_writes_plots_and_a_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    out, page = tmp_path / "out", tmp_path / "page.md"
    asked = ["accuracy", "blend", "--runs", "2", "-o", str(out), "--page", str(page)]
    monkeypatch.setattr(sys, "argv", asked)
    accuracy.main()
    assert capsys.readouterr().out.count("| power, overlap 10 |") == 1
    assert {file.name for file in out.iterdir()} == {"blend.png", "accuracy.png"}
    assert page.read_text().count("| power, overlap 10 |") == 1
    assert "(out/blend.png)" in page.read_text()
