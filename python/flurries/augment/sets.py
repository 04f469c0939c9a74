"""The files of a data set in weather: how each is read, what falls before it, how it is written."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flurries import augment
from flurries._contract import Array
from flurries.augment.calibration import Profile
from flurries.augment.layouts import Member, kept_name
from flurries.augment.weather import Weather
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
# Planes that tell the truth about a picture's weather, as fields of `Weathered`.
TRUTH = {
    "alpha": "alpha", "depth": "depth", "disparity": "weather_disparity", "motion": "motion",
}  # fmt: skip
COPY = "copy"
_DEPTHS = (".exr", ".tif", ".tiff", ".png", ".npy")
# The orientation that undoes another.
_UNDONE = {6: 8, 8: 6}


def weather_of(kind: str, severity: int, profile: Profile, **more: Any) -> Weather:
    weather: Weather = getattr(augment, WEATHERS[kind])(severity=severity, profile=profile, **more)
    return weather


def strength_of(kind: str, severity: int, profile: Profile) -> str:
    """Return how strong a weather is, in words."""
    return str(weather_of(kind, severity, profile).strength()[0])


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
        suffix = ".png" if self.plane == "alpha" else ".exr"
        return base / f"{self.level}-{self.plane}" / Path(self.name).with_suffix(suffix)


class Stored(NamedTuple):
    """A picture with what must stay as it was stored."""

    picture: Picture
    orientation: int
    grey: bool
    slate: Slate
    cover: Array | None  # The alpha that the colors are premultiplied with.

    @classmethod
    def of(cls, path: Path) -> Stored:
        with opened_picture(path, None) as opened:
            orientation, grey = opened.orientation, len(opened.color) == 1
        said, picture = read_slate(path), read_picture(path)
        turned = () if orientation == 1 else (("Orientation", "int", orientation),)
        slate = replace(said, attributes=said.attributes + turned, origin=(0, 0), display=None,
                        crop=None)  # fmt: skip
        alpha = picture.alpha if picture.premultiplied else None
        cover = None if alpha is None else alpha[..., None].astype(picture.pixels.dtype)
        return cls(picture, orientation, grey, slate, cover)

    @property
    def display(self) -> Any:
        """The picture as weather is mixed with it: straight colors, display values."""
        pixels, cover = self.picture.pixels, self.cover
        if cover is not None:
            # Weather falls on the color; how much of it shows stays as it was.
            pixels = np.divide(pixels, cover, out=np.zeros_like(pixels), where=cover > 0.0)
        pixels = pixels[..., :1] if self.grey else pixels
        # What is brighter than white stays so.
        return linear_to_srgb(pixels) if self.picture.encoding == "linear" else pixels

    def turned(self, plane: Array) -> Array:
        """Return a plane of the picture as seen, as the file's rows and columns have it."""
        back = _UNDONE.get(self.orientation, self.orientation)
        return np.ascontiguousarray(upright(plane, back))

    def write(self, path: Path, pixels: Array, header: dict[str, Any]) -> None:
        """Write a picture in weather as this one is stored."""
        alpha, encoding = self.picture.alpha, self.picture.encoding
        pixels = srgb_to_linear(pixels) if encoding == "linear" else pixels
        pixels = pixels if self.cover is None else pixels * self.cover
        write_picture(
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
    motion: bool  # Whether a plane is wanted that takes longer.
    fps: float
    focal: float  # Widths of the picture.
    distance: float  # Of both eyes, metres.
    swap: tuple[str, str] | None  # A text in a picture's path, and that in its depth's.
    unit: float  # Of depths, metres.
    tolerant: bool = True
    _hashes: Hashes = field(default_factory=Hashes)
    # The pictures made last, as read and in weather, and what they are.
    _last: tuple[Any, dict[str, Any]] = (None, {})

    def path_of(self, index: int) -> Path:
        return self.folder / self.parts[index].path

    def mark_of(self, index: int) -> Mark:
        part = self.parts[index]
        if part.plane == COPY:
            return Mark(COPY, 0, self._hashes[self.source / part.name])
        scale = "" if self.profile == "natural" else f"-{self.profile}"
        camera = f"{self.fps:g} {self.focal:g} {self.distance:g} {self.unit:g}"
        scene = f"{part.kind}-{part.level}-{self.seed}{scale}-{part.plane} {camera}"
        return Mark(scene, self._number(part), self._content(part))

    def make(self, index: int, numbers: Iterable[int]) -> Any:
        """Return what is written: a picture as read and in weather, or the file that is copied."""
        part = self.parts[index]
        if part.plane == COPY:
            return self.source / part.name
        key = self._views(part), part.kind, part.level, self._content(part)
        if self._last[0] != key:
            self._last = key, self._made(part)
        return (part.plane, *self._last[1][part.name])

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        if isinstance(made, Path):
            with replacing(path) as temporary:
                shutil.copyfile(made, temporary)
            return
        plane, stored, seen = made
        if not plane:
            return stored.write(path, seen.image, header)  # type: ignore[no-any-return]
        values = getattr(seen, TRUTH[plane])
        if values is None:
            wanted = "a depth" if plane == "depth" else "a stereo pair"
            raise ValueError(f"its {plane} is not known: that takes {wanted}")
        values = stored.turned(values)
        if plane == "alpha":
            write_picture(path, np.rint(values * 65535.0).astype(np.uint16), metadata=header)
        else:
            write_layers(path, {plane: values}, half=False, metadata=header)

    def notes(self, index: int, made: Any) -> dict[str, Any]:
        part = self.parts[index]
        notes: dict[str, Any] = {"source": part.name}
        if part.plane == COPY:
            return notes
        notes |= {"plane": part.plane} if part.plane else {}
        notes |= {"weather": part.kind, "severity": part.level, "record": self._record(part)}
        notes["strength"] = strength_of(part.kind, part.level, self.profile)
        if not part.plane:
            # Of the pixels, whatever encodes them.
            image = made[2].image
            notes["pixels"] = hashlib.sha256(
                f"{image.shape}".encode() + image.tobytes()
            ).hexdigest()
        time = self.known[part.name].time
        return notes if time is None else {**notes, "time": time}

    def _made(self, part: Part) -> dict[str, Any]:
        """Return each picture of a part's views as it was read, and in its weather, by its name."""
        views, depths = self._views(part), None
        pair = len(views) > 1
        read = [Stored.of(self.source / view) for view in views]
        if self.swap is not None:
            depths = [self._read_depth(self._depth_of(view)) for view in views]
        seen = augment.replay(self._record(part)).apply(
            tuple(one.display for one in read) if pair else read[0].display,
            time=self.known[part.name].time, fps=self.fps, motion=self.motion,
            depth=depths if pair or depths is None else depths[0], distance=self.distance,
        )  # fmt: skip
        each = seen if pair else (seen,)
        return {view: (one, made) for view, one, made in zip(views, read, each, strict=True)}

    def _views(self, part: Part) -> tuple[str, ...]:
        """Return the pictures that are made together: both of a pair."""
        return self.known[part.name].eyes or (part.name,)

    def _depth_of(self, name: str) -> Path:
        assert self.swap is not None
        way = self.source / name.replace(*self.swap)
        for suffix in _DEPTHS:
            path = way.with_suffix(suffix)
            if path != self.source / name and path.is_file():
                return path
        raise FileNotFoundError(2, f"No depth {' '.join(_DEPTHS)} of {name} is there", str(way))

    def _read_depth(self, path: Path) -> Array:
        if path.suffix == ".npy":
            found: Array = np.load(path, allow_pickle=False)
        elif path.suffix == ".png":
            found = read_picture(path).pixels[..., 0]
        else:
            found = read_depth(path)
        return np.asarray(np.asarray(found, np.float32) * np.float32(self.unit))

    def _content(self, part: Part) -> str:
        """Return a hash of the files that a picture in weather depends on."""
        views = self._views(part)
        files = [self.source / view for view in views]
        files += [] if self.swap is None else map(self._depth_of, views)
        first, *more = [self._hashes[file] for file in files]
        return hashlib.sha256("".join([first, *more]).encode()).hexdigest() if more else first

    def _record(self, part: Part) -> dict[str, Any]:
        weather = weather_of(part.kind, part.level, self.profile, seed=self.seed, focal=self.focal)
        return dict(weather.record(index=self._number(part)))

    def _number(self, part: Part) -> int:
        """Return the number of a weather: a hash of a name, not of a place in a list."""
        own = f"{self.known[part.name].weather}\0{part.kind}\0{part.level}"
        return int.from_bytes(hashlib.sha256(own.encode()).digest()[:8], "little") >> 1

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_last": (None, {})}
