"""The HTTP server: Tornado in its own thread, with bounds on connections, sizes and times.

A request is refused or accepted by its head alone, before a byte of its body is read; every write has a deadline.

GET /: the page (no secrets in it, so no token). GET /events: server-sent events, five a second. GET /reports: the runs;
GET /reports/NAME: the report of one. GET /camera/TOPIC: its next frame. GET /commissioning: what the last one found.
GET /register_service: what BlueOS asks every port of an extension by whatever name; nothing in it is a secret.
POST /here: the page is being viewed. POST /fly, /commission, /cancel, /stop, /disarm; /answer: to what a session asks.
"""

import asyncio
import errno
import json
import socket
import threading
from collections.abc import Mapping
from http import HTTPStatus
from typing import cast
from urllib.parse import unquote

from tornado.http1connection import HTTP1Connection
from tornado.httpserver import HTTPServer
from tornado.httputil import (
    HTTPConnection,
    HTTPHeaders,
    HTTPMessageDelegate,
    HTTPServerConnectionDelegate,
    RequestStartLine,
    ResponseStartLine,
)
from tornado.iostream import IOStream, StreamClosedError

from hindrax_core.errors import HindraxError, cause
from hindrax_operator.web.access import Access, RefusedRequest, security_headers
from hindrax_operator.web.page import PAGE, SCRIPT_HASH
from hindrax_operator.web.page_controller import PERIOD_S, PageController

BODY_bytes, CHUNK_bytes = 4096, 1 << 16
ORDERS = ("fly", "commission", "answer", "cancel", "stop", "disarm")
JSON_TYPE, TEXT_TYPE, HTML_TYPE = "application/json", "text/plain; charset=utf-8", "text/html; charset=utf-8"
EVENT_STREAM_TYPE = "text/event-stream; charset=utf-8"
CAMERA = "/camera/"
FRAME_TURN_S, FRAME_TURNS = 0.03, 60
IMAGES = {b"\xff\xd8\xff": "image/jpeg", b"\x89PNG\r\n\x1a\n": "image/png", b"RIFF": "image/webp"}
"""Beginning of a picture (ITU T.81 B.1.1.3, PNG 5.2, RFC 9649 2.4) and its type; a browser is sent nothing else."""
SERVICE: Mapping[str, object] = {
    "name": "hindrax",
    "description": "Identifies drag, added mass and net buoyancy of the vehicle from its own maneuvers",
    "icon": "mdi-chart-bell-curve",
    "company": "hindrax",
    "version": "0.2.0",
    "webpage": "",
    "api": "",
    "new_page": True,  # no other page may frame ours
    "works_in_relative_paths": True,
}
"""What BlueOS shows of its extension; fields of its ServiceMetadata."""
LARGEST_FRAME_bytes = 8_000_000
PATIENCE_S = 5.0
"""Time limit for the head of a request, for its body, and for each piece of the answer."""
CONNECTIONS, STREAMS = 256, 8
HEAD_bytes, BUFFER_bytes = 1 << 14, 1 << 16
CLOSE_S = 5.0


