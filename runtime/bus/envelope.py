"""The envelope of a sample on the bus: sequence and time of publication, 16 bytes beside the payload."""

from __future__ import annotations

import struct

import zenoh

from runtime.errors import PushlaneError
from runtime.sample import Sample
from runtime.time import Time

_ENVELOPE = struct.Struct("<Qq")


class BadEnvelope(PushlaneError):
    """A sample came without its envelope, or with another."""


def pack(sequence: int, time: Time) -> bytes:
    """Return the attachment of a sample."""
    return _ENVELOPE.pack(sequence, time)


def unpack(topic: str, payload: bytes, attachment: bytes | None) -> Sample:
    """Return the sample that came as `payload` with `attachment`.

    Raises:
        BadEnvelope: naming the topic and what came.
    """
    if attachment is None or len(attachment) != _ENVELOPE.size:
        size = "no attachment" if attachment is None else f"an attachment of {len(attachment)} bytes"
        raise BadEnvelope(f"'{topic}' came with {size}, expected {_ENVELOPE.size} bytes")
    sequence, time = _ENVELOPE.unpack(attachment)
    return Sample(topic, sequence, time, payload)


def opened(topic: str, sample: zenoh.Sample) -> Sample:
    """Return what came as `sample`, on `topic`.

    Raises:
        BadEnvelope: see `unpack`.
    """
    attachment = None if sample.attachment is None else bytes(sample.attachment)
    return unpack(topic, bytes(sample.payload), attachment)
