"""What the journal costs: `python docs/make_journal.py` writes it into internals/reliability.md.

Flushes are counted and left out, so that the disk is none of the time, which is the processor's.
"""

from __future__ import annotations

import os
import re
import statistics
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import s3fs
from faults.shot import s3

import flurries as fl

PAGE = Path(__file__).parent / "internals" / "reliability.md"
SCENE = fl.Scene("#304050", size=(64, 48), effects=fl.effects.TentSnow(flakes=20))
FRAMES, PART, SENT = 10_000, 1000, 200


def on_a_disk(room: Path) -> tuple[float, float, float]:
    """Return flushes of a frame, milliseconds of the rest, and seconds in which a run goes on."""
    flushes: Counter[str] = Counter()
    flush, os.fsync = os.fsync, lambda descriptor: flushes.update(["flush"])
    fl.settings(threads=1)
    beyond: list[float] = []
    try:
        # In turns, so that a busy moment of the machine meets both.
        for first in range(1, FRAMES, PART):
            last, started = first + PART - 1, time.process_time()
            for number in range(first, last + 1):
                fl.io.write_picture(room / f"{number}.png", SCENE.render(number))
            between = time.process_time()
            flushes.clear()
            SCENE.write(room / "out" / "%d.png", f"{first}-{last}")
            beyond.append(time.process_time() - between - (between - started))
        made, started = flushes["flush"], time.process_time()
        assert len(SCENE.write(room / "out" / "%d.png", f"1-{FRAMES}").kept) == FRAMES
        return made / PART, 1e3 * statistics.median(beyond) / PART, time.process_time() - started
    finally:
        os.fsync = flush


def on_s3() -> Counter[str]:
    """Return the requests of a run."""
    calls: Counter[str] = Counter()
    call = s3fs.S3FileSystem._call_s3

    def counted(system: Any, method: str, *rest: Any, **more: Any) -> Any:
        calls.update([method])
        return call(system, method, *rest, **more)

    with s3():
        s3fs.S3FileSystem._call_s3 = counted
        SCENE.write("s3://films/%d.png", f"1-{SENT}")
        s3fs.S3FileSystem._call_s3 = call
    return calls


def main() -> None:
    """Write the table."""
    with tempfile.TemporaryDirectory() as room:
        flushes, beyond, seconds = on_a_disk(Path(room))
    calls = on_s3()
    asked = [name for name in calls if name.startswith(("get", "head", "list"))]
    rows = [
        ("flushes of a frame", "2", f"{flushes:.2f}"),
        ("beyond them, ms of the processor", "2", f"{beyond:.2f}"),
        (f"{FRAMES:,} frames gone on from, s of the processor", "3", f"{seconds:.2f}"),
        ("S3: PUT for a frame", "1.2", f"{calls['put_object'] / SENT:.2f}"),
        ("S3: GET, HEAD and LIST for a frame", "0.2", f"{sum(map(calls.get, asked)) / SENT:.2f}"),
    ]
    table = "| what | at most | found |\n| --- | --- | --- |\n"
    table += "".join(f"| {what} | {most} | {found} |\n" for what, most, found in rows)
    print(table)
    text = PAGE.read_text()
    PAGE.write_text(re.sub(r"\| what \| at most \|(.*\n)+?(?=\n)", lambda _: table, text))


if __name__ == "__main__":
    main()
