"""The studies in benches/ run, and say what they should."""

import importlib
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benches"))


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
