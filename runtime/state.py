"""Snapshots without pickle: a service's state, a tree of dataclasses, as MessagePack and back.

Beyond what msgspec knows by itself a state may hold numpy arrays, protobuf messages and seeded numpy
generators. The types come from the annotations of the state class, never from the bytes, so that a snapshot
cannot make the reader run anything. Sets are refused: their order is not the same in another process.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, TypeVar, get_origin

import msgspec
import numpy as np
from google.protobuf.message import DecodeError, Message
from msgspec import inspect

from runtime.errors import PushlaneError

S = TypeVar("S")

_GENERATOR_BYTES = (16, 16, 1, 4)  # state, increment, whether half a draw is kept, that half
_PLAIN_DTYPE = re.compile(r"[<>|=][biufcSU][0-9]{1,9}|[<>|=][mM]8(\[[0-9]*[a-zA-Z]+\])?")
_DAMAGE = (
    msgspec.MsgspecError,
    DecodeError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    RecursionError,
    OverflowError,
)


class BadSnapshot(PushlaneError):
    """The bytes are no snapshot of this state class."""


def encode(state: object) -> bytes:
    """Return `state` as MessagePack, with the name of its class.

    The bytes are those that the decoded state would give: a 0 in a float field is written as 0.0.

    Raises:
        TypeError: a field's type cannot be snapshotted; this is a mistake in the service.
    """
    _refuse_sets(type(state))  # type: ignore[arg-type]
    name = type(state).__qualname__
    data = msgspec.msgpack.encode(state, enc_hook=_encode_special)
    try:
        clean = msgspec.msgpack.decode(data, type=type(state), dec_hook=_decode_special)
    except _DAMAGE as error:
        raise TypeError(f"a {name} holds what its annotations do not allow: {error}") from error
    return msgspec.msgpack.encode((name, clean), enc_hook=_encode_special)


def decode(kind: type[S], data: bytes) -> S:
    """Return the state of class `kind` that `data` holds.

    Raises:
        BadSnapshot: `data` is damaged or of another class; the message names the field.
    """
    try:
        name, state = msgspec.msgpack.decode(data, type=tuple[str, kind], dec_hook=_decode_special)  # type: ignore[valid-type]
    except _DAMAGE as error:
        raise BadSnapshot(f"snapshot is no {kind.__qualname__}: {error}") from error
    if name != kind.__qualname__:
        raise BadSnapshot(f"snapshot is no {kind.__qualname__} but a {name[:80]}")
    return state


@cache
def _refuse_sets(kind: type) -> None:
    for found in _walk(inspect.type_info(kind), set()):
        if isinstance(found, inspect.SetType | inspect.FrozenSetType):
            raise TypeError(f"{kind.__qualname__} holds a set; its order would differ between processes: use a list")


def _walk(found: object, seen: set[type]) -> Iterator[object]:
    yield found
    if isinstance(found, inspect.DataclassType | inspect.StructType | inspect.NamedTupleType | inspect.TypedDictType):
        cls = getattr(found, "cls", type(found))
        if cls in seen:
            return
        seen.add(cls)
        inner = [field.type for field in found.fields]
    else:
        names = ("item_type", "key_type", "value_type")
        inner = [getattr(found, name) for name in names if hasattr(found, name)]
        inner += [*getattr(found, "item_types", ()), *getattr(found, "types", ())]
    for one in inner:
        yield from _walk(one, seen)


def _encode_special(value: object) -> object:
    if isinstance(value, np.ndarray):
        if not _PLAIN_DTYPE.fullmatch(value.dtype.str):
            raise TypeError(f"a state cannot hold an array of {value.dtype}; use plain numbers or text")
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
    name, shape, data = value
    if not isinstance(name, str) or not _PLAIN_DTYPE.fullmatch(name):
        raise ValueError(f"no plain dtype: {name!r:.80}")
    dtype = np.dtype(name)
    if not all(type(size) is int and size >= 0 for size in shape) or not isinstance(data, bytes):
        raise ValueError(f"no shape: {shape!r:.80}")
    if math.prod(shape) * dtype.itemsize != len(data):
        raise ValueError(f"{len(data)} bytes are no array of {name} with shape {shape!r:.80}")
    return np.ndarray(shape, dtype, buffer=data).copy() if data else np.empty(shape, dtype)


def _decode_message(kind: type, value: Any) -> object:
    message: Message = kind()
    message.ParseFromString(value)
    return message


def _generator_words(generator: np.random.Generator) -> list[bytes]:
    state = generator.bit_generator.state
    if state["bit_generator"] != "PCG64":
        raise TypeError(f"a state's generator is to be a PCG64, not a {state['bit_generator']}")
    numbers = (state["state"]["state"], state["state"]["inc"], state["has_uint32"], state["uinteger"])
    return [int(n).to_bytes(size, "little") for n, size in zip(numbers, _GENERATOR_BYTES, strict=True)]


def _decode_generator(_: type, value: Any) -> object:
    if not isinstance(value, list) or [len(word) for word in value] != list(_GENERATOR_BYTES):
        raise ValueError("no words of a generator")
    words = [int.from_bytes(word, "little") for word in value]
    if words[2] > 1:
        raise ValueError(f"has_uint32 of a generator is {words[2]}")
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
