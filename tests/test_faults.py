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
from faults.shot import KINDS, Shot, s3
from faults.within import CLEAN

# Those that share a writer have some cells each, the first of them all; in a soak all have all.
SOME = {"mov": 0, "webm": 1, "mkv": 2, "jpeg": 0, "tif": 1}


@pytest.mark.parametrize("kind", KINDS)
def test_every_cell_has_the_expected_answer(kind: str):
    with tempfile.TemporaryDirectory() as room, s3() if kind == "s3" else nullcontext():
        Path(room).chmod(0o755)  # For an ordinary user.
        some = kind in SOME and "FLURRIES_SOAK" not in os.environ
        turn = slice(SOME[kind], None, 3) if some else slice(None)
        found = list(make_faults.cells(kind, Path(room), turn))
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
