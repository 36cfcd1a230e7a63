"""The one queue of a live host: what came, in order; of latest-only inputs only the newest."""

from __future__ import annotations

import queue
import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field

import zenoh

from runtime.sample import INCARNATION, Sample
from runtime.time import Time

_MOST_LIVES = 255
_LARGEST_GAP = 1 << 20


@dataclass
class Count:
    """What is known of one input.

    Attributes:
        last: sequence that came last; 0 before the first.
        dropped: stale messages of a latest-only input, replaced before they were handled.
        lost: messages that never came, by gaps in the sequence.
        repeated: came again or late, and were left out.
        refused: did not parse, were too long, or bore a number from nowhere.
    """

    last: int = 0
    dropped: int = 0
    lost: int = 0
    repeated: int = 0
    refused: int = 0


@dataclass
class Inbox:
    """Filled by Zenoh's threads, emptied by the host's. Holds samples, and queries that are requests.

    Args:
        latest: topics of which only the newest sample is kept.
        limit: entries; beyond it the oldest samples are dropped and counted, so that memory stays flat.
    """

    latest: frozenset[str]
    limit: int = 10_000
    counts: dict[str, Count] = field(default_factory=dict)
    _items: deque[Sample | tuple[str, zenoh.Query]] = field(default_factory=deque)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    # A token a new entry: a SimpleQueue wakes its reader faster than a Condition does.
    _tokens: queue.SimpleQueue[None] = field(default_factory=queue.SimpleQueue)

    def put(self, sample: Sample) -> None:
        """Take a sample, unless it is not newer than the last of its topic."""
        with self._lock:
            count = self.counts.setdefault(sample.topic, Count())
            if sample.sequence <= count.last:
                count.repeated += 1
                return
            if not _follows(sample.sequence, count.last):
                count.refused += 1
                return
            if count.last and sample.sequence // INCARNATION == count.last // INCARNATION:
                count.lost += sample.sequence - count.last - 1
            count.last = sample.sequence
            if sample.topic in self.latest and self._replaced(sample):
                count.dropped += 1
            else:
                self._items.append(sample)
                self._tokens.put(None)
                self._shorten()

    def ask(self, name: str, query: zenoh.Query) -> None:
        """Take a request."""
        with self._lock:
            self._items.append((name, query))
            self._tokens.put(None)

    def refuse(self, topic: str) -> None:
        """Count a payload that was not taken."""
        with self._lock:
            self.counts.setdefault(topic, Count()).refused += 1

    def get(self, timeout: float) -> Sample | tuple[str, zenoh.Query] | None:
        """Return the next entry, waiting up to `timeout` s for one."""
        with suppress(queue.Empty):
            self._tokens.get(block=timeout > 0, timeout=max(timeout, 0.0))
        with self._lock:
            # A dropped entry leaves its token behind: then a wait ends early, with nothing.
            return self._items.popleft() if self._items else None

    def __len__(self) -> int:
        return len(self._items)

    def _replaced(self, sample: Sample) -> bool:
        for index, item in enumerate(self._items):
            if isinstance(item, Sample) and item.topic == sample.topic:
                self._items[index] = sample
                return True
        return False

    def _shorten(self) -> None:
        if len(self._items) <= self.limit:
            return
        for index, item in enumerate(self._items):
            if isinstance(item, Sample):
                self.counts[item.topic].dropped += 1
                del self._items[index]
                return


def _follows(sequence: int, last: int) -> bool:
    """Return whether `sequence` can come after `last`: a number from nowhere would shut out all real ones."""
    life, number = divmod(sequence, INCARNATION)
    if life > _MOST_LIVES:
        return False
    known, before = divmod(last, INCARNATION)
    return number - (before if life == known else 0) <= _LARGEST_GAP or last == 0


@dataclass
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
