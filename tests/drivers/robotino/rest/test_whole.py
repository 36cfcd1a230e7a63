"""Driver, wire, sockets, server and base, in real time: what the wheels do while the network or the server fails.

The speed is the paper's for real robots, 0.1 m/s: controld3 brakes by 0.4 m/s^2, 0.25 s from there, whatever is told.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import hypot

import pytest
from google.protobuf.message import Message

from drivers.robotino.plant import IdealPlant
from drivers.robotino.rest.config import RestConfig
from drivers.robotino.rest.restapid import Response, Restapid
from drivers.robotino.rest.server import Fault, RestServer
from drivers.robotino.rest.service import RobotinoRest
from drivers.robotino.rest.wire import HttpWire
from runtime import topics
from runtime.live.alone import Alone
from runtime.messages import Odometry, RangeArray, RobotStatus, Twist2, VelocityCommand
from runtime.time import SECOND
from tests.figures import Figures

pytestmark = pytest.mark.alone

SPEED = 0.1
STEP = 0.005
LONG = 20.0
"""s, after which what should have come does not: machines that test are busy"""


class Floor:
    """A base on a floor behind the double of its server: time passes for it whether somebody asks or not."""

    def __init__(self, server: Restapid) -> None:
        self.server = server
        self.plant = IdealPlant.at_rest()
        self._lock = threading.Lock()
        self._begun = time.monotonic()
        self._last = 0.0

    def handle(self, method: str, target: str, body: bytes) -> Response:
        with self._lock:
            self._pass()
            return self.server.handle(method, target, body, self.plant)

    def speed(self) -> float:
        with self._lock:
            self._pass()
            return hypot(*self.plant.twist[:2])

    def restart(self) -> None:
        with self._lock:
            self._pass()
            self.server.restart()

    def _pass(self) -> None:
        now = time.monotonic() - self._begun
        while self._last < now:
            step = min(STEP, now - self._last)
            self._last += step
            self.plant.pass_by(step)
            self.server.advance(self._last, self.plant)


@dataclass
class Whole:
    """The whole, and what the driver published with the time of each message."""

    floor: Floor
    far: RestServer
    driver: Alone
    wish: float | None = None
    heard: list[tuple[float, Message]] = field(default_factory=list)
    _next: float = 0.0

    def until(self, enough: Callable[[], bool], what: str) -> float:
        """Run until there is enough; return how long it took, s."""
        begun = time.monotonic()

        def look() -> bool:
            newest = self.driver.last(topics.ODOMETRY)
            if self.wish is not None and newest is not None and time.monotonic() >= self._next:
                self._next = time.monotonic() + 0.05
                twist = Twist2(vx=self.wish)
                told = VelocityCommand(twist=twist, driver_sequence=newest.driver_sequence, deadline=SECOND // 5)
                self.driver.give(topics.COMMAND, told)
            return enough()

        while not self.driver.run(0.01, look):
            assert time.monotonic() < begun + LONG, what
        return time.monotonic() - begun

    def run(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, "time passes")

    def stands(self) -> float:
        return self.until(lambda: self.floor.speed() == 0.0, "the base should stand")

    def moves(self) -> float:
        return self.until(lambda: self.floor.speed() > 0.9 * SPEED, "the base should move")

    def counted(self, kind: str) -> int:
        status = self.driver.last(topics.STATUS)
        return 0 if status is None else {one.name: one.value for one in status.faults}.get(kind, 0)


@contextmanager
def moving(idle: float = 0.2) -> Iterator[Whole]:
    """Yield a base that a driver moves through sockets."""
    floor = Floor(Restapid(idle=idle))
    with RestServer(floor.handle) as far:
        driver = Alone(RobotinoRest(RestConfig(url=far.url)), HttpWire(far.url))
        whole = Whole(floor, far, driver)
        driver.listen(lambda _, message: whole.heard.append((time.monotonic(), message)))
        with driver.running():
            whole.wish = SPEED
            whole.moves()
            yield whole


def check_what_was_published(whole: Whole) -> None:
    """Odometry is that of the wheels, ranges and battery are what they are: nothing of a fault got through."""
    previous = None
    for _, message in whole.heard:
        if isinstance(message, Odometry):
            assert 0.0 <= message.pose.x <= whole.floor.plant.pose[0] + 1e-6
            assert message.pose.y == pytest.approx(0.0, abs=1e-9)
            assert previous is None or message.pose.x >= previous
            previous = message.pose.x
        elif isinstance(message, RangeArray):
            assert list(message.distance) == pytest.approx([0.41] * 9)
        elif isinstance(message, RobotStatus):
            assert not message.bumper
            assert message.battery_voltage in (0.0, 24.0)


@pytest.mark.parametrize("fault", [Fault.HANG, Fault.RESET, Fault.GARBAGE, Fault.HALF, Fault.ERROR, Fault.DRIP])
def test_a_server_that_fails_lets_the_base_stand_and_it_goes_on_after(fault: Fault, figures: Figures) -> None:
    """Two seconds of it; of status 500, three. Then the driver recovers by itself."""
    with moving() as whole:
        seconds = 3.0 if fault == Fault.ERROR else 2.0
        whole.far.fail(fault, seconds)
        begun = time.monotonic()
        rest = whole.stands()
        whole.until(lambda: time.monotonic() - begun > seconds, "the fault ends")
        assert whole.floor.speed() == 0.0
        again = whole.moves()
        figures(f"{fault}: at rest after {rest:.3f} s, moves {again:.3f} s after its end")
        # The double stops by itself after 0.2 s, and brakes for 0.25 s. A bound for busy machines.
        assert rest < 2.0
        whole.run(0.3)
        check_what_was_published(whole)
        assert sum(one.value for one in whole.driver.last(topics.STATUS).faults) > 0  # type: ignore[union-attr]


def test_reads_that_fail_let_our_side_stop_the_base(figures: Figures) -> None:
    """The drive still listens, so zero is told: no time-out of the base has to help. Its own is 5 s here."""
    with moving(idle=5.0) as whole:
        whole.far.fail(Fault.ERROR_READS)
        rest = whole.stands()
        figures(f"reads fail: at rest after {rest:.3f} s")
        assert rest < 2.0
        assert whole.floor.server.told >= 0.0
        whole.far.heal()
        whole.moves()
        check_what_was_published(whole)


def test_a_server_that_restarts_is_found_again(figures: Figures) -> None:
    with moving() as whole:
        whole.far.refuse()
        rest = whole.stands()
        whole.floor.restart()
        whole.run(0.5)
        whole.far.listen()
        again = whole.moves()
        figures(f"restarts: at rest after {rest:.3f} s, moves {again:.3f} s after it listens")
        assert whole.counted("refused") > 0
        assert rest < 2.0
        whole.run(0.3)
        check_what_was_published(whole)


def test_the_end_of_the_driver_is_the_end_of_the_motion(figures: Figures) -> None:
    """Its last word is zero: the base need not wait for a time-out, which is 5 s here."""
    with moving(idle=5.0) as whole:
        pass
    assert whole.floor.server.wish == (0.0, 0.0, 0.0), "it was told"
    begun = time.monotonic()
    while whole.floor.speed() > 0.0:
        assert time.monotonic() < begun + 4.0
        time.sleep(0.005)
    figures(f"ended: at rest after {time.monotonic() - begun:.3f} s")


def test_where_a_check_is_interrupted_the_base_is_told_zero_as_well() -> None:
    with pytest.raises(KeyboardInterrupt), moving(idle=5.0) as whole:
        raise KeyboardInterrupt
    assert whole.floor.server.wish == (0.0, 0.0, 0.0)


def test_on_image_2_0_17_a_server_that_hangs_lets_the_base_go_on_longer(figures: Figures) -> None:
    """Its time-out is 0.4 to 0.5 s; nothing on our side can reach the base then."""
    with moving(idle=0.5) as whole:
        whole.far.fail(Fault.HANG)
        figures(f"hangs, time-out of 0.5 s: at rest after {whole.stands():.3f} s")
