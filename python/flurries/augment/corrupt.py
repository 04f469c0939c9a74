"""Whole folders of pictures in weather: parallel, resumable; a picture's weather is of its name."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from flurries import augment
from flurries._contract import choice, flag, integer, seed_of
from flurries.augment.calibration import PROFILES, Profile
from flurries.augment.weather import replay
from flurries.io import linear_to_srgb, read_picture, srgb_to_linear, write_picture
from flurries.output.cluster import cluster
from flurries.output.crew import make, processes
from flurries.output.folder import Store
from flurries.output.journal import NAME, Mark
from flurries.output.sequence import Job, run
from flurries.scene.fingerprint import Hashes

__all__ = ["Corrupted", "corrupt"]

WEATHERS = {"snow": "Snowfall", "rain": "Rainfall", "fog": "Fog"}
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr")
# These are read, and written as PNG.
READ = (".webp", ".bmp", ".gif")
# Most pictures of one task: their work is to be long against a task's own cost.
_CHUNK = 8


@dataclass(frozen=True)
class Corrupted:
    """The pictures that were made.

    Attributes
    ----------
    written, kept : list of Path
        Made now; and there already.
    failed : dict of str to str
        Pictures that could not be read or written, and why.
    skipped : dict of str to int
        How many files are no pictures to be read, and why.
    journal : Path
        ``flurries.jsonl``: of each file its source, weather, severity, record and hash.
    """

    written: list[Path]
    kept: list[Path]
    failed: dict[str, str]
    skipped: dict[str, int]
    journal: Path


def corrupt(
    folder: str | os.PathLike[str], out: str | os.PathLike[str], *,
    weather: str | Sequence[str] = "snow", severity: int | str | Sequence[int] = (1, 2, 3, 4, 5),
    profile: Profile = "natural", seed: int = 0, workers: int | None = None,
    dask: str | None = None, overwrite: bool = False,
    progress: Callable[[Iterable[Any]], Iterable[Any]] | None = None,
) -> Corrupted:  # fmt: skip
    """Write every picture of a folder in weather.

    Parameters
    ----------
    folder : path
        Pictures in it and in folders below: .png, .jpg, .tif, .exr, .webp, .bmp, .gif. Symbolic
        links, pictures that move, palettes in PNG and planes of 16 bits or floats are left out.
    out : path
        Where to write; not inside `folder`. Names and formats stay, so that labels by file name
        hold; JPEG is written with quality 95, and WebP, BMP and GIF as PNG: ``a.webp`` is
        ``a.png`` then, and left out where the folder has another of that name.
    weather : {"snow", "rain", "fog"} or several
    severity : int, "1-5", "2,4" or several
        See :func:`flurries.augment.contrast_loss`.
    profile : {"natural", "hard"}
        See :class:`flurries.augment.Snowfall`.
    seed : int
    workers : int, optional
        Processes; as many as there are cores if not given. 1 works in this one.
    dask : str, optional
        Address of a Dask scheduler in place of own processes; "" starts a cluster here.
    overwrite : bool
        Replace what is there, whatever it is.
    progress : callable, optional
        Wraps the tasks, as tqdm does.

    Returns
    -------
    Corrupted
    """
    source, target = Path(folder), Path(out)
    if not source.is_dir():
        raise NotADirectoryError(20, "Is not a folder", str(source))
    if target.resolve().is_relative_to(source.resolve()):
        raise ValueError(f"out must not be inside {source}, got {target}")
    kinds = tuple(
        choice("weather", kind, tuple(WEATHERS))
        for kind in ([weather] if isinstance(weather, str) else weather)
    )
    levels = _levels(severity)
    scale = choice("profile", profile, PROFILES)
    start = seed_of(seed)
    again = flag("overwrite", overwrite)
    count = os.cpu_count() or 1 if workers is None else integer("workers", workers, low=1, high=256)
    if not (dask is None or isinstance(dask, str)):
        raise TypeError(
            f"dask must be an address, '' for a cluster here, or None, got {dask!r:.60}"
        )
    names, skipped = _names(source)
    if not names:
        raise ValueError(f"{source}: no pictures ({', '.join(SUFFIXES + READ)})")
    parts = [(name, kind, level) for name in names for kind in kinds for level in levels]
    job = _Pictures(source.absolute(), target.absolute(), parts, start, scale, overwrite=again)
    # All of them now: a worker may have a folder to itself no more than another.
    target.mkdir(exist_ok=True)
    for part in parts:
        (target / _path(part)).parent.mkdir(parents=True, exist_ok=True)
    each = len(kinds) * len(levels)
    size = each * max(min(_CHUNK, len(names) // (4 * count)), 1)
    wanted = list(range(len(parts)))
    groups = [wanted[first : first + size] for first in range(0, len(wanted), size)]
    bar = progress or iter
    if dask is None and (count == 1 or len(groups) == 1):
        done = run(job, wanted, bar)
    else:
        crew_of = processes(job, count) if dask is None else cluster(job, dask, count=count)
        with crew_of as crew:
            done = run(job, wanted, bar, partial(make, crew, groups))
    failed = {names[index // each]: why for index, why in done.failed.items()}
    files = [target / _path(part) for part in parts]
    return Corrupted(
        sorted(files[index] for index in done.written), sorted(files[index] for index in done.kept),
        failed, skipped, target / NAME,
    )  # fmt: skip


def _levels(severity: int | str | Sequence[int]) -> tuple[int, ...]:
    if isinstance(severity, str):
        several: Sequence[int] = [level for part in severity.split(",") for level in _range(part)]
    else:
        several = severity if isinstance(severity, (list, tuple, range)) else [severity]  # type: ignore[list-item]
    levels = tuple(dict.fromkeys(integer("severity", s, low=1, high=5) for s in several))
    if not levels:
        raise ValueError(f"severity must name at least one level, got {severity!r}")
    return levels


def _range(part: str) -> range:
    first, _, last = part.strip().partition("-")
    if not first.isdigit() or not (last or first).isdigit():
        raise ValueError(f"severity must be such as 3, '1-5' or '2,4', got {part!r}")
    return range(int(first), int(last or first) + 1)


def _names(folder: Path) -> tuple[list[str], dict[str, int]]:
    """Return the pictures below a folder, by their ways from it, sorted; and what is skipped."""
    found: list[str] = []
    skipped: Counter[str] = Counter()
    for here, folders, files in os.walk(folder):
        folders[:] = [f for f in folders if not f.startswith(".")]
        for file in files:
            path = Path(here) / file
            if file.startswith("."):
                skipped["hidden"] += 1
            elif path.suffix.lower() not in SUFFIXES + READ:
                skipped[f"{path.suffix.lower() or 'no suffix'} is not read"] += 1
            elif path.is_symlink():
                skipped["a symbolic link"] += 1
            elif why := _no_picture(path):
                skipped[f"{path.suffix.lower()} {why}"] += 1
            else:
                found.append(path.relative_to(folder).as_posix())
    names: dict[str, str] = {}
    # What keeps its format goes first.
    for name in sorted(found, key=lambda name: (Path(name).suffix.lower() in READ, name)):
        if names.setdefault(_kept(name), name) != name:
            skipped["another picture has its name"] += 1
    return sorted(names.values()), dict(sorted(skipped.items()))


def _no_picture(path: Path) -> str:
    """Return why a file gets no weather; nothing where it does, or fails when it is read."""
    from PIL import Image

    with suppress(OSError, ValueError, Image.DecompressionBombError), Image.open(path) as opened:
        mode = opened.mode.partition(";")[0]
        if path.suffix.lower() in READ and getattr(opened, "n_frames", 1) > 1:
            return "that moves: render it as a film"
        if mode in ("1", "I", "F") or (mode == "P" and opened.format == "PNG"):
            return "of numbers, such as a mask or a depth"
    return ""


def _kept(name: str) -> str:
    """Return the name that a picture is written under."""
    path = Path(name)
    return (path.with_suffix(".png") if path.suffix.lower() in READ else path).as_posix()


@dataclass
class _Pictures(Job):
    """Pictures, each in all its weathers after each other."""

    source: Path
    folder: Path
    parts: list[tuple[str, str, int]]
    seed: int
    profile: str = "natural"
    overwrite: bool = False
    tolerant: bool = True
    store: Store = field(default_factory=Store)
    _hashes: Hashes = field(default_factory=Hashes)
    _last: tuple[str, str, Any] = ("", "", None)

    def path_of(self, index: int) -> Path:
        """Return the path that a picture is written to."""
        return self.folder / _path(self.parts[index])

    def mark_of(self, index: int) -> Mark:
        """Return the mark that a picture must bear."""
        name, kind, level = self.parts[index]
        content = self._hashes[self.source / name]
        scale = "" if self.profile == "natural" else f"-{self.profile}"
        return Mark(f"{kind}-{level}-{self.seed}{scale}", _index(name, kind, level), content)

    def make(self, index: int) -> Any:
        """Return a picture in its weather."""
        picture, drawn = self._read(self.parts[index][0]), replay(self._record(index))
        pixels, cover = picture.pixels, None
        if picture.alpha is not None and picture.premultiplied:
            # Weather falls on the color; how much of it shows stays as it was.
            cover = picture.alpha[..., None].astype(pixels.dtype)
            pixels = np.divide(pixels, cover, out=np.zeros_like(pixels), where=cover > 0.0)
        if picture.encoding == "linear":
            # Weather is mixed in display values; what is brighter than white stays so.
            pixels = srgb_to_linear(drawn(linear_to_srgb(pixels)))
        else:
            pixels = drawn(pixels)
        return picture, pixels if cover is None else pixels * cover

    def _read(self, name: str) -> Any:
        content = self._hashes[self.source / name]
        if self._last[:2] != (name, content):
            self._last = name, content, read_picture(self.source / name)
        return self._last[2]

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        """Write a picture as its source is."""
        picture, pixels = made
        write_picture(
            path, pixels, alpha=picture.alpha, encoding=picture.encoding, metadata=header,
            premultiplied=None if picture.alpha is None else picture.premultiplied,
        )  # fmt: skip

    def notes(self, index: int) -> dict[str, Any]:
        """Return the journal's notes of a picture."""
        name, kind, level = self.parts[index]
        record = self._record(index)
        return {"source": name, "weather": kind, "severity": level, "record": record}

    def _record(self, index: int) -> dict[str, Any]:
        name, kind, level = self.parts[index]
        weather = getattr(augment, WEATHERS[kind])
        drawn = weather(severity=level, seed=self.seed, profile=self.profile)
        return dict(drawn.record(index=_index(name, kind, level)))

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_last": ("", "", None)}


def _path(part: tuple[str, str, int]) -> str:
    """Return a picture's path from the folder of the set."""
    name, kind, level = part
    return (Path(kind) / str(level) / _kept(name)).as_posix()


def _index(name: str, kind: str, level: int) -> int:
    """Return the number of a picture's weather: a hash of its name, not of its place in a list."""
    digest = hashlib.sha256(f"{name}\0{kind}\0{level}".encode()).digest()
    return int.from_bytes(digest[:8], "little") >> 1
