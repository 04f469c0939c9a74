"""The Rust tree: which folder may read which, and where unsafe stands."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
SUBJECTS = {"air", "cone", "encode", "falling", "gas", "particles", "spectral"}

# What a folder may read besides itself.
BELOW = {
    "base": set(), "frame": {"base", "particles", "spectral"},
    "python": {"base", "frame", *SUBJECTS}, "lib.rs": set(),
    **{subject: {"base"} for subject in SUBJECTS}, "falling": {"air", "base", "particles"},
}  # fmt: skip

# Rust without its comments, by file.
CODE = {
    path.relative_to(ROOT): re.sub(r"//.*", "", path.read_text("utf-8"))
    for path in sorted((ROOT / "src").rglob("*.rs"))
}


def arrows(text: str) -> set[str]:
    """Return the folders that a file names from the crate's root."""
    found = set(re.findall(r"\bcrate::(\w+)", text))
    for several in re.findall(r"\bcrate::\{([^;]*)\};", text):
        found |= set(re.findall(r"(?:^|,)\s*(\w+)", several))
    return found


def test_no_arrow_points_up_or_across():
    assert {path.parts[1] for path in CODE} == set(BELOW)
    wrong = {path: arrows(text) - {path.parts[1]} - BELOW[path.parts[1]]
             for path, text in CODE.items()}  # fmt: skip
    assert {path: names for path, names in wrong.items() if names} == {}
    seen = "use crate::{base, cone::area}; let hash = crate::particles::torus::hash();"
    assert arrows(seen) == {"base", "cone", "particles"}


def test_unsafe_stands_where_the_page_says():
    page = (ROOT / "docs" / "internals" / "architecture.md").read_text()
    part = page.split("\n## Unsafe\n")[1].split("\n## ")[0]
    found = sorted(str(path) for path, text in CODE.items() if re.search(r"\bunsafe\b", text))
    assert sorted(re.findall(r"`(src/[\w/]+\.rs)`", part)) == found
    assert f"These {len(found)} files" in part
    assert "#![deny(unsafe_code)]" in (ROOT / "src" / "lib.rs").read_text()
    assert "#![forbid(unsafe_code)]" in (ROOT / "crates" / "fft" / "src" / "lib.rs").read_text()