class RequestHandler(HTTPMessageDelegate):
    """Answers one request; the connection ends with it."""

    def __init__(self, site: "Site", connection: HTTP1Connection) -> None:
        self._site, self._connection = site, connection
        self._order, self._body = "", bytearray()

    async def headers_received(self, start_line: RequestStartLine | ResponseStartLine, headers: HTTPHeaders) -> None:
        """Answer a GET; of a POST, return whether its body is wanted."""
        line = cast("RequestStartLine", start_line)
        try:
            await self._begin(line, headers)
        except RefusedRequest as refused:
            self._answer(refused.status, f"{refused.sentence}\n" if line.method != "HEAD" else "")
        except (StreamClosedError, TimeoutError):  # a client that has gone, or does not take what it is sent
            self._connection.close()

    def data_received(self, chunk: bytes) -> None:
        """Keep a piece of the body; the server bounds it."""
        self._body += chunk

    def finish(self) -> None:
        """Take the order, now that the request is whole."""
        try:
            self._post(_object(self._body))
        except RefusedRequest as refused:
            self._answer(refused.status, f"{refused.sentence}\n")

    async def _begin(self, line: RequestStartLine, headers: HTTPHeaders) -> None:
        if (line.method, line.path) == ("GET", "/register_service"):
            await self._send(JSON_TYPE, json.dumps(SERVICE).encode())
            return
        self._site.access.check_place(headers.get_list("Host"), headers.get_list("Origin"))
        if line.method == "GET":
            await self._get(line.path, headers)
        elif line.method == "POST":
            self._expect(line.path, headers)
        else:
            raise RefusedRequest(HTTPStatus.NOT_IMPLEMENTED, f"{line.method}: wanted GET or POST")

    async def _get(self, path: str, headers: HTTPHeaders) -> None:
        if path == "/":
            await self._send(HTML_TYPE, PAGE.encode())
            return
        self._site.access.check_token(headers.get("Authorization"))
        reports, name, camera = self._site.controller.reports, path.removeprefix("/reports/"), path.removeprefix(CAMERA)
        if path == "/events":
            await self._stream_updates()
        elif path == "/reports":
            await self._send(JSON_TYPE, json.dumps(await asyncio.to_thread(reports.listed)).encode())
        elif path == "/commissioning":
            await self._send(JSON_TYPE, self._site.controller.commissioning().encode())
        elif name != path:
            await self._send(HTML_TYPE, await asyncio.to_thread(reports.read, unquote(name)))
        elif camera != path:
            await self._send_frame(unquote(camera), headers.get("If-None-Match", ""))
        else:
            raise RefusedRequest(HTTPStatus.NOT_FOUND, "no such path")

    def _expect(self, path: str, headers: HTTPHeaders) -> None:
        self._site.access.check_token(headers.get("Authorization"))
        self._order = path.removeprefix("/")
        if self._order not in ("here", *ORDERS):
            raise RefusedRequest(HTTPStatus.NOT_FOUND, "no such command")
        check_body(headers)

    def _post(self, words: Mapping[str, object]) -> None:
        controller = self._site.controller
        if self._order == "here":
            controller.note_viewer()
            self._answer(HTTPStatus.NO_CONTENT, "")
        else:
            controller.order(self._order, words)
            self._answer(HTTPStatus.ACCEPTED, f"{self._order}: passed on\n")

    async def _stream_updates(self) -> None:
        """Send updates until the page or the server closes, or the page stops reading."""
        site, stream = self._site, self._connection.stream
        if len(site.streams) >= STREAMS:
            full = f"events: {STREAMS} pages are open already; close one"
            raise RefusedRequest(HTTPStatus.SERVICE_UNAVAILABLE, full)
        site.streams.add(stream)
        try:
            # A proxy, such as the nginx of BlueOS, would keep events until its buffer is full.
            self._head(HTTPStatus.OK, EVENT_STREAM_TYPE, more={"X-Accel-Buffering": "no"})
            while True:
                await self._write(f"data: {site.controller.update()}\n\n".encode())
                await asyncio.sleep(PERIOD_S)
        finally:
            site.streams.discard(stream)

    async def _send_frame(self, camera: str, seen: str) -> None:
        """Send the next frame that was not seen yet; 304 when none comes for a while."""
        for _ in range(FRAME_TURNS):
            frame = self._site.controller.frame(camera)
            if frame is not None and f'"{frame.number}"' != seen:
                await self._send(image_type(frame.content), frame.content, {"ETag": f'"{frame.number}"'})
                return
            await asyncio.sleep(FRAME_TURN_S)
        self._head(HTTPStatus.NOT_MODIFIED, TEXT_TYPE)
        self._connection.finish()

    async def _send(self, kind: str, content: bytes, more: Mapping[str, str] | None = None) -> None:
        self._head(HTTPStatus.OK, kind, len(content), more)
        for start in range(0, len(content), CHUNK_bytes):
            await self._write(content[start : start + CHUNK_bytes])
        self._connection.finish()

    async def _write(self, content: bytes) -> None:
        async with asyncio.timeout(PATIENCE_S):
            await self._connection.write(content)

    def _answer(self, status: HTTPStatus, text: str) -> None:
        """Send a short answer, which the kernel accepts at once."""
        content = text.encode()
        self._head(status, TEXT_TYPE, len(content))
        self._connection.write(content)
        self._connection.finish()

    def _head(
        self, status: HTTPStatus, kind: str, length: int | None = None, more: Mapping[str, str] | None = None
    ) -> None:
        headers = HTTPHeaders({"Server": "hindrax", "Connection": "close", "Content-Type": kind, **(more or {})})
        headers.update(security_headers(SCRIPT_HASH))
        if length is not None:
            headers["Content-Length"] = str(length)
        self._connection.write_headers(ResponseStartLine("HTTP/1.1", status, status.phrase), headers)


