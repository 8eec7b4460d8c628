"""The HTTP server: Tornado in a thread of its own, with a bound on connections, sizes and patience."""

import asyncio
import errno
import socket
import threading
from typing import Any, cast

from tornado.http1connection import HTTP1Connection
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPConnection, HTTPServerConnectionDelegate
from tornado.iostream import IOStream

from hindrax_core.errors import HindraxError, cause
from hindrax_operator.web.access import Access
from hindrax_operator.web.page_controller import PageController
from hindrax_operator.web.request import BODY_bytes, Request, Site

PATIENCE_S = 5.0
"""How long a client may take for the head of a request, for its body, and for each piece of what it is sent."""
CONNECTIONS, STREAMS = 256, 8
HEAD_bytes, BUFFER_bytes = 1 << 14, 1 << 16
CLOSE_S = 5.0


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
        self._site = Site(access, controller, STREAMS, PATIENCE_S)
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
        listener = _Listener(
            _Requests(self._site),
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


class _Requests(HTTPServerConnectionDelegate):
    """Bounds the connections: a new one is always let in, and the one that has waited longest makes room for it.

    So slow connections cannot keep an order out. Pages that receive updates have their own limit and never make room.
    """

    def __init__(self, site: Site) -> None:
        self._site = site
        self._waiting: list[IOStream] = []

    def admit(self, stream: IOStream) -> None:
        """Make room for a connection."""
        self._waiting = [one for one in self._waiting if not one.closed() and one not in self._site.streams]
        if len(self._waiting) >= CONNECTIONS:
            self._waiting.pop(0).close()
        self._waiting.append(stream)

    def start_request(self, server_conn: object, request_conn: HTTPConnection) -> Request:  # noqa: ARG002  # Tornado's
        """Begin a request."""
        return Request(self._site, cast("HTTP1Connection", request_conn))


class _Listener(HTTPServer):
    """Tornado's server, which lets its requests bound the connections."""

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        """Serve a connection."""
        cast("_Requests", self.request_callback).admit(stream)
        super().handle_stream(stream, address)


def _unbound(address: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} of {address} is taken by another program; name a free one with --port, or --port 0"
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{address} is not an address of this machine; `ip address` lists them"
    return f"port {port} of {address} cannot be served ({cause(error)}); name another with --port"
