"""The budget: how many lines the tree may have, by `wc -l`. A limit may fall and never rise."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# The aims are 20,000, 24,500, 17,500 and 2,200: lower a limit whenever the count falls below it.
LIMITS = {
    ("src/**/*.rs", "crates/**/*.rs"): 19_803,
    ("python/**/*.py",): 30_605,
    ("tests/**/*.py",): 21_380,
    ("benches/**/*.*",): 2_282,
}


@pytest.mark.parametrize("patterns", LIMITS, ids=lambda patterns: patterns[0].split("/")[0])
def test_the_tree_is_within_its_budget(patterns: tuple[str, ...]):
    files = [file for pattern in patterns for file in ROOT.glob(pattern) if file.suffix != ".pyc"]
    lines = sum(file.read_bytes().count(b"\n") for file in files)
    assert 0 < lines <= LIMITS[patterns], f"{lines} lines"
