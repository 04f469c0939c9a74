"""Measure every hard case and write docs/internals/hard-cases.md: `make hard-cases`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hard import TABLES
from hard.case import Case

PAGE = Path(__file__).parents[1] / "docs" / "internals" / "hard-cases.md"

HEAD = """# Hard cases

What is asked at the edges: {count} questions with a known answer, what the answer must be, and what
was measured when this page was written (`make hard-cases`). `tests/test_hard_cases.py` judges all
of them on float32 and float64. "Guard" is what a case watches: without it the case fails.
"""


def number(value: float) -> str:
    """A number short enough for a table, and exact where it is a small count."""
    if value == int(value) and abs(value) < 1e6:
        return str(int(value))
    return f"{value:.9g}" if 1e-3 <= abs(value) < 1e6 else f"{value:.2e}"


def row(case: Case) -> str:
    cells = [case.name, number(case.expected)]
    for dtype in (np.float32, np.float64):
        measured, allowed = case.measure(dtype), case.allowed(dtype)
        wrong = "" if abs(measured - case.expected) <= allowed else " **wrong**"
        cells.append(f"{number(measured)} (± {number(allowed)}){wrong}")
    return "| " + " | ".join([*cells, case.because, case.guard]) + " |\n"


def page() -> str:
    text = HEAD.format(count=sum(map(len, TABLES.values())))
    for subject, cases in TABLES.items():
        text += f"\n## {subject}\n\n"
        text += "| question | expected | float32 | float64 | tolerance from | guard |\n"
        text += "| --- | --- | --- | --- | --- | --- |\n" + "".join(map(row, cases))
    return text


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
