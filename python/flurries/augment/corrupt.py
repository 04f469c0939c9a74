"""Whole folders of pictures in weather: parallel, resumable, with a manifest.

``OUT/snow/3/a/b.png`` is the picture ``a/b.png`` in snow of severity 3. A picture's weather comes
from the seed and its own name, so that it is the same whatever else is in the folder, however many
workers there are, and in whatever order they work. Each file appears whole or not at all; what is
there already, and was made of the same bytes in the same way, stays.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flurries._contract import choice, flag, integer, seed_of

__all__ = ["Corrupted", "corrupt"]

WEATHERS = {"snow": "Snowfall", "rain": "Rainfall", "fog": "Fog"}
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr")
MANIFEST = "manifest.json"

# What a run has made so far, a line a picture: a run that was killed is gone on from it.
JOURNAL = ".manifest.jsonl"

# What makes a picture anew although the seed is the same: raised when the weather itself changes.
EDITION = 1

# Most pictures of one task: their work is to be long against a task's own cost.
_CHUNK = 8


@dataclass(frozen=True)
class Corrupted:
    """What was made.

    Attributes
    ----------
    written, kept : list of Path
        Made now; and there already.
    failed : dict of str to str
        Pictures that could not be read or written, and why.
    manifest : Path
        JSON: the seed, and of each file its source, weather, severity, record and hash.
    """

    written: list[Path]
    kept: list[Path]
    failed: dict[str, str]
    manifest: Path


@dataclass(frozen=True)
class _Job:
    """One picture in all its weathers."""

    source: str
    name: str
    out: str
    weathers: tuple[str, ...]
    severities: tuple[int, ...]
    seed: int
    overwrite: bool
    known: dict[str, Any]


def corrupt(
    folder: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    weather: str | Sequence[str] = "snow",
    severity: int | str | Sequence[int] = (1, 2, 3, 4, 5),
    seed: int = 0,
    workers: int | None = None,
    dask: str | None = None,
    overwrite: bool = False,
    progress: Callable[[Iterable[Any]], Iterable[Any]] | None = None,
) -> Corrupted:
    """Write every picture of a folder in weather.

    Parameters
    ----------
    folder : path
        Pictures in it and in folders below: .png, .jpg, .tif, .exr. Symbolic links are not
        followed.
    out : path
        Where to write; not inside `folder`. Names and formats stay, so that labels by file name
        hold; JPEG is written with quality 95.
    weather : {"snow", "rain", "fog"} or several
    severity : int, "1-5" or several
        See :func:`flurries.augment.contrast_loss`.
    seed : int
    workers : int, optional
        Processes; as many as there are cores if not given. 1 works in this one.
    dask : str, optional
        Address of a Dask scheduler in place of own processes; "" starts a cluster here.
    overwrite : bool
        Make again what is there.
    progress : callable, optional
        Wraps the tasks, as tqdm does.

    Returns
    -------
    Corrupted

    Raises
    ------
    ValueError, TypeError
        For an argument that is not as described.
    OSError
        If the folder cannot be read or the manifest cannot be written. A picture that fails does
        not stop the others.
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
    start = seed_of(seed)
    again = flag("overwrite", overwrite)
    count = os.cpu_count() or 1 if workers is None else integer("workers", workers, low=1, high=256)
    if not (dask is None or isinstance(dask, str)):
        raise TypeError(
            f"dask must be an address, '' for a cluster here, or None, got {dask!r:.60}"
        )
    names = _names(source)
    if not names:
        raise ValueError(f"{source}: no pictures ({', '.join(SUFFIXES)})")
    target.mkdir(exist_ok=True)
    known = _manifest(target, start)
    of: dict[str, dict[str, Any]] = {name: {} for name in names}
    for path, entry in known.items():
        of.setdefault(entry["source"], {})[path] = entry
    jobs = [
        _Job(str(source / name), name, str(target), kinds, levels, start, again, of[name])
        for name in names
    ]
    _tidied(target)
    size = max(min(_CHUNK, len(jobs) // (4 * count)), 1)
    chunks = [jobs[i : i + size] for i in range(0, len(jobs), size)]
    answers = _Answers(chunks, count, dask)
    written: list[Path] = []
    kept: list[Path] = []
    failed: dict[str, str] = {}
    with (target / JOURNAL).open("a", encoding="utf-8") as journal:
        for answer in answers if progress is None else progress(answers):
            name, made, stayed, entries, error = answer
            written += [target / path for path in made]
            kept += [target / path for path in stayed]
            known.update(entries)
            if made:
                journal.write(json.dumps({"seed": start, "files": entries}) + "\n")
                journal.flush()
            if error is not None:
                failed[name] = error
    _save(target, start, known)
    (target / JOURNAL).unlink()
    return Corrupted(sorted(written), sorted(kept), failed, target / MANIFEST)


def _levels(severity: int | str | Sequence[int]) -> tuple[int, ...]:
    if isinstance(severity, str):
        first, _, last = severity.partition("-")
        if not first.isdigit() or not (last or first).isdigit():
            raise ValueError(f"severity must be such as 3 or '1-5', got {severity!r}")
        severity = range(int(first), int(last or first) + 1)
    several = severity if isinstance(severity, (list, tuple, range)) else [severity]
    levels = tuple(dict.fromkeys(integer("severity", s, low=1, high=5) for s in several))
    if not levels:
        raise ValueError(f"severity must name at least one level, got {severity!r}")
    return levels


def _names(folder: Path) -> list[str]:
    """Return the pictures below a folder, by their ways from it, sorted."""
    found = []
    for here, folders, files in os.walk(folder):
        folders[:] = [f for f in folders if not f.startswith(".")]
        for file in files:
            path = Path(here) / file
            hidden = file.startswith(".")
            if path.suffix.lower() in SUFFIXES and not hidden and not path.is_symlink():
                found.append(path.relative_to(folder).as_posix())
    return sorted(found)


def _manifest(folder: Path, seed: int) -> dict[str, Any]:
    """Return the entries of earlier runs; refuses those of another seed."""
    entries: dict[str, Any] = {}
    for path in (folder / MANIFEST, folder / JOURNAL):
        if not path.exists():
            continue
        text = path.read_text(encoding="utf-8")
        # Of a run that was killed the last line may be torn: it is made again.
        parts = [text] if path.name == MANIFEST else text.split("\n")[:-1]
        for part in parts:
            try:
                found = json.loads(part)
                theirs, files = found["seed"], dict(found["files"])
            except (ValueError, KeyError, TypeError):
                raise ValueError(
                    f"{path}: is no manifest of such a set; choose another folder"
                ) from None
            if theirs != seed:
                raise ValueError(
                    f"{path}: the set has the seed {theirs}, not {seed}; choose another folder"
                )
            entries.update(files)
    return {key: e for key, e in entries.items() if e.get("edition") == EDITION}


def _tidied(folder: Path) -> None:
    """Remove what a killed run left under temporary names."""
    from flurries.io import remove_leftovers

    for here, _, _ in os.walk(folder):
        remove_leftovers(here)


def _save(folder: Path, seed: int, entries: dict[str, Any]) -> None:
    from flurries import __version__
    from flurries.io import replacing

    whole = {"version": __version__, "seed": seed, "files": dict(sorted(entries.items()))}
    with replacing(folder / MANIFEST) as temporary:
        Path(temporary).write_text(json.dumps(whole, indent=1), encoding="utf-8")


class _Answers:
    """What became of each picture, as it is done, wherever the work is."""

    def __init__(self, chunks: list[list[_Job]], workers: int, dask: str | None) -> None:
        self._chunks, self._workers, self._dask = chunks, workers, dask

    def __len__(self) -> int:
        return sum(map(len, self._chunks))

    def __iter__(self) -> Iterator[Any]:
        if self._dask is not None:
            yield from self._by_dask(self._dask)
        elif self._workers == 1 or len(self._chunks) == 1:
            for chunk in self._chunks:
                yield from map(_one, chunk)
        else:
            yield from self._by_processes()

    def _by_processes(self) -> Iterator[Any]:
        import multiprocessing

        # Spawned, not forked: what the caller's threads hold is not carried along.
        with ProcessPoolExecutor(
            min(self._workers, len(self._chunks)),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_one_thread,
        ) as pool:
            for future in as_completed([pool.submit(_chunk, chunk) for chunk in self._chunks]):
                yield from future.result()

    def _by_dask(self, address: str) -> Iterator[Any]:
        import distributed

        dask: Any = distributed
        own = {"n_workers": self._workers, "threads_per_worker": 1, "dashboard_address": None}
        here: dict[str, Any] = {} if address else own
        with dask.Client(address or None, **here) as client:
            futures = client.map(_chunk, self._chunks, pure=False)
            for future in dask.as_completed(futures):
                yield from future.result()


def _one_thread() -> None:
    from flurries._threads import set_threads

    set_threads(1)


def _chunk(jobs: list[_Job]) -> list[Any]:
    return [_one(job) for job in jobs]


def _one(job: _Job) -> tuple[str, list[str], list[str], dict[str, Any], str | None]:
    """Write one picture in all its weathers: its name, files made and kept, entries, and error."""
    made: list[str] = []
    kept: list[str] = []
    entries: dict[str, Any] = {}
    from flurries.io import read_picture

    try:
        content = hashlib.sha256(Path(job.source).read_bytes()).hexdigest()
        picture: Any = None
        for kind in job.weathers:
            for level in job.severities:
                path = _path(job.name, kind, level)
                known = None if job.overwrite else job.known.get(path)
                if known and known["content"] == content and _is_whole(job.out, path, known):
                    kept.append(path)
                    entries[path] = known
                    continue
                picture = read_picture(job.source) if picture is None else picture
                entries[path] = _written(job, path, kind, level, picture, content)
                made.append(path)
    except (OSError, ValueError, TypeError, MemoryError) as error:
        return job.name, made, kept, entries, f"{type(error).__name__}: {error}"
    return job.name, made, kept, entries, None


def _path(name: str, kind: str, level: int) -> str:
    """Return where a picture goes, from the folder of the set."""
    return (Path(kind) / str(level) / name).as_posix()


def _is_whole(out: str, path: str, known: dict[str, Any]) -> bool:
    try:
        content = (Path(out) / path).read_bytes()
    except OSError:
        return False
    return bool(hashlib.sha256(content).hexdigest() == known["sha256"])


def _written(
    job: _Job, path: str, kind: str, level: int, picture: Any, content: str
) -> dict[str, Any]:
    """Write one file and return its entry."""
    from flurries import augment
    from flurries.io import linear_to_srgb, srgb_to_linear, write_picture

    weather = getattr(augment, WEATHERS[kind])(severity=level, seed=job.seed)
    record = weather.record(index=_index(job.name, kind, level))
    pixels, drawn = picture.pixels, augment.replay(record)
    if picture.encoding == "linear":
        # Weather is mixed in display values; what is brighter than white stays so.
        seen = srgb_to_linear(drawn(linear_to_srgb(pixels)))
    else:
        seen = drawn(pixels)
    target = Path(job.out) / path
    target.parent.mkdir(parents=True, exist_ok=True)
    write_picture(
        target, seen, alpha=picture.alpha, encoding=picture.encoding,
        premultiplied=None if picture.alpha is None else picture.premultiplied,
    )  # fmt: skip
    return {
        "source": job.name,
        "content": content,
        "weather": kind,
        "severity": level,
        "edition": EDITION,
        "record": record,
        "sha256": hashlib.sha256(target.read_bytes()).hexdigest(),
    }


def _index(name: str, kind: str, level: int) -> int:
    """Return the number of a picture's weather: a hash of its name, not of its place in a list."""
    digest = hashlib.sha256(f"{name}\0{kind}\0{level}".encode()).digest()
    return int.from_bytes(digest[:8], "little") >> 1
