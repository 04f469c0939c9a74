"""What a million frames cost, and a milliard: measured on this machine, and worked out from that.

python benches/scale.py            prints the figures
python benches/scale.py --write    writes docs/internals/scale.md
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import distributed
import numpy as np

import flurries as fl
from flurries.output import groups

# Pictures that data sets and films are made of.
KINDS = {
    "640 x 480, JPEG": ((640, 480), "jpg"),
    "1920 x 1080, PNG": ((1920, 1080), "png"),
    "1920 x 1080, EXR half": ((1920, 1080), "exr"),
}
FIRST = "640 x 480, JPEG"
TURNS = 3
SECONDS = 1.0
# Frames of a run with workers.
FRAMES = 1040
CORES = 10_000


def scene(size: tuple[int, int]) -> fl.Scene:
    y, x = np.mgrid[: size[1], : size[0]] / size[0]
    grain = np.random.default_rng(1).normal(0.0, 3.0, (size[1], size[0], 3))
    plate = 90 + 60 * np.stack([np.sin(9 * x), np.sin(7 * y + x), np.cos(5 * x * y)], -1) + grain
    return fl.Scene(
        None, np.clip(plate, 0, 255).astype(np.uint8), effects=fl.TentSnow.preset("heavy")
    )


def used() -> float:
    """Seconds of processor time of this process and those that it has waited for."""
    return sum(
        part.ru_utime + part.ru_stime
        for part in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def of_a_core(kind: str) -> dict[str, float]:
    """Processor time and bytes of a frame that is rendered and written, on one thread."""
    size, ending = KINDS[kind]
    shown, cost, weight = scene(size), [], 0
    with tempfile.TemporaryDirectory() as folder:
        shown.write(f"{folder}/warm%04d.{ending}", "1-2", manifest=False)
        count = 2
        for turn in range(TURNS):
            start = used()
            shown.write(f"{folder}/{turn}-%04d.{ending}", f"1-{count}", manifest=False)
            cost.append((used() - start) / count)
            count = max(int(SECONDS / cost[-1]), 2)
        files = list(Path(folder).glob(f"*-*.{ending}"))
        weight = statistics.mean(file.stat().st_size for file in files)
    return {"cpu": statistics.median(cost), "bytes": weight}


def of_tasks(client: Any, count: int = 1000) -> float:
    """Seconds of a task that does nothing, among many."""
    client.gather(client.map(int, range(100), pure=False))
    start = time.perf_counter()
    client.gather(client.map(int, range(count), pure=False))
    return (time.perf_counter() - start) / count


def of_workers() -> dict[str, Any]:
    """Time and processor time of one sequence with one and with two workers, in turns."""
    kind = "640 x 480, JPEG"
    size, ending = KINDS[kind]
    shown = scene(size)
    wall: dict[int, list[float]] = {1: [], 2: []}
    clock: dict[int, list[float]] = {1: [], 2: []}
    task, load, here = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(TURNS):
            # Which of the two comes first changes, as a machine's pace may.
            for workers in (1, 2) if turn % 2 else (2, 1):
                with distributed.LocalCluster(
                    n_workers=workers, threads_per_worker=1, dashboard_address=":0",
                    silence_logs=50,
                ) as local, distributed.Client(local, set_as_default=False) as client:  # fmt: skip
                    client.run(_warm, size)
                    before = sum(client.run(used).values())
                    start = time.perf_counter()
                    pattern = f"{folder}/{turn}-{workers}-%04d.{ending}"
                    own = used()
                    shown.write(pattern, f"1-{FRAMES}", manifest=False, dask=client)
                    wall[workers].append(time.perf_counter() - start)
                    here.append((used() - own) / FRAMES)
                    spent = sum(client.run(used).values()) - before
                    clock[workers].append(spent / FRAMES)
                    load.append(os.getloadavg()[0])
                    task.append(of_tasks(client))
    return {
        "pairs": [a / (2.0 * b) for a, b in zip(wall[1], wall[2], strict=True)],
        "here": statistics.median(here),
        "cpu": {n: statistics.median(values) for n, values in clock.items()},
        "group": len(groups.grouped(shown, list(range(1000)))[0]),
        "task": statistics.median(task),
        "load": statistics.median(load),
    }


def _warm(size: tuple[int, int], dask_worker: Any = None) -> None:
    # A core to a worker: its writing would take another one where that is free.
    cores = sorted(os.sched_getaffinity(0))
    core = cores[int(dask_worker.name) % len(cores)]
    fl.set_threads(1)
    fl.Scene(size, effects=fl.TentSnow.preset("heavy")).render(0)
    for thread in Path("/proc/self/task").iterdir():
        os.sched_setaffinity(int(thread.name), {core})


def plan(frames: int, frame: dict[str, float], group: int, task: float) -> list[str]:
    """A row of the plan: core hours, cores for a day, storage, tasks, the scheduler's hours."""
    hours = frames * frame["cpu"] / 3600.0
    tasks = frames / group
    return [
        f"{frames:.0e}".replace("e+0", "e"), f"{hours:,.0f}", f"{max(hours / 24.0, 1):,.0f}",
        _bytes(frames * frame["bytes"]), f"{tasks:,.0f}", f"{tasks * task / 3600.0:,.1f}",
        f"{100.0 * task / (group * frame['cpu']):.2f} %", f"{group * frame['cpu'] / task:,.0f}",
    ]  # fmt: skip