def image_type(content: bytes) -> str:
    """Return the type of a picture by its beginning; RefusedRequest for what is no picture, or a giant one."""
    for begin, kind in IMAGES.items():
        if content.startswith(begin) and len(content) <= LARGEST_FRAME_bytes:
            return kind
    found = content[:4].hex(" ") or "nothing"
    raise RefusedRequest(
        HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
        f"camera: found {len(content)} bytes that begin with {found}, wanted JPEG, PNG or WebP below 8 MB",
    )


def check_body(headers: HTTPHeaders) -> None:
    """Raise RefusedRequest for a body that is not announced as short JSON, by its length."""
    if headers.get("Content-Type", "").partition(";")[0].strip().lower() != JSON_TYPE:
        raise RefusedRequest(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"body: wanted {JSON_TYPE}")
    length = headers.get("Content-Length", "")
    if not (length.isascii() and length.isdigit()) or "Transfer-Encoding" in headers:
        raise RefusedRequest(HTTPStatus.LENGTH_REQUIRED, "body: wanted a Content-Length")
    if len(length) > 6 or int(length) > BODY_bytes:
        raise RefusedRequest(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"body: wanted at most {BODY_bytes} bytes")


def _object(body: bytes | bytearray) -> Mapping[str, object]:
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise RefusedRequest(HTTPStatus.BAD_REQUEST, "body: wanted one JSON object")
    return found


class Server(threading.Thread):
    """Serves a controller at one address, from `start` to `close`; bound as soon as it is made."""

    def __init__(self, address: str, port: int, access: Access, controller: PageController) -> None:
        super().__init__(name="web", daemon=True)
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        try:
            self._socket = socket.create_server((address, port), family=family, backlog=CONNECTIONS)
        except OSError as error:
            raise HindraxError(_unbound(address, port, error)) from error
        self._socket.setblocking(False)
        self.port = int(self._socket.getsockname()[1])
        self._site = Site(access, controller)
        self._loop, self._over = asyncio.new_event_loop(), asyncio.Event()

    def run(self) -> None:
        """Serve until `close`."""
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    def close(self) -> None:
        """End every connection, then the server; from another thread."""
        if self.is_alive():
            self._loop.call_soon_threadsafe(self._over.set)
            self.join(CLOSE_S)
        else:
            self._loop.close()
        self._socket.close()

    async def _serve(self) -> None:
        listener = HTTPServer(
            self._site,
            no_keep_alive=True,
            max_header_size=HEAD_bytes,
            max_body_size=BODY_bytes,
            max_buffer_size=BUFFER_bytes,
            idle_connection_timeout=PATIENCE_S,
            body_timeout=PATIENCE_S,
        )
        listener.add_socket(self._socket)
        await self._over.wait()
        listener.stop()
        await listener.close_all_connections()


class Site(HTTPServerConnectionDelegate):
    """State of all requests. A new connection is always accepted; the one that has waited longest makes room for it.

    So slow connections cannot keep an order out. Pages that receive updates have their own limit and never make room.
    """

    def __init__(self, access: Access, controller: PageController) -> None:
        self.access, self.controller = access, controller
        self.streams: set[IOStream] = set()
        """Connections that receive updates now."""
        self._waiting: list[IOStream] = []

    def start_request(self, server_conn: object, request_conn: HTTPConnection) -> RequestHandler:  # noqa: ARG002  # Tornado's
        """Make room for a new connection, and begin its request."""
        connection = cast("HTTP1Connection", request_conn)
        self._waiting = [one for one in self._waiting if not one.closed() and one not in self.streams]
        if len(self._waiting) >= CONNECTIONS:
            self._waiting.pop(0).close()
        self._waiting.append(connection.stream)
        return RequestHandler(self, connection)


def _unbound(address: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} of {address} is taken by another program; name a free one with --port, or --port 0"
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{address} is not an address of this machine; `ip address` lists them"
    return f"port {port} of {address} cannot be served ({cause(error)}); name another with --port"
