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
        measured = case.measure(dtype)
        ok = abs(measured - case.expected) <= case.allowed(dtype)
        cells.append(
            f"{number(measured)} (± {number(case.allowed(dtype))})" + ("" if ok else " **wrong**")
        )
    return "| " + " | ".join([*cells, case.because, case.guard]) + " |"


def page() -> str:
    count = sum(map(len, TABLES.values()))
    parts = [HEAD.format(count=count)]
    for subject, cases in TABLES.items():
        parts += [f"\n## {subject}\n",
                  "| question | expected | float32 | float64 | tolerance from | guard |",
                  "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
        parts += [row(case) for case in cases]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(f"{PAGE.name}: {sum(map(len, TABLES.values()))} cases")
