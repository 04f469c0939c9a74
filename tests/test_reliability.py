"""docs/internals/reliability.md keeps its word: the tests that it names exist."""

import ast
import re
from pathlib import Path

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "internals" / "reliability.md"


def declared(file: Path) -> set[str]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_every_named_test_exists_and_every_soak_test_is_named():
    named = set(re.findall(r"`([\w/]+\.py::\w+)`", PAGE.read_text(encoding="utf-8")))
    assert len(named) > 50
    files = {name.split("::")[0] for name in named}
    known = {f"{file}::{name}" for file in files for name in declared(HERE / file)}
    assert named <= known
    soak = {
        f"soak/{path.name}::{name}"
        for path in (HERE / "soak").glob("test_*.py")
        for name in declared(path)
        if name.startswith("test_")
    }
    assert soak <= named
