"""The unit of a message's field, as the comment beside it in runtime/messages/*.proto says."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from google.protobuf.message import Message

from runtime import messages

_FOLDER = Path(messages.__file__).parent
_MESSAGE = re.compile(r"^message (\w+)")
_FIELD = re.compile(r"^\s+(?:optional |repeated )?[\w.]+ (\w+) = \d+;\s*// (.*)$")
_UNIT = re.compile(r"(?:^|, )((?:m|rad)(?:/s(?:\^2)?|\^2)?|ns|s|V)(?=$|[,;: ])")


def unit_of(kind: type[Message], path: str) -> str:
    """Return the unit of the field at `path`, such as twist.vx or ranges[], of `kind`; "" where none is said."""
    message = kind.DESCRIPTOR
    *outer, name = path.replace("[]", "").split(".")
    for part in outer:
        field = message.fields_by_name.get(part)
        if field is None or field.message_type is None:
            return ""
        message = field.message_type
    return _units(Path(message.file.name).name).get((message.name, name), "")


@cache
def _units(file: str) -> dict[tuple[str, str], str]:
    """Return the units of a file of ours, (message, field) -> unit."""
    found: dict[tuple[str, str], str] = {}
    message = ""
    path = _FOLDER / file
    for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
        if begun := _MESSAGE.match(line):
            message = begun[1]
        elif (field := _FIELD.match(line)) and (unit := _UNIT.search(field[2])):
            found[message, field[1]] = unit[1]
    return found
