"""Falling snow and rain against flakes drawn one by one: ``python benches/falling_statistics.py``.

``--quick`` measures 9 cases with 2 seeds in some minutes, ``--cases`` those whose names begin so,
and ``--write`` makes docs/internals/falling_statistics.md. ``--of simulated`` judges the method
that draws all flakes, and ``--of twin`` the twin by other seeds of its own, which must not miss.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from falling_cases import CAMERAS, WEATHERS, WINDS, Case, pictures
from falling_contracts import contracts

import judges
from judges import Numbers, Picture
from twin_falling import film

# Frames of the twin, the first of them whole and of the others the middle; and frames of the
# package so far apart that each shows other flakes.
TIMES = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 16.0, 64.0, 250.0, 500.0)
QUICK = (0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 64.0, 300.0)
WAYS = "still-3", "sideways-0", "forward-0"
QUICKLY = tuple(f"{weather}-{way}" for weather in ("light", "heavy", "rain") for way in WAYS)
APART = tuple(np.arange(8) * 45.0)
PEAKS = (4.0, 60.0)  # Depths of peaks that are followed, metres.

QUOTIENTS = {
    "mean": 0.01, "deviation": 0.03, "skewness": 0.10, "kurtosis": 0.15,
    **{f"octave {n + 1}": 0.05 for n in range(judges.OCTAVES)},
    **{f"Euler {level:g}": 0.10 for level in judges.LEVELS},
}  # fmt: skip
PAGE = Path(__file__).parents[1] / "docs/internals/falling_statistics.md"


@dataclass(frozen=True)
class Figure:
    """How far a figure of the package is off."""

    ours: float
    drawn: float
    off: float  # Must not be above the limit.
    error: float  # The standard error of `off`.
    limit: float

    @property
    def verdict(self) -> str:
        if self.off <= self.limit:
            return "pass"
        return "miss" if self.off - 2.0 * self.error > self.limit else "unsure"


def table(found: dict[str, Figure]) -> str:
    head = f"{'':38}{'ours':>11}{'drawn':>11}{'off':>8}{'+-':>7}{'limit':>7}"
    lines = [
        f"{name:38}{f.ours:>11.4g}{f.drawn:>11.4g}{f.off:>8.3f}{f.error:>7.3f}{f.limit:>7.2f}"
        f"  {f.verdict}"
        for name, f in found.items()
    ]
    return "\n".join([head, *lines])


def page(cases: dict[str, dict[str, Figure]], lines: list[str], seeds: int) -> str:
    """Return the page: of each figure its worst case, and how many cases miss the limit."""
    names = list(dict.fromkeys(name for found in cases.values() for name in found))
    rows = ["| figure | limit | worst, off by | drawn | ours | case | pass | unsure | miss |"]
    rows.append("| --- |" + " --- |" * 8)
    for name in names:
        own = {case: found[name] for case, found in cases.items() if name in found}
        worst = max(own, key=lambda case: own[case].off / max(own[case].limit, 1e-9))
        f = own[worst]
        counts = [sum(x.verdict == v for x in own.values()) for v in ("pass", "unsure", "miss")]
        rows.append(
            f"| {name} | {f.limit:.2f} | {f.off:.3f} ± {f.error:.3f} | {f.drawn:.4g} | {f.ours:.4g}"
            f" | {worst} | " + " | ".join(map(str, counts)) + " |"
        )
    return INTRO.format(seeds=seeds) + "\n".join([*rows, "", *lines]) + "\n"


INTRO = """# Falling snow against flakes drawn one by one

Made by `python benches/falling_statistics.py --write`, which says what each figure is. The judge is
a twin in NumPy and float64 (`tests/twin_falling.py`) with random numbers, sizes and speeds of its
own. Flakes are round and fade in from 1.6 to 2 m, on both sides. A case is weather, camera, wind in
m/s and the picture's width; {seeds} seeds, of light snow four times as many. Of each figure its
worst case is shown. Behind ± is the standard error, of life at least that of so many peaks. "Miss"
is beyond the limit by more than two standard errors, "unsure" within two.

