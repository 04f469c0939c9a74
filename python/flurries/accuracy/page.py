"""The page that says what accuracy costs, from measured studies."""

from __future__ import annotations

import json
import os
import platform
from pathlib import Path
from typing import Any

from flurries._threads import threads
from flurries.accuracy import plot
from flurries.accuracy.study import Study

_HEAD = """# What accuracy costs

Made by `make accuracy` ({machine}, {threads} threads). For every approximation: its error against
an independent reference, and the time of a frame. Times belong to that machine and moment: read
them as ratios within a table. On the orange line lies what nothing else beats in both.
`flurries accuracy` measures yours.

![Error against time, six of the axes]({plots}/accuracy.png)
"""

_AXIS = """
## {axis.title}

`flurries accuracy {axis.name}`. Error {axis.unit}. Against: {axis.reference}.

![Error against time]({plots}/{axis.name}.png)

| setting | error | fastest of {runs}, ms | median, ms | unbeaten |
| --- | --- | --- | --- | --- |
"""


def write(
    studies: list[Study],
    folder: str | os.PathLike[str],
    *,
    page: str | os.PathLike[str] | None = None,
) -> list[Path]:
    """Write the numbers as JSON, plots as PNG, and on request a page in Markdown.

    Parameters
    ----------
    studies : list of Study
        From :func:`flurries.accuracy.study`.
    folder : path
        Where ``accuracy.json`` and the plots go; made if it is not there.
    page : path, optional
        A Markdown file that shows the plots; its links lead from there to `folder`.

    Returns
    -------
    list of Path
        What was written.
    """
    if not isinstance(studies, (list, tuple)) or not all(isinstance(s, Study) for s in studies):
        raise TypeError(f"studies must be a list of Study, got {studies!r:.60}")
    if not studies:
        raise ValueError("studies must hold at least one, got none")
    target, sheet = Path(folder), None if page is None else Path(page)
    target.mkdir(parents=True, exist_ok=True)
    data = target / "accuracy.json"
    data.write_text(json.dumps([plain(study) for study in studies], indent=1) + "\n")
    if sheet is not None:
        way = Path(os.path.relpath(target, sheet.parent)).as_posix()
        sheet.write_text(markdown(studies, way), encoding="utf-8")
    return [data, *plot.save(studies, target), *([] if sheet is None else [sheet])]


def plain(study: Study) -> dict[str, Any]:
    """Return a study as JSON has it."""
    about = {name: value for name, value in vars(study.axis).items() if name != "ways"}
    return {**about, "points": [vars(point) for point in study.points]}


def markdown(studies: list[Study], plots: str) -> str:
    """Return the page; `plots` is the way from it to the folder of the plots."""
    machine = f"{platform.machine()}, {os.cpu_count()} cores"
    parts = [_HEAD.format(machine=machine, threads=threads(), plots=plots), ""]
    for study in studies:
        parts.append(_AXIS.format(axis=study.axis, runs=study.points[0].runs, plots=plots))
        parts += [
            f"| {p.setting} | {p.error:.2g} | {p.fastest:.3g} | {p.median:.3g} | "
            f"{'yes' if p.best else ''} |\n"
            for p in sorted(study.points, key=lambda p: p.error)
        ]
    return "".join(parts)
