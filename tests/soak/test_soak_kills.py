"""Runs that are killed at random moments, alone and beside two others: nothing wrong or left."""

import os
import sys
import tempfile
import time
from contextlib import nullcontext
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import fsspec
import numpy as np
import pytest
from length import times

from flurries.augment.corrupt import corrupt
from flurries.io import write_picture
from flurries.output.journal import NAME

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))

from faults.shot import PLATE, Shot, s3
from faults.within import CLEAN


class Pictures(Shot):
    def __init__(self, kind: str, room: Path) -> None:
        super().__init__(kind, room)
        (room / "in").mkdir()
        for number in range(3):
            write_picture(room / "in" / f"{number}.png", np.roll(PLATE, number))

    def write(self, seed: int = 0, **more: Any) -> str:
        done = corrupt(self.room / "in", self.way, severity=(1, 5), seed=seed, workers=1)
        return f"made {len(done.written)}, kept {len(done.kept)}"

    def contents(self, folder: str = "") -> dict[str, bytes]:
        files = [path for path in Path(self.way).rglob("*") if path.is_file()]
        return {str(f.relative_to(self.way)): f.read_bytes() for f in files if f.name != NAME}


KINDS = dict.fromkeys(("still", "png", "exr", "dpx", "mp4", "mov", "s3"), Shot)
KINDS["corrupt"] = Pictures


def work(shot: Shot, conf: dict[str, Any], parent: Connection) -> None:
    fsspec.config.conf.update(conf)
    tempfile.tempdir = str(shot.room / "temporary")
    type(shot)(shot.kind, shot.room / str(os.getpid())).write()
    parent.send("ready")
    parent.recv()
    parent.send(shot.write())


def start(shot: Shot) -> tuple[Any, Connection]:
    here, there = CLEAN.Pipe()
    child = CLEAN.Process(target=work, args=(shot, dict(fsspec.config.conf), there))
    child.start()
    there.close()
    assert here.recv() == "ready"
    return child, here


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_kills_at_random_moments(
    kind: str, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
):
    wanted, during, chance = times(13), 0, np.random.default_rng([count, *kind.encode()])

    def made(name: str) -> Shot:
        (tmp_path / name / "shot" / "temporary").mkdir(parents=True)
        return KINDS[kind](kind, tmp_path / name / "shot")

    with s3() if kind == "s3" else nullcontext():
        first = made("whole")
        child, pipe = start(first)
        began = time.monotonic()
        pipe.send("go")
        assert pipe.recv()[:4] == "made"
        lasts, whole = time.monotonic() - began, first.contents()
        child.join()
        rounds = 0
        while during < wanted:
            rounds += 1
            assert rounds < 20 * wanted, "too few were killed in the middle"
            shot = made(str(rounds))
            crew = [start(shot) for _ in range(count)]
            for _, pipe in crew:
                pipe.send("go")
            time.sleep(chance.uniform(0.0, lasts))
            crew[0][0].kill()
            crew[0][0].join()
            try:
                during += crew[0][1].recv() == ""
            except (EOFError, ConnectionError):
                during += 1
            for child, pipe in crew[1:]:
                told = pipe.recv()
                assert told[:4] == "made", told
                child.join()
            monkeypatch.setattr(tempfile, "tempdir", str(shot.room / "temporary"))
            assert shot.write()[:4] == "made"
            assert shot.is_as(whole)
            assert not list((shot.room / "temporary").iterdir())
    with capsys.disabled():
        print(f"\n{kind}, {count} at once: {during} killed in the middle, 0 wrong, 0 left over")
