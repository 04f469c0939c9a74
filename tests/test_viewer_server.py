"""The viewer's server answers this user's page and nobody else."""

import http.client
import json
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
import webbrowser
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import pytest

import flurries as fl
from flurries.viewer.server import MOST_BYTES, MOST_LINES, Server, open_page

SCENE = fl.Scene("#203040", size=(64, 48), effects=[fl.effects.TentSnow(flakes=50)])


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    served = Server(SCENE, save=tmp_path / "tuned.toml")
    runner = threading.Thread(target=served.serve_forever, args=(0.01,), daemon=True)
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
    # No other page may frame or read it, and no other machine ask.
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Access-Control-Allow-Origin"] is None
    assert server.socket.getsockname()[0] == "127.0.0.1" and len(server.token) >= 32


def test_a_question_is_answered(server: Server):
    status, data, _ = asked(server, f"/{server.token}/ask", json.dumps({"t": 3.0}).encode())
    length = int.from_bytes(data[:4], "little")
    head = json.loads(data[4 : 4 + length])
    assert status == 200 and head["t"] == 3.0
    assert data[4 + length :][:3] == b"\xff\xd8\xff"


STRANGE = ("/", "/ask", "/x/ask", "/{t}x/ask", "/{t}/../server.py", "/{t}/%2e%2e/server.py",
           "/{t}//etc/passwd", "/{t}/page.html/x")  # fmt: skip


def test_strangers_and_foreign_names_get_nothing(server: Server):
    for body in (None, b"{}"):
        for path in STRANGE:
            assert asked(server, path.format(t=server.token), body)[0] == 404, path
        for host in ("evil.example", "evil.example:80", "127.0.0.1", ""):
            assert asked(server, f"/{server.token}/ask", body, host)[0] == 404, host


@pytest.mark.parametrize("body", [
    b"", b"{", b"[" * 5000, b"\xff", b"x" * (MOST_BYTES + 1), b'{"t": 1e999}', b'{"t": NaN}',
    *(b'{"charts": true, "%b": %b}' % (field, value % (b"9" * 5000)) for field, value in (
        (b"t", b"-%b"), (b"effect", b"%b"), (b"chart", b"%b"), (b"at", b"[%b, 0.5]"),
        (b"values", b'{"0.amount": %b}'),
    )),
])  # fmt: skip
def test_what_is_no_question_is_refused(
    server: Server, body: bytes, capfd: pytest.CaptureFixture[str]
):
    with socket.create_connection(("127.0.0.1", server.server_port)) as line:
        line.sendall(f"POST /{server.token}/ask HTTP/1.1\r\nHost: 127".encode())
    try:
        assert asked(server, f"/{server.token}/ask", body)[0] == 400
    except ConnectionError:
        assert len(body) > MOST_BYTES  # it hung up without reading all of it
    # And it goes on.
    assert asked(server, f"/{server.token}/ask", b"{}")[0] == 200
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    "length",
    [b"\xb2", b"1" * 5000, b"-1", b"+2", b"2, 2", b"0x2", b"2.0", b"", b"2\r\nContent-Length: 2"],
)
def test_16_13_an_odd_content_length_answers_400(
    server: Server, length: bytes, capfd: pytest.CaptureFixture[str]
):
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=20) as line:
        host = f"127.0.0.1:{server.server_port}"
        start = f"POST /{server.token}/ask HTTP/1.1\r\nHost: {host}\r\nContent-Length: "
        line.sendall(start.encode() + length + b"\r\n\r\n{}")
        assert line.recv(1 << 16).startswith(b"HTTP/1.1 400 ")
    assert "Traceback" not in capfd.readouterr().err


def test_16_13_connections_are_capped(server: Server):
    lines = [
        socket.create_connection(("127.0.0.1", server.server_port), timeout=20)
        for _ in range(MOST_LINES)
    ]
    try:
        # The lines that wait have threads; the next one is told so, and no thread is made for it.
        assert asked(server, f"/{server.token}/")[0] == 503
        assert threading.active_count() < MOST_LINES + 20
    finally:
        for line in lines:
            line.close()
    for _ in range(100):
        if asked(server, f"/{server.token}/")[0] == 200:
            break
        time.sleep(0.05)
    else:
        pytest.fail("lines that are closed must make room")


def test_16_13_the_token_is_in_no_list_of_processes(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A browser that writes its command line down, as every user of the machine can read it."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    browser = tmp_path / "browser"
    browser.write_text(
        f'#!/bin/sh\necho "$@" > {tmp_path}/words.new\nmv {tmp_path}/words.new {tmp_path}/words\n'
    )
    browser.chmod(0o755)
    monkeypatch.setattr(webbrowser, "open", webbrowser.GenericBrowser(str(browser)).open)
    open_page(server)
    words = (tmp_path / "words").read_text()
    assert words.startswith("file:///") and server.token not in words
    page = Path(url2pathname(urlsplit(words.strip()).path))
    assert page.stat().st_mode & 0o077 == 0
    assert f"url={server.url}" in page.read_text()
    server.server_close()
    assert not page.exists()


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
