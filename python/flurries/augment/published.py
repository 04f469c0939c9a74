"""What others read of a set in weather: its card, a table of its pictures, webdataset's shards."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, TypeAlias

from flurries import __version__
from flurries.augment.sets import COPY, Part, Pictures
from flurries.io import replacing
from flurries.io.stores import Store
from flurries.output.journal import Journal, Mark
from flurries.output.sequence import Job

_CARD, _TABLE = "README.md", "metadata.jsonl"
_OURS = "<!-- written by flurries corrupt -->"

# What a sample says of its weather.
_SAID = ("source", "weather", "severity", "strength", "record")

# The name of a member, its content, and what tells it from others.
Member: TypeAlias = "tuple[str, Path | bytes, str]"


@dataclass(kw_only=True)
class Shards(Job):
    """All shards of a set by their ways; those that are there and not right are made again."""

    folder: Path
    shards: list[tuple[Path, list[Member]]]
    scratch: bool = True

    @classmethod
    def of(cls, job: Pictures, count: int) -> Shards:
        """Return the shards, of so many samples each, of pictures that have been made."""
        lines = Journal(Store(), job.folder).last()
        samples: dict[Path, dict[str, list[Part]]] = {}
        for part in job.parts:
            if part.plane != COPY:
                own = samples.setdefault(Path(part.kind, f"{part.level}-shards"), {})
                own.setdefault(part.name, []).append(part)
        found = []
        for folder, each in samples.items():
            parts = iter(each.values())
            for number in range(-(-len(each) // count)):
                group = islice(parts, count)
                members = [member for one in group for member in _sample(job, one, lines)]
                found += [(folder / f"{number:06d}.tar", members)] if members else []
        return cls(folder=job.folder, shards=found)

    def path_of(self, index: int) -> Path:
        return self.folder / self.shards[index][0]

    def mark_of(self, index: int) -> Mark:
        told = "".join(f"{name}\0{content}\0" for name, _, content in self.shards[index][1])
        return Mark("shards", index, hashlib.sha256(told.encode()).hexdigest())

    def make(self, index: int, numbers: Iterable[int]) -> Any:
        return self.shards[index][1]

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        with replacing(path) as temporary, tarfile.open(temporary, "w") as shard:
            for name, content, _ in made:
                data = content if isinstance(content, bytes) else content.read_bytes()
                # Nobody's and of no time: equal members are equal bytes.
                told = tarfile.TarInfo(name)
                told.size = len(data)
                shard.addfile(told, io.BytesIO(data))


def _sample(job: Pictures, parts: list[Part], lines: dict[str, Any]) -> list[Member]:
    """Return the members of a picture: their names, contents and what these are known by."""
    first = parts[0]
    if first.path.as_posix() not in lines:
        return []  # It could not be made.
    # What follows the first dot of a name says what a member is.
    way = Path(first.name).with_suffix("")
    key = way.with_name(way.name.replace(".", "_")).as_posix()
    found: list[Member] = []
    for part in parts:
        if (line := lines.get(part.path.as_posix())) is not None:
            ending = (f".{part.plane}" if part.plane else "") + part.path.suffix.lower()
            found.append((key + ending, job.folder / part.path, line["sha256"]))
    said = json.dumps({name: lines[first.path.as_posix()][name] for name in _SAID})
    found.insert(1, (f"{key}.json", said.encode(), said))
    for kind in job.swaps:
        if (path := job.path_of_label(kind, first.name)) is not None:
            found.append((f"{key}.{kind}{path.suffix}", path, job.hashes[path]))
    return found


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


def _texts(folder: Path) -> dict[str, str]:
    rows, counts = [], Counter[tuple[str, int, str, str]]()
    said = {k: line for k, line in Journal(Store(), folder).last().items() if "record" in line}
    planes = defaultdict[Any, dict[str, Any]](dict)
    for name, line in said.items():
        if (plane := line.get("plane")) and (folder / name).is_file():
            own = planes[line["source"], line["weather"], line["severity"]]
            # Its numbers, or its file, which loaders read if it is a PNG.
            if name.endswith(".json"):
                own[plane] = json.loads((folder / name).read_bytes())
            else:
                own[plane if name.endswith(".exr") else f"{plane}_file_name"] = name
    for name, line in said.items():
        if not line.get("plane"):
            record, kind, level = line["record"], line["weather"], line["severity"]
            row = {"file_name": name, **{key: line.get(key) for key in _SAID[:-1]}}
            row |= {key: record[key] for key in ("profile", "amount", "weather_seed")}
            rows.append(json.dumps(row | planes[line["source"], kind, level]))
            counts[kind, level, record["profile"], line.get("strength", "")] += 1
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
    return {name: "\n".join([*text, ""]) for name, text in ((_CARD, lines), (_TABLE, rows))}
