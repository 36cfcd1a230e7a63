"""Runs one driver with its wire and nothing else: no bus, no other services. For checks of a base, and for tests."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from google.protobuf.message import Message

from runtime.live.clock import Clock
from runtime.live.wire import Wire
from runtime.node import Node
from runtime.sample import Sample
from runtime.service import Service
from runtime.time import Time, nanoseconds, seconds
from runtime.topics import TOPICS, Topic

M = TypeVar("M", bound=Message)


class Alone:
    """A service and its wire, in this thread, in real time.

    Attributes:
        newest: the last message of each topic that the service has published.
    """

    def __init__(self, service: Service, wire: Wire) -> None:
        self.newest: dict[str, Message] = {}
        self._node = Node(service, None)
        self._wire = wire
        self._clock = Clock()
        self._came: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._sequences: dict[str, int] = {}
        self._heard: list[Callable[[str, Message], None]] = []
        self._due: dict[str, Time] = {}

    @contextmanager
    def running(self) -> Iterator[None]:
        """Begin, and at the end let the service have its last words."""
        now = self._clock.now()
        self._send(self._node.begin(now))
        self._due = {name: due for due, name in self._node.due()}
        self._wire.open(self._came.put, self._clock.now)
        try:
            yield
        finally:
            # Whatever happened, Ctrl-C too: a base that moves has to be told that it is over.
            try:
                self._send(self._node.end(self._clock.now()))
            finally:
                self._wire.close()

    def listen(self, hear: Callable[[str, Message], None]) -> None:
        """Let `hear` have every message, with its topic."""
        self._heard.append(hear)

    def last(self, topic: Topic[M]) -> M | None:
        """Return the newest message of a topic, or None."""
        found = self.newest.get(topic.name)
        return found if isinstance(found, topic.message) else None

    def give(self, topic: Topic[M], message: M) -> None:
        """Give the service a message, now."""
        now = self._clock.now()
        self._send(self._node.consume(self._sample(topic.name, message, now), now, now))

    @property
    def now(self) -> Time:
        """Return the time, ns."""
        return self._clock.now()

    def run(self, duration: float, enough: Callable[[], bool] = lambda: False) -> bool:
        """Go on for `duration`, s, or until there is `enough`. Returns whether there is."""
        end = self._clock.now() + nanoseconds(duration)
        while (now := self._clock.now()) < end:
            if enough():
                return True
            name = min(self._due, key=self._due.__getitem__)
            if self._due[name] <= now:
                period = self._node.period(name)
                number = (now - self._node.start) // period  # what was missed is left out, not piled up
                self._due[name] = self._node.start + (number + 1) * period
                self._send(self._node.fire(name, number, now, now))
                continue
            try:
                message = self._came.get(timeout=seconds(min(self._due[name], end) - now))
            except queue.Empty:
                continue
            now = self._clock.now()
            self._send(self._node.consume(self._sample(self._wire.brings, message, now), now, now))
        return enough()

    def _sample(self, topic: str, message: Message, now: Time) -> Sample:
        number = self._sequences[topic] = self._sequences.get(topic, 0) + 1
        return Sample(topic, number, now, message.SerializeToString(deterministic=True))

    def _send(self, samples: list[Sample]) -> None:
        for sample in samples:
            row = TOPICS.get(sample.topic)
            if row is None:
                continue
            message = row.message.FromString(sample.payload)
            if sample.topic == self._wire.sends:
                self._wire.carry(message)
            self.newest[sample.topic] = message
            for hear in self._heard:
                hear(sample.topic, message)
