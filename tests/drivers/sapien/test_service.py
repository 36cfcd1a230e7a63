"""The simulated driver as the last line of safety: what moves the base, and what does not."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivers.sapien.service import SapienDriver
from experiments.session import prepare
from runtime.config.layers import Layer
from runtime.guard import Guard
from runtime.messages import Alive, Odometry, Truth, Twist2, VelocityCommand
from runtime.node import Node
from runtime.sample import Sample
from runtime.time import Time, nanoseconds

PERIOD = nanoseconds(0.05)


class Rig:
    """A driver alone, stepped by hand."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.now: Time = 0
        self.speed = 0.0
        self.sequence = 0
        self.commands = 0
        node.begin(0)
        self.sense(1)

    def sense(self, periods: int) -> None:
        """Let time pass."""
        for _ in range(periods):
            self.now += PERIOD
            for sample in self.node.fire("tick", self.now // PERIOD, self.now, self.now):
                if sample.topic == "truth":
                    self.speed = Truth.FromString(sample.payload).robot_twist.vx
                elif sample.topic == "odometry":
                    self.sequence = Odometry.FromString(sample.payload).driver_sequence

    def command(self, vx: float) -> None:
        """Send a fresh command."""
        self.commands += 1
        message = VelocityCommand(
            stamp=self.now, twist=Twist2(vx=vx), driver_sequence=self.sequence, deadline=nanoseconds(0.2)
        )
        self.node.consume(Sample("command", self.commands, self.now, message.SerializeToString()), self.now, self.now)

    def call(self, *nodes: str) -> None:
        """Call the roll."""
        payload = Alive(stamp=self.now, nodes=nodes).SerializeToString()
        self.node.consume(Sample("alive", 1, self.now, payload), self.now, self.now)

    def drive(self, periods: int) -> None:
        """Send a fresh command every period."""
        for _ in range(periods):
            self.command(0.3)
            self.sense(1)


@pytest.fixture
def rig() -> Iterator[Rig]:
    session = prepare([Layer("test", {"sim": {"scene": "open", "seed": 1}})])
    with Guard() as guard:
        yield Rig(Node(SapienDriver(session.effective.sections["driver"]), guard))


def test_fresh_commands_move_the_base_and_without_them_it_stops(rig: Rig) -> None:
    rig.drive(20)
    assert rig.speed == pytest.approx(0.3, abs=0.01)
    rig.sense(5)  # 0.25 s after the last: its 0.2 s are over, and the motors hold
    assert rig.speed == pytest.approx(0.0, abs=0.01)


def test_a_base_whose_controller_is_gone_stops_before_the_command_runs_out(rig: Rig) -> None:
    rig.call("controller", "driver")
    rig.drive(20)
    rig.call("driver")
    rig.sense(2)  # 0.1 s
    assert rig.speed == pytest.approx(0.0, abs=0.01)


def test_commands_of_a_controller_that_is_gone_move_nothing_until_it_is_back(rig: Rig) -> None:
    rig.call("driver")
    rig.drive(10)
    assert rig.speed == pytest.approx(0.0, abs=0.001)
    rig.call("controller", "driver")
    rig.drive(20)
    assert rig.speed == pytest.approx(0.3, abs=0.01)


def test_without_a_roll_commands_count(rig: Rig) -> None:
    rig.drive(10)
    assert rig.speed > 0.1
