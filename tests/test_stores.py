"""Frames behind urls, and on disks that fail: no frame lost, no false success (issue 16, 14)."""

import subprocess
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fsspec
import pytest
from fsspec.implementations.memory import MemoryFileSystem
from moto.server import ThreadedMotoServer

import flurries as fl
from flurries.cli import main
from flurries.io.atomic import hidden_name
from flurries.output import crew
from flurries.output.journal import is_journal
from workers import group, workers

SCENE = fl.Scene("#304050", size=(96, 64), effects=fl.effects.TentSnow("heavy", flakes=100))
KEYS = {"AWS_ACCESS_KEY_ID": "a", "AWS_SECRET_ACCESS_KEY": "b", "AWS_DEFAULT_REGION": "us-east-1"}


def named(place: str) -> Any:
    return fsspec.core.url_to_fs(place, use_listings_cache=False)


def contents(place: str) -> dict[str, bytes]:
    system, folder = named(place)
    keys = {Path(key).name: key for key in system.ls(folder, detail=False)}
    return {name: system.cat_file(key) for name, key in keys.items() if not is_journal(name)}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: Any) -> dict[str, bytes]:
    place = tmp_path_factory.mktemp("whole") / "out"
    SCENE.write(place / "%04d.png", "1-12")
    return contents(str(place))


class Server:
    """S3 on the loopback; stopped and started again it has what it had."""

    def __init__(self) -> None:
        self.host, self.port = "127.0.0.1", 0
        self.start()

    def stop(self) -> None:
        self.server.stop()

    def start(self) -> None:
        self.server = ThreadedMotoServer(ip_address=self.host, port=self.port, verbose=False)
        self.server.start()
        self.host, self.port = self.server.get_host_and_port()


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server()
    with pytest.MonkeyPatch.context() as patch:
        for name, value in KEYS.items():
            patch.setenv(name, value)
        patch.setenv("NO_PROXY", "*")
        patch.setenv("FSSPEC_S3_ENDPOINT_URL", f"http://{server.host}:{server.port}")
        patch.setitem(fsspec.config.conf, "s3", {
            "endpoint_url": f"http://{server.host}:{server.port}",
            "config_kwargs": {"retries": {"max_attempts": 1}, "connect_timeout": 2},
        })  # fmt: skip
        fsspec.filesystem("s3").makedirs("films", exist_ok=True)
        yield server
    server.stop()


@pytest.fixture(params=["local", "memory", "s3"])
def place(request: Any, tmp_path: Path) -> str:
    if request.param == "s3":
        request.getfixturevalue("server")
    token = uuid.uuid4().hex
    return {
        "local": f"file://{tmp_path}/out", "memory": f"memory://{token}",
        "s3": f"s3://films/{token}",
    }[request.param]  # fmt: skip


def test_16_14_frames_are_the_same_bytes_in_every_store(place: str, whole: dict[str, bytes]):
    done = SCENE.write(f"{place}/%04d.png", "1-12")
    assert done.written == list(range(1, 13)) and contents(place) == whole
    # What is missing is made again; the matrix of faults has all else.
    system, folder = named(place)
    system.rm_file(f"{folder}/0003.png")
    again = SCENE.write(f"{place}/%04d.png", "1-12")
    assert again.written == [3] and len(again.kept) == 11
    assert contents(place) == whole


