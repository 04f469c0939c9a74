"""The files of a data set in weather: how each is read, what falls before it, how it is written."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from flurries import augment
from flurries._contract import Array
from flurries.augment.calibration import Profile
from flurries.augment.layouts import Member, kept_name
from flurries.augment.weather import replay
from flurries.io import (
    Picture,
    Slate,
    linear_to_srgb,
    read_depth,
    read_picture,
    read_slate,
    replacing,
    srgb_to_linear,
    write_layers,
    write_picture,
)  # fmt: skip
from flurries.io.pictures.header import opened_picture, upright
from flurries.output.journal import Mark
from flurries.output.sequence import Job
from flurries.scene.fingerprint import Hashes

WEATHERS = {"snow": "Snowfall", "rain": "Rainfall", "fog": "Fog"}
# Planes that tell the truth about a picture's weather: fields of `Weathered`, and their formats.
TRUTH = {
    "alpha": ("alpha", ".png"),
    "depth": ("depth", ".exr"),
    "disparity": ("weather_disparity", ".exr"),
    "motion": ("motion", ".exr"),
}
COPY = "copy"
_DEPTHS = (".exr", ".tif", ".tiff", ".png", ".npy")
# The orientation that undoes another.
_UNDONE = {6: 8, 8: 6}


def strength_of(kind: str, severity: int, profile: Profile) -> str:
    """Return how strong a weather is, in words."""
    weather = getattr(augment, WEATHERS[kind])(severity=severity, profile=profile)
    return str(weather.strength()[0])


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
        if self.plane == COPY:
            return Path(self.kind) / str(self.level) / self.name
        name, folder = Path(kept_name(self.name)), f"{self.level}-{self.plane}".rstrip("-")
        if self.plane:
            name = name.with_suffix(TRUTH[self.plane][1])
        return Path(self.kind, folder, name)


@dataclass(frozen=True)
class Members:
    """The pictures of a set by their names, and what cameras took them."""

    folder: Path
    known: dict[str, Member]
    fps: float
    focal: float
    distance: float
    swap: tuple[str, str] | None
    unit: float

    def views(self, name: str) -> tuple[str, ...]:
        """Return the pictures that are made together with one: both of a pair."""
        return self.known[name].eyes or (name,)

    def files(self, name: str) -> list[Path]:
        """Return the files that a picture in weather depends on."""
        views = self.views(name)
        found = [self.folder / view for view in views]
        return found if self.swap is None else found + [self._depth_of(view) for view in views]

    def said(self) -> str:
        """Return what else it depends on."""
        return f"{self.fps:g} {self.focal:g} {self.distance:g} {self.unit:g}"

    def weathered(self, name: str, record: dict[str, Any], *, motion: bool) -> dict[str, Any]:
        """Return each picture as it was read, and in its weather, by its name."""
        member, views = self.known[name], self.views(name)
        read = [_Read.of(self.folder / view) for view in views]
        depths = None
        if self.swap is not None:
            depths = [self._read_depth(self._depth_of(view)) for view in views]
        pair = len(views) > 1
        seen = replay(record).apply(
            tuple(one.display for one in read) if pair else read[0].display, time=member.time,
            fps=self.fps, depth=depths if pair or depths is None else depths[0], motion=motion,
            distance=self.distance,
        )  # fmt: skip
        each = seen if pair else (seen,)
        return {view: (one, made) for view, one, made in zip(views, read, each, strict=True)}

    def _depth_of(self, name: str) -> Path:
        assert self.swap is not None
        way = self.folder / name.replace(*self.swap)
        for suffix in _DEPTHS:
            path = way.with_suffix(suffix)
            if path != self.folder / name and path.is_file():
                return path
        raise FileNotFoundError(2, f"No depth {' '.join(_DEPTHS)} of {name} is there", str(way))

    def _read_depth(self, path: Path) -> Array:
        if path.suffix == ".npy":
            found: Array = np.load(path, allow_pickle=False)
        elif path.suffix == ".png":
            found = read_picture(path).pixels[..., 0]
        else:
            found = read_depth(path)
        far: Array = np.asarray(found, np.float32) * np.float32(self.unit)
        return far


@dataclass(frozen=True)
class _Read:
    """A picture with what must stay as it was stored."""

    picture: Picture
    orientation: int
    grey: bool
    slate: Slate

    @classmethod
    def of(cls, path: Path) -> _Read:
        with opened_picture(path, None) as opened:
            orientation, grey = opened.orientation, len(opened.color) == 1
        said = read_slate(path)
        turned = () if orientation == 1 else (("Orientation", "int", orientation),)
        slate = replace(said, attributes=said.attributes + turned, origin=(0, 0), display=None,
                        crop=None)  # fmt: skip
        return cls(read_picture(path), orientation, grey, slate)

    @property
    def display(self) -> Any:
        """The picture as weather is mixed with it: straight colors, display values."""
        pixels, cover = self.picture.pixels, self._cover
        if cover is not None:
            # Weather falls on the color; how much of it shows stays as it was.
            pixels = np.divide(pixels, cover, out=np.zeros_like(pixels), where=cover > 0.0)
        pixels = pixels[..., :1] if self.grey else pixels
        if self.picture.encoding == "linear":
            # What is brighter than white stays so.
            pixels = linear_to_srgb(pixels)
        return pixels

    @property
    def _cover(self) -> Array | None:
        alpha = self.picture.alpha if self.picture.premultiplied else None
        return None if alpha is None else alpha[..., None].astype(self.picture.pixels.dtype)

    def stored(self, plane: Array) -> Array:
        """Return a plane of the picture as seen, as the file's rows and columns have it."""
        turned = upright(plane, _UNDONE.get(self.orientation, self.orientation))
        return np.ascontiguousarray(turned)

    def write(self, path: Path, pixels: Array, header: dict[str, Any]) -> None:
        """Write a picture in weather as this one is stored."""
        alpha = self.picture.alpha
        if self.picture.encoding == "linear":
            pixels = srgb_to_linear(pixels)
        pixels = pixels if self._cover is None else pixels * self._cover
        write_picture(
            path, self.stored(pixels), alpha=None if alpha is None else self.stored(alpha),
            encoding=self.picture.encoding, metadata=header, slate=self.slate,
            premultiplied=None if alpha is None else self.picture.premultiplied,
        )  # fmt: skip


