"""A server that is not ours, of bare sockets, and the host's end of a wire."""

from __future__ import annotations

import queue
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Self

from google.protobuf.message import Message

from drivers.robotino.rest.wire import HttpWire
from runtime.messages import HttpAnswer, HttpRequest
from runtime.time import SECOND

WHOLE = b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n[]"
STAMP = 1234567
LONG = 10.0
"""s, far more than anything here takes"""

Serve = Callable[[socket.socket, int], None]


def heard(line: socket.socket) -> tuple[str, bytes] | None:
    """Return the head and the body of a request, or nothing at the end of the connection."""
    data = b""
    while b"\r\n\r\n" not in data:
        more = line.recv(4096)
        if not more:
            return None
        data += more
    head, _, body = data.partition(b"\r\n\r\n")
    text = head.decode()
    length = next((int(one[15:]) for one in text.split("\r\n") if one.lower().startswith("content-length:")), 0)
    while len(body) < length:
        body += line.recv(4096)
    return text, body


class Stranger:
    """Gives every connection, and its number from 0, to `serve`, in a thread of its own."""

    def __init__(self, serve: Serve, port: int = 0) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listener.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"
        self.serve = serve
        self.lines: list[socket.socket] = []
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                line, _ = self._listener.accept()
                line.settimeout(LONG)
                self.lines.append(line)
                threading.Thread(target=self._run, args=(line, len(self.lines) - 1), daemon=True).start()

    def _run(self, line: socket.socket, number: int) -> None:
        with suppress(OSError), line:
            self.serve(line, number)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for line in [self._listener, *self.lines]:
            with suppress(OSError):
                line.shutdown(socket.SHUT_RDWR)
            line.close()
        self._thread.join(LONG)


class Host:
    """Opens a wire, and keeps what it brings."""

    def __init__(self, url: str) -> None:
        self.wire = HttpWire(url)
        self.found: dict[int, HttpAnswer] = {}
        self._came: queue.Queue[HttpAnswer] = queue.Queue()
        self.count = 0
        self.wire.open(self._take, lambda: STAMP)

    def _take(self, message: Message) -> None:
        assert isinstance(message, HttpAnswer)
        self._came.put(message)

    def ask(self, lane: str = "odometry", method: str = "GET", body: bytes = b"", timeout: float = LONG) -> int:
        """Carry a request; return its id."""
        self.count += 1
        self.wire.carry(
            HttpRequest(
                id=self.count, lane=lane, method=method, path=f"/data/{lane}", body=body, timeout=int(timeout * SECOND)
            )
        )
        return self.count

    def tell(self, body: bytes, timeout: float = LONG) -> int:
        """Carry what the drive is told."""
        return self.ask("drive", "PUT", body, timeout)

    def answer(self, number: int) -> HttpAnswer:
        """Wait for the answer to a request."""
        while number not in self.found:
            one = self._came.get(timeout=2 * LONG)
            assert one.id not in self.found, "answered twice"
            self.found[one.id] = one
        return self.found[number]

    def more(self) -> int:
        """Return how many answers came that nobody waited for."""
        return self._came.qsize()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.wire.close()
