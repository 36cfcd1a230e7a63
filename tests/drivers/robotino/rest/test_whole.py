"""The driver, the wire and the double together over real sockets, in the time of the clock on the wall."""

from __future__ import annotations

import json
import queue
import time
from collections.abc import Callable

import pytest
from google.protobuf.message import Message

from drivers.robotino.rest.config import RestConfig
from drivers.robotino.rest.server import Fault, RestServer
from drivers.robotino.rest.service import RobotinoRest
from drivers.robotino.rest.wire import HttpWire
from runtime.messages import HttpAnswer, HttpRequest, Odometry, RobotStatus, Twist2, VelocityCommand
from runtime.service import Effects, Publication
from runtime.time import SECOND
from tests.drivers.robotino.rest.base import Base
from tests.drivers.robotino.rest.strangers import LONG


class Live:
    """Does what a host does: a queue of answers, and a timer of 50 ms."""

    def __init__(self, url: str) -> None:
        self.service = RobotinoRest(RestConfig(url=url))
        self.wire = HttpWire(url)
        self.answers: queue.Queue[Message] = queue.Queue()
        self.odometry = Odometry()
        self.status = RobotStatus()
        self.wire.open(self.answers.put, time.monotonic_ns)

    def take(self, effects: Effects | None) -> None:
        for one in effects or ():
            assert isinstance(one, Publication)
            if isinstance(one.message, HttpRequest):
                self.wire.carry(one.message)
            elif isinstance(one.message, Odometry):
                self.odometry = one.message
            elif isinstance(one.message, RobotStatus):
                self.status = one.message

    def until(self, so: Callable[[], bool]) -> None:
        """Run until it is so, with a command in force."""
        begun = due = time.monotonic()
        while not so():
            assert time.monotonic() - begun < LONG, self.service.state
            try:
                answer = self.answers.get(timeout=max(0.0, due - time.monotonic()))
                assert isinstance(answer, HttpAnswer)
                self.take(self.service.hear(answer, time.monotonic_ns()))
            except queue.Empty:
                due += 0.05
                command = VelocityCommand(
                    twist=Twist2(vx=0.2), driver_sequence=self.odometry.driver_sequence, deadline=SECOND // 5
                )
                self.take(self.service.obey(command, time.monotonic_ns()))
                self.take(self.service.ask(time.monotonic_ns()))


@pytest.mark.parametrize("fault", [Fault.HANG, Fault.RESET, Fault.GARBAGE, Fault.ERROR_READS])
def test_the_base_is_driven_stands_by_a_fault_goes_on_and_is_told_zero_last(fault: Fault) -> None:
    base = Base()
    with RestServer(base.handle) as server:
        live = Live(server.url)
        try:
            live.until(lambda: live.odometry.pose.x > 0.03 and not live.status.link_down)
            server.fail(fault)
            live.until(lambda: live.status.link_down and live.service.state.gate.wish[0] == 0.0)
            server.heal()
            there = live.odometry.pose.x
            live.until(lambda: not live.status.link_down and live.odometry.pose.x > there + 0.15)
            live.take(live.service.finish(time.monotonic_ns()))
        finally:
            live.wire.close()
        told = [json.loads(body) for method, _, body in base.asked if method == "PUT"]
        assert [0.2, 0.0, 0.0] in told and told[-1] == [0.0, 0.0, 0.0]
        assert base.server.wish == (0.0, 0.0, 0.0)
