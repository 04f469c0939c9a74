"""Every cell of the matrix of faults has the expected answer, and its row on the page."""

import os
import sys
import tempfile
from contextlib import nullcontext
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))

import make_faults
from faults.power import power_cut
from faults.shot import FILMS, FORMATS, KINDS, Shot, s3
from faults.within import CLEAN

# What is one way to the disk shares its cells: films one by one, pictures twice; a soak has all.
SHARED = {kind: (n % 4, 4) for n, kind in enumerate([*FILMS, *(suffix[1:] for suffix in FORMATS)])}
SHARED["s3"] = (0, 2)  # Memory is a store, too.


@pytest.mark.parametrize("kind", KINDS)
def test_every_cell_has_the_expected_answer(kind: str):
    with tempfile.TemporaryDirectory() as room, s3() if kind == "s3" else nullcontext():
        Path(room).chmod(0o755)  # For an ordinary user.
        part = (0, 1) if "FLURRIES_SOAK" in os.environ else SHARED.get(kind, (0, 1))
        found = list(make_faults.cells(kind, Path(room), *part))
    assert [cell for cell in found if cell[1] != cell[2]] == []
    page = make_faults.PAGE.read_text()
    assert all(f"| {fault} |" in page for fault, _, _ in found) and f" {kind} |" in page


def test_a_disk_that_lies_would_be_seen_when_the_power_is_cut(tmp_path: Path):
    first = Shot("png", tmp_path / "whole")
    first.write()
    seen = power_cut(
        Shot("png", tmp_path / "cut"), first.contents(), CLEAN, anyhow=False, lying=True
    )
    assert "changed since it was written" in seen or "no journal" in seen, seen
