"""A double of the microcontroller of Robotino 3 and 4: what comes over its serial line, and what it answers.

By the facts of the firmware 1.2.3 (reference 2.2 to 2.6). It is given bytes and the time, and drives a `Plant`; it
reads no clock. PID settings, CAN, pins of the chargers and the bootloader are left out: "not implemented".
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite

from drivers.angles import wrap
from drivers.robotino import infrared
from drivers.robotino.kinematics import ROBOTINO_3_4, Geometry, Motors, Twist
from drivers.robotino.odometry import way
from drivers.robotino.plant import Plant
from drivers.robotino.serial import tags
from drivers.robotino.serial.framing import LONGEST, Decoder, encode
from drivers.robotino.serial.tags import BadTag, MotorReadings, Power, Tag

TICK = 0.1
"""s, of the main loop"""
_QUIET_TICKS = 4
"""ticks without a frame after which the next stops the motors, 0.4 to 0.5 s after the last one"""
_RELEASE = 2.0
"""s that the motors stay off after the bumper is released, with the emergency bumper on"""
_ACCELERATION = 12000.0
"""rpm/s, at start"""
_SNAP = 1.0
"""rpm around zero that count as zero"""
PIECE = 64
"""bytes of a USB write: an answer comes in pieces of so many"""
_RING = 1024
"""bytes that an answer may have, escapes and all"""
_LONGEST_TEXT = 128
_HARDWARE, _SOFTWARE = b"3.0.0", b"1.2.3"
_GRID = 30

Answer = tuple[int, bytes]


@dataclass
class Board:
    """The board.

    Attributes:
        geometry: of the drive. gyro: whether there is one on the board. grid: whether speeds are multiples of 30 rpm,
            as the firmware's counting for one millisecond gives them.
        volts: of the battery.
        now: s. heard: a frame has come since power-up; quiet: ticks since the last. ticked: ticks of the main loop.
        wish: rpm, set-points of the three drive motors and the spare one; speed: rpm, where their ramps are.
        limit: rpm/s, of the ramps. stops: the emergency bumper is on; off_until: s, until when it keeps motors off.
        turns: of the motors since power-up, as their encoders count them; offset: ticks that were preset.
        seen: x, y, theta, the plant's pose at the last step; None before the first.
        outputs, relays: bit masks. echoed: odometry that was set. bias, scale: of the gyro.
        decoder: of what comes in.
        news: what the next answer also has: tags that nobody asked for, as those of chargers.
    """

    geometry: Geometry = ROBOTINO_3_4
    gyro: bool = False
    grid: bool = False
    volts: float = 24.0
    now: float = 0.0
    heard: bool = False
    quiet: int = 0
    ticked: int = 0
    wish: list[float] = field(default_factory=lambda: [0.0] * 4)
    speed: list[float] = field(default_factory=lambda: [0.0] * 4)
    limit: list[float] = field(default_factory=lambda: [_ACCELERATION] * 4)
    stops: bool = False
    off_until: float = 0.0
    turns: list[float] = field(default_factory=lambda: [0.0] * 4)
    offset: list[int] = field(default_factory=lambda: [0] * 4)
    seen: Twist | None = None
    outputs: int = 0
    relays: int = 0
    echoed: tuple[float, float, float] = (0.0, 0.0, 0.0)
    bias: float = 0.0
    scale: float = 1.0
    decoder: Decoder = field(default_factory=Decoder)
    news: list[Answer] = field(default_factory=list)

    def reset(self) -> None:
        """Begin as after power-up: counters at zero, nothing set, no traffic yet."""
        fresh = Board(self.geometry, self.gyro, self.grid, self.volts, self.now, ticked=self.ticked, seen=self.seen)
        self.__dict__.update(fresh.__dict__)

    def advance(self, now: float, plant: Plant) -> None:
        """Let time pass up to `now`, s, and tell the plant how its wheels are to turn from now on.

        Call it at least every few ms: the ramps are exact, but the plant only hears of them here.
        """
        self._count(plant.pose)
        while (self.ticked + 1) * TICK <= now:
            self.ticked += 1
            self.quiet += 1
            if self.heard and self.quiet > _QUIET_TICKS:
                self._stop()
        if self.stops and plant.bumper:
            self.off_until = now + _RELEASE
        if now < self.off_until:
            self._stop()
        seconds, self.now = now - self.now, now
        for index, (wish, speed) in enumerate(zip(self.wish, self.speed, strict=True)):
            step = self.limit[index] * seconds
            near = wish if abs(wish - speed) <= step else speed + (step if wish > speed else -step)
            self.speed[index] = 0.0 if wish == 0.0 and abs(near) <= _SNAP else near
        plant.drive(self.geometry.twist((self.speed[0], self.speed[1], self.speed[2])))

    def receive(self, data: bytes, plant: Plant) -> bytes:
        """Take bytes from the host; return the answers to all frames that end in them."""
        out = b""
        for frame in self.decoder.feed(data):
            if frame.fault == "broken off":
                continue  # the firmware begins anew without a word
            if frame.fault:
                said = "RX checksum mismatch " if frame.fault == "checksum" else "payload to long: "
                out += self._framed([_error(said + frame.detail)], plant)
                continue
            self.heard, self.quiet = True, 0
            answers = self._answers(frame.payload, plant)
            if answers:
                out += self._framed(answers, plant)
        return out

    def _stop(self) -> None:
        """Set-points, ramps and PWM to zero, at once."""
        self.wish, self.speed = [0.0] * 4, [0.0] * 4

    def _count(self, pose: Twist) -> None:
        """Turn the encoders by what the plant moved."""
        if self.seen is not None:
            # Speeds in rpm for a minute, turns for a second.
            moved = self.geometry.motors(way(self.seen, pose))
            for index, one in enumerate(moved):
                self.turns[index] += one / 60.0
        self.seen = pose

    def _framed(self, answers: list[Answer], plant: Plant) -> bytes:
        """Return one frame of these answers, with what stands at the end of all, in the space that there is."""
        power = Power(self.volts, 1.5, False, 1, 0, self.volts < 19.0, 60000)
        last = [tags.pack_power(power), (Tag.POWER_BUTTON, b"\0")]
        self._count(plant.pose)
        kept, tail, self.news = [*answers, *self.news], list(last), []
        while True:
            payload = tags.packed([*kept, *tail])
            if len(payload) <= LONGEST and len(frame := encode(payload, LONGEST)) <= _RING:
                return frame
            kept, tail = kept[:-1], [_error("producer_buffer overrun"), *last]

    def _answers(self, payload: bytes, plant: Plant) -> list[Answer]:
        found: list[Answer] = []
        at = 0
        while at + 2 <= len(payload):
            tag, length = payload[at], payload[at + 1]
            data = payload[at + 2 : at + 2 + length]
            if len(data) < length:
                return [*found, _error(f"tag_length={length} greater than length={len(payload) - at - 2}")]
            found += self._answer(tag, data, plant)
            at += 2 + length
        return found

    def _answer(self, tag: int, data: bytes, plant: Plant) -> list[Answer]:
        """Return the answer to one tag: none to what only sets something."""
        expected, work = _TABLE.get(tag, (-1, None))
        if work is None:
            return [_error(f"Tag {tag} not implemented")]
        if len(data) != expected:
            return [_error(f"TAG_{Tag(tag).name} invalid length {len(data)}")]
        try:
            answer = work(self, data, plant)
        except BadTag as error:
            return [_error(f"TAG_{Tag(tag).name} {error}")]
        return [] if answer is None else [answer]

    def _ticks(self) -> tuple[int, int, int, int]:
        count = (round(turns * self.geometry.ticks) + off for turns, off in zip(self.turns, self.offset, strict=True))
        a, b, c, d = ((one + 2**31) % 2**32 - 2**31 for one in count)
        return a, b, c, d

    def _rpm(self, plant: Plant) -> tuple[int, int, int, int]:
        motors: Motors = self.geometry.motors(plant.twist)
        a, b, c = ((_GRID * round(one / _GRID) if self.grid else round(one)) for one in motors)
        return a, b, c, 0

    def _readings(self, _: bytes, plant: Plant) -> Answer:
        rpm = self._rpm(plant)
        current = tuple(0.5 if one else 0.0 for one in rpm)
        return tags.pack_motor_readings(MotorReadings(rpm, self._ticks(), (current[0], current[1], current[2], 0.0)))

    def _distances(self, _: bytes, plant: Plant) -> Answer:
        return tags.pack_distance_volts([infrared.volts(one) for one in plant.distances])

    def _set_speed(self, data: bytes, _: Plant) -> None:
        motor, rpm = struct.unpack("<Bh", data)
        if motor > 3:
            raise BadTag(f"invalid motor {motor}")
        self.wish[motor] = float(rpm)

    def _set_position(self, data: bytes, _: Plant) -> None:
        motor, position = struct.unpack("<Bi", data)
        if motor > 3:
            raise BadTag(f"invalid motor {motor}")
        self.offset[motor] = position - round(self.turns[motor] * self.geometry.ticks)

    def _set_limits(self, data: bytes, _: Plant) -> None:
        motor, least, most = struct.unpack("<Bff", data)
        if motor > 3:
            raise BadTag(f"invalid motor {motor}")
        if not (isfinite(least) and isfinite(most)):
            raise BadTag(f"invalid limits {least} {most}")
        if least <= 0.0 < most:
            self.limit[motor] = min(-least, most) if least < 0.0 else most

    def _limits(self, data: bytes, _: Plant) -> Answer:
        motor = data[0]
        if motor > 3:
            raise BadTag(f"invalid motor {motor}")
        return (Tag.MOTOR_ACCEL_LIMITS, struct.pack("<Bff", motor, -self.limit[motor], self.limit[motor]))

    def _set_bumper(self, data: bytes, _: Plant) -> None:
        self.stops = bool(data[0])

    def _set_outputs(self, data: bytes, _: Plant) -> None:
        self.outputs = data[0]

    def _set_relays(self, data: bytes, _: Plant) -> None:
        self.relays = data[0] & 3

    def _set_odometry(self, data: bytes, _: Plant) -> None:
        x, y, phi = struct.unpack("<3f", data)
        self.echoed = (x, y, phi)

    def _odometry(self, _: bytes, __: Plant) -> Answer:
        # The firmware never integrates: this only says what was set.
        return (Tag.ODOMETRY, struct.pack("<3f", *self.echoed))

    def _gyro(self, _: bytes, plant: Plant) -> Answer | None:
        if not self.gyro:
            return None
        return (Tag.GYRO_Z_ANGLE, struct.pack("<ff", wrap(plant.pose[2]), plant.twist[2]))

    def _set_gyro(self, data: bytes, _: Plant) -> None:
        which, value = struct.unpack("<Bf", data)
        if which:
            self.scale = value
        else:
            self.bias = value


def _error(said: str) -> Answer:
    return (Tag.ERROR, said.encode()[:_LONGEST_TEXT])


def _fixed(tag: Tag, data: bytes) -> Callable[[Board, bytes, Plant], Answer]:
    return lambda board, _, plant: (tag, data)  # noqa: ARG005


_Work = Callable[[Board, bytes, Plant], Answer | None]
_TABLE: dict[int, tuple[int, _Work]] = {
    Tag.GET_HW_VERSION: (0, _fixed(Tag.HW_VERSION, _HARDWARE)),
    Tag.GET_SW_VERSION: (0, _fixed(Tag.SW_VERSION, _SOFTWARE)),
    Tag.GET_DISTANCE_SENSORS: (0, Board._distances),
    Tag.SET_MOTOR_SPEED: (3, Board._set_speed),
    Tag.GET_ALL_MOTOR_SPEEDS: (
        0,
        lambda board, _, plant: (Tag.ALL_MOTOR_SPEEDS, struct.pack("<4h", *board._rpm(plant))),
    ),
    Tag.SET_MOTOR_POSITION: (5, Board._set_position),
    Tag.GET_ALL_MOTOR_POSITIONS: (
        0,
        lambda board, _, plant: (Tag.ALL_MOTOR_POSITIONS, struct.pack("<4i", *board._ticks())),  # noqa: ARG005
    ),
    Tag.SET_ALL_DIGITAL_OUTPUTS: (1, Board._set_outputs),
    Tag.SET_ALL_RELAYS: (1, Board._set_relays),
    Tag.SET_ODOMETRY: (12, Board._set_odometry),
    Tag.GET_ODOMETRY: (0, Board._odometry),
    Tag.GET_ALL_MOTOR_CURRENTS: (0, _fixed(Tag.ALL_MOTOR_CURRENTS, bytes(16))),
    Tag.GET_ALL_ANALOG_INPUTS: (0, _fixed(Tag.ALL_ANALOG_INPUTS, bytes(32))),
    Tag.GET_ALL_DIGITAL_INPUTS: (0, _fixed(Tag.ALL_DIGITAL_INPUTS, b"\0")),
    Tag.GET_BUMPER: (0, lambda board, _, plant: (Tag.BUMPER, bytes((plant.bumper,)))),  # noqa: ARG005
    Tag.GET_POWER_BUTTON: (0, _fixed(Tag.POWER_BUTTON, b"\0")),
    Tag.GET_ALL_MOTOR_READINGS: (0, Board._readings),
    Tag.SET_EMERGENCY_BUMPER: (1, Board._set_bumper),
    Tag.SET_MOTOR_ACCEL_LIMITS: (9, Board._set_limits),
    Tag.GET_MOTOR_ACCEL_LIMITS: (1, Board._limits),
    Tag.GET_GYRO_Z_ANGLE: (0, Board._gyro),
    Tag.GET_CHARGER_VERSION: (1, lambda board, data, plant: (Tag.CHARGER_VERSION, data + b"\1\2\3")),  # noqa: ARG005
    Tag.GYRO_SET_PARAM: (5, Board._set_gyro),
    Tag.GYRO_GET_PARAM: (
        0,
        lambda board, _, plant: (Tag.GYRO_PARAM, struct.pack("<ff", board.bias, board.scale)),  # noqa: ARG005
    ),
}
