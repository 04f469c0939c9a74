"""A data set in a fixed table of weathers, told by its hashes from any other; scores of it."""

import csv
import hashlib
import io
import json
import os
import platform
import shutil
from collections.abc import Callable, Iterable
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from flurries._contract import Array, choice, library
from flurries._threads import scope
from flurries.augment.calibration import PROFILES
from flurries.augment.corrupt import corrupt
from flurries.augment.layouts import kept_name
from flurries.io import read_picture, replacing
from flurries.io.annotations import ENDINGS, read_label
from flurries.io.stores import Store
from flurries.output.journal import Journal

__all__ = ["Scores", "make", "score"]

# What version 1 is, for ever.
VERSION, KINDS, LEVELS, SEED = 1, ("snow", "rain", "fog"), (1, 2, 3, 4, 5), 0
NAME, CLEAR = "benchmark.json", "clear"

# A part's pictures by the names that predictions have, and what predicts or where predictions are.
Pictures: TypeAlias = "dict[str, Path]"
Given: TypeAlias = "Callable[..., Any] | Path"


def make(
    folder: str | os.PathLike[str], out: str | os.PathLike[str], *,
    like: str | os.PathLike[str] | None = None, **how: Any,
) -> tuple[list[str], dict[str, str]]:  # fmt: skip
    """Write a data set in every weather of the benchmark; what is there already stays.

    Parameters
    ----------
    folder : path
        The set, see :func:`flurries.augment.corrupt.corrupt`.
    out : path
        Gets a set for each weather, ``out/hard/snow/3/...``, the pictures as they are,
        ``out/clear/...``, and ``benchmark.json`` with a hash of each.
    like : path, optional
        ``benchmark.json`` of the set to compare with; that of `out`, if it has one.
    **how
        `layout`, `include`, `exclude`, `depths`, `workers`, `progress` and the like of `corrupt`.

    Returns
    -------
    differs : list of str
        Parts that are not those of `like`, such as ``"hard/snow/3"``.
    failed : dict of str to str
        Pictures that could not be read, and why.

    Notes
    -----
    Hashes are of pixels before they are encoded, in the reproducible mode, by class of processor;
    a class that is not in `like` is compared with another.
    """
    source, target = Path(folder), Path(out)
    past = Path(like) if like is not None else target / NAME
    known = _hashes(past) if like is not None or past.exists() else {}
    corrupt(source, target, dry_run=True, **how)
    target.mkdir(exist_ok=True)
    failed: dict[str, str] = {}
    with scope(threads=None, reproducible=True):
        how |= {"weather": KINDS, "severity": LEVELS, "seed": SEED}
        for profile in PROFILES:
            failed |= corrupt(source, target / profile, **how | {"profile": profile}).failed
    hashes = {}
    for part, rows in _parts(target).items():
        text = json.dumps(sorted((name, digest) for name, _, digest in rows))
        hashes[part] = hashlib.sha256(text.encode()).hexdigest()
        for _, path, _ in rows:
            if not path.exists():  # Of the clear ones.
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source / path.relative_to(target / part), path)
    here = f"{platform.system()} {platform.machine()}"
    wanted = known.get(here) or next(iter(known.values()), hashes)
    text = json.dumps({"version": VERSION, "hashes": {**known, here: hashes}}, indent=1)
    with replacing(target / NAME) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    return sorted(p for p in hashes | wanted if hashes.get(p) != wanted.get(p)), failed


@dataclass(frozen=True)
class Scores:
    """Scores of a model by weather and severity; as text a table.

    Attributes
    ----------
    task : {"accuracy", "mAP", "EPE"}
        Share of right classes; mean precision of boxes, as COCO has it; mean error of flow, pixels.
    values : dict of str to float
        Of each part that has predictions: ``"clear"``, ``"hard/snow/3"``.
    """

    task: str
    values: dict[str, float]

    def __str__(self) -> str:
        rows = [[self.task, CLEAR, *map(str, LEVELS)]]
        for way, numbers in self._curves().items():
            rows.append([way, *("" if np.isnan(n) else f"{n:.4f}" for n in numbers)])
        return "\n".join("\t".join(row) for row in rows)

    def plot(self, path: str | os.PathLike[str]) -> None:
        """Draw a curve of each weather and profile, from clear on, into a file."""
        need = "plots need matplotlib: pip install 'flurries[plots]'"
        figure = library("matplotlib.figure", need).Figure((9.0, 3.0), layout="constrained")
        panels = dict(zip(KINDS, figure.subplots(1, len(KINDS), sharey=True), strict=True))
        for way, numbers in self._curves().items():
            profile, kind = way.split("/")
            panels[kind].plot((0, *LEVELS), numbers, "o-", label=profile)
            panels[kind].set(title=kind, xlabel="severity", ylabel=self.task)
            panels[kind].legend()
        figure.savefig(os.fspath(path))

    def _curves(self) -> dict[str, list[float]]:
        """Return the scores of each weather from clear on; NaN where there are no predictions."""
        ways = [f"{profile}/{kind}" for kind in KINDS for profile in PROFILES]
        parts = {way: [CLEAR, *(f"{way}/{level}" for level in LEVELS)] for way in ways}
        return {w: [self.values.get(part, np.nan) for part in parts[w]] for w in ways}


