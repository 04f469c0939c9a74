"""The viewer in a browser: one page and its answers, for this machine and this user alone."""

import hmac
import html
import json
import os
import re
import secrets
import sys
import tempfile
import threading
import webbrowser
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from flurries.scene.scene import Scene
from flurries.viewer.session import Session, packed
from flurries.viewer.web import PAGES, text_of

_KINDS = {"html": "text/html", "js": "text/javascript", "css": "text/css"}
_POLICY = "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'"

MOST_BYTES = 1 << 16  # A question is a few sliders.

# A page opens six; a line that says nothing keeps its place until the handler's timeout.
MOST_LINES = 32

_FULL = b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"


class Server(ThreadingHTTPServer):
    """A viewer at `url` until `shutdown` is called."""

    daemon_threads = True
    # With fewer a page's lines that come together wait a second or more for their turn.
    request_queue_size = 2 * MOST_LINES
    redirect: Path | None = None

    def __init__(self, scene: Scene, *, port: int = 0, **options: Any) -> None:
        self.session = Session(scene, **options)
        self.token = secrets.token_urlsafe(24)
        self._free = threading.BoundedSemaphore(MOST_LINES)
        super().__init__(("127.0.0.1", port), _Handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        if self._free.acquire(blocking=False):
            try:
                super().process_request(request, client_address)
            except RuntimeError:  # No thread could be made.
                self._free.release()
                raise
            return
        with suppress(OSError):
            request.sendall(_FULL)
        self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def server_close(self) -> None:
        super().server_close()
        if self.redirect is not None:
            self.redirect.unlink(missing_ok=True)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A page that was closed in the middle of an answer is no error."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/{self.token}/"


class _Handler(BaseHTTPRequestHandler):
    server: Server
    protocol_version = "HTTP/1.1"
    # Answers must not wait to be filled up to a packet: that would halve the frame rate.
    disable_nagle_algorithm = True
    timeout = 20

    def do_GET(self) -> None:
        page = "page.html" if self._name() == "" else self._name()
        if page not in PAGES:
            return self._send(404, b"not found\n", "text/plain")
        kind = _KINDS[page.rsplit(".")[-1]]
        self._send(200, text_of(page).encode(), f"{kind}; charset=utf-8")

    def do_POST(self) -> None:
        body = self._body()
        if self._name() != "ask":
            return self._send(404, b"not found\n", "text/plain")
        try:
            ask = json.loads(body)
        except (ValueError, RecursionError):
            return self._send(400, b"a question is a JSON object\n", "text/plain")
        head, buffers = self.server.session.answer(ask)
        # That a scene cannot be saved is an answer, and no fault of the question.
        saves = isinstance(ask, dict) and ask.get("kind") == "save"
        status = 400 if "error" in head and not saves else 200
        self._send(status, packed(head, buffers), "application/octet-stream")

    def _body(self) -> bytes:
        """Return the body of a request; nothing where its length is not said or is none."""
        said = self.headers.get_all("Content-Length", [])
        # Other digits than ASCII's, thousands of digits and two lengths come only from strangers.
        if len(said) == 1 and re.fullmatch("[0-9]{1,9}", said[0]) and int(said[0]) <= MOST_BYTES:
            return self.rfile.read(int(said[0]))
        # What was announced and not read would be taken for the next request.
        self.close_connection = True
        return b""

    def _name(self) -> str | None:
        """Return the path behind the token; None for strangers."""
        # The token is against other users and other sites, the name against a foreign one that
        # was made to point here.
        host = self.headers.get("Host", "")
        known = {f"{name}:{self.server.server_port}" for name in ("127.0.0.1", "localhost")}
        _, token, *rest = [*self.path.split("?")[0].split("/", 2), ""]
        if host not in known or not hmac.compare_digest(token.encode(), self.server.token.encode()):
            return None
        return rest[0]

    def _send(self, status: int, body: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", _POLICY)
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: the token stands in every address."""


def open_page(server: Server) -> None:
    """Show a viewer's page in the browser, without the token in any list of processes."""
    descriptor, path = tempfile.mkstemp(prefix="flurries-", suffix=".html")
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        address = html.escape(server.url)
        file.write(f'<!doctype html><meta http-equiv="refresh" content="0; url={address}">\n')
    server.redirect = Path(path)
    webbrowser.open(server.redirect.as_uri())


def serve(server: Server) -> None:
    with suppress(KeyboardInterrupt), server:
        server.serve_forever(poll_interval=0.2)
