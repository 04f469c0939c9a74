"""The notebooks on the site, with what their cells print and show."""

from __future__ import annotations

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

# What wants a kernel or scripts of elsewhere; the picture beside it stays.
_LIVE = "application/vnd.jupyter.widget-view+json"


def still(book: nbformat.NotebookNode) -> None:
    """Leave of each widget the picture that it shows without a kernel."""
    book.metadata.pop("widgets", None)
    for cell in book.cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if data.pop(_LIVE, None) is not None:
                data.pop("text/html", None)


def write(source: Path, target: Path, *, run: bool) -> None:
    """Copy notebooks, run from top to bottom if asked, and write the page that lists them."""
    target.mkdir(parents=True)
    rows = []
    for path in sorted(source.glob("*.ipynb")):
        book = nbformat.read(path, as_version=4)
        if run:
            print(f"site: {path.name}", file=sys.stderr, flush=True)
            folder = target / "run"
            folder.mkdir(exist_ok=True)
            client = NotebookClient(
                book, timeout=600, kernel_name="python3", resources={"metadata": {"path": folder}}
            )
            client.execute()
            still(book)
        nbformat.write(book, target / path.name)
        rows.append(path.stem)
    listed = "\n".join(rows)
    (target / "index.md").write_text(
        "# Notebooks\n\nEach runs from top to bottom in Jupyter; the files are in the folder "
        f"`notebooks` of the repository.\n\n```{{toctree}}\n:maxdepth: 1\n\n{listed}\n```\n",
        encoding="utf-8",
    )
