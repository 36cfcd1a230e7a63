"""Frames of Robotino 1 and 2 (EA05, EA09): "REC", what is told or read, "rec"; no checksum (reference 2.8)."""

from __future__ import annotations

from dataclasses import dataclass

HEAD, TAIL = b"REC", b"rec"
SENT, ANSWERED = 47, 101
"""bytes of a frame to the board, and of its answer"""
RPM = 27
"""rpm of a motor per unit of speed: ticks in 1/900 s, of 2000 a turn"""
RESYNC = bytes(256)
"""what is written to bring both sides together again"""

_SLAVES, _SLAVE = (14, 35, 56, 77), 21
_MASTER = 3
_DISTANCE_VOLTS, _ANALOG_VOLTS = 2.55 / 1024, 10.0 / 1024
_BATTERY, _CURRENT, _MOTOR_CURRENT = 36.10, 61.44, 156.0
_DEFAULT_GAIN = 255
# (slave, place among its seven) of the nine distance sensors and the eight analog inputs.
_DISTANCES = ((2, 1), (2, 0), (1, 6), (1, 1), (1, 0), (0, 0), (0, 1), (0, 6), (2, 6))
_ANALOG = ((0, 2), (0, 3), (0, 4), (0, 5), (1, 2), (1, 3), (1, 4), (1, 5))


class BadRec(ValueError):
    """Bytes are no frame of the board, or numbers do not fit in one."""


@dataclass(frozen=True)
class RecCommand:
    """What the board is told.

    Attributes:
        speeds: rpm, of motors 1 to 3: rounded to steps of 27. outputs: eight. relays: two. power: -255 to 255.
        shutdown: whether the board is to switch off. zero: positions to be set to zero, motors 1 to 3.
    """

    speeds: tuple[float, float, float]
    outputs: tuple[bool, ...] = (False,) * 8
    relays: tuple[bool, bool] = (False, False)
    power: int = 0
    shutdown: bool = False
    zero: tuple[bool, bool, bool] = (False, False, False)

    def encode(self) -> bytes:
        """Return the 47 bytes.

        Raises:
            BadRec: a speed or the power is out of range.
        """
        frame = bytearray(SENT)
        frame[:3], frame[44:] = HEAD, TAIL
        frame[3] = 0x02 if self.shutdown else 0x00
        for slave in range(3):
            units = round(self.speeds[slave] / RPM)
            _drive(frame, slave, units, 0x08 if self.zero[slave] else 0x00)
        for number, on in enumerate(self.outputs):
            if on:
                frame[4 + 10 * (number // 4)] |= 0x02 << (number % 4)
        for number, on in enumerate(self.relays):
            if on:
                frame[4 + 10 * number] |= 0x20
        _drive(frame, 3, self.power, 0)
        return bytes(frame)


@dataclass(frozen=True)
class RecAnswer:
    """What the board says.

    Attributes:
        speeds: rpm, positions: ticks, of motors 1 to 3; currents: A.
        distances: V, (9,), of the infra-red sensors; analog: V, (8,). inputs: eight. bumper: pressed.
        battery: V, current: A, of all.
    """

    speeds: tuple[int, ...]
    positions: tuple[int, ...]
    currents: tuple[float, ...]
    distances: tuple[float, ...]
    analog: tuple[float, ...]
    inputs: tuple[bool, ...]
    bumper: bool
    battery: float
    current: float

    @classmethod
    def decode(cls, frame: bytes) -> RecAnswer:
        """Return what 101 bytes say.

        Raises:
            BadRec: of another length, or without "REC" and "rec" at its ends.
        """
        if len(frame) != ANSWERED or frame[:3] != HEAD or frame[-3:] != TAIL:
            raise BadRec(f"{len(frame)} bytes from {frame[:3]!r} to {frame[-3:]!r}, expected {ANSWERED}, REC to rec")
        slaves = [frame[at : at + _SLAVE] for at in _SLAVES]
        low = [int.from_bytes(one[8:10], "little") for one in slaves]
        readings = [
            [4 * one[k] + (bits >> (2 * k) & 3) for k in range(8)] for one, bits in zip(slaves, low, strict=True)
        ]
        # The first reading of a slave is its motor's current, the others its converters'.
        return cls(
            speeds=tuple((RPM if one[10] & 1 else -RPM) * one[11] for one in slaves[:3]),
            positions=tuple(-int.from_bytes(one[12:16], "little", signed=True) for one in slaves[:3]),
            currents=tuple(one[0] / _MOTOR_CURRENT for one in readings[:3]),
            distances=tuple(_DISTANCE_VOLTS * readings[slave][1 + place] for slave, place in _DISTANCES),
            analog=tuple(_ANALOG_VOLTS * readings[slave][1 + place] for slave, place in _ANALOG),
            inputs=tuple(bool(slaves[k // 4][16] >> (k % 4) & 1) for k in range(8)),
            bumper=bool(slaves[0][16] & 0x10),
            battery=(4 * frame[_MASTER + 1]) / _BATTERY,
            current=(4 * frame[_MASTER]) / _CURRENT,
        )


def frames(data: bytes) -> tuple[list[bytes], bytes]:
    """Return the answers in what came so far, and what is left of it for the next time."""
    found: list[bytes] = []
    while (at := data.find(HEAD)) >= 0:
        frame = data[at : at + ANSWERED]
        if len(frame) < ANSWERED:
            return found, data[at:]
        if frame.endswith(TAIL):
            found.append(frame)
            data = data[at + ANSWERED :]
        else:
            data = data[at + 1 :]
    return found, data[-2:]


def _drive(frame: bytearray, slave: int, units: int, more: int) -> None:
    if abs(units) > 255:
        raise BadRec(f"{units} units for slave {slave}, expected -255 to 255")
    at = 4 + 10 * slave
    frame[at] |= 0x01  # the brake is released: without this bit nothing moves
    frame[at + 1] = (0x02 if units > 0 else 0x00) | more
    frame[at + 2] = abs(units)
    frame[at + 7 : at + 10] = bytes([_DEFAULT_GAIN] * 3)
