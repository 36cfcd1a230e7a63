"""A recorded session in memory: header, configuration, samples by name, journals and snapshots."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import zstandard
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Message, Metadata
from mcap.stream_reader import StreamReader

from replays import integrity
from runtime.errors import PushlaneError
from runtime.messages import Journal, Reply, Request, Snapshot
from runtime.recorder.header import CONFIG_NAME, END_NAME, FORMAT, METADATA_NAME, Header
from runtime.recorder.viewer import PREFIX as VIEWER_PREFIX
from runtime.sample import Sample


class Unusable(PushlaneError):
    """The file cannot be replayed at all."""


class OutsideRecording(PushlaneError):
    """A time is not in the recording."""


@dataclass
class Recording:
    """What a session file holds.

    Attributes:
        damage: what is wrong with the file, None if every byte is as it was written.
        samples: (topic, sequence) -> sample, in the order of the file; without the runtime's own topics.
        journals: node -> batches in order of their entries.
        snapshots: (node, number) -> snapshot.
        requests, replies: (node, id) -> the message.
        doubled: (topic, sequence) that occur more than once.
        running: node -> number of the last journal entry recorded, for nodes that went on when the recorder left them
            in good order: at its end, or for the next part.
    """

    path: Path
    header: Header
    config: dict[str, Any]
    damage: str | None
    samples: dict[tuple[str, int], Sample] = field(default_factory=dict)
    journals: dict[str, list[Journal]] = field(default_factory=dict)
    snapshots: dict[tuple[str, int], Snapshot] = field(default_factory=dict)
    requests: dict[tuple[str, int], Request] = field(default_factory=dict)
    replies: dict[tuple[str, int], Reply] = field(default_factory=dict)
    doubled: list[tuple[str, int]] = field(default_factory=list)
    running: dict[str, int] = field(default_factory=dict)

    @property
    def corrupt(self) -> bool:
        """Return whether bytes were changed, which is more than an end that is missing."""
        return self.damage is not None and self.damage.startswith("corrupt")


def load(path: Path) -> Recording:
    """Read the session at `path`, up to the cut if it was cut.

    Raises:
        Unusable: no such file, no MCAP, no pushlane session, or damaged before the header.
    """
    try:
        damage = integrity.damage(path)
        data = path.read_bytes()
    except OSError as error:
        raise Unusable(f"cannot read {path}: {error.strerror or error}") from error
    except integrity.NotMcap as error:
        raise Unusable(str(error)) from error
    header: Header | None = None
    config: dict[str, Any] | None = None
    running: dict[str, int] = {}
    found: list[tuple[str, Message]] = []
    broken = None
    try:
        for record in _records(data):
            if isinstance(record, Metadata) and record.name == METADATA_NAME:
                header = Header.from_metadata(record.metadata)
            elif isinstance(record, Metadata) and record.name == END_NAME:
                running = msgspec.json.decode(record.metadata["running"], type=dict[str, int])
            elif isinstance(record, Attachment) and record.name == CONFIG_NAME:
                config = msgspec.json.decode(record.data)
            elif isinstance(record, tuple):
                found.append(record)
    except (
        McapError,
        zstandard.ZstdError,
        struct.error,
        msgspec.MsgspecError,
        ValueError,
        KeyError,
    ) as error:
        broken = f"{type(error).__name__} {error}".strip()
    if damage is None and broken is not None:
        damage = f"corrupt: {broken}"
    if header is None or config is None:
        raise Unusable(f"{path} is no pushlane session: its header is missing ({damage or 'no such record'})")
    if header.format != FORMAT:
        raise Unusable(f"{path} has log format {header.format}; this version reads {FORMAT}")
    recording = Recording(path, header, config, damage, running=running)
    for topic, message in found:
        try:
            _sort(recording, topic, message)
        except DecodeError as error:
            text = f"corrupt: message {message.sequence} of '{topic}' does not parse: {error}"
            recording.damage = recording.damage or text
    for batches in recording.journals.values():
        batches.sort(key=lambda batch: batch.first)
    return recording


def _records(data: bytes) -> Iterator[Metadata | Attachment | tuple[str, Message]]:
    channels: dict[int, str] = {}
    for record in StreamReader(BytesIO(data), validate_crcs=True).records:
        if isinstance(record, Channel):
            channels[record.id] = record.topic
        elif isinstance(record, Message):
            yield channels[record.channel_id], record
        elif isinstance(record, Metadata | Attachment):
            yield record


def _sort(recording: Recording, topic: str, message: Message) -> None:
    kind, _, node = topic.partition("/")
    if topic.startswith(VIEWER_PREFIX):
        return
    if kind == "journal":
        recording.journals.setdefault(node, []).append(Journal.FromString(message.data))
    elif kind == "snapshot":
        snapshot = Snapshot.FromString(message.data)
        recording.snapshots[(node, snapshot.number)] = snapshot
    elif kind == "request":
        request = Request.FromString(message.data)
        recording.requests[(node, request.id)] = request
    elif kind == "reply":
        reply = Reply.FromString(message.data)
        recording.replies[(node, reply.id)] = reply
    else:
        key = (topic, message.sequence)
        if key in recording.samples:
            recording.doubled.append(key)
        else:
            recording.samples[key] = Sample(topic, message.sequence, message.publish_time, message.data)
