"""Asks a Robotino 3 or 4 once for all that its board can say. Nothing moves: no speed is sent."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from select import select
from time import monotonic

from serial import Serial

from drivers.robotino import infrared
from drivers.robotino.health import Row
from drivers.robotino.serial import tags
from drivers.robotino.serial.framing import Decoder, encode
from drivers.robotino.serial.port import FAILURES, NoLine, gone, opened, shut
from drivers.robotino.serial.tags import BadTag, Tag

_ASKED = (
    Tag.GET_HW_VERSION, Tag.GET_SW_VERSION, Tag.GET_ALL_MOTOR_READINGS, Tag.GET_DISTANCE_SENSORS, Tag.GET_BUMPER,
    Tag.GET_ALL_ANALOG_INPUTS, Tag.GET_ALL_DIGITAL_INPUTS, Tag.GET_GYRO_Z_ANGLE,
)  # fmt: skip
_KINDS = {0: "lead", 1: "NiMH", 2: "Li-ion"}
_MOST = 4096


@dataclass
class _Heard:
    """What came back: tags of the answer and the board's error texts, or what there was in place of them."""

    tags: dict[int, bytes]
    errors: list[str]
    bytes: int
    fault: str
    seconds: float


def read_all(device: str, timeout: float = 1.0) -> list[Row]:
    """Return a row for the line, and if it opens, one for each thing that the board was asked for.

    Args:
        device: a path; empty or "auto": the one device that says it is a Robotino.
        timeout: s, for the board to answer.
    """
    began = monotonic()
    try:
        port = opened(device)
    except NoLine as error:
        return [Row("line", "missing" if error.absent else "bad", str(error), _since(began))]
    line = Row("line", "ok", str(port.port), _since(began))
    began = monotonic()
    try:
        heard = _asked(port, timeout)
    except FAILURES as error:
        return [Row("line", "bad", gone(error, str(port.port)), _since(began))]
    finally:
        shut(port)
    if heard.tags:
        return [line, *_rows(heard)]
    if heard.bytes == 0:
        words = f"no answer within {timeout:g} s: expected a Robotino 3 or 4 that is switched on"
        return [line, Row("board", "missing", words, 1000.0 * heard.seconds)]
    words = "; ".join([*heard.errors, heard.fault]).strip("; ") or "no frame"
    found = f"{heard.bytes} bytes, but no answer in them: {words}; expected a Robotino 3 or 4"
    return [line, Row("board", "bad", found, 1000.0 * heard.seconds)]


def _since(began: float) -> float:
    return 1000.0 * (monotonic() - began)


def _asked(port: Serial, timeout: float) -> _Heard:
    """Ask once, and wait for the answer.

    Raises:
        OSError, termios.error: the line failed.
    """
    began = monotonic()
    decoder, heard = Decoder(), _Heard({}, [], 0, "", 0.0)
    try:
        os.write(port.fileno(), encode(tags.packed(tags.request(*_ASKED))))
    except BlockingIOError:
        heard.fault = "the line takes no bytes"
    while not heard.tags and (left := began + timeout - monotonic()) > 0.0:
        select([port.fileno()], [], [], left)
        data = port.read(_MOST)
        heard.bytes += len(data)
        for frame in decoder.feed(data):
            heard.fault = f"{frame.fault} {frame.detail}" if frame.fault else heard.fault
            try:
                found = tags.unpacked(frame.payload)
            except BadTag as error:
                heard.fault = str(error)
                continue
            heard.errors += [f'the board says "{tags.text(data)}"' for tag, data in found if tag == Tag.ERROR]
            said = {tag: data for tag, data in found if tag != Tag.ERROR}
            # What stands at the end of every answer is none if it stands alone: then the board refused the question.
            if said.keys() - {Tag.POWER_SOURCE_READINGS, Tag.POWER_BUTTON}:
                heard.tags = said
    heard.seconds = monotonic() - began
    return heard


def _rows(heard: _Heard) -> list[Row]:
    """Return a row for each thing, and for what the board said against the question."""
    milliseconds = 1000.0 * heard.seconds
    rows = []
    for name, tag, words in _READ:
        if tag not in heard.tags:
            none = "no gyro on this board" if tag == Tag.GYRO_Z_ANGLE else f"not in the answer: expected {tag.name}"
            rows.append(Row(name, "missing", none, milliseconds))
            continue
        try:
            rows.append(Row(name, "ok", words(heard.tags[tag]), milliseconds))
        except BadTag as error:
            rows.append(Row(name, "bad", str(error), milliseconds))
    refused = [one for one in heard.errors if not one.endswith(f'Tag {Tag.GET_GYRO_Z_ANGLE} not implemented"')]
    return rows + [Row("board", "bad", one, milliseconds) for one in refused]


def _motors(data: bytes) -> str:
    one = tags.motor_readings(data)
    currents = " ".join(f"{ampere:.2f}" for ampere in one.currents[:3])
    return f"{_list(one.speeds[:3])} rpm, {_list(one.ticks[:3])} ticks, {currents} A"


def _distances(data: bytes) -> str:
    return " ".join(f"{infrared.metres(volts):.2f}" for volts in tags.distance_volts(data)) + " m"


def _power(data: bytes) -> str:
    one = tags.power(data)
    kind = _KINDS.get(one.kind, "unknown kind")
    source = "power from outside" if one.external else "on its battery"
    words = f"{one.volts:.1f} V, {one.amperes:.1f} A, {kind}, {source}, chargers: {one.chargers}"
    if one.low:
        raise BadTag(f"battery low: {words}, off in {one.shutdown / 1000:.0f} s")
    return words


def _analog(data: bytes) -> str:
    if len(data) != 32:
        raise BadTag(f"{len(data)} bytes, expected 32")
    found = struct.unpack("<8f", data)
    if not all(map(isfinite, found)):
        raise BadTag(f"{found}, expected finite numbers")
    return " ".join(f"{volts:.2f}" for volts in found) + " V"


def _digital(data: bytes) -> str:
    if len(data) != 1:
        raise BadTag(f"{len(data)} bytes, expected 1")
    return " ".join(str(data[0] >> index & 1) for index in range(8))


def _gyro(data: bytes) -> str:
    one = tags.gyro(data)
    return f"{one.angle:.3f} rad, {one.rate:.3f} rad/s"


def _list(numbers: tuple[int, ...]) -> str:
    return " ".join(map(str, numbers))


_READ: tuple[tuple[str, Tag, Callable[[bytes], str]], ...] = (
    ("hardware", Tag.HW_VERSION, tags.text),
    ("firmware", Tag.SW_VERSION, tags.text),
    ("motors", Tag.ALL_MOTOR_READINGS, _motors),
    ("distances", Tag.DISTANCE_SENSORS, _distances),
    ("bumper", Tag.BUMPER, lambda data: "pressed" if tags.flag(Tag.BUMPER, data) else "not pressed"),
    ("power", Tag.POWER_SOURCE_READINGS, _power),
    ("analog inputs", Tag.ALL_ANALOG_INPUTS, _analog),
    ("digital inputs", Tag.ALL_DIGITAL_INPUTS, _digital),
    ("gyro", Tag.GYRO_Z_ANGLE, _gyro),
)
