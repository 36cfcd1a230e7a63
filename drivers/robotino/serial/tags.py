"""Tags: what stands in a frame's payload, one after the other: id, length, data (reference 2.4)."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from math import isfinite

from drivers.robotino.infrared import COUNT
from drivers.robotino.kinematics import Motors


class Tag(IntEnum):
    """The ids that are used here, by the names of the firmware."""

    GET_HW_VERSION = 1
    HW_VERSION = 2
    GET_SW_VERSION = 3
    SW_VERSION = 4
    GET_DISTANCE_SENSORS = 5
    DISTANCE_SENSORS = 6
    SET_MOTOR_SPEED = 9
    GET_ALL_MOTOR_SPEEDS = 10
    ALL_MOTOR_SPEEDS = 11
    SET_MOTOR_POSITION = 12
    GET_ALL_MOTOR_POSITIONS = 13
    ALL_MOTOR_POSITIONS = 14
    SET_ALL_DIGITAL_OUTPUTS = 18
    SET_ALL_RELAYS = 19
    SET_ODOMETRY = 20
    GET_ODOMETRY = 22
    ODOMETRY = 23
    GET_ALL_MOTOR_CURRENTS = 26
    ALL_MOTOR_CURRENTS = 27
    GET_ALL_ANALOG_INPUTS = 32
    ALL_ANALOG_INPUTS = 33
    GET_ALL_DIGITAL_INPUTS = 34
    ALL_DIGITAL_INPUTS = 35
    GET_BUMPER = 36
    BUMPER = 37
    GET_POWER_BUTTON = 38
    POWER_BUTTON = 39
    GET_ALL_MOTOR_READINGS = 52
    ALL_MOTOR_READINGS = 53
    SET_EMERGENCY_BUMPER = 57
    POWER_SOURCE_READINGS = 65
    SET_MOTOR_ACCEL_LIMITS = 66
    MOTOR_ACCEL_LIMITS = 67
    GET_MOTOR_ACCEL_LIMITS = 68
    GET_GYRO_Z_ANGLE = 69
    GYRO_Z_ANGLE = 70
    CHARGER_INFO = 80
    CHARGER_VERSION = 82
    GET_CHARGER_VERSION = 83
    GYRO_SET_PARAM = 95
    GYRO_GET_PARAM = 96
    GYRO_PARAM = 97
    ERROR = 252


class BadTag(ValueError):
    """A payload, or the data of a tag, is not what its id says."""


@dataclass(frozen=True)
class MotorReadings:
    """Of motors 1 to 3 and the spare one: rpm of the shaft, encoder ticks, A."""

    speeds: tuple[int, int, int, int]
    ticks: tuple[int, int, int, int]
    currents: tuple[float, float, float, float]


@dataclass(frozen=True)
class Power:
    """The battery: V, A; external power; chargers; kind (0 lead, 1 NiMH, 2 Li-ion); low; ms to the shutdown."""

    volts: float
    amperes: float
    external: bool
    chargers: int
    kind: int
    low: bool
    shutdown: int


@dataclass(frozen=True)
class ChargerInfo:
    """A charger: its number; V and A of its battery, degrees Celsius; its state and what it says, in words."""

    number: int
    volts: float
    amperes: float
    temperatures: tuple[float, float]
    state: str
    words: str


CHARGER_STATES = (
    "none", "idle", "monitor", "check battery", "no battery", "NTC error", "start", "stage 1", "stage 2", "stage 3",
    "stage 4", "error", "unknown",
)  # fmt: skip
"""of tag 80, by number, as the manufacturer's host names them"""


@dataclass(frozen=True)
class Gyro:
    """Angle, rad, and rate, rad/s."""

    angle: float
    rate: float


_READINGS = struct.Struct("<4h4i4f")
_DISTANCES = struct.Struct(f"<{COUNT}f")
_POWER = struct.Struct("<ff4BI")
_GYRO = struct.Struct("<ff")
_CHARGER = struct.Struct("<BI4fB")
_SPEED = struct.Struct("<Bh")
_MOST_RPM = 32767


def packed(tags: Iterable[tuple[int, bytes]]) -> bytes:
    """Return the payload of (id, data), in order.

    Raises:
        BadTag: data is longer than a tag can say.
    """
    out = bytearray()
    for tag, data in tags:
        if len(data) > 255:
            raise BadTag(f"tag {tag} with {len(data)} bytes, expected at most 255")
        out += bytes((tag, len(data))) + data
    return bytes(out)


def unpacked(payload: bytes) -> list[tuple[int, bytes]]:
    """Return (id, data) of every tag.

    Raises:
        BadTag: a tag is longer than what is left.
    """
    found, at = [], 0
    while at < len(payload):
        if at + 2 > len(payload) or at + 2 + payload[at + 1] > len(payload):
            raise BadTag(f"tag {payload[at]} at byte {at} is longer than the {len(payload) - at} bytes that are left")
        end = at + 2 + payload[at + 1]
        found.append((payload[at], payload[at + 2 : end]))
        at = end
    return found


def request(*tags: Tag) -> list[tuple[int, bytes]]:
    """Return tags without data."""
    return [(tag, b"") for tag in tags]


