"""docs/internals/deviations.md keeps its word: it has all errata, and its tests exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from every import every

HERE = Path(__file__).parent
PAGE = (HERE.parent / "docs" / "internals" / "deviations.md").read_text(encoding="utf-8")
NAMED = re.compile(r"`(test_\w+\.py)?::(test_\w+)`")


def named(page: str) -> list[tuple[str, str]]:
    """(file, test) of every mention; "::test" belongs to the file named before it in its line."""
    found = []
    for line in page.splitlines():
        file = ""
        for match in NAMED.finditer(line):
            file = match[1] or file
            found.append((file, match[2]))
    return found


def declared(file: str) -> set[str]:
    tree = ast.parse((HERE / file).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_every_erratum_has_a_line_with_a_test():
    table = PAGE.split("## Errata of Langer 2004")[1].split("\n## ")[0]
    numbers: list[int] = []
    for line in table.splitlines():
        match = re.match(r"\| ([\d, ]+) \|", line)
        if match:
            numbers += [int(number) for number in match[1].split(",")]
            assert NAMED.search(line), line
    assert sorted(numbers) == list(range(1, 21))


@every(("file", "test"), sorted(set(named(PAGE))))
def test_a_named_test_exists(file: str, test: str):
    assert test in declared(file)


def test_a_wrong_name_would_be_found():
    assert named("| `test_x.py::test_a`, `::test_b` |") == [
        ("test_x.py", "test_a"),
        ("test_x.py", "test_b"),
    ]
    assert "test_nobody" not in declared("test_deviations.py")
