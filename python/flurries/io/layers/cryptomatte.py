"""Cryptomatte: mattes of things by the names that a renderer has given them, in its EXR files."""

import json
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flurries._contract import Array, PathLike
from flurries.io.files import read_text
from flurries.io.pictures.header import Opened, opened_picture

_ABOUT = re.compile(r"cryptomatte/([^/]+)/(\w+)")
_HOW = {"hash": "MurmurHash3_32", "conversion": "uint32_to_float32"}

MOST_BYTES = 1 << 26


class Group(NamedTuple):
    """The names of one kind in a file, such as those of objects."""

    name: str
    names: dict[str, str] | None  # The manifest, if there is one.
    ranks: list[tuple[int, list[int]]]  # The part and the places of every four channels.

    def planes(self, opened: Opened) -> Iterator[tuple[Array, Array]]:
        """Yield pairs of planes (H, W): numbers as uint32, and shares."""
        for number, places in self.ranks:
            part = opened.at(number)
            [values] = part.read("float", places)
            shown = part.shown(values)
            for k in (0, 2):
                yield np.ascontiguousarray(shown[..., k]).view(np.uint32), shown[..., k + 1]

    def has(self, opened: Opened, name: str) -> bool:
        """Whether a thing of that name is in the manifest; without one, in the picture."""
        if self.names is not None:
            return name in self.names
        return any(bool((ids == hash_of(name)).any()) for ids, _ in self.planes(opened))


def hash_of(name: str) -> int:
    """Return the number of a name: MurmurHash3 of 32 bits, and never a float without a value."""
    data, mask, mixed = name.encode(), 0xFFFFFFFF, 0

    def turned(value: int, by: int) -> int:
        return (value << by | value >> 32 - by) & mask

    for at in range(0, len(data), 4):
        block = data[at : at + 4]
        word = int.from_bytes(block, "little") * 0xCC9E2D51 & mask
        mixed ^= turned(word, 15) * 0x1B873593 & mask
        if len(block) == 4:
            mixed = turned(mixed, 13) * 5 + 0xE6546B64 & mask
    mixed ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        mixed = (mixed ^ mixed >> shift) * factor & mask
    # An exponent of zeros or ones is a denormal number, infinity or NaN.
    return mixed ^ 1 << 23 if mixed >> 23 & 255 in (0, 255) else mixed


def split_names(spec: PathLike) -> tuple[str, list[str]]:
    """Return the file and the names of ``plate.exr:house,tree``; of another file no names."""
    file, mark, names = os.fspath(spec).partition(".exr:")
    if not mark or Path(spec).exists():
        return os.fspath(spec), []
    found = [name.strip() for name in names.split(",")]
    if not all(found):
        raise ValueError(f"{file}.exr: wants names after the colon, got {names!r}")
    return f"{file}.exr", found


def read_matte(path: Path, things: Iterable[tuple[str, str]], *, overscan: bool) -> Array:
    """Return what things, each a group and a name of it, cover together, (H, W) float32."""
    with opened_picture(path, overscan=overscan) as opened:
        groups = _groups(opened)
        total = np.zeros(opened.size[::-1], np.float32)
        for kind, name in things:
            if kind not in groups:
                raise ValueError(f"{path}: has no Cryptomatte called {kind}")
            for ids, shares in groups[kind].planes(opened):
                total += np.where(ids == hash_of(name), shares, 0.0)
        return np.clip(total, 0.0, 1.0)


def things_of(path: Path, names: Iterable[str]) -> tuple[dict[str, tuple[str, str]], set[str]]:
    """Return the group and name of each thing that a file has, and all names that it knows."""
    with opened_picture(path, overscan=True) as opened:
        groups, found = _groups(opened).values(), dict[str, tuple[str, str]]()
        for name in names:
            # Of one thing, or with the group before it, where several have one of that name.
            split = [(group, name.removeprefix(f"{group.name}.")) for group in groups]
            having = [(group.name, bare) for group, bare in split if group.has(opened, bare)]
            if len(having) > 1:
                words = " or ".join(f"{kind}.{bare}" for kind, bare in having)
                raise ValueError(f"{path}: {name!r} is in several Cryptomattes: write {words}")
            found |= {name: having[0]} if having else {}
        return found, {name for group in groups for name in group.names or ()}


def _groups(opened: Opened) -> dict[str, Group]:
    """Return the groups of a file by their names, or refuse a file without any."""
    about, channels = dict[str, dict[str, str]](), dict[str, tuple[int, int, str]]()
    for part, spec in enumerate(opened.parts):
        for attribute in spec.extra_attribs:
            if found := _ABOUT.fullmatch(attribute.name):
                about.setdefault(found[1], {})[found[2]] = str(attribute.value)
        # In a part of its own a channel may have the bare name of its color.
        called = spec.get_string_attribute("oiio:subimagename")
        for place, name in enumerate(spec.channelnames):
            at = part, place, str(spec.channelformat(place))
            channels[name if "." in name else f"{called}.{name}"] = at
    if not about:
        raise ValueError(f"{opened.path}: no Cryptomatte is in it: its header has no cryptomatte/")
    return {said.get("name", ""): _group(opened.path, said, channels) for said in about.values()}


def _group(path: Path, said: dict[str, str], channels: dict[str, tuple[int, int, str]]) -> Group:
    """Return the group that a header describes, with every four channels of it."""
    name = said.get("name", "")
    called = f"{path}: {name}"
    for key, wanted in _HOW.items():
        if said.get(key, wanted) != wanted:
            raise ValueError(f"{called} wants {key} {wanted}, got {said[key]}")
    ranks: dict[str, dict[str, tuple[int, int, str]]] = {}
    for channel, at in channels.items():
        if found := re.fullmatch(rf"{re.escape(name)}(\d+)\.([rgba])\w*", channel, re.IGNORECASE):
            ranks.setdefault(found[1], {})[found[2].lower()] = at
    for number, four in ranks.items():
        if len(four) != 4 or len({(part, kind) for part, _, kind in four.values()}) != 1:
            raise ValueError(f"{called}{number} must be four channels of one part")
        if four["r"][2] != "float":
            raise ValueError(f"{called}{number} must be floats of 32 bits, got {four['r'][2]}")
    if not ranks:
        raise ValueError(f"{called} has no channels {name}00.R, .G, .B, .A")
    places = [(four["r"][0], [four[color][1] for color in "rgba"]) for four in ranks.values()]
    return Group(name, _manifest(path, said), places)


def _manifest(path: Path, said: dict[str, str]) -> dict[str, str] | None:
    """Return a group's names, from the header or from the file beside that it names."""
    text, beside = said.get("manifest"), path.parent / said.get("manif_file", "")
    if text is None and beside.is_file():
        text = read_text(beside, MOST_BYTES, "Cryptomatte manifest")
    try:
        names = None if text is None else json.loads(text)
    except (ValueError, RecursionError):
        names = text
    if isinstance(names, (dict, type(None))):
        return names
    raise ValueError(f"{path}: the Cryptomatte manifest of {said.get('name')} is damaged")