Euler numbers are those of the pixels above a picture's own percentile; C(t) is the largest
correlation with the picture t frames later over shifts of up to 64 px; life is the share of bright
peaks that are followed over 10 frames, in rain over 4. Each judge finds an imitation out
(`tests/test_judges.py`).

"""


def middle(shape: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return the middle of a picture, half of it in each direction: top, bottom, left, right."""
    height, width = shape
    return height // 4, height - height // 4, width // 4, width - width // 4


def of_film(case: Case, first: Picture, later: list[Picture], times: tuple[float, ...]) -> Numbers:
    """Return what is asked of pictures over time, the middle of each; `first` is whole."""
    top, bottom, left, right = middle(first.shape)
    shown = dict(zip(times, [first[top:bottom, left:right], *later], strict=True))
    found: Numbers = {}
    for t, picture in shown.items():
        if t > 0.0:
            found[f"C({t:g})"] = judges.largest(shown[0.0], picture)
        if t in (1.0, 2.0, 4.0, 8.0):
            found[f"after {t:g}"] = judges.kept(shown[0.0], picture)
    steps = [t for t in times if t <= case.followed]
    lives, row = judges.alive([shown[t] for t in steps], steps, case.flow, PEAKS, (left, top))
    if len(lives) > 20:
        found |= {"peaks": float(len(lives)), "life": float(lives.mean())}
        found |= {f"life, rows {n + 1}": float(x) for n, x in enumerate(judges.by_rows(lives, row))}
    found["C(0), far shifts"] = judges.repeated(first)
    return found


def measure(
    case: Case, seed: int, times: tuple[float, ...], of: str
) -> dict[str, tuple[Numbers, Picture]]:
    """Return numbers and slopes (n, 3, rows, cols) of the package's and of the twin's pictures."""
    law, view = case.twin()
    whole = film(law, view, times[:1], seed)[0]
    part = middle(whole.shape)
    top, bottom, left, right = part
    later = list(film(law, view, times[1:], seed, window=part))
    drawn = judges.numbers(whole) | of_film(case, whole, later, times)
    if of == "twin":
        apart = list(film(law, view, APART[::4], seed + 1000))
        cut = list(film(law, view, times[1:], seed + 1000, window=part))
    else:
        scene = case.scene(seed, of)
        # What turns sees the wind from another side later.
        apart = pictures(scene, tuple(np.array(APART) / 9.0 ** (case.camera == "turning")))
        cut = [picture[top:bottom, left:right] for picture in pictures(scene, times[1:])]
    each = [judges.numbers(picture) for picture in apart]
    ours = {name: float(np.mean([one[name] for one in each])) for name in each[0]}
    ours |= of_film(case, apart[0], cut, times)
    return {
        "ours": (ours, np.stack([judges.slopes(picture) for picture in apart])),
        "drawn": (drawn, judges.slopes(whole)[None]),
    }


def leaning(ours: list[Picture], drawn: list[Picture]) -> dict[str, Figure]:
    """Return the figures of direction, of slopes (n, 3, rows, cols) by seeds."""
    known = judges.direction(sum(one.sum(axis=0) for one in drawn))
    whole = [judges.direction(sum(one.sum(axis=(0, 2, 3)) for one in who)) for who in (ours, drawn)]
    each = [[float(judges.direction(one.sum(axis=(0, 2, 3)))) for one in who]
            for who in (ours, drawn)]  # fmt: skip
    error = float(np.sqrt(sum(np.var(one, ddof=1) / len(one) for one in each)))
    off = abs(float(whole[0] - whole[1]))
    found = {"direction": Figure(float(whole[0]), float(whole[1]), off, error, 0.03)}
    # Tiles lean by seeds of their own: what frames of one seed scatter is chance, and what seeds of
    # the twin do.
    chance = np.var([judges.direction(one.sum(axis=0)) for one in drawn], axis=0, ddof=1).mean()
    apart = [judges.direction(one.transpose(1, 0, 2, 3)) for one in ours]
    noise = np.mean([np.var(one, axis=0, ddof=1).mean() / len(one) for one in apart])
    blocks = [judges.direction(one.sum(axis=0)) for one in ours]
    square = float(np.mean([(one - known) ** 2 for one in blocks]))
    rest = max(square - noise - chance / len(drawn), 0.0)
    spread = (noise + chance / len(drawn)) / np.sqrt(known.size / 2.0)
    error = float(np.sqrt(rest + spread) - np.sqrt(rest))
    found["direction, blocks"] = Figure(np.sqrt(square), 0.0, np.sqrt(rest), error, 0.03)
    least = 0.1 + 2.0 * float(np.sqrt(chance / len(drawn)))
    turned = float(np.mean([judges.turned(one, known, least) for one in blocks]))
    found["direction, blocks of the other sign"] = Figure(turned, 0.0, turned, 0.0, 0.0)
    return found


