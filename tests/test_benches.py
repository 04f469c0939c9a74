"""The studies in benches/ run, and say what they should."""

import importlib
import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
import twin

sys.path.insert(0, str(Path(__file__).parents[1] / "benches"))

import accuracy
from accuracy_axes import continuum, lattice, torus

import textured


@pytest.fixture(autouse=True)
def same_threads(threads) -> None:
    """Benches set the number of threads; it comes back."""


def run(name: str, *arguments: str, monkeypatch: pytest.MonkeyPatch, capsys) -> str:
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    importlib.import_module(name).main()
    return capsys.readouterr().out


def test_the_papers_tables(monkeypatch, capsys):
    out = run("paper_tables", "--runs", "1", monkeypatch=monkeypatch, capsys=capsys)
    lines = {line[:18].strip(): line[18:].split() for line in out.splitlines()}
    # The last part holds ratios: many / few, hybrid / few, hybrid / many.
    assert len(lines["Human Condition"]) == 3
    assert "30000" in out and "150000" in out and out.count("1024 x 1024") == 1
    assert all(float(value) > 0.0 for value in lines["Flythrough"])


def test_a_frame_goes_a_short_way_through_the_code(monkeypatch, capsys):
    out = run("calls", monkeypatch=monkeypatch, capsys=capsys)
    changes = {line[:24].strip(): int(line.split()[-6]) for line in out.splitlines()}
    assert changes["heavy frame"] <= 60 and changes["first heavy frame"] <= 120
    assert changes["heavy frame, flying"] <= 90 and changes["flakes with layers"] <= 90


PAGE = Path(__file__).parents[1] / "docs" / "internals" / "accuracy.md"


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
    z = textured.field((64, 64), drift=(0, 0), seed=3, overlap=0, dtype=np.float64)
    power = np.abs(np.fft.fft2(z)) ** 2
    found = np.fft.ifft2(power).real[0, 1:33] / 64**2
    assert np.abs(found - lattice(64, (4.0, 32.0))).max() < 1e-12


@pytest.mark.parametrize("axis", accuracy.AXES)
def test_the_page_has_the_errors_that_are_found(axis: str):
    page = PAGE.read_text(encoding="utf-8")
    rows = page.partition(f"accuracy.py {axis}`")[2].partition("\n## ")[0]
    said = dict(re.findall(r"^\| ([^|]+) \| (\d[\d.e-]*) \|", rows, re.MULTILINE))
    found = {way.setting: way.error(way.make()) for way in accuracy.AXES[axis].ways()}
    assert set(said) == set(found)
    for setting, error in found.items():
        # Rounding depends on the processor; all else has the two digits of the page.
        near = 0.06 if error > 1e-5 else 3.0
        assert error == pytest.approx(float(said[setting]), rel=near, abs=1e-12), setting
    if axis == "precision":
        assert found["field, float64"] < 1e-12 < 1e-8 < found["field, float32"] < 3e-6
        assert not fl.settings().reproducible
    if axis == "composite":
        assert found["joined, then uint8, float32"] <= 0.5 + 1e-4 < found["uint8 each"] <= 3.0
