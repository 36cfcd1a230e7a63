"""Changes recordings on purpose, with checksums made good again, so that only the content betrays it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from runtime.messages import Journal


@dataclass(frozen=True)
class Row:
    """One recorded message with its topic."""

    topic: str
    sequence: int
    time: int
    data: bytes


Change = Callable[[list[Row]], Iterable[Row]]


def rewrite(source: Path, target: Path, change: Change) -> Path:
    """Write what `change` makes of the messages of `source` to `target`, header and schemas as they were."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    rows: list[Row] = []
    with source.open("rb") as stream, target.open("wb") as out:
        writer = Writer(out, compression=CompressionType.ZSTD, enable_data_crcs=True)
        writer.start(profile="", library="tampering")
        for record in StreamReader(stream).records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Metadata):
                writer.add_metadata(record.name, record.metadata)
            elif isinstance(record, Attachment):
                writer.add_attachment(0, 0, record.name, record.media_type, record.data)
            elif isinstance(record, Message):
                topic = channels[record.channel_id].topic
                rows.append(Row(topic, record.sequence, record.publish_time, record.data))
        ids = {}
        for channel in {one.topic: one for one in channels.values()}.values():
            schema = schemas[channel.schema_id]
            schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
            ids[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, schema_id)
        for row in change(rows):
            writer.add_message(ids[row.topic], row.time, row.data, row.time, row.sequence)
        writer.finish()
    return target


def altered(topic: str, sequence: int, change: Callable[[bytes], bytes]) -> Change:
    """Return the change of one payload."""

    def apply(rows: list[Row]) -> Iterable[Row]:
        found = [row for row in rows if (row.topic, row.sequence) == (topic, sequence)]
        assert len(found) == 1, f"{topic} {sequence} occurs {len(found)} times"
        return [replace(row, data=change(row.data)) if row is found[0] else row for row in rows]

    return apply


def journal_changed(node: str, number: int, change: Callable[[Journal, int], None]) -> Change:
    """Return the change of the batch that holds entry `number`; `change` gets the batch and the index in it."""

    def apply(rows: list[Row]) -> Iterable[Row]:
        changed = 0
        for row in rows:
            if row.topic == f"journal/{node}":
                batch = Journal.FromString(row.data)
                if batch.first <= number < batch.first + len(batch.kind):
                    change(batch, number - batch.first)
                    changed += 1
                    yield replace(row, data=batch.SerializeToString(deterministic=True))
                    continue
            yield row
        assert changed == 1, f"entry {number} of {node} is in {changed} batches"

    return apply


def times(batch: Journal) -> list[int]:
    """Return the whole times of a batch's entries."""
    found, time = [], 0
    for difference in batch.time:
        time += difference
        found.append(time)
    return found


def put(batch: Journal, rows: list[tuple[int, int, int, int, int]]) -> None:
    """Set the columns of a batch from rows of (kind, name, sequence, time, digest)."""
    for column in (batch.kind, batch.name, batch.sequence, batch.time, batch.digest):
        del column[:]
    before = 0
    for kind, name, sequence, time, digest in rows:
        batch.kind.append(kind)
        batch.name.append(name)
        batch.sequence.append(sequence)
        batch.time.append(time - before)
        batch.digest.append(digest)
        before = time


def rows_of(batch: Journal) -> list[tuple[int, int, int, int, int]]:
    """Return a batch as rows of (kind, name, sequence, time, digest)."""
    return list(zip(batch.kind, batch.name, batch.sequence, times(batch), batch.digest, strict=True))
