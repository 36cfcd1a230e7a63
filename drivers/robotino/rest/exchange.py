"""One connection to a base, and one HTTP exchange after the other over it, each whole before its deadline or failed.

h11 reads and writes HTTP; the socket is ours, since the time-outs of HTTP clients are those of a single read, and a
server that drips bytes outlasts them.
"""

from __future__ import annotations

import socket
import time
from contextlib import suppress
from dataclasses import dataclass

import h11

from drivers.robotino.rest.connecting import Address, Failed, Search, is_quiet, late, left
from runtime.messages import HttpFault

MOST = 2 * 2**20
"""bytes of a body"""
_HEAD = 64 * 1024
_READ = 64 * 1024
_HTTP = b"HTTP/"
_REPEATABLE = ("GET", "PUT")
JSON = "application/json"


@dataclass(frozen=True)
class Answer:
    """A whole answer: status, media type, body."""

    status: int
    media: str
    body: bytes


class Connection:
    """To one base. `ask` is for one thread; `abort` and `end` may be called by another."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._name = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        self._search: Search | None = None
        self._line: socket.socket | None = None
        self._http: h11.Connection | None = None
        self._head = b""
        self._gone = False
        self._aborted = False
        self._ended = False

    def ask(self, method: str, path: str, body: bytes, seconds: float) -> Answer:
        """Return the answer to a request.

        A server may close a connection that is idle just when we use it: then GET and PUT are tried once more, anew.

        Args:
            seconds: for all of it, the connection too.

        Raises:
            Failed: there is none. The connection is dropped, and the next request opens another.
            h11.LocalProtocolError, UnicodeError: the path is none.
        """
        until = time.monotonic() + seconds
        self._aborted = False
        reused = self._open()
        while True:
            try:
                if not reused:
                    self._connect(until)
                return self._exchange(method, path, body, until)
            except Failed as failed:
                self.drop()
                expired = reused and not self._head and failed.fault == HttpFault.HTTP_CUT
                if not expired or self._aborted or method not in _REPEATABLE:
                    raise
                reused = False
            except BaseException:
                self.drop()
                raise

    def drop(self) -> None:
        """Close the connection, if there is one."""
        line, self._line, self._http = self._line, None, None
        if line is not None:
            line.close()

    def abort(self) -> None:
        """Let the exchange that is under way fail now."""
        self._aborted = True
        line = self._line
        if line is not None:
            with suppress(OSError):
                line.shutdown(socket.SHUT_RDWR)

    def end(self) -> None:
        """Abort, and open no connection any more."""
        self._ended = True
        self.abort()

    def _open(self) -> bool:
        """Return whether there is a connection as it should be: one where bytes wait, or their end, is not."""
        if self._http is None or self._line is None:
            return False
        if is_quiet(self._line):
            return True
        self.drop()
        return False

    def _connect(self, until: float) -> None:
        reason = "no address"
        for family, address in self._addresses(until):
            self._line = line = socket.socket(family, socket.SOCK_STREAM)
            try:
                line.settimeout(left(until, connected=False))
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                if self._ended:
                    raise Failed(HttpFault.HTTP_CUT, "ended by us", connected=False)
                line.connect(address)
            except TimeoutError as error:
                raise late(connected=False) from error
            except OSError as error:
                reason = str(error)
                self.drop()
                continue
            self._http = h11.Connection(h11.CLIENT, max_incomplete_event_size=_HEAD)
            return
        raise Failed(HttpFault.HTTP_REFUSED, f"{self._name}: {reason}", connected=False)

    def _addresses(self, until: float) -> list[Address]:
        search = self._search = self._search or Search(self._host, self._port)
        search.join(left(until, connected=False))
        if search.is_alive():
            raise Failed(HttpFault.HTTP_TIMEOUT, f"{self._host} not looked up in time", connected=False)
        self._search = None
        if search.reason:
            raise Failed(HttpFault.HTTP_REFUSED, f"{self._host}: {search.reason}", connected=False)
        return search.found

    def _exchange(self, method: str, path: str, body: bytes, until: float) -> Answer:
        http = self._http
        assert http is not None
        self._head, self._gone = b"", False
        headers = [("Host", self._name), ("Accept", "*/*"), ("User-Agent", "pushlane")]
        if method != "GET":
            headers += [("Content-Type", JSON), ("Content-Length", str(len(body)))]
        try:
            words = [h11.Request(method=method, target=path, headers=headers), h11.Data(body), h11.EndOfMessage()]
            self._send(b"".join(http.send(one) or b"" for one in words), until)
            answer = self._receive(http, until)
        except h11.RemoteProtocolError as error:
            kind = HttpFault.HTTP_CUT if self._gone else HttpFault.HTTP_MALFORMED
            raise Failed(kind, "the connection ended within the answer" if self._gone else str(error)) from error
        whole = http.our_state is h11.DONE and http.their_state is h11.DONE
        if whole and http.trailing_data == (b"", False):
            http.start_next_cycle()
        else:
            self.drop()
        return answer

    def _send(self, data: bytes, until: float) -> None:
        line, rest = self._line, memoryview(data)
        assert line is not None
        while rest:
            line.settimeout(left(until))
            try:
                rest = rest[line.send(rest) :]
            except TimeoutError as error:
                raise late() from error
            except OSError as error:
                raise Failed(HttpFault.HTTP_CUT, f"{self._name}: {error}") from error

    def _receive(self, http: h11.Connection, until: float) -> Answer:
        status, media, body = 0, "", bytearray()
        while True:
            event = http.next_event()
            if event is h11.NEED_DATA:
                http.receive_data(self._more(until))
            elif isinstance(event, h11.Response):
                status = event.status_code
                media = dict(event.headers).get(b"content-type", b"").decode("latin-1")
            elif isinstance(event, h11.Data):
                body += event.data
                if len(body) > MOST:
                    raise Failed(HttpFault.HTTP_MALFORMED, f"body of more than {MOST} bytes")
            elif isinstance(event, h11.EndOfMessage):
                return Answer(status, media, bytes(body))
            elif not isinstance(event, h11.InformationalResponse):
                raise Failed(HttpFault.HTTP_CUT, "the connection ended before the answer")

    def _more(self, until: float) -> bytes:
        line = self._line
        assert line is not None
        line.settimeout(left(until))
        try:
            data = line.recv(_READ)
        except TimeoutError as error:
            raise late() from error
        except OSError as error:
            raise Failed(HttpFault.HTTP_CUT, f"{self._name}: {error}") from error
        self._gone = not data
        self._head = (self._head + data)[: len(_HTTP)]
        if not _HTTP.startswith(self._head):
            raise Failed(HttpFault.HTTP_MALFORMED, f"no HTTP: {data[:40]!r}")
        return data
