"""How the figures of falling snow are said: verdicts, tables and the page."""

from __future__ import annotations

from dataclasses import dataclass


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
        """Return "pass", "unsure" or "miss"."""
        if self.off <= self.limit:
            return "pass"
        return "miss" if self.off - 2.0 * self.error > self.limit else "unsure"


def table(found: dict[str, Figure]) -> str:
    """Return the figures of a case as lines."""
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
    return INTRO.format(seeds=seeds) + "\n".join([*rows, "", CONTROLS, "", *lines]) + "\n"


INTRO = """# Falling snow against flakes drawn one by one

Made by `python benches/falling_statistics.py --write`, which says what each figure is. The judge is
a twin in NumPy and float64 (`tests/twin_falling.py`) with random numbers, sizes and speeds of its
own. Flakes are round and none is nearer than 2 m, on both sides. A case is weather, camera, wind in
m/s and the picture's width; {seeds} seeds, of light snow four times as many. Of each figure its
worst case is shown. Behind ± is the standard error. "Miss" is beyond the limit by more than two
standard errors, "unsure" within two.

Euler numbers are those of the pixels above a picture's own percentile; C(t) is the largest
correlation with the picture t frames later over shifts of up to 64 px; life is the share of bright
peaks that are followed over 10 frames, in rain over 4.

"""

CONTROLS = """Each judge finds an imitation out (`tests/test_judges.py`): a Gaussian field with the
same spectrum, a mirrored tile, flakes that die at the borders of tiles, a sheet of one speed, a
picture of equal tiles, a box of flakes as large as the picture, motion extrapolated from the
shutter's in a zoom."""
