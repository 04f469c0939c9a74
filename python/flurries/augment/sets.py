"""The files of a data set in weather: how each is read, what falls before it, how it is written."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flurries import io
from flurries._contract import Array
from flurries.augment.calibration import Profile
from flurries.augment.layouts import Layout, Member, kept_name
from flurries.augment.weather import Weather, replay
from flurries.augment.weathers import Fog, Rainfall, Snowfall
from flurries.io.annotations import ENDINGS, read_label
from flurries.io.color import unmultiply
from flurries.io.pictures.header import opened_picture, upright
from flurries.output.journal import Mark
from flurries.output.sequence import Job
from flurries.scene.fingerprint import Hashes

WEATHERS: dict[str, type[Weather]] = {"snow": Snowfall, "rain": Rainfall, "fog": Fog}
# What tells the truth about a picture's weather: how its file ends, and fields of `Weathered`.
TRUTH: dict[str, tuple[str, ...]] = {
    "clean": ("",),
    "weather": (".png", "layer"),
    "alpha": (".png", "alpha"),
    "layers": (".exr", "falling"),
    "motion": (".exr", "motion"),
    "flow": (".exr", "flow"),
    "depth": (".exr", "depth"),
    "disparity": (".exr", "weather_disparity", "disparity"),
    "occlusion": (".json", "boxes", "occlusion", "coverage", "visibility"),
    "instances": (".json", "instances", "instance_occlusion", "instance_visibility"),
}
# Labels of the set that truth is made of; others change a picture.
NEEDS = {"depth": "depth", "flow": "flow", "occlusion": "boxes", "instances": "masks"}
ALWAYS = ("depth", "wet")
# Planes that take longer; and whose first two channels are x and y.
_SLOW = {"disparity", "layers", "motion"}
_VECTORS = ("falling", "flow", "motion")
COPY = "copy"
# The orientation that undoes another.
_UNDONE = {6: 8, 8: 6}


def weather_of(kind: str, severity: int, profile: Profile, **more: Any) -> Weather:
    return WEATHERS[kind](severity=severity, profile=profile, **more)


@dataclass(frozen=True)
class Part:
    """One file that is made: a picture in a weather, a plane of its truth, or a copy."""

    name: str
    kind: str
    level: int
    plane: str = ""

    @property
    def path(self) -> Path:
        """The file's path from the folder of the whole."""
        base = Path(self.kind)
        if self.plane == COPY:
            return base / str(self.level) / self.name
        if not self.plane:
            return base / str(self.level) / kept_name(self.name)
        suffix = TRUTH[self.plane][0] or Path(self.name).suffix
        return base / f"{self.level}-{self.plane}" / Path(self.name).with_suffix(suffix)

    @property
    def copied(self) -> bool:
        return self.plane in (COPY, "clean")


class Stored(NamedTuple):
    """A picture with what must stay as it was stored."""

    picture: io.Picture
    orientation: int
    grey: bool
    slate: io.Slate

    @classmethod
    def of(cls, path: Path) -> Stored:
        with opened_picture(path, None) as opened:
            orientation, grey = opened.orientation, len(opened.color) == 1
        said, picture = io.read_slate(path), io.read_picture(path)
        turned = () if orientation == 1 else (("Orientation", "int", orientation),)
        slate = replace(said, attributes=said.attributes + turned, origin=(0, 0), display=None,
                        crop=None)  # fmt: skip
        return cls(picture, orientation, grey, slate)

    @property
    def cover(self) -> Any:
        """The alpha that the colors are premultiplied with."""
        alpha = self.picture.alpha if self.picture.premultiplied else None
        return None if alpha is None else alpha[..., None].astype(self.picture.pixels.dtype)

    @property
    def display(self) -> Any:
        """The picture as weather is mixed with it: straight colors, display values."""
        pixels, cover = self.picture.pixels, self.cover
        # Weather falls on the color; how much of it shows stays as it was.
        pixels = pixels if cover is None else unmultiply(pixels, cover)
        pixels = pixels[..., :1] if self.grey else pixels
        # What is brighter than white stays so.
        return io.linear_to_srgb(pixels) if self.picture.encoding == "linear" else pixels

    def turned(self, plane: Array, *, vectors: bool = False) -> Array:
        """Return a plane of the picture as seen, as the file's rows and columns have it."""
        back = _UNDONE.get(self.orientation, self.orientation)
        found = np.array(upright(plane, back), order="C")
        if vectors:
            # How far along x and y as seen the next column is, and the next row.
            places = upright(np.moveaxis(np.mgrid[:2, :2][::-1], 0, -1), back)
            steps = np.stack([places[0, 1] - places[0, 0], places[1, 0] - places[0, 0]], axis=-1)
            found[..., :2] = found[..., :2] @ steps
        return found

    def write(self, path: Path, pixels: Array, header: dict[str, Any]) -> None:
        """Write a picture in weather as this one is stored."""
        alpha, encoding = self.picture.alpha, self.picture.encoding
        pixels = io.srgb_to_linear(pixels) if encoding == "linear" else pixels
        pixels = pixels if self.cover is None else pixels * self.cover
        io.write_picture(
            path, self.turned(pixels), alpha=None if alpha is None else self.turned(alpha),
            encoding=encoding, metadata=header, slate=self.slate,
            premultiplied=None if alpha is None else self.picture.premultiplied,
        )  # fmt: skip


