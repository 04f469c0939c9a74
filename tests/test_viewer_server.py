"""The viewer's server answers this user's page and nobody else."""

from __future__ import annotations

import http.client
import json
import re
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

import flurries as fl
from flurries.viewer.server import MOST_BYTES, Server

SCENE = fl.Scene((64, 48), "#203040", effects=[fl.Snow(flakes=50)])


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    served = Server(SCENE, save=tmp_path / "tuned.toml")
    runner = threading.Thread(target=served.serve_forever, daemon=True)
    runner.start()
    yield served
    served.shutdown()
    served.server_close()
    runner.join()


def asked(
    server: Server, path: str, body: bytes | None = None, host: str | None = None
) -> tuple[int, bytes, http.client.HTTPMessage]:
    line = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=20)
    headers = {} if host is None else {"Host": host}
    line.request("GET" if body is None else "POST", path, body, headers)
    reply = line.getresponse()
    data = reply.read()
    line.close()
    return reply.status, data, reply.headers


def test_the_page_and_all_that_it_loads(server: Server):
    status, page, headers = asked(server, f"/{server.token}/")
    assert status == 200 and headers["Content-Type"].startswith("text/html")
    named = re.findall(r'(?:src|href)="([a-z.]+)"', page.decode())
    assert set(named) == {"viewer.css", "page.js"}
    for name in (*named, "viewer.js"):
        assert asked(server, f"/{server.token}/{name}")[0] == 200


def test_a_question_is_answered(server: Server):
    status, data, _ = asked(server, f"/{server.token}/ask", json.dumps({"t": 3.0}).encode())
    length = int.from_bytes(data[:4], "little")
    head = json.loads(data[4 : 4 + length])
    assert status == 200 and head["t"] == 3.0
    assert data[4 + length :][:3] == b"\xff\xd8\xff"


@pytest.mark.parametrize(
    "path",
    [
        "/", "/ask", "/x/", "/x/ask", "/{t}x/ask", "/{t}/../ask", "/{t}/server.py",
        "/{t}/../server.py", "/{t}/%2e%2e/server.py", "/{t}//etc/passwd", "/{t}/page.html/x",
    ],
)  # fmt: skip
@pytest.mark.parametrize("body", [None, b"{}"], ids=["get", "post"])
def test_strangers_get_nothing(server: Server, path: str, body: bytes | None):
    assert asked(server, path.format(t=server.token), body)[0] == 404


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", ""])
def test_a_foreign_name_that_points_here_gets_nothing(server: Server, host: str):
    assert asked(server, f"/{server.token}/", host=host)[0] == 404
    assert asked(server, f"/{server.token}/ask", b"{}", host=host)[0] == 404


def test_it_listens_to_this_machine_alone(server: Server):
    assert server.socket.getsockname()[0] == "127.0.0.1"
    other = Server(SCENE)
    other.server_close()
    assert len(server.token) >= 32 and other.token != server.token


@pytest.mark.parametrize("body", [b"", b"{", b"[" * 5000, b"\xff", b"x" * (MOST_BYTES + 1)])
def test_what_is_no_question_is_refused(server: Server, body: bytes):
    try:
        assert asked(server, f"/{server.token}/ask", body)[0] == 400
    except ConnectionError:
        assert len(body) > MOST_BYTES  # it hung up without reading all of it
    # And it goes on.
    assert asked(server, f"/{server.token}/ask", b"{}")[0] == 200


def test_a_line_that_breaks_off_is_no_error(server: Server, capfd: pytest.CaptureFixture[str]):
    for _ in range(3):
        line = socket.create_connection(("127.0.0.1", server.server_port))
        line.sendall(f"POST /{server.token}/ask HTTP/1.1\r\nHost: 127".encode())
        line.close()
    assert asked(server, f"/{server.token}/")[0] == 200
    assert "Traceback" not in capfd.readouterr().err


def test_no_other_page_may_frame_or_read_it(server: Server):
    headers = asked(server, f"/{server.token}/")[2]
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Access-Control-Allow-Origin"] is None


def test_the_command(tmp_path: Path):
    SCENE.save(tmp_path / "night.toml")
    words = [sys.executable, "-m", "flurries", "view", "night.toml", "--no-browser"]
    with subprocess.Popen(
        words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        assert running.stdout is not None
        url = running.stdout.readline().strip()
        ask = urllib.request.Request(f"{url}ask", b'{"kind": "describe"}')
        with urllib.request.urlopen(ask, timeout=20) as reply:
            data = reply.read()
        assert json.loads(data[4:])["save"] == "night-tuned.toml"
        running.send_signal(2)
        assert running.wait(timeout=20) == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [(["missing.toml"], "missing.toml"), (["#000000"], "weather"), (["a.toml", "--port", "x"], "")],
)
def test_mistakes_end_with_2(words: list[str], said: str, capsys: pytest.CaptureFixture[str]):
    from flurries.cli import main

    assert main(["view", *words]) == 2
    assert said in capsys.readouterr().err
