"""Data sets as people publish them: their pictures, and which of them have one weather."""

import os
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr")
# These are read, and written as PNG.
READ = (".webp", ".bmp", ".gif")

# Folders whose pictures are labels, in sets of no layout that we know.
_LABELS = (
    "annotations?|class|depths?|disp(arity)?|flow|gt\\w*|instances?|labels?|masks?|normals?|"
    "occlusions?|panoptic\\w*|seg\\w*|semantic\\w*|stuff\\w*"
)
_NOT_LABELS = rf"(?!(.*/)?({_LABELS})/)"


@dataclass(frozen=True)
class Layout:
    """Where a kind of data set has its pictures, told by regular expressions of whole paths."""

    signs: tuple[str, ...] = ()  # Each is the path of some file.
    pictures: str = f"(?i:{_NOT_LABELS}).*"  # These get weather.
    # Frames of films, whose names the groups are; `t`: numbers, or microseconds since 1970.
    films: tuple[str, ...] = (r"(.*/)?frame[-_]?(?P<t>\d+)\.\w+",)
    eyes: tuple[tuple[str, str], ...] = (("/left/", "/right/"),)  # Texts in names of a pair.
    fps: float = 30.0
    focal: float = 1.2  # Widths of the picture.
    distance: float = 0.12  # Between the eyes, metres.
    # Texts in the names of a picture and of its label; and tables of boxes of COCO's kind.
    labels: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    boxes: str = ""


_KITTI = r"image_0?[0-3]"

LAYOUTS = {
    "cityscapes": Layout(
        signs=(r"(.*/)?leftImg8bit\w*/.*_leftImg8bit\.png",),
        pictures=r"(.*/)?(left|right)Img8bit(_sequence)?/.*",
        films=(r"(?:.*/)?leftImg8bit(?:_sequence)?/(.*_)(?P<t>\d+)_leftImg8bit\.\w+",),
        eyes=(("leftImg8bit", "rightImg8bit"),), fps=17.0, focal=1.105, distance=0.209,
        labels={"masks": ("leftImg8bit", "gtFine")}),
    "coco": Layout(
        signs=(r"(.*/)?(annotations/.*|_annotations\.coco)\.json",),
        boxes=r"(.*/)?(annotations/instances_.*|_annotations\.coco)\.json"),
    "kitti": Layout(
        signs=(rf"(.*/)?{_KITTI}/.*",), pictures=rf"(.*/)?{_KITTI}/.*",
        films=(rf"(.*/)?{_KITTI}/data/(?P<t>\d+)\.\w+", rf"(.*/)?{_KITTI}/(\d+/)(?P<t>\d+)\.\w+",
               rf"(.*/)?{_KITTI}/(\d+_)(?P<t>\d+)\.\w+",
               rf"(.*/sequences/\d+/|sequences/\d+/){_KITTI}/(?P<t>\d+)\.\w+"),
        eyes=(("/image_2/", "/image_3/"), ("/image_0/", "/image_1/"),
              ("/image_02/", "/image_03/"), ("/image_00/", "/image_01/")),
        fps=10.0, focal=0.58, distance=0.54,
        labels={"boxes": ("image_2", "label_2"), "masks": ("image_2", "instance"),
                "flow": ("image_2", "flow_occ")}),
    "nuscenes": Layout(
        signs=(r"(.*/)?samples/CAM_\w+/.*",), pictures=r"(.*/)?(samples|sweeps)/CAM_\w+/.*",
        films=(r"(?:.*/)?(?:samples|sweeps)/(CAM_\w+)/(.*__)CAM_\w+__(?P<t>\d+)\.\w+",),
        eyes=(), fps=12.0, focal=0.79),
    "voc": Layout(
        signs=(r"(.*/)?JPEGImages/.*", r"(.*/)?Annotations/.*\.xml"),
        pictures=r"(.*/)?JPEGImages/.*",
        labels={"boxes": ("JPEGImages", "Annotations"),
                "masks": ("JPEGImages", "SegmentationObject")}),
    "yolo": Layout(
        signs=(r"(.*/)?images/.*", r"(.*/)?labels/.*\.txt"), pictures=r"(.*/)?images/.*",
        labels={"boxes": ("images", "labels")}),
    "plain": Layout(),
}  # fmt: skip
# Any picture whose name ends in a number, as one of the film that the rest of the name is.
_RUNNING = r"(.*?)(?P<t>\d+)\.\w+"
# A number from here on is a time in microseconds, and seconds of a film are counted from here.
_EPOCH = 1_400_000_000_000_000


