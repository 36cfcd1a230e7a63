"""Carries the requests of the driver to a real base, over HTTP, and brings the answers (`runtime.live.wire`).

Each lane has a connection and a thread, so that a sensor that hangs never holds up the drive.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from google.protobuf.message import Message

from drivers.robotino.rest.config import LaserConfig, RestConfig
from drivers.robotino.rest.connecting import Failed, parsed
from drivers.robotino.rest.exchange import Answer, Connection
from drivers.robotino.rest.service import DRIVE
from runtime.live.wire import Bring
from runtime.messages import HttpAnswer, HttpFault, HttpRequest
from runtime.time import SECOND, Time

_FAREWELL = 0.25
"""s that `close` may take"""
_PATIENCE = 0.12
"""s of these after which an exchange that is under way is given up for the last word that waits behind it"""
_ENDING = 0.05
"""s of these that are kept for the ends of the threads"""

Answered = Callable[[HttpRequest, Answer | Failed], None]


class HttpWire:
    """Speaks HTTP/1.1 to the base at `url`: one connection per lane, one request under way on each, the newest wins.

    Raises:
        BadUrl: `url` is not one of a base.
    """

    sends = "http/request"
    brings = "http/answer"

    def __init__(self, url: str) -> None:
        self._host, self._port = parsed(url)
        self._lanes: dict[str, _Lane] = {}
        self._lock = threading.RLock()
        self._bring: Bring | None = None
        self._now: Callable[[], Time] = int
        self._closing = False

    @classmethod
    def of(cls, config: RestConfig | LaserConfig) -> HttpWire:
        """Return the wire to the base that settings name."""
        return cls(config.url)

    def open(self, bring: Bring, now: Callable[[], Time]) -> None:
        """Begin. A connection is opened by the first request of its lane."""
        with self._lock:
            self._bring, self._now = bring, now

    def carry(self, message: Message) -> None:
        """Send a request on its way, unless the wire is not open. The one that waited in its lane is answered now."""
        if not isinstance(message, HttpRequest):
            return
        with self._lock:
            if self._closing or self._bring is None:
                return
            lane = self._lanes.get(message.lane)
            if lane is None:
                lane = self._lanes[message.lane] = _Lane(message.lane, self._host, self._port, self._answered)
            replaced = lane.give(message)
        if replaced is not None:
            self._answered(replaced, Failed(HttpFault.HTTP_REPLACED, f"by request {message.id}"))

    def close(self) -> None:
        """See off what the drive was told last, for a quarter of a second at most, and end. Brings nothing after it."""
        begun = time.monotonic()
        with self._lock:
            self._closing = True
            lanes = dict(self._lanes)
        drive = lanes.pop(DRIVE, None)
        for lane in lanes.values():
            lane.end()
        if drive is not None:
            if not drive.settled(begun + _PATIENCE):
                drive.hasten()
            drive.settled(begun + _FAREWELL - _ENDING)
            drive.end()
            lanes[DRIVE] = drive
        with self._lock:
            self._bring = None
        for lane in lanes.values():
            lane.join(begun + _FAREWELL)

    def _answered(self, request: HttpRequest, what: Answer | Failed) -> None:
        with self._lock:  # held while it is brought, which never waits: so nothing comes after `close`
            if self._bring is None:
                return
            answer = HttpAnswer(stamp=self._now(), id=request.id, path=request.path)
            if isinstance(what, Failed):
                answer.fault, answer.reason = what.fault, str(what)
            else:
                answer.status, answer.content_type, answer.body = what.status, what.media, what.body
            self._bring(answer)


class _Lane:
    """The thread and the connection of one lane."""

    def __init__(self, name: str, host: str, port: int, answered: Answered) -> None:
        self._connection = Connection(host, port)
        self._answered = answered
        self._change = threading.Condition()
        self._waiting: HttpRequest | None = None
        self._busy = False
        self._ended = False
        self._thread = threading.Thread(target=self._work, name=f"http {name}", daemon=True)
        self._thread.start()

    def give(self, request: HttpRequest) -> HttpRequest | None:
        """Take a request; return the one that waited, and now never goes."""
        with self._change:
            replaced, self._waiting = self._waiting, request
            self._change.notify_all()
        return replaced

    def settled(self, until: float) -> bool:
        """Return whether by then, s of the monotonic clock, there is nothing left to do."""
        with self._change:
            left = max(0.0, until - time.monotonic())
            return self._change.wait_for(lambda: not self._busy and self._waiting is None, left)

    def hasten(self) -> None:
        """Give up what is under way, if another request waits behind it."""
        with self._change:
            if self._waiting is not None:
                self._connection.abort()

    def end(self) -> None:
        """Let the thread end, whatever it does."""
        with self._change:
            self._ended = True
            self._connection.end()
            self._change.notify_all()

    def join(self, until: float) -> None:
        """Wait for the end of the thread, up to then."""
        self._thread.join(max(0.0, until - time.monotonic()))

    def _work(self) -> None:
        while (request := self._next()) is not None:
            self._answered(request, self._asked(request))
        self._connection.drop()

    def _next(self) -> HttpRequest | None:
        with self._change:
            self._busy = False
            self._change.notify_all()
            self._change.wait_for(lambda: self._ended or self._waiting is not None)
            request, self._waiting = self._waiting, None
            self._busy = True
            return None if self._ended else request

    def _asked(self, request: HttpRequest) -> Answer | Failed:
        try:
            return self._connection.ask(request.method, request.path, request.body, request.timeout / SECOND)
        except Failed as failed:
            return failed
        except Exception as error:  # a path that is none, or what nobody thought of: the lane goes on
            return Failed(HttpFault.HTTP_MALFORMED, f"{type(error).__name__}: {error}")
