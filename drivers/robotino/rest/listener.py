"""The socket of the REST double: connections, the shape of HTTP, and the faults that go on below it."""

from __future__ import annotations

import socket
import struct
import threading
import time
from enum import StrEnum
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from socketserver import BaseServer, ThreadingTCPServer
from typing import Any, Protocol

from drivers.robotino.rest.restapid import Response

_MOST = 2**20
"""bytes of a body"""
_DIGITS = 12
_DRIP = 0.02
"""s between two bytes"""
_STEP = 0.01
_GARBAGE = b"\x00\xff\x16\x03 this is no HTTP \xde\xad\r\n\r\n"


class Fault(StrEnum):
    """What can be wrong with every request that comes."""

    NONE = "none"
    HANG = "hang"  # never answered, and cut when the fault is over
    RESET = "reset"
    GARBAGE = "garbage"
    HALF = "half"
    DRIP = "drip"
    ERROR = "error"
    ERROR_READS = "error-reads"


class Owner(Protocol):
    """Who answers.

    Attributes:
        connections: how many were accepted. lock: for that.
    """

    address: str
    port: int
    connections: int
    lock: threading.Lock

    @property
    def fault(self) -> Fault:
        """Return what is wrong now."""

    def answer(self, method: str, target: str, body: bytes) -> Response:
        """Return the answer to a whole request."""


class Listener(ThreadingTCPServer):
    """One listening socket and its connections, a thread each."""

    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False
    request_queue_size = 64

    def __init__(self, owner: Owner) -> None:
        self.owner = owner
        self.over = False
        self._lines: set[socket.socket] = set()
        super().__init__((owner.address, owner.port), _Handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Take a connection."""
        with self.owner.lock:
            self.owner.connections += 1
            self._lines.add(request)
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection; one that is to be reset must not be ended in good manners first."""
        with self.owner.lock:
            self._lines.discard(request)
        if request.fileno() >= 0 and request.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER):
            request.close()
        else:
            super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A connection that broke is the client's affair, and no news."""

    def cut(self) -> None:
        """Close every connection."""
        self.over = True
        with self.owner.lock:
            lines = list(self._lines)
        for line in lines:
            try:
                line.shutdown(socket.SHUT_RDWR)
            except OSError:
                continue  # it has gone by itself


class _Handler(BaseHTTPRequestHandler):
    """One connection. `http.server` reads the head; bodies and answers are ours."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    timeout = 60.0

    def __init__(self, request: Any, client_address: Any, server: BaseServer) -> None:
        assert isinstance(server, Listener)
        self.listener = server
        super().__init__(request, client_address, server)

    def do_GET(self) -> None:
        """Take a whole request, and answer as the fault that is switched on allows."""
        body = self._body()
        owner = self.listener.owner
        fault = owner.fault
        if body is None:
            return
        if fault in (Fault.HANG, Fault.RESET, Fault.GARBAGE):
            self.close_connection = True
            while fault == Fault.HANG == owner.fault and not self.listener.over:
                time.sleep(_STEP)
            if fault == Fault.RESET:
                self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            elif fault == Fault.GARBAGE:
                self.connection.sendall(_GARBAGE)
            return
        answer = owner.answer(str(self.command), self.path, body)
        data = self._head(answer.status, answer.media, len(answer.body)) + answer.body
        if fault == Fault.HALF:
            self.close_connection = True
            data = data[: max(len(data) - max(len(answer.body) // 2, 1), 1)]
        if fault == Fault.DRIP:
            for k in range(len(data)):
                if self.listener.over:
                    return
                self.connection.sendall(data[k : k + 1])
                time.sleep(_DRIP)
        else:
            self.connection.sendall(data)

    do_PUT = do_POST = do_DELETE = do_OPTIONS = do_GET  # noqa: N815

    def log_message(self, format: str, *args: object) -> None:
        """Write nothing."""

    def _body(self) -> bytes | None:
        """Return the body, or answer that its length cannot be."""
        if self.headers.get("Transfer-Encoding"):
            self._refuse(411)
            return None
        length = (self.headers.get("Content-Length") or "0").strip()
        if not (length.isascii() and length.isdigit()):
            self._refuse(400)
            return None
        if len(length) > _DIGITS or int(length) > _MOST:
            self._refuse(413)
            return None
        body = self.rfile.read(int(length))
        if len(body) < int(length):
            self.close_connection = True  # the client went away within its request
            return None
        return body

    def _refuse(self, status: int) -> None:
        self.close_connection = True
        self.connection.sendall(self._head(status, "text/plain", 0))

    def _head(self, status: int, media: str, length: int) -> bytes:
        try:
            phrase = HTTPStatus(status).phrase
        except ValueError:
            phrase = "Unknown"
        ends = "Connection: close\r\n" if self.close_connection else ""
        head = f"HTTP/1.1 {status} {phrase}\r\nContent-Type: {media}\r\nContent-Length: {length}\r\n{ends}\r\n"
        return head.encode("latin-1", "replace")
