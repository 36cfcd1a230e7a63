"""The REST double on a real socket: HTTP around `restapid`, with faults that can be switched while it runs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from math import inf
from types import TracebackType
from typing import Self

from drivers.robotino.rest.listener import Fault, Listener
from drivers.robotino.rest.restapid import Response

__all__ = ["Fault", "Handle", "RestServer"]

Handle = Callable[[str, str, bytes], Response]
"""Answers a request by method, target and body. It is called by one thread at a time."""


class RestServer:
    """Serves from entry to exit of a `with`, or from construction to `close`.

    Attributes:
        port: that it listens on. requests: how many came whole. connections: how many were accepted.
    """

    def __init__(self, handle: Handle, address: str = "127.0.0.1", port: int = 0) -> None:
        self.handle = handle
        self.address, self.port = address, port
        self.requests = 0
        self.connections = 0
        self.lock = threading.Lock()
        self._fault, self._over = Fault.NONE, inf
        self._listener: Listener | None = None
        self.listen()

    @property
    def url(self) -> str:
        """Return where it is."""
        return f"http://{self.address}:{self.port}"

    @property
    def fault(self) -> Fault:
        """Return what is wrong now."""
        return self._fault if time.monotonic() < self._over else Fault.NONE

    def fail(self, fault: Fault, seconds: float = inf) -> None:
        """Let this be wrong with every request from now on, for so long."""
        self._fault, self._over = fault, time.monotonic() + seconds

    def heal(self) -> None:
        """Let nothing be wrong."""
        self.fail(Fault.NONE)

    def refuse(self) -> None:
        """Close the listening socket and every connection: who comes is refused, until `listen`."""
        listener, self._listener = self._listener, None
        if listener is not None:
            listener.shutdown()
            listener.server_close()
            listener.cut()

    def listen(self) -> None:
        """Listen, on the same port as before."""
        if self._listener is None:
            self._listener = Listener(self)
            self.port = int(self._listener.server_address[1])
            threading.Thread(target=self._listener.serve_forever, args=(0.01,), daemon=True).start()

    def close(self) -> None:
        """End, with every connection."""
        self.refuse()

    def answer(self, method: str, target: str, body: bytes) -> Response:
        """Return the answer to a whole request; what `handle` raises is a 500."""
        with self.lock:
            self.requests += 1
            fault = self.fault
            if fault == Fault.ERROR or (fault == Fault.ERROR_READS and method == "GET"):
                return Response(500, "text/plain", b"switched to fail")
            try:
                return self.handle(method, target, body)
            except Exception as error:  # a server lives on
                return Response(500, "text/plain", f"{type(error).__name__}: {error}".encode())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
