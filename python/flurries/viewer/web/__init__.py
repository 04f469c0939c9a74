"""The front end, the same for notebooks and browsers."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

_HERE = Path(__file__).parent


def _text(*names: str) -> str:
    return "\n".join((_HERE / name).read_text(encoding="utf-8") for name in names)


def script() -> str:
    """Return the module that draws the viewer: what draws charts and the rest, as one."""
    return _text("draw.js", "viewer.js")


def style() -> str:
    return _text("viewer.css")


PAGES: dict[str, Callable[[], str]] = {
    "page.html": partial(_text, "page.html"),
    "page.js": partial(_text, "page.js"),
    "viewer.js": script,
    "viewer.css": style,
}
