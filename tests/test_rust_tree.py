"""The Rust tree: which folder may read which, and where unsafe stands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "src").rglob("*.rs"))
SUBJECTS = {"air", "cone", "encode", "falling", "gas", "particles", "spectral"}

# What a folder may read besides itself.
BELOW = {
    "base": set(),
    "frame": {"base", "particles", "spectral"},
    "python": {"base", "frame", *SUBJECTS},
    "lib.rs": set(),
    **{subject: {"base"} for subject in SUBJECTS},
    "falling": {"air", "base", "particles"},
}


def code(text: str) -> str:
    """Return Rust without its comments."""
    return re.sub(r"//.*", "", text)


def arrows(text: str) -> set[str]:
    """Return the folders that a file names from the crate's root."""
    text = code(text)
    found = set(re.findall(r"\bcrate::(\w+)", text))
    for several in re.findall(r"\bcrate::\{([^;]*)\};", text):
        found |= set(re.findall(r"(?:^|,)\s*(\w+)", several))
    return found


def folder(path: Path) -> str:
    return path.relative_to(ROOT / "src").parts[0]


def test_the_tree_is_the_one_that_is_known():
    assert {folder(path) for path in SOURCES} == set(BELOW)


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_arrow_points_up_or_across(path: Path):
    own = folder(path)
    assert arrows(path.read_text()) <= {own} | BELOW[own]


def test_an_arrow_is_seen():
    text = """
        use crate::gas::sprite::Eye; // crate::air
        use crate::{base, cone::area};
        let hash = crate::particles::torus::hash();
    """
    assert arrows(text) == {"gas", "base", "cone", "particles"}


def test_unsafe_stands_where_the_page_says():
    page = (ROOT / "docs" / "internals" / "architecture.md").read_text()
    part = page.split("\n## Unsafe\n")[1].split("\n## ")[0]
    listed = re.findall(r"`(src/[\w/]+\.rs)`", part)
    found = sorted(
        str(path.relative_to(ROOT))
        for path in SOURCES
        if re.search(r"\bunsafe\b", code(path.read_text()))
    )
    assert sorted(listed) == found
    assert f"These {len(found)} files" in part
    assert "#![deny(unsafe_code)]" in (ROOT / "src" / "lib.rs").read_text()
    assert "#![forbid(unsafe_code)]" in (ROOT / "crates" / "fft" / "src" / "lib.rs").read_text()
