"""The matrix of faults: every format and store, each fault, with a journal and without.

`python docs/make_faults.py` writes docs/internals/faults.md; tests/test_faults.py asks for them.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

from faults import between, within
from faults.shot import KINDS, Shot, s3

PAGE = Path(__file__).parent / "internals" / "faults.md"


def cells(kind: str, room: Path, turn: int = 0, of: int = 1) -> Iterator[tuple[str, ...]]:
    """Yield fault, expected and seen answer of a format's or a store's cells, or of one in `of`."""
    shots = (Shot(kind, room / f"{kind}{number}") for number in itertools.count())
    first = next(shots)
    first.write()
    whole = first.contents()
    assert len(whole) == (1 if first.alone else 3)
    inside = within.cells(kind, shots, whole, (turn, of))
    for number, (fault, want, see) in enumerate((*between.cells(kind, shots, whole), *inside)):
        # Those with a journal and without are neighbours; of power cuts each kind has some.
        if number // 2 % of == turn or fault.startswith("power cut"):
            yield fault, want, see()


def main() -> None:
    """Write the page."""
    found = {}
    with tempfile.TemporaryDirectory() as room:
        Path(room).chmod(0o755)
        for kind in KINDS:
            # A server's threads must not be there where children are made.
            with s3() if kind == "s3" else nullcontext():
                found[kind] = {f: (want, seen) for f, want, seen in cells(kind, Path(room))}
    faults = list(dict.fromkeys(fault for cell in found.values() for fault in cell))
    wrong = sum(want != seen for cell in found.values() for want, seen in cell.values())
    count = sum(map(len, found.values()))
    lines = [
        "# The matrix of faults",
        "",
        f"Printed by `python docs/make_faults.py`: {count} cells, {wrong} with another answer than "
        "the expected one. `make soak` asks for each; `make test` asks for each of containers "
        "once, of pictures twice.",
        "",
        "A run waits for the disk when a file's bytes are written (flush 1), when its line in the "
        "journal is (flush 2), and so on to the journal's joining. The power is cut at each flush, "
        "three times: without anything that was not flushed, and with some of it. Names are in "
        "order where a file system has a journal of them.",
        "",
        f"| fault | expected | {' | '.join(found)} |",
        f"|{' --- |' * (len(found) + 2)}",
    ]
    for fault in faults:
        row = [found[kind].get(fault) for kind in found]
        want = " or ".join(dict.fromkeys(cell[0] for cell in row if cell))
        seen = ["-" if c is None else "yes" if c[0] == c[1] else c[1] for c in row]
        lines.append(f"| {fault} | {want} | {' | '.join(seen)} |")
    PAGE.write_text("\n".join(lines) + "\n")
    print(f"{count} cells, {wrong} wrong")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