def test_16_14_the_command_line_renders_and_checks(place: str, capsys: Any):
    words = ["render", "#304050", "--snow", "heavy", "--size", "96x64", "--frames", "1-2", "-q"]
    assert main([*words, "-o", f"{place}/%04d.png"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert [line.rsplit("/", 1)[1] for line in out] == ["0001.png", "0002.png"]
    assert main(["check", place, "-q"]) == 0
    system, folder = named(place)
    system.rm_file(f"{folder}/0001.png")
    system.pipe_file(f"{folder}/0002.png", b"other")
    assert main(["check", place]) == 3
    err = capsys.readouterr().err
    assert "0001.png is missing" in err and "0002.png has changed" in err


@pytest.fixture
def client(monkeypatch: Any) -> Iterator[Any]:
    group(3, monkeypatch)
    with workers(1, 2) as client:
        yield client


def test_16_14_workers_write_to_s3(server: Server, client: Any, whole: Any, monkeypatch: Any):
    place = f"s3://films/{uuid.uuid4().hex}"
    assert len(SCENE.write(f"{place}/%04d.png", "1-12", dask=client).written) == 12
    assert contents(place) == whole
    named(place)[0].rm_file(named(place)[1] + "/0004.png")
    assert SCENE.write(f"{place}/%04d.png", "1-12", dask=client).written == [4]
    assert contents(place) == whole
    # A store that each worker has for itself is no success.
    monkeypatch.setattr(crew, "_LATE", 0.3)
    with pytest.raises(OSError, match=r"memory:///apart/0.*\.png: a worker has written it, but"):
        SCENE.write("memory://apart/%04d.png", "1-12", dask=client)


def test_16_14_a_store_that_vanishes(server: Server, whole: dict[str, bytes]):
    place = f"s3://films/{uuid.uuid4().hex}"

    def progress(frames: Any) -> Iterator[int]:
        for number in frames:
            if number == 12:
                while not named(place)[0].glob(f"{place}/*.png"):
                    time.sleep(0.01)
                server.stop()
            yield number

    try:
        with pytest.raises(OSError, match=r"^s3://films/.*"):
            SCENE.write(f"{place}/%04d.png", "1-12", progress=progress)
    finally:
        server.start()
    there = contents(place)
    frames = {name: data for name, data in there.items() if name.endswith("png")}
    assert frames.items() <= whole.items()
    done = SCENE.write(f"{place}/%04d.png", "1-12")
    assert len(done.written) + len(done.kept) == 12 and contents(place) == whole


class Apart(MemoryFileSystem):
    """A store in memory with a name and objects of its own."""

    @classmethod
    def _strip_protocol(cls, path: str) -> str:
        return str(MemoryFileSystem._strip_protocol(path.replace(f"{cls.protocol}://", "/")))


class Sealed(Apart):
    """A store that can be read alone."""

    protocol = "sealed"

    def pipe_file(self, path: str, value: bytes, mode: str = "overwrite", **more: Any) -> None:
        raise PermissionError(13, "Access denied", path)


class Plain(Apart):
    """A store in which half an object can be seen."""

    protocol = "plain"
    store: dict[str, Any] = {}  # noqa: RUF012


class Losing(Apart):
    """A store that says yes and keeps half of it."""

    protocol = "losing"
    store: dict[str, Any] = {}  # noqa: RUF012

    def pipe_file(self, path: str, value: bytes, mode: str = "overwrite", **more: Any) -> None:
        super().pipe_file(path, value[: len(value) // 2])


for kind in (Sealed, Plain, Losing):
    fsspec.register_implementation(kind.protocol, kind, clobber=True)


def test_16_14_a_read_only_store():
    with pytest.raises(PermissionError, match=r"^sealed://.*: Access denied"):
        SCENE.write("sealed://out/%04d.png", "1-3")
    assert not Sealed().find("/out")


def test_16_14_a_store_that_keeps_half_is_no_success():
    with pytest.raises(OSError, match=r"losing://.*: does not read back as what was written"):
        SCENE.write("losing://out/%04d.png", "1-3")


def test_16_14_where_halves_are_seen_frames_are_renamed(whole: dict[str, bytes]):
    dead = subprocess.Popen(["true"])
    dead.wait()
    own = hidden_name(".png")
    gone = f"{own[:20]}{dead.pid:06x}{own[26:]}"
    for name in (own, gone):
        Plain().pipe_file(f"/out/{name}", b"half")
    SCENE.write("plain://out/%04d.png", "1-12")
    # What a process left that has ended is gone; another's is not.
    assert contents("plain://out") == {**whole, own: b"half"}


@pytest.mark.parametrize(("target", "words"), [
    ("s3://films/film.mp4", "a video is written to this machine"),
    ("simplecache::s3://films/%04d.png", "name the store itself"),
    ("nothing://films/%04d.png", "Protocol not known: nothing"),
])  # fmt: skip
def test_16_14_a_url_that_cannot_be_is_one_sentence(target: str, words: str, capsys: Any):
    code = main(["render", "#304050", "--snow", "heavy", "--frames", "1", "-o", target])
    err = capsys.readouterr().err
    assert code == 2 and words in err and len(err.splitlines()) == 1, err
