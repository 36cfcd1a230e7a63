"""The one queue of a live host: what came, in order; of latest-only inputs only the newest."""

from __future__ import annotations

import queue
from collections import deque
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from runtime.sample import INCARNATION, Sample
from runtime.time import Time

_MOST_LIVES = 255
_LARGEST_GAP = 1 << 20

_MOST_REQUESTS = 100

E = TypeVar("E")


@dataclass(slots=True)
class Count:
    """What is known of one input.

    Attributes:
        last: sequence that came last; 0 before the first.
        consumed: messages that were handled.
        age: s, of the newest when it was handled.
        dropped: messages that waited and were left out: stale ones of a latest-only input, and the oldest of a
            queue that was full.
        lost: messages that never came, by gaps in the sequence.
        repeated: came again or late, and were left out.
        refused: did not parse, were too long, or bore a number from nowhere.
        refusal: why the last one was refused.
    """

    last: int = 0
    consumed: int = 0
    age: float = 0.0
    dropped: int = 0
    lost: int = 0
    repeated: int = 0
    refused: int = 0
    refusal: str = ""


@dataclass
class Inbox(Generic[E]):
    """What waits for a host's loop, which alone fills and empties it: entries, each for a sample or a request.

    Args:
        latest: topics of which only the newest sample is kept.
        limit: entries; beyond it the oldest samples are dropped and counted, so that memory stays flat.
    """

    latest: frozenset[str]
    limit: int = 10_000
    counts: dict[str, Count] = field(default_factory=dict)
    # An item is a list of one entry, so that a newer one can take its place; a request's topic is empty.
    _items: deque[tuple[str, list[E]]] = field(default_factory=deque)
    _waiting: dict[str, list[E]] = field(default_factory=dict)  # of latest-only inputs
    _requests: int = 0

    def count(self, topic: str) -> Count:
        """Return what is known of an input."""
        found = self.counts.get(topic)
        if found is None:
            found = self.counts[topic] = Count()
        return found

    def put(self, sample: Sample, entry: E) -> str:
        """Take the entry of a sample. Returns "", or why it is refused.

        One that is not newer than the last of its topic is left out and counted.
        """
        topic, sequence = sample.topic, sample.sequence
        count = self.count(topic)
        last = count.last
        if sequence != last + 1:
            if sequence <= last:
                count.repeated += 1
                return ""
            if not follows(sequence, last):
                return f"'{topic}' came with the number {sequence} after {last}"
            if last and sequence // INCARNATION == last // INCARNATION:
                count.lost += sequence - last - 1
        count.last = sequence
        if topic not in self.latest:
            self._items.append((topic, [entry]))
        elif topic in self._waiting:
            self._waiting[topic][0] = entry
            count.dropped += 1
        else:
            place = self._waiting[topic] = [entry]
            self._items.append((topic, place))
        if len(self._items) > self.limit:
            self._shorten()
        return ""

    def ask(self, entry: E) -> bool:
        """Take a request. Returns whether there was room for it."""
        if self._requests >= _MOST_REQUESTS:
            return False
        self._requests += 1
        self._items.append(("", [entry]))
        return True

    def get(self) -> E | None:
        """Return the next entry, or None if nothing waits."""
        if not self._items:
            return None
        topic, place = self._items.popleft()
        if topic in self._waiting:
            del self._waiting[topic]
        elif not topic:
            self._requests -= 1
        return place[0]

    def __len__(self) -> int:
        return len(self._items)

    def _shorten(self) -> None:
        for index, (topic, _) in enumerate(self._items):
            if topic:
                self.count(topic).dropped += 1
                self._waiting.pop(topic, None)
                del self._items[index]
                return


class Arrivals(Generic[E]):
    """What Zenoh's threads brought and the host's loop has not looked at yet.

    A callback does nothing but `put`, so that it never waits and holds Python's lock for the shortest time: with more
    work there the two threads hand the lock to and fro for every message, at a tenth of the speed.

    Args:
        limit: beyond it the oldest is dropped and counted by topic, so that memory stays flat behind a slow handler.
    """

    def __init__(self, limit: int = 20_000) -> None:
        self._limit = limit
        self._queue: queue.SimpleQueue[tuple[str, E]] = queue.SimpleQueue()
        self.dropped: dict[str, int] = {}
        self.oldest = self._queue.get_nowait
        """Returns the oldest of those that `len` counts."""

    def put(self, topic: str, what: E) -> None:
        """Take what came on `topic`. Safe to call from any thread."""
        self._queue.put((topic, what))
        if self._queue.qsize() > self._limit:
            oldest = self.get(0.0)
            if oldest is not None:
                self.dropped[oldest[0]] = self.dropped.get(oldest[0], 0) + 1

    def get(self, timeout: float) -> tuple[str, E] | None:
        """Return the oldest, waiting up to `timeout` s for one."""
        try:
            return self._queue.get(timeout > 0, timeout if timeout > 0 else None)
        except queue.Empty:
            return None

    def __len__(self) -> int:
        return self._queue.qsize()


def follows(sequence: int, last: int) -> bool:
    """Return whether `sequence` can come after `last`: a number from nowhere would shut out all real ones."""
    life, number = divmod(sequence, INCARNATION)
    if life > _MOST_LIVES:
        return False
    known, before = divmod(last, INCARNATION)
    return number - (before if life == known else 0) <= _LARGEST_GAP or last == 0


@dataclass(slots=True)
class Busy:
    """How long handlers took since the last health message."""

    events: int = 0
    total: Time = 0
    longest: Time = 0

    def add(self, took: Time) -> None:
        """Take one handler's time, ns."""
        self.events += 1
        self.total += took
        self.longest = max(self.longest, took)
