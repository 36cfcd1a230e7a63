from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.journal import Entry, JournalWriter, chain, entries
from runtime.messages import EntryKind, Journal

NAMES = ["", "odometry", "push/target", "tick", "journal/größe"]


@dataclass(frozen=True)
class Row:
    kind: int
    name: str
    sequence: int
    time: int
    payload: bytes


ROWS = st.lists(
    st.builds(
        Row,
        kind=st.sampled_from([int(value) for value in EntryKind.values()]),
        name=st.sampled_from(NAMES),
        sequence=st.integers(0, 2**40),
        time=st.integers(-(2**40), 2**60),
        payload=st.binary(max_size=20),
    ),
    max_size=12,
)


def digests_by_hand(rows: list[Row], before: int = 0) -> list[int]:
    """CRC-32 by the book: kind, sequence, time, length of the name (little-endian), name, payload; chained."""
    found = []
    for row in rows:
        record = bytes([row.kind]) + struct.pack("<Q", row.sequence) + struct.pack("<q", row.time)
        name = row.name.encode()
        record += struct.pack("<H", len(name)) + name + row.payload
        before = zlib.crc32(record, before) & 0xFFFFFFFF
        found.append(before)
    return found


def write(rows: list[Row], cuts: list[int], first: int = 0, digest: int = 0) -> list[Journal]:
    """Write `rows`, taking a batch after each of the rows numbered in `cuts` and at the end."""
    writer = JournalWriter("node", first, digest)
    batches = []
    for index, row in enumerate(rows):
        writer.add(row.kind, row.name, row.sequence, row.time, row.payload)
        if index in cuts:
            batches.append(writer.batch())
    batches.append(writer.batch())
    assert writer.batch() is None
    # Through the wire and back, as a recording does it.
    return [Journal.FromString(batch.SerializeToString()) for batch in batches if batch is not None]


def breaks(found: list[Entry], rows: list[Row]) -> list[int]:
    """Return the indices at which recomputing from the digest before does not give the entry's own."""
    broken, before = [], 0
    for index, (entry, row) in enumerate(zip(found, rows, strict=True)):
        if chain(before, entry.kind, entry.name, entry.sequence, entry.time, row.payload) != entry.digest:
            broken.append(index)
        before = entry.digest
    return broken


@given(ROWS, st.lists(st.integers(0, 12)), st.integers(0, 2**40), st.integers(0, 2**32 - 1))
def test_batches_give_back_what_was_written_with_the_chain_of_the_book(
    rows: list[Row], cuts: list[int], first: int, digest: int
) -> None:
    found = list(entries(write(rows, cuts, first, digest)))
    assert [(e.kind, e.name, e.sequence, e.time) for e in found] == [(r.kind, r.name, r.sequence, r.time) for r in rows]
    assert [e.number for e in found] == list(range(first, first + len(rows)))
    assert [e.digest for e in found] == digests_by_hand(rows, digest)


def test_the_first_digest_is_this_number() -> None:
    # crc32(05 | 01 00.. | 0a 00.. | 04 00 | "scan" | "x"), computed with the polynomial 0xEDB88320 bit by bit.
    record = b"\x05" + b"\x01" + bytes(7) + b"\x0a" + bytes(7) + b"\x04\x00scanx"
    register = 0xFFFFFFFF
    for byte in record:
        register ^= byte
        for _ in range(8):
            register = (register >> 1) ^ (0xEDB88320 if register & 1 else 0)
    assert chain(0, EntryKind.PRODUCED, "scan", 1, 10, b"x") == register ^ 0xFFFFFFFF


def many(count: int) -> list[Row]:
    return [Row(2 + i % 4, NAMES[1 + i % 4], i, 1000 * i, bytes([i])) for i in range(count)]


@given(st.integers(2, 12), st.data())
def test_an_altered_payload_breaks_the_chain_there_and_nowhere_else(count: int, data: st.DataObject) -> None:
    rows = many(count)
    found = list(entries(write(rows, [count // 2])))
    assert breaks(found, rows) == []
    place = data.draw(st.integers(0, count - 1))
    altered = Row(rows[place].kind, rows[place].name, rows[place].sequence, rows[place].time, b"altered")
    assert breaks(found, [*rows[:place], altered, *rows[place + 1 :]]) == [place]


@pytest.mark.parametrize("column", ["kind", "name", "sequence", "time"])
@given(place=st.integers(0, 7))
def test_an_altered_entry_breaks_the_chain_there(column: str, place: int) -> None:
    rows = many(8)
    batch = write(rows, [])[0]
    before = getattr(batch, column)[place]
    # Kinds of the sample are 2 to 5 and names 0 to 3: another one of the same range.
    getattr(batch, column)[place] = (before + 1) % 4 if column == "name" else before + 1
    first = breaks(list(entries([batch])), rows)[0]
    assert first == place


@given(st.integers(2, 12), st.data())
def test_a_dropped_entry_breaks_the_chain_at_the_one_after(count: int, data: st.DataObject) -> None:
    rows = many(count)
    found = list(entries(write(rows, [])))
    place = data.draw(st.integers(0, count - 2))
    del found[place], rows[place]
    assert breaks(found, rows) == [place]


@given(st.integers(1, 12), st.data())
def test_a_doubled_entry_breaks_the_chain_at_its_copy(count: int, data: st.DataObject) -> None:
    rows = many(count)
    found = list(entries(write(rows, [])))
    place = data.draw(st.integers(0, count - 1))
    found.insert(place, found[place])
    rows.insert(place, rows[place])
    assert breaks(found, rows) == [place + 1]


@given(st.integers(2, 12), st.data())
def test_swapped_entries_break_the_chain_at_the_first_of_them(count: int, data: st.DataObject) -> None:
    rows = many(count)
    found = list(entries(write(rows, [])))
    place = data.draw(st.integers(0, count - 2))
    found[place], found[place + 1] = found[place + 1], found[place]
    rows[place], rows[place + 1] = rows[place + 1], rows[place]
    assert breaks(found, rows)[:2] == [place, place + 1]


@pytest.mark.parametrize("column", ["kind", "name", "sequence", "time", "digest"])
def test_columns_of_unequal_length_are_refused(column: str) -> None:
    batch = write(many(3), [])[0]
    del getattr(batch, column)[-1]
    with pytest.raises(ValueError, match="differ in length"):
        list(entries([batch]))


def test_a_name_that_points_nowhere_is_refused() -> None:
    batch = write(many(3), [])[0]
    batch.name[1] = 77
    with pytest.raises(ValueError, match="entry 1 points to no name"):
        list(entries([batch]))
