"""Whole data sets in weather: parallel, resumable; a picture's weather is of its name."""

import multiprocessing
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby, product
from pathlib import Path
from typing import Any

from flurries._contract import choice, flag, integer, mapping, rate_of, real, seed_of
from flurries.augment.calibration import Profile
from flurries.augment.layouts import LAYOUTS, Layout, Member, files_of, layout_of, members_of
from flurries.augment.published import Shards, write_card
from flurries.augment.sets import ALWAYS, COPY, NEEDS, TRUTH, WEATHERS, Part, Pictures, weather_of
from flurries.io import frame_range
from flurries.io.annotations import read_coco
from flurries.output.cluster import cluster
from flurries.output.crew import Crew, make
from flurries.output.journal import NAME
from flurries.output.sequence import run

__all__ = ["Corrupted", "corrupt"]

# Most pictures of one task: their work is to be long against a task's own cost.
_CHUNK = 8


@dataclass(frozen=True)
class Corrupted:
    """What became of a set's files.

    Attributes
    ----------
    written, kept, copied : list of Path
        Pictures and planes of truth made now; those that were there already; copies of others.
    failed : dict of str to str
        Files that could not be read or written, and why.
    skipped, found : dict of str to int
        How many files were left out, or get weather or are copied, and why.
    layout : str
    journal : Path
        ``flurries.jsonl``: of each file its source, weather, severity, strength, record and hash.
    strengths : dict of str to str
        Of each weather and severity, ``"snow 3"``, how strong it is.
    """

    skipped: dict[str, int]
    layout: str
    found: dict[str, int]
    journal: Path
    strengths: dict[str, str]
    written: list[Path] = field(default_factory=list)
    kept: list[Path] = field(default_factory=list)
    copied: list[Path] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)