def score(
    benchmark: str | os.PathLike[str], predictions: Callable[..., Any] | str | os.PathLike[str],
    *, task: str | None = None, truth: str | None = None,
) -> Scores:  # fmt: skip
    """Score predictions of a benchmark's pictures.

    Parameters
    ----------
    benchmark : path
        What :func:`make` wrote.
    predictions : path or callable
        A folder that has, of each part or of some, ``hard/snow/3.csv`` with a picture's path and
        its class in each row, or ``hard/snow/3.json``, results as COCO has them, or a flow for each
        picture, ``hard/snow/3/...`` and its path, .flo, .npy or KITTI's .png. Or what takes a
        picture and returns a class, or rows of (x, y, width, height, score, category); for "EPE"
        what takes a picture and the next one in its folder and returns (H, W, 2), pixels.
    task : {"accuracy", "mAP", "EPE"}
        Told by the files, if not given.
    truth : str, optional
        For "accuracy" a file of the set with a picture's path and its class in each row; else
        classes are folders. For "mAP" the file of annotations, if there are several. For "EPE" a
        text in a picture's path, and what stands there in that of its flow: "image_2:flow_occ".
    """
    target, given = Path(benchmark), predictions if callable(predictions) else Path(predictions)
    _hashes(target / NAME)
    if not isinstance(truth, str | None):
        raise TypeError(f"truth must be a text, got {truth!r:.60}")
    if isinstance(given, Path) and task is None:
        kinds = {path.suffix for path in given.rglob("*")}
        task = next((one for one, (suffix, _) in _TASKS.items() if suffix in kinds), "EPE")
    task = choice("task", task, tuple(_TASKS))
    suffix, judge = _TASKS[task]
    labels, values = target / PROFILES[0] / KINDS[0] / str(LEVELS[0]), {}
    for part, rows in _parts(target).items():
        own = given / f"{part}{suffix}" if isinstance(given, Path) else given
        if not isinstance(own, Path) or own.exists():
            values[part] = judge(labels, {name: path for name, path, _ in rows}, own, truth)
    if not values:
        raise FileNotFoundError(2, f"Has no predictions like hard/snow/3{suffix}", str(given))
    return Scores(task, values)


def _accuracy(labels: Path, pictures: Pictures, given: Given, truth: str | None) -> float:
    folders = {name: Path(name).parent.name for name in pictures}
    right = folders if truth is None else _rows(labels / truth)
    said = _rows(given) if isinstance(given, Path) else {
        name: str(given(read_picture(path).pixels)) for name, path in pictures.items()
    }  # fmt: skip
    _require(f"{given}: no prediction of", pictures, said)
    _require("truth: no class of", pictures, {name for name, kind in right.items() if kind})
    return float(np.mean([said[name] == right[name] for name in pictures]))


def _rows(path: Path) -> dict[str, str]:
    found = {}
    for row in csv.reader(path.read_text("utf-8-sig").splitlines()):
        if len(row) != 2:
            raise ValueError(f"{path}: rows must be a picture's path and a class, got {row}")
        found[kept_name(row[0])] = row[1]
    return found


