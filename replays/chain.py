"""Reads a node's journal entry by entry and names the place where it, or a message it stands for, was changed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from replays.recording import Recording
from runtime.journal import Entry, chain, entries
from runtime.messages import EntryKind


@dataclass(frozen=True)
class Break:
    """A place where the journal does not fit itself or the recorded messages.

    Attributes:
        entry: the first entry that does not fit.
        text: what seems to have happened.
        structural: entries are missing, doubled or moved: what follows cannot be re-executed.
    """

    entry: Entry
    text: str
    structural: bool


def payload_of(recording: Recording, node: str, entry: Entry) -> bytes | None:
    """Return the payload that `entry` stands for, or None if it was not recorded."""
    if entry.kind in (EntryKind.MESSAGE, EntryKind.PRODUCED):
        sample = recording.samples.get((entry.name, entry.sequence))
        return None if sample is None else sample.payload
    if entry.kind == EntryKind.REQUEST:
        request = recording.requests.get((node, entry.sequence))
        return None if request is None else request.payload
    if entry.kind == EntryKind.REPLIED:
        reply = recording.replies.get((node, entry.sequence))
        return None if reply is None else reply.SerializeToString(deterministic=True)
    if entry.kind == EntryKind.SNAPSHOT:
        snapshot = recording.snapshots.get((node, entry.sequence))
        return None if snapshot is None else snapshot.service + snapshot.host
    return b""


def read(recording: Recording, node: str) -> list[Entry]:
    """Return all entries of `node`'s journal as recorded.

    Raises:
        ValueError: a batch is malformed.
    """
    return list(entries(recording.journals.get(node, [])))


def segments(rows: list[Entry]) -> list[list[Entry]]:
    """Return `rows` cut before every entry that says that the service was started, or started again."""
    starts = [0, *(i for i, entry in enumerate(rows) if i and entry.kind == EntryKind.STARTED), len(rows)]
    return [rows[begin:end] for begin, end in pairwise(starts) if begin < end]


def breaks(recording: Recording, node: str, rows: list[Entry]) -> Iterator[Break]:
    """Return every place in a segment where the chain of digests, the numbering or a payload does not fit.

    The digest before the first entry is 0 where a service was started; a journal that was joined later is checked
    from its second entry on.
    """
    for index, entry in enumerate(rows):
        if index and entry.number != rows[index - 1].number + 1:
            gap = entry.number - rows[index - 1].number - 1
            what = f"{gap} entries are missing" if gap > 0 else "numbers go back"
            yield Break(entry, f"before {entry}: {what}", structural=True)
            continue
        if index == 0 and entry.kind != EntryKind.STARTED:
            continue
        before = rows[index - 1].digest if index else 0
        payload = payload_of(recording, node, entry)
        if payload is None:
            yield Break(entry, f"{entry}: the message was not recorded", structural=False)
            continue
        sample = recording.samples.get((entry.name, entry.sequence)) if entry.kind == EntryKind.PRODUCED else None
        if sample is not None and sample.time != entry.time:
            yield Break(entry, f"{entry}: recorded at {sample.time} ns, given at {entry.time} ns", structural=False)
        if chain(before, entry.kind, entry.name, entry.sequence, entry.time, payload) != entry.digest:
            yield _explain(recording, node, rows, index)


def _explain(recording: Recording, node: str, rows: list[Entry], index: int) -> Break:
    """Find out what happened at `rows[index]`, whose digest does not follow from the one before."""
    entry = rows[index]
    if index and _same(entry, rows[index - 1]):
        return Break(entry, f"{entry}: doubled, it repeats the entry before", structural=True)
    if index + 1 < len(rows):
        following = rows[index + 1]
        payload = payload_of(recording, node, following)
        before = rows[index - 1].digest if index else 0
        if payload is not None and following.digest == chain(
            before, following.kind, following.name, following.sequence, following.time, payload
        ):
            return Break(entry, f"{entry}: moved, {following} came before it", structural=True)
    if _fits_after_other(rows, index):
        return Break(entry, f"before {entry}: an entry was dropped", structural=True)
    what = f"'{entry.name}' {entry.sequence}" if entry.name else "its snapshot"
    return Break(entry, f"{entry}: {what} as recorded, or the entry itself, was altered", structural=False)


def _fits_after_other(rows: list[Entry], index: int) -> bool:
    """Tell a dropped entry from an altered one: after a drop, numbers of the batch no longer reach the next.

    Within the batch numbers are counted from its first, so a drop makes the next batch begin one too late.
    """
    for before, entry in zip(rows[index:], rows[index + 1 :], strict=False):
        if entry.number != before.number + 1:
            return entry.number > before.number + 1
    return False


def _same(a: Entry, b: Entry) -> bool:
    return (a.kind, a.name, a.sequence, a.time, a.digest) == (b.kind, b.name, b.sequence, b.time, b.digest)