def judged(case: Case, each: list[dict[str, tuple[Numbers, Picture]]]) -> dict[str, Figure]:
    """Return all figures of a case, which was measured with several seeds."""
    peaks = [sum(e[who][0].get("peaks", 0.0) for e in each) for who in ("ours", "drawn")]
    found = {}
    names = [n for n in each[0]["ours"][0] if all(n in e[w][0] for e in each for w in e)]
    for name in names:
        if name == "peaks" or (name.startswith("life, rows") and not case.uniform):
            continue
        rows = [np.array([one[who][0][name] for one in each]) for who in ("ours", "drawn")]
        a, b = (float(row.mean()) for row in rows)
        error = float(np.sqrt(sum(row.var(ddof=1) / len(each) for row in rows)))
        if name.startswith("life"):
            # A share of so few peaks scatters more than two seeds may happen to.
            bands = 1 if name == "life" else 3
            chance = sum(bands * x * (1.0 - x) / n for x, n in zip((a, b), peaks, strict=True))
            error = max(error, float(np.sqrt(chance)))
        if name in QUOTIENTS:
            off, error, limit = abs(a / b - 1.0), error / abs(b), QUOTIENTS[name]
        elif name == "life" and not case.uniform:
            off, error, limit = 1.0 - a / b, error / b, 0.3
        elif name.startswith("life"):
            off, limit = abs(a - b), 0.05 if name == "life" else 0.1
        else:
            off, limit = abs(a - b), 0.03 if name.startswith("after") else 0.02
        found[name] = Figure(a, b, off, error, limit)
    slopes = ([one[who][1] for one in each] for who in ("ours", "drawn"))
    return found | leaning(*slopes)


def main() -> None:
    words = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    words.add_argument("--quick", action="store_true")
    words.add_argument("--cases", nargs="+", default=[], metavar="BEGINNING")
    words.add_argument("--of", choices=("flakes", "simulated", "twin"), default="flakes")
    words.add_argument("--write", action="store_true", help="make the page")
    asked = words.parse_args()
    wanted = tuple(asked.cases) or (QUICKLY if asked.quick else ("",))
    seeds, times = (2, QUICK) if asked.quick else (8, TIMES)
    cases = [Case(c, w, wind) for w in WEATHERS for c in CAMERAS for wind in WINDS]
    cases = [case for case in cases if str(case).startswith(wanted)]
    found = {}
    for case in cases:
        # Light snow is cheap, and its few flakes scatter.
        more = seeds * (4 if case.weather == "light" else 1)
        each = [measure(case, seed, times, asked.of) for seed in range(1, more + 1)]
        found[str(case)] = judged(case, each)
        print(f"\n{case}\n{table(found[str(case)])}", flush=True)
    lines = contracts(quick=asked.quick) if asked.of == "flakes" and not asked.cases else []
    print("\n" + "\n".join(lines))
    if asked.write:
        PAGE.write_text(page(found, lines, seeds), encoding="utf-8")


if __name__ == "__main__":
    main()
