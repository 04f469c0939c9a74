"""Run the tests of docs/internals/reliability.md and write the page: `make soak`.

FLURRIES_SOAK=0.1 takes a tenth of the length. The page is written however it ends; the exit code
says whether all held.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as Xml
from dataclasses import dataclass, field
from pathlib import Path

from reliability import SECTIONS, Row, named

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "internals" / "reliability.md"
HEAD = """# Reliability: what is promised, and the test that holds it

Written by `make soak`: {share} of its full length, {minutes:.0f} minutes on {machine} ({cores}
cores) at a load of {load:.1f}, Python {python}. Tests in `soak/` run there, all others in
`make test` too; `tests/test_reliability.py` sees that every name exists. A control is a test that
sees the failure where the guard is taken away.
"""


@dataclass
class Outcome:
    """What became of one test, with all its parameters."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    figures: list[str] = field(default_factory=list)
    met: bool = True

    def told(self) -> str:
        parts = [f"{self.passed} of {self.passed + self.failed} passed"]
        if self.skipped:
            parts.append(f"{self.skipped} skipped")
        figures = list(dict.fromkeys(self.figures))
        if len(figures) > 8:
            figures = [*figures[:7], f"and {len(figures) - 7} more"]
        return "; ".join([", ".join(parts), *figures])


def run(tests: list[str], share: str) -> dict[str, Outcome]:
    """Run tests by name and return what became of each."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-n", "0", f"--junitxml={report}",
             f"--basetemp={folder}/tmp",
             "-o", "junit_family=xunit1", *(f"tests/{test}" for test in tests)],
            cwd=ROOT, env={**os.environ, "FLURRIES_SOAK": share}, check=False,
        )  # fmt: skip
        found: dict[str, Outcome] = {test: Outcome() for test in tests}
        for case in Xml.parse(report).iter("testcase"):
            file = (case.get("file") or "").removeprefix("tests/")
            name = f"{file}::{(case.get('name') or '').split('[')[0]}"
            outcome = found.setdefault(name, Outcome())
            bad = case.find("failure") is not None or case.find("error") is not None
            outcome.failed += bad
            outcome.skipped += case.find("skipped") is not None
            outcome.passed += not bad and case.find("skipped") is None
            for said in case.iter("property"):
                if said.get("name") == "figure":
                    outcome.figures.append(str(said.get("value")))
                if said.get("name") == "met":
                    outcome.met = outcome.met and said.get("value") == "True"
        return found


def line(row: Row, found: dict[str, Outcome]) -> str:
    outcomes = [found[test] for test in row.tests]
    held = all(o.passed and not o.failed for o in outcomes)
    state = (
        "**fails**" if not held else "**not met**" if not all(o.met for o in outcomes) else "holds"
    )
    tests = "<br>".join(f"`{test}`: {found[test].told()}" for test in row.tests)
    control = "<br>".join(f"`{test}`: {found[test].told()}" for test in row.control) or "-"
    return f"| {row.promise} | {row.claim} | {state} | {tests} | {control} |"


def main() -> int:
    share, started = os.environ.get("FLURRIES_SOAK", "1"), time.monotonic()
    found = run(sorted(named()), share)
    text = HEAD.format(
        share=f"{100 * float(share):.0f} %", minutes=(time.monotonic() - started) / 60,
        machine=platform.machine(), cores=os.cpu_count(), load=os.getloadavg()[0],
        python=platform.python_version(),
    )  # fmt: skip
    for name, rows in SECTIONS.items():
        text += f"\n## {name}\n| promise | claimed | | tests and what they measured | control |\n"
        text += "| --- | --- | --- | --- | --- |\n"
        text += "\n".join(line(row, found) for row in rows) + "\n"
    text += LEFT
    PAGE.write_text(text, encoding="utf-8")
    bad = [test for test, outcome in found.items() if outcome.failed or not outcome.passed]
    print("\n".join(["failed:", *bad]) if bad else "all hold")
    return 1 if bad else 0


LEFT = """
## What is not promised
- A free-threaded Python: the wheel is built for the stable ABI, which such a Python does not load,
  and flurries says so at import.
- In the reproducible mode, float64 fields of tiles large enough for a Fourier transform follow the
  C library's sine, whose last bit may differ between processors without and with fused products.
- Several processes at the same frames: each may make all of them, each time whole and with the same
  bits; who shares out work is `--frames` or Dask. Hidden files that a process has left are removed
  by its own machine at once, and by others when they have not changed for an hour; the clocks of
  machine and folder must agree within that. Where a folder has no locks, and in stores behind a
  url, processes that end at the same moment may lose each other's lines of `flurries.json`; the
  next run of either adds its own again.
- A process that is killed while it writes to a store may leave its copy of a frame in the system's
  temporary folder, and where the store shows halves a hidden object.
- Frames of an earlier version with other bits are refused, never replaced unasked.
- `make asan` puts the kernels' tests and random calls under AddressSanitizer, `make audit` looks at
  licences and known holes, `make test-lowest` runs the suite with the oldest libraries; none of
  them is part of `make test`. Python 3.14 is untried.
- Frames of other plates with the same file names count as this scene's over retouched plates.
- Across versions of NumPy, of the C library and of the package itself bits may differ; kept hashes
  say when the package's do.
"""

if __name__ == "__main__":
    sys.exit(main())
