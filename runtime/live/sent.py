"""What a host has sent lately, so that a recorder that was cut off can ask for what it missed."""

from __future__ import annotations

import threading
from collections import deque

import msgspec

from runtime.sample import Sample


class Missing(msgspec.Struct, frozen=True):
    """A question for messages of a topic by their sequences, from `first` to `last`."""

    topic: str
    first: int
    last: int


class Sent:
    """Keeps the newest samples. Filled by the host's loop, read by Zenoh's threads.

    Args:
        limit: bytes of payloads; beyond it the oldest are forgotten, so that memory stays flat.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._size = 0
        self._samples: deque[Sample] = deque()
        self._lock = threading.Lock()

    def add(self, sample: Sample) -> None:
        """Keep a sample that was just sent."""
        with self._lock:
            self._samples.append(sample)
            self._size += len(sample.payload)
            while self._size > self._limit:
                self._size -= len(self._samples.popleft().payload)

    def find(self, missing: Missing) -> list[Sample]:
        """Return what is still kept of what was asked for, in order."""
        with self._lock:
            return [
                sample
                for sample in self._samples
                if sample.topic == missing.topic and missing.first <= sample.sequence <= missing.last
            ]
