"""The card of a set in weather, for people; and a table of its pictures, for loaders."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

from flurries import __version__
from flurries.io import replacing
from flurries.io.stores import Store
from flurries.output.journal import Journal

_CARD, _TABLE = "README.md", "metadata.jsonl"
_OURS = "<!-- written by flurries corrupt -->"


def write_card(folder: Path) -> None:
    """Write what a folder's journal says of its pictures, where no card of somebody's own is."""
    card = folder / _CARD
    if card.exists() and _OURS not in card.read_text("utf-8", "replace"):
        return
    before, after = None, _texts(folder)
    # Others that work on the set may end while this is written.
    while after != before:
        for name, text in after.items():
            with replacing(folder / name) as temporary:
                temporary.write_text(text, encoding="utf-8")
        before, after = after, _texts(folder)


def _told(folder: Path, plane: str, name: str) -> dict[str, Any]:
    """Return what a row says of a plane: its numbers, or its file, which loaders read if a PNG."""
    if name.endswith(".json"):
        return {plane: json.loads((folder / name).read_bytes())}
    return {plane if name.endswith(".exr") else f"{plane}_file_name": name}


def _texts(folder: Path) -> dict[str, str]:
    journal = Journal(Store(), folder)
    rows, counts = [], Counter[tuple[str, int, str, str]]()
    entries = {name: journal.lines(name)[-1] for name in journal.names()}
    planes: dict[tuple[str, str, int], dict[str, Any]] = {}
    for name, line in entries.items():
        if "record" in line and (plane := line.get("plane")) and (folder / name).is_file():
            key = line["source"], line["weather"], line["severity"]
            planes.setdefault(key, {}).update(_told(folder, plane, name))
    for name, line in entries.items():
        if "record" not in line or line.get("plane"):
            continue
        record = line["record"]
        said = {key: line.get(key) for key in ("source", "weather", "severity", "strength")}
        said |= {key: record[key] for key in ("profile", "amount", "weather_seed")}
        said |= planes.get((line["source"], line["weather"], line["severity"]), {})
        rows.append(json.dumps({"file_name": name, **said}))
        strength = line.get("strength", "")
        counts[line["weather"], line["severity"], record["profile"], strength] += 1
    table = [
        f"| `{weather}/{severity}` | {weather} | {severity} | {profile} | {said} | {count} |"
        for (weather, severity, profile, said), count in sorted(counts.items())
    ]
    lines = [
        "---", "tags: [weather, robustness]", "---", _OURS, f"# {folder.name}", "",
        f"Pictures in weather, by flurries {__version__}. Each folder is a whole set whose",
        f"labels are copies. `{_TABLE}` lists the pictures, and `flurries.jsonl` holds the",
        "record of each, from which `flurries.augment.replay` makes its weather again.", "",
        "| folder | weather | severity | profile | strength | pictures |",
        "| --- | --- | --- | --- | --- | --- |",
        *table,
    ]  # fmt: skip
    texts = ((_CARD, lines), (_TABLE, rows))
    return {name: "\n".join(text) + "\n" for name, text in texts}
