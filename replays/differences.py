"""Field-by-field differences of two messages, collected over many."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

_NUMBERS = (int, float)


@dataclass
class FieldError:
    """How far one field is off, over all compared messages. Elements of a repeated field count as one field.

    Attributes:
        largest: absolute difference; infinite where values cannot be subtracted (text, missing elements).
        squares: sum of squared differences, for `rms`.
        count: differing values.
        first: logical time of the first difference, ns.
    """

    largest: float = 0.0
    squares: float = 0.0
    count: int = 0
    first: int = 0

    @property
    def rms(self) -> float:
        """Return the root mean square over the differing values."""
        return math.sqrt(self.squares / self.count) if self.count else 0.0


@dataclass
class Differences:
    """Collects the errors of a topic by field."""

    fields: dict[str, FieldError] = field(default_factory=dict)

    def add(self, recorded: Message, replayed: Message, time: int) -> dict[str, float]:
        """Compare two messages of one type. Returns the largest error of each field that differs."""
        largest: dict[str, float] = {}
        for name, difference in differences(recorded, replayed):
            error = self.fields.setdefault(name, FieldError(first=time))
            error.largest = max(error.largest, difference)
            error.squares += difference * difference
            error.count += 1
            largest[name] = max(largest.get(name, 0.0), difference)
        return largest

    def join(self, other: Differences) -> None:
        """Take in what was collected elsewhere, later."""
        for name, error in other.fields.items():
            mine = self.fields.setdefault(name, FieldError(first=error.first))
            mine.largest = max(mine.largest, error.largest)
            mine.squares += error.squares
            mine.count += error.count


def differences(recorded: Message, replayed: Message, prefix: str = "") -> Iterator[tuple[str, float]]:
    """Return (field path, absolute difference) of every value that differs."""
    for descriptor in recorded.DESCRIPTOR.fields:
        a, b = getattr(recorded, descriptor.name), getattr(replayed, descriptor.name)
        path = f"{prefix}{descriptor.name}"
        if descriptor.is_repeated:
            for x, y in zip_longest(a, b):
                yield from _value(descriptor, x, y, f"{path}[]")
        elif descriptor.has_presence and recorded.HasField(descriptor.name) != replayed.HasField(descriptor.name):
            yield path, math.inf
        else:
            yield from _value(descriptor, a, b, path)


def _value(descriptor: Any, a: Any, b: Any, path: str) -> Iterator[tuple[str, float]]:
    if descriptor.type == FieldDescriptor.TYPE_MESSAGE and a is not None and b is not None:
        yield from differences(a, b, f"{path}.")
    elif a != b:
        numbers = isinstance(a, _NUMBERS) and isinstance(b, _NUMBERS)
        exact = isinstance(a, bool) or descriptor.type == FieldDescriptor.TYPE_ENUM
        yield path, abs(a - b) if numbers and not exact else math.inf