@dataclass(kw_only=True)
class Pictures(Job):
    """All files that are made of a set."""

    folder: Path
    source: Path
    known: dict[str, Member]  # The pictures by their names.
    parts: list[Part]
    seed: int
    profile: Profile
    overwrite: bool
    planes: tuple[str, ...]  # Of truth, that are wanted.
    layout: Layout
    # Of each label a text in a picture's path, and what stands there in the label's.
    swaps: Mapping[str, tuple[str, str]]
    boxes: Mapping[str, list[list[float]]] | None  # Of pictures by their names, as COCO has them.
    unit: float  # Of depths, metres.
    more: Mapping[str, float]  # Of the weathers, where it is not as usual.
    strengths: Mapping[str, str]  # Of each weather and severity.
    tolerant: bool = True
    hashes: Hashes = field(default_factory=Hashes)
    # The pictures made last, as read and in weather, and what they are.
    _last: tuple[Any, dict[str, Any]] = (None, {})

    def path_of(self, index: int) -> Path:
        return self.folder / self.parts[index].path

    def mark_of(self, index: int) -> Mark:
        part = self.parts[index]
        if part.copied:
            return Mark(COPY, 0, self.hashes[self.source / part.name])
        scale = "" if self.profile == "natural" else f"-{self.profile}"
        camera = "".join(f"{name} {value:g} " for name, value in self.more.items())
        by = self.layout
        camera += f"{by.fps:g} {by.focal:g} {by.distance:g} {self.unit:g}"
        scene = f"{part.kind}-{part.level}-{self.seed}{scale}-{part.plane} {camera}"
        return Mark(scene, self._number(part), self._content(part))

    def make(self, index: int, numbers: Iterable[int]) -> Any:
        """Return what is written: a picture as read and in weather, or the file that is copied."""
        part = self.parts[index]
        if part.copied:
            return self.source / part.name
        # Truth is made with its picture.
        key = self._views(part), part.kind, part.level, self._content(replace(part, plane=""))
        if self._last[0] != key:
            self._last = key, self._made(part)
        stored, seen = self._last[1][part.name]
        # Here, once, and not by each who writes a plane.
        _ = [getattr(seen, name) for name in TRUTH.get(part.plane, ())[1:]]
        return part.plane, stored, seen

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        if isinstance(made, Path):
            with io.replacing(path) as temporary:
                shutil.copyfile(made, temporary)
            return
        plane, stored, seen = made
        if not plane:
            return stored.write(path, seen.image, header)  # type: ignore[no-any-return]
        suffix, *fields = TRUTH[plane]
        found = {name: one for name in fields if (one := getattr(seen, name)) is not None}
        if not found:
            raise ValueError(f"its {plane} is not known: that takes a stereo pair")
        if suffix == ".json":
            with io.replacing(path) as temporary:
                temporary.write_text(json.dumps({k: _plain(v) for k, v in found.items()}))
            return
        found = {k: stored.turned(v, vectors=k in _VECTORS) for k, v in found.items()}
        if suffix == ".exr":
            io.write_layers(path, found, half=False, metadata=header)
            return
        levels, alpha = np.rint(found[fields[0]] * 65535.0).astype(np.uint16), None
        if plane == "weather":
            alpha = levels[..., 3].copy()
            levels = np.full_like(levels[..., :3], np.rint(np.array(seen.color) * 65535.0))
        io.write_picture(path, levels, alpha=alpha, metadata=header)

    def notes(self, index: int, made: Any) -> dict[str, Any]:
        part = self.parts[index]
        notes: dict[str, Any] = {"source": part.name}
        if part.plane == COPY:
            return notes
        notes |= {"plane": part.plane} if part.plane else {}
        notes |= {"weather": part.kind, "severity": part.level, "record": self._record(part)}
        notes["strength"] = self.strengths[f"{part.kind} {part.level}"]
        if not part.plane:
            # Of the pixels, whatever encodes them.
            image = made[2].image
            notes["pixels"] = sha256(f"{image.shape}".encode() + image.tobytes()).hexdigest()
        time = self.known[part.name].time
        return notes if time is None else {**notes, "time": time}

    def _made(self, part: Part) -> dict[str, Any]:
        """Return each picture of a part's views as it was read, and in its weather, by its name."""
        read = {view: Stored.of(self.source / view) for view in self._views(part)}
        kinds = (*self.swaps, *(() if self.boxes is None else ("boxes",)))
        given: Any = {kind: [self._label(kind, *one) for one in read.items()] for kind in kinds}
        pictures: Any = tuple(one.display for one in read.values())
        if len(read) == 1:
            (pictures,), given = pictures, {kind: label for kind, (label,) in given.items()}
        seen = replay(self._record(part)).apply(
            pictures, time=self.known[part.name].time, fps=self.layout.fps,
            distance=self.layout.distance, motion=not _SLOW.isdisjoint(self.planes), **given,
        )  # fmt: skip
        each = seen if len(read) > 1 else (seen,)
        return {view: (read[view], made) for view, made in zip(read, each, strict=True)}

    def _views(self, part: Part) -> tuple[str, ...]:
        """Return the pictures that are made together: both of a pair."""
        return self.known[part.name].eyes or (part.name,)

    def path_of_label(self, kind: str, name: str) -> Path | None:
        """Return the file of a picture's label; None where there is none, but a folder of such."""
        base, way = self.source / name, self.source / name.replace(*self.swaps[kind])
        for ending in ENDINGS[kind]:
            path = way.with_name(way.stem + ending)
            if path != base and path.is_file():
                return path
        if kind in ("boxes", "masks") and (way.parent == base.parent or way.parent.is_dir()):
            return None
        raise FileNotFoundError(2, f"No {kind} {' '.join(ENDINGS[kind])} of {name}", str(way))

    def _label(self, kind: str, name: str, picture: Stored) -> Array:
        shape = picture.picture.pixels.shape[:2]
        if kind == "boxes" and self.boxes is not None:
            return np.reshape(self.boxes.get(name, ()), (-1, 4))
        path = self.path_of_label(kind, name)
        if path is None:
            return np.zeros((0, 4)) if kind == "boxes" else np.zeros(shape, np.uint8)
        found = read_label(kind, path, shape)
        return found * np.float32(self.unit) if kind == "depth" else found

    def _content(self, part: Part) -> str:
        """Return a hash of the files that a picture in weather depends on."""
        views = self._views(part)
        files = [self.source / view for view in views]
        kinds = [kind for kind in self.swaps if kind in (*ALWAYS, NEEDS.get(part.plane))]
        labels = [self.path_of_label(kind, view) for kind in kinds for view in views]
        files += [label for label in labels if label is not None]
        first, *more = [self.hashes[file] for file in files]
        if part.plane == "occlusion" and self.boxes is not None:
            more += [repr(self.boxes.get(view)) for view in views]
        return sha256("".join([first, *more]).encode()).hexdigest() if more else first

    def _record(self, part: Part) -> dict[str, Any]:
        how = {"seed": self.seed, "focal": self.layout.focal, **self.more}
        weather = weather_of(part.kind, part.level, self.profile, **how)
        return dict(weather.record(index=self._number(part)))

    def _number(self, part: Part) -> int:
        """Return the number of a weather: a hash of a name, not of a place in a list."""
        own = f"{self.known[part.name].weather}\0{part.kind}\0{part.level}"
        return int.from_bytes(sha256(own.encode()).digest()[:8], "little") >> 1

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_last": (None, {})}


def _plain(values: Array) -> list[Any]:
    """Return numbers as JSON has them: what is not known is null."""
    known = np.isfinite(values)
    found: list[Any] = np.where(known, np.asarray(values, object), None).tolist()  # type: ignore[call-overload]
    return found