@dataclass
class Pictures(Job):
    """All files that are made of a set."""

    folder: Path
    members: Members
    parts: list[Part]
    seed: int
    profile: Profile = "natural"
    overwrite: bool = False
    motion: bool = False
    tolerant: bool = True
    _hashes: Hashes = field(default_factory=Hashes)
    _last: tuple[Any, dict[str, Any]] = (None, {})

    def path_of(self, index: int) -> Path:
        return self.folder / self.parts[index].path

    def mark_of(self, index: int) -> Mark:
        part = self.parts[index]
        if part.plane == COPY:
            return Mark(COPY, 0, self._hashes[self.members.folder / part.name])
        scale = "" if self.profile == "natural" else f"-{self.profile}"
        scene = f"{part.kind}-{part.level}-{self.seed}{scale}-{part.plane} {self.members.said()}"
        return Mark(scene, self._number(part), self._content(part))

    def make(self, index: int, numbers: Iterable[int]) -> Any:
        """Return what is written: a picture as read and in weather, or the file that is copied."""
        part = self.parts[index]
        if part.plane == COPY:
            return self.members.folder / part.name
        key = self.members.views(part.name), part.kind, part.level, self._content(part)
        if self._last[0] != key:
            made = self.members.weathered(part.name, self._record(part), motion=self.motion)
            self._last = key, made
        return (part.plane, *self._last[1][part.name])

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        if isinstance(made, Path):
            with replacing(path) as temporary:
                shutil.copyfile(made, temporary)
            return
        plane, read, seen = made
        if not plane:
            read.write(path, seen.image, header)
            return
        values = getattr(seen, TRUTH[plane][0])
        if values is None:
            wanted = "a depth" if plane == "depth" else "a stereo pair"
            raise ValueError(f"its {plane} is not known: that takes {wanted}")
        values = read.stored(values)
        if plane == "alpha":
            write_picture(path, np.rint(values * 65535.0).astype(np.uint16), metadata=header)
        else:
            write_layers(path, {plane: values}, half=False, metadata=header)

    def notes(self, index: int, made: Any) -> dict[str, Any]:
        part = self.parts[index]
        if part.plane == COPY:
            return {"source": part.name}
        record = self._record(part)
        more: dict[str, Any] = {"plane": part.plane} if part.plane else {}
        more |= {"weather": part.kind, "severity": part.level, "record": record}
        more["strength"] = strength_of(part.kind, part.level, self.profile)
        time = self.members.known[part.name].time
        return {"source": part.name, **more, **({} if time is None else {"time": time})}

    def _content(self, part: Part) -> str:
        files = [self._hashes[file] for file in self.members.files(part.name)]
        return files[0] if len(files) == 1 else hashlib.sha256("".join(files).encode()).hexdigest()

    def _record(self, part: Part) -> dict[str, Any]:
        weather = getattr(augment, WEATHERS[part.kind])
        drawn = weather(severity=part.level, seed=self.seed, profile=self.profile,
                        focal=self.members.focal)  # fmt: skip
        return dict(drawn.record(index=self._number(part)))

    def _number(self, part: Part) -> int:
        """Return the number of a weather: a hash of a name, not of a place in a list."""
        own = f"{self.members.known[part.name].weather}\0{part.kind}\0{part.level}"
        return int.from_bytes(hashlib.sha256(own.encode()).digest()[:8], "little") >> 1

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_last": (None, {})}
