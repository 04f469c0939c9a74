"""The front end, the same for notebooks and browsers."""

from pathlib import Path

# The files of each page; the module that draws the viewer is two.
PAGES = {
    "page.html": ("page.html",),
    "page.js": ("page.js",),
    "viewer.js": ("draw.js", "viewer.js"),
    "viewer.css": ("viewer.css",),
}


def text_of(page: str) -> str:
    files = (Path(__file__).with_name(name) for name in PAGES[page])
    return "\n".join(file.read_text(encoding="utf-8") for file in files)
