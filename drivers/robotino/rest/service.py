"""The driver of a Robotino over its REST interface.

The velocity is told 20 times a second; sensors are asked side by side, each at its own rate, one request of each at a
time. Requests and answers are messages, so the service is executed again from a recording; `drivers.robotino.rest.wire`
carries them. The base's own controld3 shapes what it is told, so there is no ramp here: two would double the delay.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import dist

from drivers.robotino.driver import BaseState, RobotinoDriver
from drivers.robotino.gate import STILL
from drivers.robotino.odometry import way
from drivers.robotino.rest import laser, shapes
from drivers.robotino.rest.config import RestConfig
from drivers.robotino.rest.shapes import BadShape, OdometryAnswer
from drivers.robotino.rest.trouble import trouble
from runtime import topics
from runtime.messages import HttpAnswer, HttpFault, HttpRequest
from runtime.service import Effects, Input, Output, Publication, Timer, on
from runtime.time import SECOND, Time, nanoseconds

_PERIOD = 0.05
DRIVE = "drive"
OMNIDRIVE = "/data/omnidrive"
SENSORS = {
    "odometry": "/data/odometry",
    "ranges": "/data/distancesensorarray",
    "bumper": "/data/bumper",
    laser.LANE: laser.PATH,
    "power": "/data/powermanagement",
}
_LANES = {path: lane for lane, path in SENSORS.items()}
_STATUS_EVERY = 4
_STALE = SECOND // 4
"""ns without new odometry after which the link counts as down: five of its publications"""
_FASTEST, _JUMP = 3.0, 0.1
"""m/s and m that odometry may go on from one to the next"""
_TURN, _TURNING = 0.3, 6.0
"""rad and rad/s, the same of the heading"""
_DRIVE_TIMEOUT = SECOND // 10
"""ns for the answer to a velocity, whatever is given the sensors: the next one waits behind it, and may be zero"""
_PATIENCE = SECOND // 2
"""ns more than its time-out after which a request counts as answered, whatever became of it"""


@dataclass
class RestState(BaseState):
    """What the driver goes on from.

    Attributes:
        asked: id and time, ns, of the request of each lane that waits for its answer.
        due: ns, when each lane is to be asked again.
        requests: so far; ticks: of the timer.
        fresh: ns, of the last new odometry; None before. stale: none comes. blind: the last answer was none.
        sequence, pose: of the last one, as the base said it; None before. scanned: counter of the last scan.
    """

    asked: dict[str, tuple[int, int]] = field(default_factory=dict)
    due: dict[str, int] = field(default_factory=dict)
    requests: int = 0
    ticks: int = 0
    fresh: Time | None = None
    stale: bool = True
    blind: bool = False
    sequence: int = 0
    pose: tuple[float, float, float] | None = None
    scanned: int = -1


class RobotinoRest(RobotinoDriver):
    """Publishes what the base's sensors say, and tells the base what a command wants while it is fresh."""

    name = "robotino-rest"
    Config = RestConfig

    answer = Input(topics.HTTP_ANSWER, wired=True)
    scan = Output(topics.SCAN)
    request = Output(topics.HTTP_REQUEST)
    tick = Timer(_PERIOD)

    config: RestConfig
    state: RestState

    def __init__(self, config: RestConfig) -> None:
        super().__init__(config)
        self.state = RestState()

    def finish(self, now: Time) -> Effects:
        """Stop the base: the last words."""
        self.state.gate.hold()
        yield self._told(now)

    @on(tick)
    def ask(self, now: Time) -> Effects:
        """Tell the velocity, and ask the sensors that are due."""
        state = self.state
        state.ticks += 1
        if not state.stale and state.fresh is not None and now - state.fresh > _STALE:
            state.stale = True
            yield from self._fault("stale", f"no new odometry for {(now - state.fresh) / SECOND:.2f} s", now)
            yield self._status(now)
        yield self._told(now)
        for lane, path in SENSORS.items():
            rate = float(getattr(self.config, f"{lane}_rate"))
            if rate > 0.0 and now >= state.due.get(lane, 0) and not self._waits(lane, now):
                # Half a tick early is on time: else a rate of the timer's own would miss every other tick.
                state.due[lane] = now + nanoseconds(1.0 / rate - 0.5 * _PERIOD)
                yield self._ask(lane, "GET", path, b"", now)
        if state.ticks % _STATUS_EVERY == 0:
            yield self._status(now)

    @on(answer)
    def hear(self, answer: HttpAnswer, now: Time) -> Effects:
        """Take an answer, or what became of a request."""
        state = self.state
        lane = _LANES.get(answer.path, DRIVE if answer.path == OMNIDRIVE else "")
        asked = now
        if lane in state.asked and state.asked[lane][0] == answer.id:
            _, asked = state.asked.pop(lane)
        elif lane != DRIVE:
            return  # of a request that was given up, or of nobody's: too late to say what is so now
        if answer.fault == HttpFault.HTTP_REPLACED:
            return
        # An empty answer is usual for a laser that is not there: counted, and no news.
        wrong = trouble(answer, "" if lane == DRIVE else f"no {lane}")
        if wrong is not None:
            yield from self._fault(*wrong, now)
        elif lane == DRIVE:
            return
        elif now - asked > _STALE:
            yield from self._fault(f"late {lane}", f"{answer.path}: after {(now - asked) / SECOND:.2f} s", now)
        else:
            try:
                yield from self._take(lane, answer.body, asked, now)
            except BadShape as error:
                yield from self._fault(f"{lane} shape", str(error), now)
            else:
                return
        if lane == "odometry" and not state.blind:
            # Who cannot see where the base goes lets it stand at once: it brakes slowly enough.
            state.blind = True
            yield self._told(now)

    def _take(self, lane: str, body: bytes, asked: Time, now: Time) -> Effects:
        """Take what a sensor said. It was so when it was asked, not only when the answer came."""
        state = self.state
        if lane == "odometry":
            yield from self._moved(shapes.odometry(body), asked, now)
        elif lane == "ranges":
            yield self._ranges(list(shapes.distances(body)), asked)
        elif lane == "scan":
            yield from self._scanned(shapes.scan(body), asked)
        elif lane == "bumper":
            pressed = shapes.bumper(body)
            if pressed != state.bumper:
                state.bumper = pressed
                if pressed:
                    state.gate.hold()
                    yield self._told(now)
                yield self._status(now)
        else:
            found = shapes.power(body)
            state.battery, state.charging, state.low = found.voltage, found.external, found.low

    def _moved(self, found: OdometryAnswer, asked: Time, now: Time) -> Effects:
        """Go on by what is new. The base's odometry begins anew when somebody sets it; ours never jumps.

        The age of commands counts from when it was asked for, so that slow answers make them no younger.
        """
        state = self.state
        if state.pose is not None and found.sequence == state.sequence:
            return
        seconds = 0.0 if state.fresh is None else (now - state.fresh) / SECOND
        if state.pose is not None:
            step = way(state.pose, found.pose)
            leaps = dist(state.pose[:2], found.pose[:2]) > _JUMP + _FASTEST * seconds
            if found.sequence < state.sequence or leaps or abs(step[2]) > _TURN + _TURNING * seconds:
                yield from self._fault("odometry", f"{state.pose} and {found.pose}: it has begun anew", now)
            else:
                state.reckoning.go(step)
        was_stale, state.stale, state.blind = state.stale, False, False
        state.pose, state.sequence, state.fresh = found.pose, found.sequence, now
        yield self.odometry(state.reckoning.message(asked, found.twist, state.gate.sensed(asked)))
        if was_stale:
            yield self._status(now)

    def _told(self, now: Time) -> Publication:
        """Return the request that tells the base how to move now."""
        state = self.state
        wish, blind = state.gate.now(now), state.stale or state.blind or state.bumper
        return self._ask(DRIVE, "PUT", OMNIDRIVE, shapes.omnidrive(*(STILL if blind else wish)), now)

    def _works(self) -> bool:
        return not self.state.stale

    def _ask(self, lane: str, method: str, path: str, body: bytes, now: Time) -> Publication:
        state = self.state
        state.requests += 1
        state.asked[lane] = (state.requests, now)
        timeout = nanoseconds(self.config.timeout)
        return self.request(
            HttpRequest(
                stamp=now, id=state.requests, lane=lane, method=method, path=path, body=body,
                timeout=min(timeout, _DRIVE_TIMEOUT) if lane == DRIVE else timeout,
            )
        )  # fmt: skip

    def _waits(self, lane: str, now: Time) -> bool:
        asked = self.state.asked.get(lane)
        return asked is not None and now - asked[1] < nanoseconds(self.config.timeout) + _PATIENCE

    def _scanned(self, found: shapes.ScanAnswer, now: Time) -> Effects:
        if found.sequence == self.state.scanned:
            return  # the laser has nothing new
        self.state.scanned = found.sequence
        yield self.scan(laser.message(found, self.config, now))
