"""The driver of a Robotino 3 or 4 over its serial link, in place of the manufacturer's controld3.

The board is polled at 50 Hz, the speeds in the same frame. Any frame keeps its watchdog quiet, and it goes on with the
last speeds for as long as it is polled; so the age of commands is this driver's affair (`drivers.robotino.gate`). What
goes over the wire is messages: the service itself touches nothing, and is executed again from a recording.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from drivers.angles import wrap
from drivers.robotino import infrared
from drivers.robotino.driver import BaseState, RobotinoDriver
from drivers.robotino.gate import STILL
from drivers.robotino.kinematics import Twist, ramped
from drivers.robotino.odometry import counted
from drivers.robotino.serial import tags
from drivers.robotino.serial.config import SerialConfig
from drivers.robotino.serial.framing import Decoder, encode
from drivers.robotino.serial.tags import BadTag, ChargerInfo, Gyro, MotorReadings, Power, Tag
from runtime import topics
from runtime.messages import Charger, SerialData
from runtime.service import Effects, Input, Output, Publication, Timer, on
from runtime.time import SECOND, Time

_PERIOD = 0.02
_ODOMETRY_EVERY, _RANGES_EVERY, _STATUS_EVERY = 2, 5, 10
_ASK_AGAIN = SECOND // 2
"""ns between two tries to start"""
_SILENT = SECOND // 5
"""ns without an answer after which the link counts as down: controld3's read time-out"""
_START_AGAIN = 2 * SECOND
"""ns without an answer after which the board is taken to be another one"""
_GAP = SECOND // 10
_LATE = SECOND // 10
"""ns that an answer may be older than the last question: it may be one to a question before"""
_SLACK_TICKS = 200
_REFUSED = 10
"""implausible readings in a row after which the encoders are taken to have begun anew"""
_MARK = 1 << 29
"""ticks at which encoders are told to begin, 3 km from 0: those of a board that was reset begin at 0, and are told from
these wherever the base has been"""
_MARK_TRIES = 25
"""times that a board is told so before its own counts are taken as they are"""

Ticks = tuple[int, int, int]


@dataclass
class SerialState(BaseState):
    """What the driver goes on from.

    Attributes:
        decoder: of what comes in. started: the board has said its versions. asked: ns, when it was asked for them.
        hardware, software: what it said.
        heard: ns, of the last good frame; polled: ns, of the last question; None before.
        read: ns, of the question before the last believed readings: they are no older than it, however late they
            are heard; None before.
        silent: no answer comes. open: the line is there, as far as the wire says.
        ticks: the encoders at the last believed readings, also of before the line was gone; unbelieved: readings in a
            row that were not.
        marks: times that the encoders were told where to begin since they were last believed.
        told: m/s and rad/s, what the board was told last.
        gyro: the last angle; None without one.
        polls, readings: so far.
    """

    decoder: Decoder = field(default_factory=Decoder)
    started: bool = False
    asked: Time | None = None
    hardware: str = ""
    software: str = ""
    heard: Time | None = None
    polled: Time | None = None
    read: Time | None = None
    silent: bool = True
    open: bool = True
    ticks: Ticks | None = None
    unbelieved: int = 0
    marks: int = 0
    told: Twist = STILL
    gyro: float | None = None
    polls: int = 0
    readings: int = 0