@dataclass(frozen=True)
class Member:
    """A picture of a data set."""

    name: str
    weather: str  # What it is drawn from: the picture's name, its film's or its left eye's.
    time: float | None = None  # Of a frame, seconds.
    eyes: tuple[str, str] | None = None  # Names of its pair.

    @property
    def words(self) -> str:
        """How it gets its weather, in words."""
        films = ", frames of films" if self.time is not None else ""
        return f"{_suffix(self.name)} in weather{films}{', in pairs' if self.eyes else ''}"


def layout_of(files: Iterable[str]) -> str:
    """Return the layout that a set's files show; "plain" where they show none."""
    names = list(files)
    for kind, layout in LAYOUTS.items():
        if all(any(re.fullmatch(sign, name) for name in names) for sign in layout.signs):
            return kind
    return "plain"


def files_of(
    folder: Path, include: Sequence[str], exclude: Sequence[str], skipped: Counter[str]
) -> list[str]:
    """Return the plain files below a folder by their paths in it, sorted; count the others."""
    found = []
    for here, folders, files in os.walk(folder):
        folders[:] = [f for f in folders if not f.startswith(".")]
        for file in files:
            path = Path(here) / file
            name = path.relative_to(folder).as_posix()
            if file.startswith("."):
                skipped["hidden"] += 1
            elif path.is_symlink():
                skipped["a symbolic link"] += 1
            elif any(fnmatch(name, one) for one in exclude):
                skipped["excluded"] += 1
            elif include and not any(fnmatch(name, one) for one in include):
                skipped["not included"] += 1
            else:
                found.append(name)
    return sorted(found)


def members_of(
    folder: Path, files: Sequence[str], layout: Layout, films: bool | None, pairs: bool | None
) -> tuple[list[Member], dict[str, str]]:
    """Return the pictures of a set in the order of their weathers, and why others are copied."""
    others: dict[str, str] = {}
    pictures: dict[str, str] = {}
    # What keeps its format goes first.
    for name in sorted(files, key=lambda name: (_suffix(name) in READ, name)):
        if why := _no_picture(folder, name, layout):
            others[name] = why
        elif pictures.setdefault(kept_name(name), name) != name:
            others[name] = "another picture has its name"
    known = set(pictures.values())
    eyes = () if pairs is False else layout.eyes
    found = []
    for name in known:
        pair = _pair_of(name, eyes, known)
        own = name if pair is None else pair[0]
        weather, time = own, None
        for film in () if films is False else (*layout.films, *((_RUNNING,) if films else ())):
            if (match := re.fullmatch(film, own)) is not None:
                groups = list(match.groups(""))
                groups[match.re.groupindex["t"] - 1] = "*"
                weather = "".join(groups)
                number = int(match["t"])
                time = number / layout.fps if number < _EPOCH else (number - _EPOCH) / 1e6
                break
        found.append(Member(name, weather, time, pair))
    found.sort(key=lambda one: (one.weather, one.time or 0.0, one.name))
    return found, others


def _pair_of(name: str, eyes: Iterable[tuple[str, str]], known: set[str]) -> tuple[str, str] | None:
    way = f"/{name}"
    for left, right in eyes:
        if left in way and (other := way.replace(left, right)[1:]) in known:
            return name, other
        if right in way and (other := way.replace(right, left)[1:]) in known:
            return other, name
    return None


def _suffix(name: str) -> str:
    return Path(name).suffix.lower()


def kept_name(name: str) -> str:
    """Return the name that a picture is written under."""
    return (Path(name).with_suffix(".png") if _suffix(name) in READ else Path(name)).as_posix()


def _no_picture(folder: Path, name: str, layout: Layout) -> str:
    """Return why a file is copied as it is; nothing where it gets weather, or fails when read."""
    from PIL import Image

    suffix = _suffix(name)
    if suffix not in SUFFIXES + READ:
        return f"{suffix or 'no suffix'}"
    if re.fullmatch(layout.pictures, name) is None:
        return f"{suffix} where this layout has no pictures"
    failures: Any = (OSError, ValueError, Image.DecompressionBombError)
    with suppress(failures), Image.open(folder / name) as opened:
        mode = opened.mode.partition(";")[0]
        if suffix in READ and getattr(opened, "n_frames", 1) > 1:
            return f"{suffix} that moves: render it as a film"
        if mode in ("1", "I", "F") or (mode == "P" and opened.format == "PNG"):
            return f"{suffix} of numbers, such as a mask or a depth"
    return ""