def _precision(labels: Path, pictures: Pictures, given: Given, truth: str | None) -> float:
    """Return COCO's mean average precision of boxes."""
    coco, evaluation = (
        library(f"pycocotools.{name}", "mAP needs pycocotools: pip install pycocotools")
        for name in ("coco", "cocoeval")
    )
    files = [labels / truth] if truth else sorted(labels.rglob("*.json"))
    if len(files) != 1:
        names = ", ".join(file.relative_to(labels).as_posix() for file in files)
        raise ValueError(f"truth must be the file of annotations, out of: {names or 'none there'}")
    # Whatever is printed on the way is for nobody.
    with redirect_stdout(io.StringIO()):
        known = coco.COCO(files[0])
        numbers = {kept_name(one["file_name"]): number for number, one in known.imgs.items()}
        # A name in the annotations is the end of a path.
        ends = {name: Path(name).parts for name in pictures}
        ids = {
            name: numbers[end] for name, parts in ends.items() for k in range(len(parts))
            if (end := "/".join(parts[k:])) in numbers
        }  # fmt: skip
        _require(f"{files[0]}: no image", pictures, ids)
        found = json.loads(given.read_text("utf-8")) if isinstance(given, Path) else [
            {"image_id": ids[name], "category_id": int(row[5]), "score": float(row[4]),
             "bbox": [float(number) for number in row[:4]]}
            for name, path in pictures.items()
            for row in np.reshape(given(read_picture(path).pixels), (-1, 6))
        ]  # fmt: skip
        if not found:
            return 0.0
        judge = evaluation.COCOeval(known, known.loadRes(found), "bbox")
        judge.params.imgIds = sorted(ids.values())
        for step in (judge.evaluate, judge.accumulate, judge.summarize):
            step()
    return float(judge.stats[0])


def _end_points(labels: Path, pictures: Pictures, given: Given, truth: str | None) -> float:
    """Return the mean distance of the predicted from the true motion, of all known pixels."""
    picture, _, flow = (truth or "").partition(":")
    if not (picture and flow):
        raise ValueError(f"truth must be two texts, such as 'image_2:flow_occ', got {truth!r}")
    names, errors = sorted(pictures), []
    for name, after in zip(names, [*names[1:], ""], strict=True):
        right = _flow(labels / name.replace(picture, flow)) if picture in name else None
        if right is None:
            continue
        if isinstance(given, Path):
            said = _flow(given / name)
            if said is None:
                raise FileNotFoundError(2, f"Has no flow, {ENDINGS['flow']}", str(given / name))
        elif Path(after).parent != Path(name).parent:
            raise ValueError(f"{name}: no picture follows, to which its flow leads")
        else:
            said = np.asarray(given(*(read_picture(pictures[one]).pixels for one in (name, after))))
        known = np.isfinite(right).all(axis=-1)
        if said.shape != right.shape or not np.isfinite(said[known]).all():
            raise ValueError(f"{name}: its flow must be finite and {right.shape}, got {said.shape}")
        errors.append(np.linalg.norm((said - right)[known], axis=-1))
    if not errors:
        raise ValueError(f"truth: {truth!r} leads from no picture to its flow, {ENDINGS['flow']}")
    return float(np.concatenate(errors).mean())


def _flow(way: Path) -> Array | None:
    """Return the flow beside a path, (H, W, 2), NaN where it is not known."""
    paths = [way.with_suffix(ending) for ending in ENDINGS["flow"]]
    return next((read_label("flow", path) for path in paths if path.is_file()), None)


_TASKS = {"accuracy": (".csv", _accuracy), "mAP": (".json", _precision), "EPE": ("", _end_points)}


def _parts(target: Path) -> dict[str, list[tuple[str, Path, str]]]:
    """Return each part's pictures: the names that predictions have, the files, and hashes."""
    parts: dict[str, list[tuple[str, Path, str]]] = {CLEAR: []}
    for profile in PROFILES:
        for file, line in Journal(Store(), target / profile).last().items():
            if "pixels" in line:
                part, own = f"{profile}/{line['weather']}/{line['severity']}", line["source"]
                row = kept_name(own), target / profile / file, line["pixels"]
                parts.setdefault(part, []).append(row)
                if len(parts) == 2:
                    parts[CLEAR].append((row[0], target / CLEAR / own, line["inputs"]))
    return parts


def _hashes(path: Path) -> dict[str, dict[str, str]]:
    """Return the hashes of each part by class of processor."""
    with suppress(ValueError, LookupError, TypeError):
        facts = json.loads(path.read_text("utf-8"))
        if facts["version"] == VERSION:
            return dict(facts["hashes"])
    raise ValueError(f"{path}: is no file of hashes of version {VERSION} of the benchmark")


def _require(words: str, wanted: Iterable[str], there: Iterable[str]) -> None:
    if missing := sorted(set(wanted).difference(there)):
        raise ValueError(f"{words} {missing[0]} (so with {len(missing) - 1} more)")
