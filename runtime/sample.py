"""A message with its envelope, and how it is taken apart at the edge."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from google.protobuf.message import DecodeError, Message

from runtime.errors import PushlaneError
from runtime.finite import nonfinite, surely_finite
from runtime.time import Time

M = TypeVar("M", bound=Message)

INCARNATION = 1 << 24
"""Numbers that one incarnation of a service has for itself; MCAP's sequence has 32 bits, which leaves 256."""


class BadMessage(PushlaneError):
    """A payload does not parse, or holds a number that is not finite."""


class Sample(NamedTuple):
    """A message with its envelope, as it travels and as it is recorded.

    Attributes:
        topic: name in the table of topics.
        sequence: of this topic, from 1; (topic, sequence) names the message.
        time: logical time of publication, ns.
        payload: the encoded message.
    """

    topic: str
    sequence: int
    time: Time
    payload: bytes


def parse(kind: type[M], payload: bytes, topic: str) -> M:
    """Return the message of class `kind` that `payload` holds.

    Raises:
        BadMessage: it does not parse, or holds a number that is not finite; the message names `topic`.
    """
    try:
        message = kind.FromString(payload)
    except DecodeError as error:
        raise BadMessage(f"'{topic}': {len(payload)} bytes are no {kind.__name__}: {error}") from error
    if not surely_finite(payload):
        bad = nonfinite(message)
        if bad is not None:
            raise BadMessage(f"'{topic}': {bad} is not finite")
    return message