def speeds(motors: Motors) -> list[tuple[int, bytes]]:
    """Return the tags that set motors 1 to 3 to so many rpm, whole ones."""
    whole = [min(max(round(one), -_MOST_RPM), _MOST_RPM) for one in motors]
    return [(Tag.SET_MOTOR_SPEED, _SPEED.pack(index, one)) for index, one in enumerate(whole)]


def emergency_bumper(on: bool) -> tuple[int, bytes]:
    """Return the tag that lets the board stop the motors by itself while the bumper is pressed."""
    return (Tag.SET_EMERGENCY_BUMPER, bytes((on,)))


def motor_readings(data: bytes) -> MotorReadings:
    """Return what tag 53 says.

    Raises:
        BadTag: of the wrong length, or a current that is not finite.
    """
    _check(Tag.ALL_MOTOR_READINGS, data, _READINGS.size)
    found = _READINGS.unpack(data)
    _finite(Tag.ALL_MOTOR_READINGS, found[8:])
    return MotorReadings(found[:4], found[4:8], found[8:])


def pack_motor_readings(one: MotorReadings) -> tuple[int, bytes]:
    """Return tag 53."""
    return (Tag.ALL_MOTOR_READINGS, _READINGS.pack(*one.speeds, *one.ticks, *one.currents))


def distance_volts(data: bytes) -> tuple[float, ...]:
    """Return the volts, (9,), of tag 6.

    Raises:
        BadTag: of the wrong length, or not volts that the board's converter can give.
    """
    _check(Tag.DISTANCE_SENSORS, data, _DISTANCES.size)
    found = _DISTANCES.unpack(data)
    _finite(Tag.DISTANCE_SENSORS, found)
    if not all(-0.1 <= one <= 5.1 for one in found):
        raise BadTag(f"distance sensors at {found} V, expected 0 to 5")
    return found


def pack_distance_volts(volts: Iterable[float]) -> tuple[int, bytes]:
    """Return tag 6 of (9,) volts."""
    return (Tag.DISTANCE_SENSORS, _DISTANCES.pack(*volts))


def power(data: bytes) -> Power:
    """Return what tag 65 says.

    Raises:
        BadTag: of the wrong length, or not finite.
    """
    _check(Tag.POWER_SOURCE_READINGS, data, _POWER.size)
    volts, amperes, external, chargers, kind, low, shutdown = _POWER.unpack(data)
    _finite(Tag.POWER_SOURCE_READINGS, (volts, amperes))
    return Power(volts, amperes, bool(external), chargers, kind, bool(low), shutdown)


def pack_power(one: Power) -> tuple[int, bytes]:
    """Return tag 65."""
    data = _POWER.pack(one.volts, one.amperes, one.external, one.chargers, one.kind, one.low, one.shutdown)
    return (Tag.POWER_SOURCE_READINGS, data)


def gyro(data: bytes) -> Gyro:
    """Return what tag 70 says.

    Raises:
        BadTag: of the wrong length, or not finite.
    """
    _check(Tag.GYRO_Z_ANGLE, data, _GYRO.size)
    angle, rate = _GYRO.unpack(data)
    _finite(Tag.GYRO_Z_ANGLE, (angle, rate))
    return Gyro(angle, rate)


def charger(data: bytes) -> ChargerInfo:
    """Return what tag 80 says, which the board sends unasked.

    Raises:
        BadTag: it is too short, or a number is not finite.
    """
    if len(data) < _CHARGER.size:
        raise BadTag(f"tag 80 with {len(data)} bytes, expected {_CHARGER.size} and a text")
    number, _, volts, amperes, first, second, state = _CHARGER.unpack(data[: _CHARGER.size])
    _finite(Tag.CHARGER_INFO, (volts, amperes, first, second))
    name = CHARGER_STATES[state] if state < len(CHARGER_STATES) else f"state {state}"
    return ChargerInfo(number, volts, amperes, (first, second), name, text(data[_CHARGER.size :]))


def pack_charger(found: ChargerInfo) -> tuple[int, bytes]:
    """Return tag 80, as a board sends it."""
    numbers = (found.number, 0, found.volts, found.amperes, *found.temperatures, CHARGER_STATES.index(found.state))
    return (Tag.CHARGER_INFO, _CHARGER.pack(*numbers) + found.words.encode())


def flag(tag: Tag, data: bytes) -> bool:
    """Return the one byte of a tag as a truth value.

    Raises:
        BadTag: of the wrong length, or neither 0 nor 1.
    """
    _check(tag, data, 1)
    if data[0] > 1:
        raise BadTag(f"{tag.name} is {data[0]}, expected 0 or 1")
    return bool(data[0])


def text(data: bytes) -> str:
    """Return the text of a tag; what is not printable stands escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in data.decode("latin-1"))


def _check(tag: Tag, data: bytes, length: int) -> None:
    if len(data) != length:
        raise BadTag(f"{tag.name} with {len(data)} bytes, expected {length}")


def _finite(tag: Tag, numbers: Iterable[float]) -> None:
    if not all(map(isfinite, numbers)):
        raise BadTag(f"{tag.name} holds {tuple(numbers)}, expected finite numbers")
