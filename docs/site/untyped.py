"""Types in the built reference: a signature or a parameter whose type is Any tells a reader nothing."""

from __future__ import annotations

import re
from pathlib import Path

SHOWN = re.compile(r'<dt class="sig.*?</dt>|<span class="classifier">.*?</span>', re.S)
TAG = re.compile(r"<[^>]+>")


def untyped(site: Path) -> list[str]:
    """Return the signatures and types in which Any stands."""
    return [
        f"{page.name}: {' '.join(TAG.sub('', shown).split())}"
        for page in sorted((site / "reference").glob("*.html"))
        for shown in SHOWN.findall(page.read_text(encoding="utf-8"))
        if re.search(r"\bAny\b", TAG.sub("", shown))
    ]
