"""The journal: the exact order of what one service consumed and produced, in a chain that shows any change.

Each entry carries a CRC-32 over itself, the payload it stands for and the digest of the entry before. A dropped,
doubled, moved or altered entry, and an altered payload of a message that was consumed or produced, is therefore
found at exactly its place, by reading alone.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from runtime.messages import EntryKind, Journal
from runtime.time import Time

_HEAD = struct.Struct("<BQqH")


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of a journal.

    Attributes:
        number: of the entry in its node's journal, without gaps.
        kind: an `EntryKind`.
        name: topic, timer or request; empty for STARTED and SNAPSHOT.
        sequence: which message, firing, request or snapshot.
        time: logical time, ns.
        digest: CRC-32 as in `chain`.
    """

    number: int
    kind: int
    name: str
    sequence: int
    time: Time
    digest: int

    def __str__(self) -> str:
        return f"entry {self.number} ({EntryKind.Name(self.kind)} {self.name} {self.sequence})"  # type: ignore[arg-type]


def chain(before: int, kind: int, name: str, sequence: int, time: Time, payload: bytes) -> int:
    """Return the digest of an entry that follows the digest `before`."""
    text = name.encode()
    head = zlib.crc32(_HEAD.pack(kind, sequence, time, len(text)) + text, before)
    return zlib.crc32(payload, head)


class JournalWriter:
    """Collects the entries of one node and gives them away in batches.

    Digests are computed when somebody asks for them: not between the arrival of a message and what it brings about.
    """

    def __init__(self, node: str, first: int = 0, digest: int = 0) -> None:
        self.node = node
        self.number = first
        self._digest = digest
        self._clear()

    @property
    def digest(self) -> int:
        """Return the digest of the newest entry."""
        self._work_up()
        return self._digest

    def add(self, kind: int, name: str, sequence: int, time: Time, payload: bytes = b"") -> None:
        """Write down one entry; `payload` is the message, request, reply or snapshot it stands for."""
        self._fresh.append((kind, name, sequence, time, payload))
        self.number += 1

    def batch(self) -> Journal | None:
        """Return the entries since the last batch, or None if there are none."""
        self._work_up()
        if not self._rows:
            return None
        kind, name, sequence, time, digest = zip(*self._rows, strict=True)
        differences = [time[0], *(b - a for a, b in pairwise(time))]
        batch = Journal(
            node=self.node,
            first=self.number - len(self._rows),
            names=list(self._index),
            kind=kind,
            name=name,
            sequence=sequence,
            time=differences,
            digest=digest,
        )
        self._clear()
        return batch

    def _work_up(self) -> None:
        digest = self._digest
        for kind, name, sequence, time, payload in self._fresh:
            digest = chain(digest, kind, name, sequence, time, payload)
            index = self._index.setdefault(name, len(self._index))
            self._rows.append((kind, index, sequence, time, digest))
        self._digest = digest
        self._fresh.clear()

    def _clear(self) -> None:
        self._index: dict[str, int] = {}
        self._rows: list[tuple[int, int, int, Time, int]] = []
        self._fresh: list[tuple[int, str, int, Time, bytes]] = []


def entries(batches: Iterable[Journal]) -> Iterator[Entry]:
    """Return the entries of batches in the order given.

    Raises:
        ValueError: a batch's columns differ in length or point outside its names.
    """
    for batch in batches:
        columns = (batch.kind, batch.name, batch.sequence, batch.time, batch.digest)
        if len({len(column) for column in columns}) != 1:
            raise ValueError(f"journal of {batch.node}: columns of the batch at {batch.first} differ in length")
        time = 0
        rows = zip(*columns, strict=True)
        for offset, (kind, name, sequence, difference, digest) in enumerate(rows):
            if name >= len(batch.names):
                raise ValueError(f"journal of {batch.node}: entry {batch.first + offset} points to no name")
            time += difference
            yield Entry(batch.first + offset, kind, batch.names[name], sequence, time, digest)
