"""The HTTP server: a handful of paths, each request checked before it is read, and a bound on everything.

GET /: the page (no secrets in it, so no token). GET /news: server-sent events, five a second. GET /reports: names of
the finished; GET /reports/NAME: one of them. POST /here: somebody sees the news. POST /fly, /cancel, /stop, /disarm.
"""

from __future__ import annotations

import contextlib
import errno
import json
import socket
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any
from urllib.parse import unquote

from hindrax_bringup.web.access import Access, Refused, security_headers
from hindrax_bringup.web.desk import PERIOD_S, Desk
from hindrax_bringup.web.page import PAGE, SCRIPT_HASH
from hindrax_core.errors import HindraxError

PATIENCE_S = 5.0
"""How long a client may take to say what it wants, or to take what it is sent."""
BODY_bytes = 4096
CONNECTIONS, STREAMS = 32, 8
ORDERS = ("fly", "cancel", "stop", "disarm")
JSON_TYPE, TEXT_TYPE, HTML_TYPE = "application/json", "text/plain; charset=utf-8", "text/html; charset=utf-8"


class Server(ThreadingHTTPServer):
    """Serves a desk at one address; `close` ends every stream."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = CONNECTIONS

    def __init__(self, address: str, port: int, access: Access, desk: Desk) -> None:
        self.access, self.desk = access, desk
        self.ending = threading.Event()
        self._connections = threading.BoundedSemaphore(CONNECTIONS)
        self._streams = threading.BoundedSemaphore(STREAMS)
        self.address_family = socket.AF_INET6 if ":" in address else socket.AF_INET
        try:
            super().__init__((address, port), Handler)
        except OSError as error:
            raise HindraxError(_unbound(address, port, error)) from error
        self.port = int(self.server_address[1])

    def server_bind(self) -> None:
        """Bind, without asking a name server for our own name: at the pool there is none, and that takes long."""
        TCPServer.server_bind(self)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Give a connection a thread, or drop it when there are too many."""
        if not self._connections.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve one connection and make room for another."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._connections.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of clients that went away; a mistake of ours is told with its place."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)

    @contextlib.contextmanager
    def stream(self) -> Iterator[None]:
        """Room for one stream of news; Refused when all are taken."""
        if not self._streams.acquire(blocking=False):
            raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, f"news: {STREAMS} pages are open already; close one")
        try:
            yield
        finally:
            self._streams.release()

    def close(self) -> None:
        """End the streams, then the server; from another thread than `serve_forever`."""
        self.ending.set()
        self.shutdown()
        self.server_close()


def _unbound(address: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} of {address} is taken by another program; name a free one with --port, or --port 0"
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{address} is not an address of this machine; `ip address` lists them"
    return f"port {port} of {address} cannot be served ({error.strerror}); name another with --port"


class Handler(BaseHTTPRequestHandler):
    """One request; the connection ends with it."""

    server: Server
    timeout = PATIENCE_S
    server_version, sys_version = "hindrax", ""

    def do_GET(self) -> None:
        """Serve the page, the news, the reports."""
        self._serve(self._get)

    def do_POST(self) -> None:
        """Take an order."""
        self._serve(self._post)

    def log_message(self, format: str, *_: Any) -> None:  # noqa: A002  # the name is the base class's
        """Keep the terminal for what the vehicle says."""

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Answer what is no request of ours, in the same plain way as a refusal."""
        self.close_connection = True
        self._send(code, TEXT_TYPE, f"{message or explain or 'not served'}\n".encode())

    def _serve(self, act: Callable[[], None]) -> None:
        try:
            headers = self.headers
            self.server.access.check_place(headers.get_all("Host", []), headers.get_all("Origin", []))
            act()
        except Refused as refused:
            self._send(refused.status, TEXT_TYPE, f"{refused.sentence}\n".encode())

    def _get(self) -> None:
        if self.path == "/":
            self._send(HTTPStatus.OK, HTML_TYPE, PAGE.encode())
            return
        self.server.access.check_token(self.headers.get("Authorization"))
        reports = self.server.desk.reports
        name = self.path.removeprefix("/reports/")
        if self.path == "/news":
            with self.server.stream():
                self._stream()
        elif self.path == "/reports":
            self._send(HTTPStatus.OK, JSON_TYPE, json.dumps(reports.names()).encode())
        elif name != self.path:
            self._send(HTTPStatus.OK, HTML_TYPE, reports.read(unquote(name)))
        else:
            raise Refused(HTTPStatus.NOT_FOUND, "nothing is served under this path")

    def _post(self) -> None:
        self.server.access.check_token(self.headers.get("Authorization"))
        words, name = self._words(), self.path.removeprefix("/")
        desk = self.server.desk
        if name == "here":
            if not desk.read_only:  # who cannot act is no operator
                desk.attendance.note()
            self._send(HTTPStatus.NO_CONTENT, TEXT_TYPE, b"")
        elif name in ORDERS:
            desk.order(name, words)
            self._send(HTTPStatus.ACCEPTED, TEXT_TYPE, f"{name}: passed on\n".encode())
        else:
            raise Refused(HTTPStatus.NOT_FOUND, "no such order")

    def _words(self) -> Mapping[str, Any]:
        """Read the body: a short JSON object, by its length."""
        if self.headers.get_content_type() != JSON_TYPE:
            raise Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"body: wanted {JSON_TYPE}")
        text = self.headers.get("Content-Length", "")
        if not (text.isascii() and text.isdigit()) or "Transfer-Encoding" in self.headers:
            raise Refused(HTTPStatus.LENGTH_REQUIRED, "body: wanted a Content-Length")
        if len(text) > 6 or int(text) > BODY_bytes:
            raise Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"body: wanted at most {BODY_bytes} bytes")
        try:
            found = json.loads(self.rfile.read(int(text)))
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict):
            raise Refused(HTTPStatus.BAD_REQUEST, "body: wanted one JSON object")
        return found

    def _stream(self) -> None:
        """Send the news until the page or the server goes; a page that does not take them within `timeout` is left."""
        self._head(HTTPStatus.OK, "text/event-stream; charset=utf-8")
        with contextlib.suppress(OSError):
            while not self.server.ending.is_set():
                self.wfile.write(f"data: {self.server.desk.news()}\n\n".encode())
                self.server.ending.wait(PERIOD_S)

    def _send(self, status: int, kind: str, content: bytes) -> None:
        with contextlib.suppress(OSError):  # a client that has gone wants no answer
            self._head(status, kind, length=len(content))
            self.wfile.write(content)

    def _head(self, status: int, kind: str, *, length: int | None = None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if length is not None:
            self.send_header("Content-Length", str(length))
        for name, value in security_headers(SCRIPT_HASH).items():
            self.send_header(name, value)
        self.end_headers()