class RobotinoSerial(RobotinoDriver):
    """Publishes what the base's sensors say, and tells its motors what a command wants while it is fresh."""

    name = "robotino-serial"
    Config = SerialConfig

    received = Input(topics.SERIAL_RECEIVED, wired=True)
    sent = Output(topics.SERIAL_SENT)
    poll = Timer(_PERIOD)

    config: SerialConfig
    state: SerialState

    def __init__(self, config: SerialConfig) -> None:
        super().__init__(config)
        self.state = SerialState()

    def finish(self, now: Time) -> Effects:
        """Stop the motors: the last words."""
        yield self._frame(tags.speeds(STILL), now)

    @on(poll)
    def ask(self, now: Time) -> Effects:
        """Tell the speeds, and ask for readings; or for the versions of a board that has not said them."""
        state = self.state
        state.polls += 1
        state.polled = now
        since = None if state.heard is None else now - state.heard
        if not state.silent and (since is None or since > _SILENT):
            state.silent = True
            yield from self._fault("silent", f"no answer for {(since or 0) / SECOND:.2f} s", now)
            yield self._status(now)
        if since is not None and since > _START_AGAIN and state.started:
            state.started = False
        if not state.started:
            state.told = STILL
            if state.asked is None or now - state.asked >= _ASK_AGAIN:
                state.asked = now
                yield self._frame(self._start(), now)
        else:
            asked = [Tag.GET_ALL_MOTOR_READINGS, Tag.GET_DISTANCE_SENSORS, Tag.GET_BUMPER]
            asked += [Tag.GET_GYRO_Z_ANGLE] if self.config.gyro else []
            yield self._frame([*self._speeds(now), *tags.request(*asked)], now)
        if state.polls % _STATUS_EVERY == 0:
            yield self._status(now)

    @on(received)
    def hear(self, received: SerialData, now: Time) -> Effects:
        """Take bytes from the line, or that it is gone or there again."""
        state = self.state
        if received.open != state.open:
            state.open = received.open
            state.decoder = Decoder()
            if received.open:
                state.asked, state.started = None, False
                yield self.say("the serial line is there", now)
            else:
                # Not only after a silence: with its line the link is down at once.
                state.silent = True
                yield from self._fault("line", received.fault or "closed", now)
                yield self._status(now)
        elif received.fault:
            yield self.say(f"line: {received.fault}", now, "WARNING")
        for frame in state.decoder.feed(received.data):
            if frame.fault:
                yield from self._fault(frame.fault, frame.detail, now)
                continue
            try:
                yield from self._take(tags.unpacked(frame.payload), now)
            except BadTag as error:
                yield from self._fault("tag", str(error), now)

    def _take(self, found: list[tuple[int, bytes]], now: Time) -> Effects:
        """Take the tags of a good frame: all are read before any is believed."""
        state = self.state
        said = {tag: data for tag, data in found if tag != Tag.ERROR}
        for tag, data in found:
            if tag == Tag.ERROR:
                yield from self._fault("board", tags.text(data), now)
        motors = tags.motor_readings(said[Tag.ALL_MOTOR_READINGS]) if Tag.ALL_MOTOR_READINGS in said else None
        volts = tags.distance_volts(said[Tag.DISTANCE_SENSORS]) if Tag.DISTANCE_SENSORS in said else None
        power = tags.power(said[Tag.POWER_SOURCE_READINGS]) if Tag.POWER_SOURCE_READINGS in said else None
        gyro = tags.gyro(said[Tag.GYRO_Z_ANGLE]) if Tag.GYRO_Z_ANGLE in said else None
        bumper = tags.flag(Tag.BUMPER, said[Tag.BUMPER]) if Tag.BUMPER in said else state.bumper
        chargers = [tags.charger(data) for tag, data in found if tag == Tag.CHARGER_INFO]
        was_silent = state.silent
        if motors is not None or not state.started:
            # Of a board that only complains nothing is known.
            state.heard, state.silent = now, False
        if Tag.HW_VERSION in said and Tag.SW_VERSION in said:
            yield from self._met(tags.text(said[Tag.HW_VERSION]), tags.text(said[Tag.SW_VERSION]), now)
        if power is not None:
            self._note(power)
        for charger in chargers:
            yield from self._charged(charger, now)
        if motors is not None and state.started:
            yield from self._moved(motors, gyro, now)
            if volts is not None and state.readings % _RANGES_EVERY == 1:
                yield self._ranges([infrared.metres(one) for one in volts], now)
        if bumper != state.bumper or was_silent:
            state.bumper = bumper
            yield self._status(now)

    def _charged(self, found: ChargerInfo, now: Time) -> Effects:
        """Note what a charger says, and say it where its state is another."""
        before = self.state.chargers.get(found.number)
        self.state.chargers[found.number] = Charger(
            number=found.number, voltage=found.volts, current=found.amperes, temperature=found.temperatures,
            state=found.state,
        )  # fmt: skip
        if before is None or before.state != found.state:
            words = f"charger {found.number}: {found.state}, {found.volts:.1f} V, {found.amperes:.1f} A {found.words}"
            yield self.say(words.strip(), now, "WARNING" if "error" in found.state.lower() else "INFO")

    def _met(self, hardware: str, software: str, now: Time) -> Effects:
        state = self.state
        if not state.started:
            state.started, state.hardware, state.software = True, hardware, software
            state.unbelieved, state.gyro = 0, None
            yield self.say(f"board {hardware}, firmware {software}", now)

    def _moved(self, motors: MotorReadings, gyro: Gyro | None, now: Time) -> Effects:
        """Go where the encoders say, unless no base could have gone there."""
        state, config = self.state, self.config
        ticks: Ticks = motors.ticks[:3]
        if state.ticks is None:
            if not _marked(ticks) and state.marks < _MARK_TRIES:
                state.marks += 1
                yield self._frame(_mark(), now)
                return
            if state.marks >= _MARK_TRIES:
                yield self.say("the board takes no positions: its reset is told by jumps alone", now, "WARNING")
        elif state.read is not None:
            before = state.ticks
            gone = (counted(before[0], ticks[0]), counted(before[1], ticks[1]), counted(before[2], ticks[2]))
            seconds = (now - state.read) / SECOND
            fastest = 1.5 * config.geometry.max_rpm / 60.0 * config.geometry.ticks
            most = fastest * (seconds + _LATE / SECOND) + _SLACK_TICKS
            from_zero = (_marked(before) and not _marked(ticks)) or (
                seconds > _GAP / SECOND and max(map(abs, ticks)) <= most < max(map(abs, before))
            )
            if max(map(abs, gone)) > most or from_zero:
                yield from self._unbelieved(gone, from_zero, now)
                return
            way = config.geometry.way(gone)
            if gyro is not None:
                turn = wrap(gyro.angle - state.gyro) if state.gyro is not None else way[2]
                way = (way[0], way[1], turn)
            state.reckoning.go(way)
        state.ticks, state.read, state.unbelieved, state.marks = ticks, state.polled, 0, 0
        state.gyro = None if gyro is None else gyro.angle
        state.readings += 1
        if state.readings % _ODOMETRY_EVERY == 1:
            # Speeds of the spare motor are not the base's.
            rpm = (float(motors.speeds[0]), float(motors.speeds[1]), float(motors.speeds[2]))
            twist = config.geometry.twist(rpm)
            yield self.odometry(state.reckoning.message(now, twist, state.gate.sensed(now)))

    def _unbelieved(self, gone: Ticks, from_zero: bool, now: Time) -> Effects:
        state = self.state
        state.unbelieved += 1
        yield from self._fault("encoders", f"{gone} ticks since the last reading", now)
        if from_zero or state.unbelieved >= _REFUSED:
            # The board has begun anew; it has forgotten its settings too. What was driven meanwhile is lost.
            state.ticks, state.unbelieved = None, 0
            state.started, state.asked = False, None
            yield self.say("the board has begun anew", now, "WARNING")

    def _told(self, now: Time) -> Publication:
        return self._frame(self._speeds(now), now)

    def _works(self) -> bool:
        return self.state.started and not self.state.silent

    def _stopped(self) -> bool:
        return self.state.bumper and self.config.emergency_bumper

    def _speeds(self, now: Time) -> list[tuple[int, bytes]]:
        """Return the tags of the speeds of now.

        The board's own ramp is six times as steep as `acceleration`, so ours is the one that shapes a motion; it is
        left out where there is no command in force: a base that is to stop is to stop soon.
        """
        state, config = self.state, self.config
        wish = state.gate.now(now)
        if state.gate.until is None or state.silent:
            state.told = STILL
        else:
            step = (config.acceleration * _PERIOD, config.angular_acceleration * _PERIOD)
            # Between two motions that the motors can do there are some that they cannot.
            state.told, _ = config.geometry.within(ramped(state.told, wish, *step))
        return tags.speeds(config.geometry.motors(state.told))

    def _start(self) -> list[tuple[int, bytes]]:
        """Return what a board is told and asked first: stand still, versions, ramps, and the emergency bumper."""
        limit = self.config.ramp
        ramps = [(int(Tag.SET_MOTOR_ACCEL_LIMITS), struct.pack("<Bff", motor, -limit, limit)) for motor in range(3)]
        return [
            *tags.speeds(STILL),
            *tags.request(Tag.GET_HW_VERSION, Tag.GET_SW_VERSION),
            *ramps,
            tags.emergency_bumper(self.config.emergency_bumper),
        ]

    def _frame(self, content: list[tuple[int, bytes]], now: Time) -> Publication:
        return self.sent(SerialData(stamp=now, data=encode(tags.packed(content)), open=True))

    def _note(self, power: Power) -> None:
        state = self.state
        state.battery, state.charging, state.low = power.volts, power.external, power.low


def _mark() -> list[tuple[int, bytes]]:
    """Return the tags that let the encoders begin at `_MARK`."""
    return [(int(Tag.SET_MOTOR_POSITION), struct.pack("<Bi", motor, _MARK)) for motor in range(3)]


def _marked(ticks: Ticks) -> bool:
    """Return whether the encoders have begun at `_MARK`."""
    return all(abs(one - _MARK) < _MARK // 2 for one in ticks)
