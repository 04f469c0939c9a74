"""A few frames of a scene, as files of each kind that is written."""

from __future__ import annotations

import logging
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fsspec
import numpy as np
from moto.server import ThreadedMotoServer

import flurries as fl
from flurries.io.pictures.writer import FORMATS
from flurries.io.sequences import VIDEO_EXTENSIONS
from flurries.output.journal import is_journal

STORES = ("memory", "s3")
FILMS = tuple(suffix[1:] for suffix in VIDEO_EXTENSIONS)
KINDS = [*(suffix[1:] for suffix in FORMATS), *FILMS, "still", *STORES]
PLATE = np.random.default_rng(7).integers(0, 200, (24, 32, 3)).astype(np.uint8)

# Of a film: a whole group, and a part of one.
LAST = 60


class Shot:
    """A scene over a plate, as files of one kind: three frames, one still, or a film."""

    def __init__(self, kind: str, room: Path) -> None:
        self.kind, self.room = kind, room
        self.film = kind in FILMS
        self.alone = kind == "still" or self.film
        self.plate = room / "plate.png"
        (room / "out").mkdir(parents=True)
        fl.io.write_picture(self.plate, PLATE)
        name = {"still": "still.png"}.get(kind, f"film.{kind}" if self.alone else f"%d.{kind}")
        self.folder, self.frames = str(room / "out"), 2 if kind == "still" else "1-3"
        if self.film:
            self.frames = f"1-{LAST}"
        if kind in STORES:
            name, own = "%d.png", uuid.uuid4().hex
            self.folder = f"s3://films/{own}" if kind == "s3" else f"memory://{own}"
        self.pattern = f"{self.folder}/{name}"
        self.victim = self.pattern.replace("%d", "2")
        self.name = Path(self.victim).name
        self.system, self.way = fsspec.core.url_to_fs(self.folder, use_listings_cache=False)

    def write(self, seed: int = 0, **more: Any) -> str:
        """Return what a run says: how many it made and kept, or its refusal."""
        snow = fl.effects.TentSnow("heavy", flakes=20)
        scene = fl.Scene(self.plate, effects=snow, seed=seed)
        try:
            done = scene.write(self.pattern, self.frames, quality="draft", **more)
        except (ValueError, OSError, RuntimeError) as error:
            return f"{type(error).__name__}: {error}"
        except (KeyboardInterrupt, SystemExit) as error:
            return type(error).__name__
        return f"made {len(done.written)}, kept {len(done.kept)}"

    def contents(self, folder: str = "") -> dict[str, bytes]:
        """Return all files but those of the journal, hidden ones too."""
        found = {}
        for key in self.system.ls(f"{self.way}{folder}", detail=False):
            name = Path(key).name
            if not is_journal(name):
                plain = self.kind in STORES or Path(key).is_file()
                found[name] = self.system.cat_file(key) if plain else b"no plain file"
        return found

    def is_as(self, whole: dict[str, bytes]) -> bool:
        """Whether the files of a whole run are there, one journal, and nothing else."""
        names = [Path(key).name for key in self.system.ls(self.way, detail=False)]
        return self.contents() == whole and sum(map(is_journal, names)) == 1

    def put(self, data: bytes) -> None:
        self.system.pipe_file(f"{self.way}/{self.name}", data)

    def drop_journal(self, folder: str = "") -> None:
        for key in self.system.ls(f"{self.way}{folder}", detail=False):
            if is_journal(Path(key).name):
                self.system.rm_file(key)


@contextmanager
def s3() -> Iterator[ThreadedMotoServer]:
    """Serve a bucket on this machine."""
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    os.environ["NO_PROXY"] = "*"
    fsspec.config.conf["s3"] = {
        "endpoint_url": f"http://{host}:{port}", "key": "a", "secret": "b"
    }  # fmt: skip
    fsspec.filesystem("s3").makedirs("films", exist_ok=True)
    yield server
    server.stop()
