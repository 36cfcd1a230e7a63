"""What a scheduler says to a worker, and what it answers: MessagePack, one query a step."""

from __future__ import annotations

from typing import Any

import msgspec

from runtime.sample import Sample
from runtime.time import Time


class Build(msgspec.Struct, frozen=True, tag="build"):
    """Build the service anew from its configuration."""

    config: Any


class Begin(msgspec.Struct, frozen=True, tag="begin"):
    """Start the service's life."""

    now: Time


class Consume(msgspec.Struct, frozen=True, tag="consume"):
    """Give it a message."""

    topic: str
    sequence: int
    time: Time
    payload: bytes
    now: Time
    finish: Time


class Fire(msgspec.Struct, frozen=True, tag="fire"):
    """Fire a timer."""

    timer: str
    number: int
    now: Time
    finish: Time


class Ask(msgspec.Struct, frozen=True, tag="ask"):
    """Ask a request, an encoded `Request`."""

    request: bytes
    now: Time
    finish: Time


class Snap(msgspec.Struct, frozen=True, tag="snapshot"):
    """Take a snapshot."""

    now: Time


class Flush(msgspec.Struct, frozen=True, tag="flush"):
    """Give the journal entries since the last flush."""

    now: Time


class End(msgspec.Struct, frozen=True, tag="end"):
    """End the service's life."""

    now: Time


class Stop(msgspec.Struct, frozen=True, tag="stop"):
    """End the process."""


Step = Build | Begin | Consume | Fire | Ask | Snap | Flush | End | Stop


class Done(msgspec.Struct, frozen=True):
    """What came of a step.

    samples: (topic, sequence, time, payload) rows. error: why it failed, empty if it did not. code: exit code of
    that error.
    """

    samples: list[tuple[str, int, Time, bytes]] = []
    error: str = ""
    code: int = 2

    def published(self) -> list[Sample]:
        """Return the samples as such."""
        return [Sample(*row) for row in self.samples]


def encode(message: Step | Done) -> bytes:
    """Return a step or its answer as bytes."""
    return msgspec.msgpack.encode(message)


def decode_step(data: bytes) -> Step:
    """Return the step that `data` holds.

    Raises:
        msgspec.MsgspecError: it is none.
    """
    return msgspec.msgpack.decode(data, type=Step)


def decode_done(data: bytes) -> Done:
    """Return the answer that `data` holds.

    Raises:
        msgspec.MsgspecError: it is none.
    """
    return msgspec.msgpack.decode(data, type=Done)
