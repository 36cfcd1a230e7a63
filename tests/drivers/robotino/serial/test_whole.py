"""Driver, wire, terminal and board, in real time: what the wheels do while the line is spoiled or unplugged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import hypot
from pathlib import Path
from queue import Empty, SimpleQueue
from time import monotonic, sleep, time_ns

import pytest
from google.protobuf.message import Message

from drivers.robotino.serial.board import Board
from drivers.robotino.serial.config import SerialConfig
from drivers.robotino.serial.line import Noise, PtyLine
from drivers.robotino.serial.service import RobotinoSerial
from drivers.robotino.serial.wire import SerialWire
from runtime.messages import SerialData
from tests.drivers.robotino.rig import BaseRig
from tests.drivers.robotino.serial.bare import LONG
from tests.figures import Figures

pytestmark = pytest.mark.alone

WISH = (0.2, 0.1, 0.4)


@dataclass
class LiveRig(BaseRig):
    """The loop of a host, in small: polls every 20 ms, commands every 40, and hears what the wire brings."""

    line: PtyLine = field(init=False)
    wire: SerialWire = field(init=False)
    came: SimpleQueue[Message] = field(default_factory=SimpleQueue)
    polls: int = 0

    service: RobotinoSerial = field(init=False)

    def __post_init__(self) -> None:
        self.service = RobotinoSerial(SerialConfig())

    def run(self, seconds: float) -> None:
        end = monotonic() + seconds
        while monotonic() < end:
            self.turn()

    def turn(self) -> None:
        """Poll, and hear for 20 ms."""
        self.now = time_ns()
        self.polls += 1
        if self.wish is not None and self.polls % 2 == 0:
            self.order(*self.wish)
        self.take(self.service.ask(self.now))
        end = monotonic() + 0.02
        while (left := end - monotonic()) > 0.0:
            try:
                message = self.came.get(timeout=left)
            except Empty:
                break
            assert isinstance(message, SerialData)
            self.now = max(time_ns(), self.now)
            self.take(self.service.hear(message, self.now))
        with self.line.lock:
            self.look()

    def carry(self, message: Message) -> None:
        self.wire.carry(message)

    def moves(self, aim: bool, seconds: float = LONG) -> float:
        """Run until the wheels move, or stand; return how long it took, s."""
        began = monotonic()
        while (self.plant.twist != (0.0, 0.0, 0.0)) != aim:
            assert monotonic() < began + seconds, f"the wheels should {'move' if aim else 'stand'}"
            self.turn()
        return monotonic() - began


@contextmanager
def live(folder: Path) -> Iterator[LiveRig]:
    """Yield a driver that moves the base."""
    rig = LiveRig()
    wire = SerialWire(str(folder / "robotino"))
    with PtyLine(Board(), rig.plant, rig.plant.pass_by, folder / "robotino") as line:
        rig.line, rig.wire = line, wire
        wire.open(rig.came.put, time_ns)
        try:
            rig.run(0.1)
            rig.wish = WISH
            rig.moves(True)
            yield rig
        finally:
            wire.close()


def ends_where_the_wheels_are(rig: LiveRig) -> float:
    """Let the base come to rest; return how far its odometry is from it, m.

    On a machine with many times too much to do the kernel itself may hold a terminal's bytes for seconds. A driver that
    heard nothing for 2 s begins anew and does not know what was driven meanwhile: then there is nothing to compare.
    """
    rig.wish = None
    rig.line.noise = Noise()
    rig.moves(False)
    count, end = len(rig.odometry), monotonic() + LONG
    while len(rig.odometry) < count + 5:
        assert monotonic() < end
        rig.turn()
    last, there = rig.odometry[-1]
    if sum("firmware" in one for one in rig.said) > 1:
        return 0.0
    assert last.pose.theta == pytest.approx(there[2], abs=0.01)
    return hypot(last.pose.x - there[0], last.pose.y - there[1])


def test_a_base_is_driven_through_a_line_that_spoils_bytes(tmp_path: Path, figures: Figures) -> None:
    """1 byte in 1,000 lost, as many put in, as many flipped, each way."""
    with live(tmp_path) as rig:
        rig.run(1.0)
        rig.line.noise = Noise(1e-3, 1e-3, 1e-3)
        since = rig.now
        rig.run(4.0)
        speeds = [speed for at, speed in rig.speeds if at > since]
        share = sum(speed > 0.05 for speed in speeds) / len(speeds)
        off = ends_where_the_wheels_are(rig)
        counts = {one.name: one.value for one in rig.service.state.faults.messages()}
        figures(f"spoiled line: the base moved {100 * share:.1f} % of 4 s, odometry {1000 * off:.3f} mm off, {counts}")
        assert share > 0.2 and off < 2e-3
        assert not any(one.bumper for one in rig.statuses)
        assert sum(counts.values()) > 0, "some of it was seen"


def test_an_unplugged_base_stops_and_goes_on_once_it_is_plugged_in(tmp_path: Path, figures: Figures) -> None:
    with live(tmp_path) as rig:
        rig.run(1.0)
        rig.line.unplug()
        began = monotonic()
        while rig.plant.twist != (0.0, 0.0, 0.0):
            assert monotonic() < began + LONG
            sleep(0.001)
        stopped = monotonic() - began
        rig.run(max(1.0 - stopped, 0.0))
        assert rig.statuses[-1].link_down and rig.faults("line") == 1
        assert rig.plant.twist == (0.0, 0.0, 0.0)
        rig.line.plug()
        again = rig.moves(True)
        figures(f"unplugged: at rest after {stopped:.3f} s; plugged in again: moves after {again:.3f} s")
        assert stopped < 3.0
        end = monotonic() + LONG
        while rig.statuses[-1].link_down:
            assert monotonic() < end
            rig.turn()


def test_a_driver_that_ends_leaves_a_base_at_rest(tmp_path: Path, figures: Figures) -> None:
    with live(tmp_path) as rig:
        rig.run(1.0)
        began = monotonic()
        rig.take(rig.service.finish(time_ns()))
        rig.wire.close()
        while rig.plant.twist != (0.0, 0.0, 0.0):
            assert monotonic() < began + LONG
            sleep(0.001)
        figures(f"ended: at rest after {monotonic() - began:.3f} s, by its last words")


def test_a_board_that_hangs_and_one_that_is_reset(tmp_path: Path, figures: Figures) -> None:
    with live(tmp_path) as rig:
        rig.run(0.5)
        rig.line.hangs = True
        hung = rig.moves(False)
        rig.run(0.5)
        assert rig.statuses[-1].link_down
        rig.line.hangs = False
        again = rig.moves(True)
        rig.line.reset()
        rig.run(0.5)
        reset = rig.moves(True)
        figures(
            f"board hangs: at rest after {hung:.3f} s; answers again: moves after {again:.3f} s; reset: {reset:.3f} s"
        )
        assert rig.faults("silent") >= 1 and rig.faults("line") == 0