def corrupt(
    folder: str | os.PathLike[str], out: str | os.PathLike[str], *,
    weather: str | Sequence[str] = "snow", severity: int | str | Sequence[int] = (1, 2, 3, 4, 5),
    profile: Profile = "natural", seed: int = 0, layout: str | None = None,
    include: str | Sequence[str] = (), exclude: str | Sequence[str] = (),
    films: bool | None = None, pairs: bool | None = None, fps: float | None = None,
    focal: float | None = None, distance: float | None = None,
    depths: tuple[str, str] | None = None, depth_unit: float = 1.0,
    labels: Mapping[str, tuple[str, str]] | None = None, truth: str | Sequence[str] = (),
    shards: int = 0, shade: float = 0.0, drops: float = 0.0, workers: int | None = None,
    dask: str | None = None, overwrite: bool = False, dry_run: bool = False,
    progress: Callable[[Iterable[Any]], Iterable[Any]] | None = None,
) -> Corrupted:  # fmt: skip
    """Write a data set in weather: its pictures changed, all its other files copied.

    Frames of a film have one weather that goes on, and so have both pictures of a stereo pair.

    Parameters
    ----------
    folder : path
        Pictures in it and in folders below; labels and what else is no picture are copied, and
        symbolic links and hidden files left out.
    out : path
        Where to write; not inside `folder`. Each weather and severity gets a whole set,
        ``out/snow/3/...``, of the same names and formats, so that labels hold; JPEG is written
        with quality 95, and WebP, BMP and GIF as PNG: ``a.webp`` is ``a.png`` then, and copied
        where the folder has another of that name. ``README.md`` is a card, and ``metadata.jsonl`` a
        table that Hugging Face's loaders read.
    weather : {"snow", "rain", "fog"} or several
    severity : int, "1-5", "2,4" or several
    profile : {"natural", "hard"}
        See :class:`flurries.augment.Snowfall`.
    seed : int
    layout, include, exclude, films, pairs, fps, focal, distance, depth_unit, workers
        As ``flurries corrupt -h`` has them; None is what the layout says.
    depths : (str, str), optional
        A text in the path of a picture, and what stands there in the path of its depth, such as
        ``("rgb", "depth")``; any of .exr, .tif, .png and .npy. 0 and NaN are unknown.
    labels : mapping of {"boxes", "masks", "flow", "wet"} to (str, str), optional
        The same for other labels, where the layout does not know them: boxes of YOLO, KITTI or VOC,
        instances as PNG of whole numbers, motion of Middlebury or KITTI; and masks of wet ground.
    truth : str or several
        Planes of :class:`flurries.augment.Weathered` to be written in ``out/snow/3-alpha/...``: as
        PNG of 16 bits "alpha" and "weather", its `layer`; as EXR "layers", its `falling`, "motion",
        "flow", "depth" and "disparity"; as JSON "occlusion" of boxes and "instances" of masks. And
        "clean", copies of the pictures as they were.
    shards : int
        Samples of each tar file for webdataset, ``out/snow/3-shards/000000.tar``, with a picture,
        its truth and labels under one name. 0 writes none.
    shade, drops : float
        See :class:`flurries.augment.Snowfall`.
    dask : str, optional
        Address of a Dask scheduler in place of own processes; "" starts a cluster here.
    overwrite : bool
        Replace what is there, whatever it is.
    dry_run : bool
        Make nothing; say what would be made.
    progress : callable, optional
        Wraps the tasks, as tqdm does.
    """
    source, target = Path(folder), Path(out)
    if not source.is_dir():
        raise NotADirectoryError(20, "Is not a folder", str(source))
    if target.resolve().is_relative_to(source.resolve()):
        raise ValueError(f"out must not be inside {source}, got {target}")
    kinds = tuple(choice("weather", kind, tuple(WEATHERS)) for kind in _several(weather))
    planes = tuple(choice("truth", plane, tuple(TRUTH)) for plane in _several(truth))
    weathers = list(product(kinds, _levels(severity)))
    more = {name: value for name, value in (("shade", shade), ("drops", drops)) if value}
    strengths = {
        f"{kind} {n}": str(weather_of(kind, n, profile, **more).strength()[0])
        for kind, n in weathers
    }
    start, again, dry = seed_of(seed), flag("overwrite", overwrite), flag("dry_run", dry_run)
    count = os.cpu_count() or 1 if workers is None else integer("workers", workers, low=1, high=256)
    if not (dask is None or isinstance(dask, str)):
        raise TypeError(f"dask must be an address, '' for one here, or None, got {dask!r:.60}")
    skipped: Counter[str] = Counter()
    files = files_of(source, _several(include), _several(exclude), skipped)
    told = layout_of(files) if layout is None else choice("layout", layout, tuple(LAYOUTS))
    by = LAYOUTS[told]
    by = replace(
        by, fps=rate_of(by.fps if fps is None else fps),
        focal=real("focal", by.focal if focal is None else focal, low=0.05, high=1e3),
        distance=real("distance", by.distance if distance is None else distance, low=0.0, high=1e3),
    )  # fmt: skip
    unit = real("depth_unit", depth_unit, above=0.0)
    many = integer("shards", shards, low=0, high=10**9)
    swaps = _swaps(depths, labels, by, planes)
    pictures, others = members_of(source, files, by, films, pairs)
    if not pictures:
        raise ValueError(f"{source}: no pictures")
    if planes or many:
        _require_own_names(pictures)
    found = Counter([*(one.words for one in pictures), *(f"{o}: copied" for o in others.values())])
    made = Corrupted(dict(sorted(skipped.items())), told, dict(found), target / NAME, strengths)
    if dry:
        return made
    tables = [source / name for name in files if by.boxes and re.fullmatch(by.boxes, name)]
    use = "occlusion" in planes and "boxes" not in swaps
    boxes = read_coco(tables, (one.name for one in pictures)) if use else None
    # Pictures of one moment, which are made together, stand together.
    parts = []
    for _, group in groupby(pictures, lambda one: (one.weather, one.time, one.eyes)):
        views = list(group)
        parts += [
            Part(one.name, *weather, plane)
            for weather in weathers for one in views for plane in ("", *planes)
        ]  # fmt: skip
    # Labels of pictures with nothing on them are often empty files, about which there is no line.
    for copy in (Part(name, *weather, COPY) for name in sorted(others) for weather in weathers):
        if (source / copy.name).stat().st_size:
            parts.append(copy)
        else:
            _make_empty(target / copy.path)
    job = Pictures(
        folder=target.absolute(), source=source.absolute(),
        known={one.name: one for one in pictures}, parts=parts, seed=start, profile=profile,
        overwrite=again, planes=planes, layout=by, swaps=swaps, boxes=boxes, unit=unit, more=more,
        strengths=strengths,
    )  # fmt: skip
    # All of them now: a worker may have a folder to itself no more than another.
    _make_folders(target / part.path for part in parts)
    each = len(weathers) * (1 + len(planes))
    size = each * max(min(_CHUNK, len(pictures) // (4 * count)), 1)
    wanted = list(range(len(parts)))
    groups = [wanted[first : first + size] for first in range(0, len(wanted), size)]
    if dask is None and (count == 1 or len(groups) == 1):
        fates = run(job, wanted, progress or iter)
    else:
        crew_of = _processes(job, count) if dask is None else cluster(job, dask, count=count)
        with crew_of as crew:
            fates = run(job, wanted, progress or iter, partial(make, crew, groups))
    among = {"written": made.written, "kept": made.kept}
    for index, fate in fates.items():
        part = parts[index]
        if fate not in among:
            made.failed[part.name] = fate
        else:
            (made.copied if part.plane == COPY else among[fate]).append(target / part.path)
    if many and (tars := Shards.of(job, many)).shards:
        numbers = list(range(len(tars.shards)))
        _make_folders(map(tars.path_of, numbers))
        for index, fate in run(tars, numbers, iter).items():
            among[fate].append(tars.path_of(index))
    for paths in (made.written, made.kept, made.copied):
        paths.sort()
    if made.written or made.kept:
        write_card(target)
    return made


def _levels(severity: int | str | Sequence[int]) -> tuple[int, ...]:
    several: Any = severity if isinstance(severity, (list, tuple, range)) else [severity]
    if isinstance(severity, str):
        with suppress(ValueError):
            several = frame_range(severity)
    levels = tuple(dict.fromkeys(integer("severity", s, low=1, high=5) for s in several))
    if not levels:
        raise ValueError(f"severity must name at least one level, got {severity!r}")
    return levels


def _make_empty(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists() and path.stat().st_size:
        raise FileExistsError(17, "Is there already and not empty, as it is in the set", str(path))
    path.touch()


def _several(value: str | Sequence[str]) -> tuple[str, ...]:
    return (value,) if isinstance(value, str) else tuple(value)


def _swaps(
    depths: tuple[str, str] | None, labels: Mapping[str, tuple[str, str]] | None, layout: Layout,
    planes: tuple[str, ...],
) -> dict[str, tuple[str, str]]:  # fmt: skip
    """Return the labels that are used, with what finds their files."""
    told = {} if depths is None else {"depth": depths}
    for kind, pair in mapping("labels", labels or {}).items():
        told[choice("labels", kind, ("boxes", "flow", "masks", "wet"))] = pair
    for kind, pair in told.items():
        if not (isinstance(pair, (tuple, list)) and len(pair) == 2 and all(pair)):
            name = "depths" if kind == "depth" else f"labels: {kind}"
            raise ValueError(f"{name} must be two texts, such as ('rgb', 'x'), got {pair!r:.60}")
    known = {**layout.labels, **told}
    wanted = [NEEDS[plane] for plane in planes if plane in NEEDS]
    if layout.boxes and "boxes" not in told and "boxes" in wanted:
        wanted.remove("boxes")
    if missing := [kind for kind in wanted if kind not in known]:
        raise ValueError(f"truth needs {missing[0]}, which this layout has not: say where it is")
    return {kind: known[kind] for kind in dict.fromkeys([*wanted, *set(told) & {*ALWAYS}])}


def _require_own_names(pictures: Iterable[Member]) -> None:
    """Refuse pictures that differ by their endings alone, whose planes would have one name."""
    known: dict[Path, str] = {}
    for one in pictures:
        if (other := known.setdefault(Path(one.name).with_suffix(""), one.name)) != one.name:
            raise ValueError(f"truth and shards must have names: {other} and {one.name} share one")


def _make_folders(paths: Iterable[Path]) -> None:
    for folder in {path.parent for path in paths}:
        folder.mkdir(parents=True, exist_ok=True)


# What the tasks of a process share.
_shared: list[Any] = []


def _begin(shared: Any) -> None:
    _shared[:] = [shared]


def _with_shared(task: Callable[..., Any], *arguments: Any) -> Any:
    return task(_shared[0], *arguments)


@contextmanager
def _processes(shared: Any, count: int) -> Iterator[Crew]:
    # Spawned, not forked: what the caller's threads hold is not carried along.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, context, _begin, (shared,)) as pool:
        yield Crew(lambda *task: pool.submit(_with_shared, *task), lambda: count, remote=False)
