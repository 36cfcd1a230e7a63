"""Reads an MCAP session into typed tracks, as far as the file is whole."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

import foxglove_schemas_protobuf.CameraCalibration_pb2
import foxglove_schemas_protobuf.CompressedImage_pb2  # noqa: F401  the imports fill the descriptor pool
import numpy as np
from google.protobuf import descriptor_pool
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass
from mcap.exceptions import EndOfFile, InvalidMagic, RecordLengthLimitExceeded
from mcap.records import Attachment, Channel, McapRecord, Metadata, Schema
from mcap.records import Message as Record
from mcap.stream_reader import CRCValidationError, StreamReader
from numpy.typing import NDArray
from zstandard import ZstdError

import runtime.messages  # noqa: F401
from replays.inspect.errors import Unreadable
from replays.integrity import MAGIC

M = TypeVar("M", bound=Message)

# What a reader meets at the end of a file that was cut, or where a disk went bad.
_DAMAGE = (
    EndOfFile,
    RecordLengthLimitExceeded,
    CRCValidationError,
    InvalidMagic,
    struct.error,
    ZstdError,
    ValueError,
)
# The recorder's copies for plain viewers: the same map again.
_DERIVED = "viewer/"


@dataclass(frozen=True)
class Track(Generic[M]):
    """The messages of one topic, in the order of their time.

    `times` is (N) int64, ns of logical time; `messages` has N entries.
    """

    times: NDArray[np.int64]
    messages: list[M]

    def __len__(self) -> int:
        return len(self.messages)

    def latest(self, times: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the index of the newest message not after each of `times`; -1 where there is none."""
        return (np.searchsorted(self.times, times, side="right") - 1).astype(np.int64)


@dataclass(frozen=True)
class Session:
    """What one file holds. `damage` says why reading stopped early, and is empty for a whole file.

    `undecoded` counts the messages per topic whose type is not known here, or whose bytes are not of it.
    """

    tracks: dict[str, Track[Message]]
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    undecoded: dict[str, int]
    damage: str

    def track(self, topic: str, kind: type[M]) -> Track[M]:
        """Return the messages of `topic`; none where it was not recorded.

        Raises:
            Unreadable: the topic carries another type than `kind`.
        """
        found = self.tracks.get(topic)
        if found is None:
            return Track(np.empty(0, np.int64), [])
        messages = [message for message in found.messages if isinstance(message, kind)]
        if len(messages) != len(found.messages):
            other = found.messages[0].DESCRIPTOR.full_name
            raise Unreadable(f"topic {topic} carries {other}, expected {kind.DESCRIPTOR.full_name}")
        return Track(found.times, messages)

    @property
    def span(self) -> tuple[int, int]:
        """First and last time of the session, ns."""
        ends = [(int(track.times[0]), int(track.times[-1])) for track in self.tracks.values()]
        return min(first for first, _ in ends), max(last for _, last in ends)


def read_session(path: Path) -> Session:
    """Read everything before the first damage.

    Raises:
        Unreadable: the file is missing, is no MCAP, or holds no message of a type known here.
    """
    reading = _Reading()
    damage = ""
    try:
        with path.open("rb") as file:
            for record in StreamReader(file, validate_crcs=True).records:
                reading.take(record)
    except OSError as error:
        raise Unreadable(f"{path}: {error.strerror}") from error
    except _DAMAGE as error:
        damage = f"{type(error).__name__}: {error}".rstrip(": ")
    if not reading.rows:
        begins = _begins(path)
        if begins != MAGIC:
            raise Unreadable(
                f"{path}: nothing to show: it begins with {begins!r}, as no MCAP file does; expected an MCAP session"
            )
        unknown = f"{sum(reading.undecoded.values())} messages, none of a type known here"
        raise Unreadable(f"{path}: nothing to show ({damage or unknown}); expected an MCAP session")
    tracks = {topic: _sorted(rows) for topic, rows in sorted(reading.rows.items())}
    return Session(tracks, reading.metadata, reading.attachments, reading.undecoded, damage)


def _begins(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(len(MAGIC))


@dataclass
class _Reading:
    """What was read so far."""

    rows: dict[str, list[tuple[int, Message]]] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    undecoded: dict[str, int] = field(default_factory=dict)
    _classes: dict[int, type[Message] | None] = field(default_factory=dict)
    _channels: dict[int, Channel] = field(default_factory=dict)

    def take(self, record: McapRecord) -> None:
        match record:
            case Schema():
                self._classes[record.id] = _class_of(record)
            case Channel():
                self._channels[record.id] = record
            case Metadata():
                self.metadata[record.name] = dict(record.metadata)
            case Attachment():
                self.attachments[record.name] = record.data
            case Record():
                self._take_message(record)

    def _take_message(self, record: Record) -> None:
        channel = self._channels[record.channel_id]
        topic = channel.topic.lstrip("/")
        if topic.startswith(_DERIVED):
            return
        message = _decode(self._classes.get(channel.schema_id), record.data)
        if message is None:
            self.undecoded[topic] = self.undecoded.get(topic, 0) + 1
        else:
            self.rows.setdefault(topic, []).append((record.log_time, message))


def _class_of(schema: Schema) -> type[Message] | None:
    """Return the generated class of a schema's name. It reads older payloads too, by protobuf's own rules."""
    if schema.encoding != "protobuf":
        return None
    try:
        return GetMessageClass(descriptor_pool.Default().FindMessageTypeByName(schema.name))
    except KeyError:
        return None


def _decode(kind: type[Message] | None, data: bytes) -> Message | None:
    if kind is None:
        return None
    try:
        return kind.FromString(data)
    except DecodeError:
        return None


def _sorted(rows: list[tuple[int, Message]]) -> Track[Message]:
    times = np.array([time for time, _ in rows], np.int64)
    order = np.argsort(times, kind="stable")
    return Track(times[order], [rows[index][1] for index in order])
