"""Labels of data sets as their files have them: boxes, instances, motion and planes of numbers."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from flurries._contract import Array, Float64, naming
from flurries.io.pictures.reader import read_depth, read_picture

# Endings of the files of each label, which is what is left of a picture's name and one of them.
ENDINGS = {
    "depth": (".exr", ".tif", ".tiff", ".png", ".npy"),
    "flow": (".flo", ".png", ".npy"),
    "boxes": (".txt", ".xml"),
    "masks": ("_instanceIds.png", ".png", ".npy"),
    "wet": (".png", ".npy"),
}


_DAMAGE = (ValueError, IndexError, TypeError, EOFError, ElementTree.ParseError)


def read_label(kind: str, path: Path, shape: tuple[int, int] = (1, 1)) -> Array:
    """Return a label of a picture, whose shape boxes of shares take; others are refused."""
    with naming(f"{path}: holds no {kind} of a picture", *_DAMAGE, then=ValueError):
        plain = path.suffix == ".npy"
        found = np.load(path, allow_pickle=False) if plain else _READERS[kind](path, shape)
        if kind == "wet":
            return np.asarray(found != 0)
        return np.asarray(found, np.float32 if kind == "depth" else None)


def _boxes(path: Path, shape: tuple[int, int]) -> Float64:
    """Return (x0, y0, x1, y1) in pixels of each line of YOLO's or KITTI's, or object of VOC's."""
    if path.suffix == ".xml":
        # VOC counts pixels from 1, and the last one is inside.
        each = [
            [float(box.findtext(side, "")) - first for side, first in _VOC]
            for box in ElementTree.parse(path).iter("bndbox")
        ]
        return np.array(each, np.float64).reshape(-1, 4)
    found = []
    for line in path.read_text("utf-8").splitlines():
        kind, *rest = line.split() or [""]
        if kind.replace(".", "", 1).isdigit():
            found.append(_yolo([float(word) for word in rest], shape))
        elif kind:
            found.append([float(word) for word in rest[3:7]])
    return np.array(found, np.float64).reshape(-1, 4)


_VOC = (("xmin", 1.0), ("ymin", 1.0), ("xmax", 0.0), ("ymax", 0.0))


def _yolo(values: list[float], shape: tuple[int, int]) -> list[float]:
    """Return a box of shares: its middle and sides, or the corners of a polygon around it."""
    if len(values) in (4, 5):
        x, y, width, height = values[:4]
        values = [x - width / 2, y - height / 2, x + width / 2, y + height / 2]
    across, down = values[0::2], values[1::2]
    sides = min(across), min(down), max(across), max(down)
    return [share * size for share, size in zip(sides, (*shape[::-1], *shape[::-1]), strict=True)]


def read_coco(files: Iterable[Path], names: Iterable[str]) -> dict[str, list[list[float]]]:
    """Return the boxes of pictures by their names, from COCO's tables of annotations."""
    known = set(names)
    ends: dict[str, list[str]] = {}
    for name in known:
        ends.setdefault(Path(name).name, []).append(name)
    found: dict[str, list[list[float]]] = {}
    for file in files:
        table = json.loads(file.read_bytes())
        pictures: dict[Any, str] = {}
        for picture in table["images"]:
            alike = ends.get(Path(picture["file_name"]).name, [])
            beside = [name for name in alike if name.startswith(f"{file.parent.name}/")] or alike
            split = [name for name in beside if Path(name).parent.name in file.stem] or beside
            if len(split) > 1:
                raise ValueError(f"{file}: {picture['file_name']} may be any of {sorted(split)}")
            pictures |= {picture["id"]: split[0]} if split else {}
        for one in table["annotations"]:
            x, y, width, height = one["bbox"]
            if one["image_id"] in pictures:
                corners = [x, y, x + width, y + height]
                found.setdefault(pictures[one["image_id"]], []).append(corners)
    return found


def _flow(path: Path, shape: tuple[int, int]) -> Array:
    """Return (H, W, 2) pixels per frame of Middlebury's or KITTI's; NaN where it is not known."""
    if path.suffix == ".flo":
        head, data = np.fromfile(path, "<i4", 3), np.fromfile(path, "<f4", offset=12)
        if head[:1].tobytes() != b"PIEH" or data.size != 2 * head[1:].prod():
            raise ValueError("its head and size are not those of Middlebury's format")
        return np.where(np.abs(data) < 1e9, data, np.nan).reshape(head[2], head[1], 2)
    stored = read_picture(path).pixels
    if stored.dtype != np.uint16 or stored.shape[2] != 3:
        raise ValueError(f"a PNG of motion has 3 channels of 16 bits, got {stored.dtype}")
    known = stored[..., 2:] > 0
    return np.where(known, (stored[..., :2].astype(np.float32) - 2.0**15) / 64.0, np.nan)


def _numbers(path: Path, shape: tuple[int, int]) -> Array:
    """Return (H, W) whole numbers: instances, or a mask."""
    from PIL import Image

    with Image.open(path) as opened:
        found = np.array(opened)
        # The 255 of a palette is what VOC leaves open.
        return np.where(found == 255, 0, found) if opened.mode == "P" else found


def _depth(path: Path, shape: tuple[int, int]) -> Array:
    return read_picture(path).pixels[..., 0] if path.suffix == ".png" else read_depth(path)


_READERS: dict[str, Callable[[Path, tuple[int, int]], Any]] = {
    "depth": _depth, "flow": _flow, "boxes": _boxes, "masks": _numbers, "wet": _numbers,
}  # fmt: skip
