"""docs/internals/deviations.md keeps its word: it has all errata, and its tests exist."""

import ast
import re
from pathlib import Path

HERE = Path(__file__).parent
PAGE = (HERE.parent / "docs" / "internals" / "deviations.md").read_text(encoding="utf-8")
NAMED = re.compile(r"`(test_\w+\.py)?::(test_\w+)`")


def lost(page: str) -> list[tuple[str, str]]:
    """Return (file, test) of what is not there; "::test" belongs to the file before it."""
    found = []
    for line in page.splitlines():
        file = ""
        for match in NAMED.finditer(line):
            file = match[1] or file
            tree = ast.parse((HERE / file).read_text(encoding="utf-8"))
            if match[2] not in {getattr(node, "name", "") for node in ast.walk(tree)}:
                found.append((file, match[2]))
    return found


def test_every_erratum_has_a_line_with_a_test():
    table = PAGE.split("## Errata of Langer 2004")[1].split("\n## ")[0]
    rows = re.findall(r"^\| ([\d, ]+) \|(.*)", table, re.MULTILINE)
    assert all(NAMED.search(row) for _, row in rows)
    assert sorted(int(n) for numbers, _ in rows for n in numbers.split(",")) == list(range(1, 21))


def test_the_named_tests_exist():
    assert lost(PAGE) == []
    here = "`test_deviations.py::test_nobody`, `::test_the_named_tests_exist`"
    assert lost(here) == [("test_deviations.py", "test_nobody")]
