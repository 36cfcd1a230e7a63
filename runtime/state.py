"""Snapshots without pickle: a service's state, a tree of dataclasses, as MessagePack and back.

Beyond what msgspec knows by itself a state may hold numpy arrays, protobuf messages and seeded numpy
generators. The types come from the annotations of the state class, never from the bytes, so that a snapshot
cannot make the reader run anything.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, get_origin

import msgspec
import numpy as np
from google.protobuf.message import DecodeError, Message

from runtime.errors import PushlaneError

S = TypeVar("S")

_GENERATOR_WORDS = 4


class BadSnapshot(PushlaneError):
    """The bytes are no snapshot of this state class."""


def encode(state: object) -> bytes:
    """Return `state` as MessagePack.

    Raises:
        TypeError: a field's type cannot be snapshotted; this is a mistake in the service.
    """
    return msgspec.msgpack.encode(state, enc_hook=_encode_special, order="deterministic")


def decode(kind: type[S], data: bytes) -> S:
    """Return the state of class `kind` that `data` holds.

    Raises:
        BadSnapshot: `data` is damaged or of another class; the message names the field.
    """
    try:
        return msgspec.msgpack.decode(data, type=kind, dec_hook=_decode_special)
    except (msgspec.MsgspecError, DecodeError, ValueError, KeyError, IndexError, TypeError) as error:
        raise BadSnapshot(f"snapshot is no {kind.__name__}: {error}") from error


def _encode_special(value: object) -> object:
    if isinstance(value, np.ndarray):
        return [value.dtype.str, list(value.shape), value.tobytes()]
    if isinstance(value, Message):
        return value.SerializeToString(deterministic=True)
    if isinstance(value, np.random.Generator):
        return _generator_words(value)
    raise TypeError(f"a state cannot hold a {type(value).__name__}; use numbers, text, arrays or messages")


def _decode_special(kind: type, value: object) -> object:
    origin = get_origin(kind) or kind
    decoder = next((decode for base, decode in _DECODERS.items() if issubclass(origin, base)), None)
    if decoder is None:
        raise TypeError(f"a state cannot hold a {kind}")
    return decoder(origin, value)


def _decode_array(_: type, value: Any) -> object:
    dtype, shape, data = value
    return np.frombuffer(data, dtype).reshape(shape).copy()


def _decode_message(kind: type, value: Any) -> object:
    message: Message = kind()
    message.ParseFromString(value)
    return message


def _generator_words(generator: np.random.Generator) -> list[bytes]:
    state = generator.bit_generator.state
    if state["bit_generator"] != "PCG64":
        raise TypeError(f"a state's generator is to be a PCG64, not a {state['bit_generator']}")
    numbers = (state["state"]["state"], state["state"]["inc"], state["has_uint32"], state["uinteger"])
    return [int(number).to_bytes(16, "little") for number in numbers]


def _decode_generator(_: type, value: Any) -> object:
    words = [int.from_bytes(word, "little") for word in value]
    if len(words) != _GENERATOR_WORDS:
        raise ValueError(f"a generator has {_GENERATOR_WORDS} words, not {len(words)}")
    bits = np.random.PCG64(0)
    bits.state = {
        "bit_generator": "PCG64",
        "state": {"state": words[0], "inc": words[1]},
        "has_uint32": words[2],
        "uinteger": words[3],
    }
    return np.random.Generator(bits)


_DECODERS: dict[type, Callable[[type, Any], object]] = {
    np.ndarray: _decode_array,
    Message: _decode_message,
    np.random.Generator: _decode_generator,
}
