"""Every cell of the matrix of faults has the expected answer, and its row on the page."""

from __future__ import annotations

import sys
import tempfile
from contextlib import nullcontext
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))

import make_faults


@pytest.mark.parametrize("kind", make_faults.KINDS)
def test_every_cell_has_the_expected_answer(kind: str):
    server = make_faults.s3() if kind == "s3" else nullcontext()
    with tempfile.TemporaryDirectory() as room, server:
        Path(room).chmod(0o755)  # For an ordinary user.
        found = list(make_faults.cells(kind, Path(room)))
    assert [cell for cell in found if cell[1] != cell[2]] == []
    page = make_faults.PAGE.read_text()
    assert all(f"| {fault} |" in page for fault, _, _ in found) and f" {kind} |" in page