def verdict(gain: float, must: float) -> str:
    return f"Asked for: {must}, aimed at: 0.98." + (" Not met." if gain < must else "")


def many_cores(frames: dict[str, dict[str, float]], workers: dict[str, Any]) -> list[str]:
    """What that many cores would do and ask of what they share, from the figures above."""
    lines = [
        f"## {CORES:,} cores",
        "",
        "Worked out, not measured: frames are cores over the processor time of one; a scheduler",
        f"takes one task in {1e3 * workers['task']:.2f} ms, and a client looks at one frame in "
        f"{1e3 * workers['here']:.2f} ms, so both",
        "say into how many parts, each with a client and a scheduler of its own, a range has to be",
        "cut. What the storage has to take is the sum over all parts.",
        "",
        "| picture | frames a second | tasks a second | parts for the schedulers | parts for the "
        "clients | written a second | flushes a second | 1e6 frames in |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for kind, frame in frames.items():
        group = len(groups.grouped(scene(KINDS[kind][0]), list(range(1000)))[0])
        rate = CORES / frame["cpu"]
        schedulers = math.ceil(rate / group * workers["task"])
        clients = math.ceil(rate * workers["here"] * frame["bytes"] / frames[FIRST]["bytes"])
        lines.append(
            f"| {kind} | {rate:,.0f} | {rate / group:,.0f} | {schedulers} | {clients} | "
            f"{_bytes(rate * frame['bytes'])} | {2.0 * rate:,.0f} | {1e6 / rate:,.0f} s |"
        )
    return lines


def _bytes(count: float) -> str:
    for unit in ("B", "KB", "MB", "GB", "TB", "PB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} EB"


def report() -> str:
    os.environ.setdefault("FLURRIES_NUM_THREADS", "1")
    fl.set_threads(1)
    frames = {kind: of_a_core(kind) for kind in KINDS}
    workers = of_workers()
    lines = [TITLE]
    lines += [
        "| picture | processor time a frame | frames a core hour | a file |",
        "| --- | --- | --- | --- |",
    ]
    for kind, cost in frames.items():
        hourly = f"{3600 / cost['cpu']:,.0f}"
        lines.append(
            f"| {kind} | {1e3 * cost['cpu']:.0f} ms | {hourly} | {_bytes(cost['bytes'])} |"
        )
    one, two = (1e3 * workers["cpu"][n] for n in (1, 2))
    pairs, load, task = workers["pairs"], workers["load"], 1e3 * workers["task"]
    gain = statistics.median(pairs)
    share = 100.0 * workers["task"] / (workers["group"] * frames["640 x 480, JPEG"]["cpu"])
    lines += [
        "",
        "## Workers and the scheduler",
        f"- From one worker to two, each held to a core: efficiency {gain:.2f} by the clock, the",
        f"  median of {TURNS} pairs of runs of {FRAMES} frames of 640 x 480",
        f"  ({', '.join(f'{pair:.2f}' for pair in pairs)}), on a machine of {os.cpu_count()} cores",
        f"  with a load of {load:.1f}, of which 2 to 3 are the bench's own. {verdict(gain, 0.95)}",
        "  Client and scheduler have no core of their own here and take theirs from the second",
        f"  worker. Processor time of a frame: {one:.1f} ms with one worker, {two:.1f} with two,",
        f"  an efficiency of {one / two:.2f}; {1e3 * workers['here']:.2f} ms in the client, which",
        "  looks at each file and its hash.",
        f"- A task that does nothing costs {task:.2f} ms. Frames of 640 x 480 come in groups of",
        f"  {workers['group']}: the scheduler takes {share:.2f} % of the work; 2 % was asked for, "
        "0.5 % aimed at.",
        "",
        "## A plan",
        PLAN,
        "",
        "| picture | frames | core hours | cores for a day | storage | tasks | scheduler, hours "
        "| of the work | cores it feeds |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    for kind in ("640 x 480, JPEG", "1920 x 1080, PNG"):
        group = len(groups.grouped(scene(KINDS[kind][0]), list(range(1000)))[0])
        for count in (10**6, 10**9):
            row = plan(count, frames[kind], group, workers["task"])
            lines.append("| " + " | ".join([kind, *row]) + " |")
    lines += ["", *many_cores(frames, workers), "", WALLS, "", SECURITY]
    return "\n".join(lines) + "\n"


TITLE = """# Many frames

Made by `python benches/scale.py --write`. Figures are of the machine that made it, a preset
`heavy` over an 8-bit plate, rendered, written, read back, flushed and renamed, one thread to a
frame; processor time, so that other work on the machine counts little.

`flurries render --dask` starts a worker on each core of this machine; `--dask tcp://host:8786`
uses a cluster's. Workers write the frames themselves, into a folder that all of them see, and
give back names and hashes; the client holds a few tasks for each worker and no more, whatever the
number of frames. A group of frames that comes again after its worker died finds the frames that
are there and makes the rest. `scene.to_dask(frames)` is the same as a lazy array, for what is
computed with frames and not kept. Scripts that start a local cluster need `if __name__ ==
"__main__":`, as all programs that start processes do.

## A frame"""

PLAN = """Core hours are frames times processor time. The scheduler's hours are tasks times its cost
for one: it is one thread, and where they pass the wall time of the whole it is what everybody waits
for."""

WALLS = """Where it breaks first:

- **The scheduler** of one cluster is one thread: it keeps as many cores busy as the work of a
  group is worth of its time for a task, the last column of the plan. Beyond that start one client
  with a scheduler of its own for each part of the range (`--frames 1-1000000`,
  `1000001-2000000`): parts share nothing.
- **One folder.** File systems slow down with millions of names in a folder, and `flurries.json`
  holds a line for each: at 10^6 frames it has some 200 MB. Write parts into folders of their own,
  10^4 to 10^5 frames each.
- **Renames and flushes.** Each frame costs an fsync of the file and of its folder. A network file
  system that takes 5 ms for each bounds one folder to 100 frames a second; many folders on many
  servers do not share that bound.
- **Storage.** At 10^9 frames files, not cores, are the price. Keep scenes and seeds instead: a
  frame is a function of both, and `to_dask` or `Scene.render` in the loader makes it again with
  the same bits in less time than a slow disk gives it back.
- **Plates.** A scene's array is sent once to each worker; a plate on disk is read by each worker
  that needs it. Put plates where all workers read fast, since rendering is faster than most
  archives."""

SECURITY = """## Security

A Dask scheduler runs whatever Python reaches it: tasks and results are pickles, and to load a
pickle is to run a program. Whoever can open a connection to a scheduler or a worker is that
worker's user. flurries adds no check of its own. So:

- keep schedulers and workers in a network that only you reach, or give both TLS certificates
  (`distributed.comm.tls` in Dask's configuration, `tls://host:8786` as the address): then only
  holders of a certificate connect, and nobody reads or changes frames on their way;
- a cluster that `--dask` starts without an address listens on this machine alone
  (`tests/test_cluster.py`), where other users of the machine can still connect;
- scene files are no programs: they are read without pickle, and `Scene.load` on a worker runs
  nothing (`tests/test_scenefile.py`). An effect of your own does travel as a pickle."""


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    text = report()
    if options.write:
        (Path(__file__).parent.parent / "docs" / "internals" / "scale.md").write_text(text)
    sys.stdout.write(text)
