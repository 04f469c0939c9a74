"""Words that the site's search knows beside those that a page says, as users' own words for things.

A page says them in a comment below a heading, which nothing shows: ``<!-- search: seamless loop, gif -->``.
The search then leads from each of them to that place.
"""

from __future__ import annotations

import re
from pathlib import Path

WORDS = re.compile(r"^(#+ .*\n)<!-- search: (.*?) -->\n", re.M)


def index(stage: Path) -> None:
    """Make entries of the index and keywords of the comments of all pages of a folder."""
    for page in stage.rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        if changed := with_entries(text):
            page.write_text(changed, encoding="utf-8")


def with_entries(text: str) -> str | None:
    """Return a page with its words as MyST has them; None for a page without any."""
    found = [phrase.strip() for _, words in WORDS.findall(text) for phrase in words.split(",")]
    if not found:
        return None
    # An entry answers who types just that; keywords answer who types some of the words, and others.
    single = sorted({word for phrase in found for word in re.findall(r"\w+", phrase)})
    head = f'---\nmyst:\n  html_meta:\n    keywords: "{", ".join(single)}"\n---\n'
    return head + WORDS.sub(entries, text)


def entries(found: re.Match[str]) -> str:
    """Return a heading with the entries that lead to it; "!" makes an entry a main one."""
    phrases = ", ".join(f"! {phrase.strip()}" for phrase in found[2].split(","))
    return f"{found[1]}\n```{{index}} {phrases}\n```\n"
