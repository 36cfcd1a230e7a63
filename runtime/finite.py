"""Finds numbers that are not finite in a message. None may pass an edge."""

from __future__ import annotations

import math
from functools import cache

from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message

_FLOATS = (FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FLOAT)


def nonfinite(message: Message) -> str | None:
    """Return the path of the first float field of `message` that is NaN or infinite, or None."""
    for name, repeated, inner in _fields(message.DESCRIPTOR):
        if inner:
            found = _nonfinite_inner(message, name, repeated)
            if found is not None:
                return found
        elif repeated:
            values = getattr(message, name)
            # One sum tells at C speed that all are finite; only a suspicious one is looked through.
            if not math.isfinite(sum(values)):
                for index, value in enumerate(values):
                    if not math.isfinite(value):
                        return f"{name}[{index}]"
        elif not math.isfinite(getattr(message, name)):
            return name
    return None


def _nonfinite_inner(message: Message, name: str, repeated: bool) -> str | None:
    if not repeated:
        if not message.HasField(name):
            return None
        found = nonfinite(getattr(message, name))
        return None if found is None else f"{name}.{found}"
    for index, inner in enumerate(getattr(message, name)):
        found = nonfinite(inner)
        if found is not None:
            return f"{name}[{index}].{found}"
    return None


@cache
def _fields(kind: Descriptor) -> tuple[tuple[str, bool, bool], ...]:
    """Return (name, repeated, is a message) of each field that can hold a float."""
    rows = []
    for field in kind.fields:
        if field.type in _FLOATS:
            rows.append((field.name, field.is_repeated, False))
        elif field.type == FieldDescriptor.TYPE_MESSAGE and _fields(field.message_type):
            rows.append((field.name, field.is_repeated, True))
    return tuple(rows)
