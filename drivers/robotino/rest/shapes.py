"""What the REST interface says, checked: nothing of the wrong shape gets past here (reference 1.2)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, pi
from typing import cast

from drivers.robotino.infrared import COUNT

_MOST_BEAMS = 20_000
_PINS = 8
_FAR = 1e6
_TEXT = 60


class BadShape(ValueError):
    """An answer is not what its path says; the message names what was found and what was expected."""


@dataclass(frozen=True)
class OdometryAnswer:
    """x, y, m, and rot, rad, in the base's own odom frame; vx, vy, m/s, and omega, rad/s, base frame; a counter."""

    pose: tuple[float, float, float]
    twist: tuple[float, float, float]
    sequence: int


@dataclass(frozen=True)
class PowerAnswer:
    """The battery: V; external power; low; its kind; ms to the shutdown."""

    voltage: float
    external: bool
    low: bool
    kind: str
    shutdown: int


@dataclass(frozen=True)
class ScanAnswer:
    """A laser scan: a counter; first and last angle, rad; nearest and farthest, m; ranges, (N,), m, 0: nothing."""

    sequence: int
    first: float
    last: float
    nearest: float
    farthest: float
    ranges: tuple[float, ...]


def read(body: bytes) -> object:
    """Return the JSON of a body.

    Raises:
        BadShape: it is none; NaN and infinity are none.
    """
    try:
        return json.loads(body, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise BadShape(f"no JSON: {error}"[:200]) from error


def odometry(body: bytes) -> OdometryAnswer:
    """Return what /data/odometry says.

    Raises:
        BadShape: not exactly seven finite numbers, the last a counter.
    """
    x, y, rot, vx, vy, omega, sequence = _numbers(read(body), 7, "odometry")
    if sequence != int(sequence) or not 0 <= sequence < 2**63:
        raise BadShape(f"sequence {sequence} of odometry, expected a whole number")
    if not abs(rot) <= pi + 1e-3 or max(abs(vx), abs(vy)) > 10.0 or abs(omega) > 50.0:
        raise BadShape(f"odometry with rot {rot}, velocity {vx}, {vy}, {omega}: no base does that")
    return OdometryAnswer((x, y, rot), (vx, vy, omega), int(sequence))


def distances(body: bytes) -> tuple[float, ...]:
    """Return what /data/distancesensorarray says, (9,) m.

    Raises:
        BadShape: not nine numbers of metres.
    """
    found = _numbers(read(body), COUNT, "distances")
    if not all(0.0 <= one <= 2.0 for one in found):
        raise BadShape(f"distances {list(found)}, expected metres from 0 to 2")
    return tuple(found)


def bumper(body: bytes) -> bool:
    """Return what /data/bumper says.

    Raises:
        BadShape: no object with a truth value.
    """
    found = _object(read(body), "bumper").get("value")
    if not isinstance(found, bool):
        raise BadShape(f"bumper is {_short(found)}, expected true or false")
    return found


def power(body: bytes) -> PowerAnswer:
    """Return what /data/powermanagement says.

    Raises:
        BadShape: a field lacks or is of another kind.
    """
    found = _object(read(body), "power management")
    voltage = found.get("voltage")
    if not _is_number(voltage) or not 0.0 <= cast(float, voltage) <= 100.0:
        raise BadShape(f"voltage is {_short(voltage)}, expected 0 to 100 V")
    flags = [found.get("ext_power", False), found.get("batteryLow", False)]
    if not all(isinstance(one, bool) for one in flags):
        raise BadShape(f"ext_power and batteryLow are {_short(flags)}, expected truth values")
    left = found.get("batteryLowShutdownCounter", 60000)
    if not _is_number(left):
        raise BadShape(f"batteryLowShutdownCounter is {_short(left)}, expected a number")
    kind = str(found.get("batteryType", "Unknown"))[:_TEXT]
    return PowerAnswer(float(cast(float, voltage)), bool(flags[0]), bool(flags[1]), kind, int(cast(float, left)))


def scan(body: bytes) -> ScanAnswer:
    """Return what /data/scan0 says.

    Raises:
        BadShape: numbers lack, or do not go together.
    """
    found = _object(read(body), "scan")
    names = ("angle_min", "angle_max", "angle_increment", "range_min", "range_max", "seq")
    values = [found.get(name) for name in names]
    if not all(_is_number(one) for one in values):
        raise BadShape(f"scan with {dict(zip(names, map(_short, values), strict=True))}, expected numbers")
    first, last, step, nearest, farthest, sequence = (float(cast(float, one)) for one in values)
    ranges = found.get("ranges")
    if not isinstance(ranges, list) or not 2 <= len(ranges) <= _MOST_BEAMS:
        raise BadShape(f"ranges are {_short(ranges)}, expected a list of 2 to {_MOST_BEAMS}")
    if not (last > first and last - first <= 2.0 * pi + 1e-3 and 0.0 <= nearest < farthest <= 1000.0):
        raise BadShape(f"scan from {first} to {last} rad and {nearest} to {farthest} m, expected less before more")
    # A real scan says as its last angle the one after its last beam: 441 beams, 441 steps (reference 1.2).
    if step <= 0.0 or not -0.5 < (last - first) / step - (len(ranges) - 1) < 1.5:
        raise BadShape(f"{len(ranges)} beams of {step} rad from {first} to {last} rad: they do not fit")
    beams = _numbers(ranges, len(ranges), "ranges")
    if not all(0.0 <= one <= farthest + 1.0 for one in beams):
        raise BadShape(f"ranges from {min(beams)} to {max(beams)} m, expected 0 to {farthest}")
    return ScanAnswer(int(sequence), first, first + step * (len(ranges) - 1), nearest, farthest, tuple(beams))


def analog(body: bytes) -> tuple[float, ...]:
    """Return what /data/analoginputarray says, (8,) V.

    Raises:
        BadShape: not eight voltages.
    """
    found = _numbers(read(body), _PINS, "analog inputs")
    if not all(-1.0 <= one <= 11.0 for one in found):
        raise BadShape(f"analog inputs {list(found)}, expected 0 to 10 V")
    return tuple(found)


def digital(body: bytes) -> tuple[bool, ...]:
    """Return what /data/digitalinputarray says, (8,).

    Raises:
        BadShape: not eight truth values.
    """
    found = read(body)
    if not isinstance(found, list) or len(found) != _PINS or not all(isinstance(one, bool) for one in found):
        raise BadShape(f"digital inputs: {_short(found)}, expected {_PINS} truth values")
    return tuple(found)


def versions(body: bytes) -> tuple[str, str]:
    """Return what /data/controllerinfo says: hardware and software, plain or in a payload.

    Raises:
        BadShape: neither stands there.
    """
    found = _object(read(body), "controller info")
    inner = _object(found.get("payload", found), "controller info")
    both = inner.get("hardware"), inner.get("software")
    if not all(isinstance(one, str) for one in both):
        raise BadShape(f"controller info {_short(found)}, expected hardware and software")
    return str(both[0])[:_TEXT], str(both[1])[:_TEXT]


def omnidrive(vx: float, vy: float, omega: float) -> bytes:
    """Return the body of a PUT to /data/omnidrive, m/s and rad/s, base frame.

    Raises:
        BadShape: a number is not finite.
    """
    if not all(map(isfinite, (vx, vy, omega))):
        raise BadShape(f"velocity {vx}, {vy}, {omega}, expected finite numbers")
    return json.dumps([vx, vy, omega]).encode()


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON")


def _is_number(one: object) -> bool:
    return isinstance(one, int | float) and not isinstance(one, bool) and abs(one) < 2**63 and isfinite(one)


def _numbers(found: object, count: int, what: str) -> Sequence[float]:
    if not isinstance(found, list) or len(found) != count or not all(_is_number(one) for one in found):
        raise BadShape(f"{what}: {_short(found)}, expected {count} finite numbers")
    numbers = [float(one) for one in found]
    if any(abs(one) > _FAR for one in numbers[:-1]):
        raise BadShape(f"{what}: {_short(found)}, expected numbers of a room")
    return numbers


def _object(found: object, what: str) -> dict[str, object]:
    if not isinstance(found, dict):
        raise BadShape(f"{what}: {_short(found)}, expected an object")
    return found


def _short(found: object) -> str:
    text = repr(found)
    return text if len(text) <= _TEXT else f"{text[:_TEXT]}..."
