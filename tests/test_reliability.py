"""docs/internals/reliability.md keeps its word: the list has its rows, and its tests exist."""

from __future__ import annotations

import ast
from pathlib import Path

from every import every
from make_reliability import PAGE, Outcome, line
from reliability import SECTIONS, Row, named

HERE = Path(__file__).parent
ROWS = [row for section in SECTIONS.values() for row in section]


def declared(file: str) -> set[str]:
    tree = ast.parse((HERE / file).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


@every("name", sorted(named()))
def test_a_named_test_exists(name: str):
    file, test = name.split("::")
    assert test in declared(file)


def test_a_wrong_name_would_be_found():
    assert "test_nobody" not in declared("test_reliability.py")


def test_the_page_has_every_row():
    page = PAGE.read_text(encoding="utf-8")
    for section, rows in SECTIONS.items():
        part = page.split(f"## {section}\n")[1].split("\n## ")[0]
        assert part.count("\n| ") == len(rows) + 1
        for row in rows:
            (found,) = (text for text in part.splitlines() if text.startswith(f"| {row.promise} |"))
            assert all(f"`{test}`" in found for test in (*row.tests, *row.control))
            assert "**fails**" not in found


def test_every_soak_test_has_a_row():
    soak = {
        f"soak/{path.name}::{name}"
        for path in (HERE / "soak").glob("test_*.py")
        for name in declared(f"soak/{path.name}")
        if name.startswith("test_")
    }
    assert soak == {name for name in named() if name.startswith("soak/")}


def test_a_row_that_fails_says_so():
    row = Row("a", "b", ("x.py::test_y",), ("x.py::test_z",))
    for outcome, word in (
        (Outcome(passed=1), "holds"),
        (Outcome(passed=1, failed=1), "**fails**"),
        (Outcome(), "**fails**"),
        (Outcome(skipped=1), "**fails**"),
        (Outcome(passed=1, met=False), "**not met**"),
    ):
        assert f"| {word} |" in line(row, {"x.py::test_y": outcome, "x.py::test_z": Outcome()})
