"""What a scene's frames depend on, as hashes: its own values, and the files that it reads."""

import bisect
import hashlib
import pickle
import socket
import time
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flurries import __version__
from flurries._threads import scope
from flurries.effects.kinds import OURS, kind_of
from flurries.effects.motion import STILL
from flurries.effects.notes import Where
from flurries.io import Pattern
from flurries.io.colorspace import config_hash
from flurries.io.files import hash_of
from flurries.io.oiio import openimageio
from flurries.motion.keys import Keys
from flurries.scene.depth import DepthMap
from flurries.scene.foreground import called, listed
from flurries.scene.numbered import Planes
from flurries.scene.scene import Scene, expect_scene
from flurries.scene.toml.writer import describe
from flurries.spectral import field as waves

__all__ = ["BITS", "fingerprint"]

# Frames that two versions of flurries make go together only where this number is the same: it is
# raised with every change that alters a bit of a frame, in a kernel or in a look.
BITS = 71

# A file that changed less than this before it was hashed, in nanoseconds, may change again and
# keep its time: clocks of file systems tick that slowly.
_TICK = 2_000_000_000

# What a frame sees of these, where they are keyed, is the value of its own time.
_NOW = {
    "effects": ("amount", "color", "emission", "haze", "opacity"),
    "lens": ("focus", "f_stop"),
    "light": ("snow", "sky", "ground"),
    "lights": ("place", "direction", "color", "power"),
}

# Of a camera it sees the way since frame 0 and what comes in the next frame; of the rest these
# effects ask no more than `_take_way` says.
_WAY = ("position", "velocity", "orientation", "focal")
_ON_THE_WAY = {"snow", "rain", "mist"}


def fingerprint(scene: Scene) -> str:
    """Return a hash of all that a scene's frames depend on, files' contents included."""
    digest = hashlib.sha256(Settings(scene, whole=True).common.encode())
    for name, spec in _specs(scene).items():
        digest.update("".join([name, *map(hash_of, _files(spec))]).encode())
    return digest.hexdigest()[:16]


class Settings:
    """Hashes of all that a scene's frames depend on but the files that the scene reads."""

    # Of keys a frame sees those up to the first that it has not come to: who changes a later one
    # changes no bit of it.

    def __init__(self, scene: Scene, *, whole: bool = False) -> None:
        digest, given = hashlib.sha256(), list(_specs(expect_scene(scene)))
        for name, value in _values(scene).items():
            value = value.source if isinstance(value, DepthMap) else value
            if isinstance(value, np.ndarray):
                digest.update(f"{name} {value.shape} {value.dtype}".encode())
                digest.update(np.ascontiguousarray(value).tobytes())
                given.append(name)
        kinds = [kind_of(effect) for effect in scene.effects]
        for place, effect in enumerate(scene.effects):
            picked = [getattr(effect, name, None) for name in ("where", "holdout")]
            for where in [one for one in picked if isinstance(one, Where)]:
                # What a text does not hold: what is in its files, or what it is over the picture.
                files = _files(where.source) if isinstance(where.source, str) else []
                digest.update("".join(map(hash_of, files)).encode())
                digest.update(b"" if files else where.shares(scene._shape, 0.0).tobytes())
            if kinds[place] is None:
                # Somebody's own, which no scene file can hold but frames can be made of. Its
                # fields: an effect may keep what it made of them.
                bare = not is_dataclass(effect)
                own = effect if bare else [getattr(effect, f.name) for f in fields(effect)]
                digest.update(f"effect {place}".encode() + pickle.dumps((type(effect), own), 5))
        table = describe(scene, leave_out=(*given, "effects", "output"))
        # Times of keys, hashes of the keys up to each, and how many frames ahead a frame looks.
        self._courses: list[tuple[list[float], list[str], float | None]] = []
        if not whole and scene.loop is None:
            self._take_values(table)
            if _ON_THE_WAY.issuperset(kinds):
                self._take_way(scene, table)
        digest.update(repr((sorted(given), sorted(table.items()))).encode())
        self.common = digest.hexdigest()[:16]  # A hash of what is the same for all frames.

    def of(self, number: int) -> str:
        """Return what `common` lacks for a frame; empty where that is all."""
        seen = []
        for times, hashes, after in self._courses:
            if after is None:
                end = bisect.bisect_left(times, number)
            else:
                end = bisect.bisect_right(times, max(number, 0) + after)
            seen.append(hashes[min(end, len(hashes) - 1)])
        return f"+{short_hash(seen)}" if seen else ""

    def _take_values(self, table: dict[str, Any]) -> None:
        for name, known in _NOW.items():
            found = table.get(name, [])
            for part in [found] if isinstance(found, dict) else found if found != "none" else []:
                keyed = {key for key, value in part.items() if isinstance(value, dict)}
                # Densities and sizes, where keyed, are made to one course with the amount.
                if part.get("kind", "snow") in OURS and keyed.issubset(known):
                    for key in keyed:
                        self._take(part, key, part[key]["keys"])

    def _take_way(self, scene: Scene, table: dict[str, Any]) -> None:
        path, way = scene._path, table["camera"]
        # What frames depend on of a camera's way after them.
        comes = path.goes_along(path.camera.matrix()[:, 2])
        bends = len(path.course(1.0).knots) > 0
        lengths = path.widest.focal, path.longest_focal
        table["way"] = path.turns, path.zooms, *lengths, comes, bends
        shutters = [getattr(effect, "shutter", None) or 1.0 for effect in scene.effects]
        longest = [max(v for _, v in s.keys) if isinstance(s, Keys) else s for s in shutters]
        after = max([scene.fps * STILL, *longest])
        for name in _WAY:
            value = way.get(name)
            if isinstance(value, dict):
                self._take(way, name, value["keys"], after)
            elif isinstance(value, list) and name != "velocity":
                self._take(way, name, list(enumerate(value)), after)

    def _take(
        self, table: dict[str, Any], name: str, keys: list[Any], after: float | None = None
    ) -> None:
        digest, hashes = hashlib.sha256(), []
        for key in keys:
            digest.update(repr(key).encode())
            hashes.append(digest.hexdigest())
        self._courses.append(([time for time, _ in keys], hashes, after))
        table[name] = type(table[name]).__name__


