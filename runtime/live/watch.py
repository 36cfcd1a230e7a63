"""Listens to a running system for a while."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import zenoh
from google.protobuf.message import DecodeError

from runtime.bus import envelope
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.sample import Sample
from runtime.topics import TOPICS

_SILENCE = 3.0


@dataclass
class Tally:
    """What came while listening.

    Attributes:
        seconds: s listened.
        counts, sizes: messages and bytes, by topic.
        longest: s, longest gap between two messages of a topic.
    """

    seconds: float = 0.0
    counts: dict[str, int] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)
    longest: dict[str, float] = field(default_factory=dict)
    _last: dict[str, float] = field(default_factory=dict)

    def add(self, topic: str, size: int, now: float) -> None:
        """Take one message."""
        self.counts[topic] = self.counts.get(topic, 0) + 1
        self.sizes[topic] = self.sizes.get(topic, 0) + size
        gap = now - self._last.get(topic, now)
        self.longest[topic] = max(self.longest.get(topic, 0.0), gap)
        self._last[topic] = now

    def rate(self, topic: str) -> float:
        """Return messages a second."""
        return self.counts[topic] / self.seconds if self.seconds else 0.0


def listen(
    bus: BusConfig,
    pattern: str,
    duration: float,
    show: Callable[[Sample], None] | None = None,
    silent: Callable[[], None] | None = None,
    latched: bool = False,
) -> Tally:
    """Listen to the topics that match `pattern` for `duration` s, or until Ctrl-C if that is 0.

    Args:
        show: is given every message.
        silent: is called if nothing has come after a while, or at the end.
        latched: ask for the last value of latched topics first.

    Raises:
        NoBus: there is no meeting point.
    """
    keys, tally, lock = Keys(bus.robot), Tally(), threading.Lock()

    def take(topic: str, payload: bytes, attachment: bytes | None) -> None:
        with lock:
            tally.add(topic, len(payload), time.monotonic())
            if show is not None and attachment is not None:
                with suppress(envelope.BadEnvelope, DecodeError, KeyError):  # no message of ours
                    show(envelope.unpack(topic, payload, attachment))

    def hear(sample: zenoh.Sample) -> None:
        attachment = None if sample.attachment is None else bytes(sample.attachment)
        take(keys.name(str(sample.key_expr)), bytes(sample.payload), attachment)

    with client(bus) as session:
        for topic, payload, attachment in _last_values(session, keys, pattern) if latched else ():
            take(topic, payload, attachment)
        begin = time.monotonic()
        subscriber = session.declare_subscriber(keys.topic(pattern), hear)
        try:
            patience = min(duration or _SILENCE, _SILENCE)
            threading.Event().wait(patience)
            if not tally.counts and silent is not None:
                silent()
            if duration != patience:
                threading.Event().wait(duration - patience if duration else None)
        except KeyboardInterrupt:
            pass
        finally:
            subscriber.undeclare()
            tally.seconds = time.monotonic() - begin
    return tally


def _last_values(session: zenoh.Session, keys: Keys, pattern: str) -> Iterator[tuple[str, bytes, bytes | None]]:
    """Return the last value of every latched topic that matches `pattern`: (topic, payload, attachment)."""
    wanted = zenoh.KeyExpr(keys.topic(pattern))
    for topic, row in TOPICS.items():
        if row.latched and wanted.includes(zenoh.KeyExpr(keys.topic(topic))):
            for reply in session.get(keys.latched(topic), timeout=1.0):
                if reply.ok is not None:
                    attachment = reply.ok.attachment
                    yield topic, bytes(reply.ok.payload), None if attachment is None else bytes(attachment)


class Window:
    """Everything that comes, kept until it is taken: never more than `limit` messages, the newest.

    The callback only appends. Whoever takes may be as slow as he likes; no publisher ever waits for him.

    Attributes:
        dropped: messages given up because nobody took them in time.
    """

    def __init__(self, limit: int) -> None:
        self.dropped = 0
        self._limit = limit
        self._samples: deque[Sample] = deque()
        self._lock = threading.Lock()

    def put(self, sample: Sample) -> None:
        """Take one message in, and give up the oldest if there are too many."""
        with self._lock:
            if len(self._samples) >= self._limit:
                self._samples.popleft()
                self.dropped += 1
            self._samples.append(sample)

    def take(self) -> list[Sample]:
        """Return what has come since the last time."""
        with self._lock:
            found, self._samples = list(self._samples), deque()
        return found


@contextmanager
def window(bus: BusConfig, limit: int) -> Iterator[Window]:
    """Watch all topics of a running system, beginning with the last values of the latched ones.

    Raises:
        NoBus: there is no meeting point.
    """
    keys, found = Keys(bus.robot), Window(limit)

    def hear(sample: zenoh.Sample) -> None:
        with suppress(envelope.BadEnvelope):
            found.put(envelope.opened(keys.name(str(sample.key_expr)), sample))

    with client(bus) as session:
        for topic, payload, attachment in _last_values(session, keys, "**"):
            with suppress(envelope.BadEnvelope):
                found.put(envelope.unpack(topic, payload, attachment))
        subscriber = session.declare_subscriber(keys.everything(), hear)
        try:
            yield found
        finally:
            subscriber.undeclare()
