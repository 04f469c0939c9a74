"""The viewer in a browser: one page and its answers, for this machine and this user alone.

Bound to 127.0.0.1. Every address begins with a random token, so that neither other users nor pages
of other sites can ask; the name in the request must be this machine's, so that no foreign name can
be made to point here. What the page may write is one file, chosen on the command line.
"""

from __future__ import annotations

import hmac
import json
import secrets
import sys
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from flurries.scene.scene import Scene
from flurries.viewer.session import Session, packed
from flurries.viewer.web import PAGES

_KINDS = {"html": "text/html", "js": "text/javascript", "css": "text/css"}
_POLICY = "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'"

# A question is a few sliders.
MOST_BYTES = 1 << 16


class Server(ThreadingHTTPServer):
    """A viewer at `url` until `shutdown` is called.

    Parameters
    ----------
    scene : Scene
    port : int
        0 for any that is free.
    size, save
        See :func:`flurries.viewer.view`.
    """

    daemon_threads = True

    def __init__(self, scene: Scene, *, port: int = 0, **options: Any) -> None:
        self.session = Session(scene, **options)
        self.token = secrets.token_urlsafe(24)
        super().__init__(("127.0.0.1", port), _Handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A page that was closed in the middle of an answer is no error."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)

    @property
    def url(self) -> str:
        """Where it is."""
        return f"http://127.0.0.1:{self.server_port}/{self.token}/"


class _Handler(BaseHTTPRequestHandler):
    server: Server
    protocol_version = "HTTP/1.1"
    # Answers must not wait to be filled up to a packet: that would halve the frame rate.
    disable_nagle_algorithm = True
    timeout = 60

    def do_GET(self) -> None:
        name = self._name()
        text = None if name is None else PAGES.get(name or "page.html")
        if text is None:
            return self._send(404, b"not found\n", "text/plain")
        kind = _KINDS[(name or "page.html").rsplit(".")[-1]]
        self._send(200, text().encode(), f"{kind}; charset=utf-8")

    def do_POST(self) -> None:
        length = self.headers.get("Content-Length", "")
        body = b""
        if length.isdigit() and int(length) <= MOST_BYTES:
            body = self.rfile.read(int(length))
        else:
            # What was announced and not read would be taken for the next request.
            self.close_connection = True
        if self._name() != "ask":
            return self._send(404, b"not found\n", "text/plain")
        try:
            ask = json.loads(body)
        except (ValueError, RecursionError):
            return self._send(400, b"a question is a JSON object\n", "text/plain")
        self._send(200, packed(*self.server.session.answer(ask)), "application/octet-stream")

    def _name(self) -> str | None:
        """Return what is asked for behind the token; None for strangers."""
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


def serve(server: Server) -> None:
    """Answer until Ctrl-C."""
    try:
        server.serve_forever(poll_interval=0.2)
    except KeyboardInterrupt:
        pass
    finally:
        server.server_close()