def short_hash(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()[:16]


def terms_of(plain: bool) -> tuple[tuple[str, str], ...]:
    """Return what the bits of files depend on, beside what travels with a task, in a mode."""
    with scope(threads=None, reproducible=plain):
        wave = waves((64, 64), drift=(1.3, 0.7), seed=1).tobytes()
    return (
        ("flurries", f"{__version__} (bits {BITS})"),
        ("NumPy", np.__version__),
        ("OpenImageIO", openimageio().VERSION_STRING),
        ("vector instructions", hashlib.sha256(wave).hexdigest()[:8]),
        ("$OCIO", config_hash()[:8]),
    )


@dataclass
class Hashes:
    """Hashes of files, found again only where a file has changed since."""

    # Size, time of change and place on the disk say whether it has; a file that changed just before
    # it was hashed is hashed again.

    _known: dict[Path, tuple[tuple[int, ...], str]] = field(default_factory=dict)

    def __getitem__(self, path: Path) -> str:
        now = time.time_ns()
        found = path.stat()
        key = (found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino)
        known = self._known.get(path)
        if known is not None and known[0] == key:
            return known[1]
        told = hash_of(path)
        if now - max(found.st_mtime_ns, found.st_ctime_ns) > _TICK:
            self._known[path] = key, told
        return told


class Inputs:
    """The files that a scene's frames are made of."""

    # What serves all frames, a still or a film, is hashed once, and must stay as it is until the
    # last frame is made, on whatever machine. Of a sequence each frame has its own file.

    def __init__(self, scene: Scene) -> None:
        self._hashes = Hashes()
        self._sequences: list[Planes] = []
        self._stills: dict[Path, str] = {}
        for name, spec in _specs(scene).items():
            planes = scene._files[name]
            # A frame of a background that holds may be that of any file.
            if Path(spec).is_file() or getattr(planes.source, "damaged", "stop") == "hold":
                self._stills.update((file, self._told(file)) for file in _files(spec))
            else:
                self._sequences.append(planes)

    def of(self, number: int) -> str:
        """Return a hash of a frame's inputs; OSError if a file that serves all has changed."""
        for file, before in self._stills.items():
            now = self._told(file)
            if now == "missing":
                raise FileNotFoundError(2, f"Is not on {socket.gethostname()}", str(file))
            if now != before:
                raise OSError(
                    f"{file} changed while frames were made of it; run again with overwrite=True "
                    "(--overwrite)"
                )
        told = [*self._stills.values()]
        told += [self._told(planes.file(number)) for planes in self._sequences]
        return short_hash(told) if told else ""

    def _told(self, file: Path) -> str:
        return self._hashes[file] if file.exists() else "missing"


def _values(scene: Scene) -> dict[str, Any]:
    """Return the values that may be files or arrays, by their names in `Scene.files`."""
    found = {"background": scene.background, "depth": scene.depth}
    mattes = [] if scene.foreground is None else listed(scene.foreground)
    for number, matte in enumerate(mattes, 1):
        name = called(number)
        found |= {name: matte.source, f"{name} depth": matte.depth}
    return found


def _specs(scene: Scene) -> dict[str, str]:
    found = {name: planes.spec for name, planes in scene._files.items()}
    return {name: str(Path(spec).absolute()) for name, spec in found.items() if spec is not None}


def _files(spec: str) -> list[Path]:
    if Path(spec).is_file():
        return [Path(spec)]
    pattern = Pattern(spec)
    return [pattern.path(number) for number in pattern.existing()]
