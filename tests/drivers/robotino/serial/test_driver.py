"""The driver against the double of the board: what it publishes, and what becomes of faults."""

from __future__ import annotations

import struct
from itertools import pairwise

import numpy as np
import pytest

from drivers.robotino import infrared
from drivers.robotino.infrared import FARTHEST
from drivers.robotino.kinematics import ROBOTINO_3_4
from drivers.robotino.serial import board, tags
from drivers.robotino.serial.board import Board
from drivers.robotino.serial.config import SerialConfig
from drivers.robotino.serial.framing import Decoder, encode
from drivers.robotino.serial.service import RobotinoSerial
from drivers.robotino.serial.tags import Tag
from runtime.messages import Alive, SerialData
from runtime.time import SECOND
from tests.drivers.robotino.rig import driven as after
from tests.drivers.robotino.serial.rig import Rig, noisy

AROUND = (0.2, 0.1, 0.4)


def driven(seconds: float = 2.0, wish: tuple[float, float, float] = AROUND, **values: object) -> Rig:
    return after(Rig(**values), 0.2, seconds, wish)  # type: ignore[arg-type]


def test_a_command_is_followed_and_the_odometry_is_where_the_base_is() -> None:
    rig = driven(4.0)
    assert rig.plant.twist == pytest.approx(AROUND, abs=0.002), "whole rpm"
    # A tick is 3 micrometres of way; what is left is the arcs between whole ticks.
    assert rig.worst() < 1e-4
    last, there = rig.odometry[-1]
    assert last.pose.theta == pytest.approx(there[2], abs=1e-4)
    assert (last.twist.vx, last.twist.vy, last.twist.omega) == pytest.approx(AROUND, abs=0.002)
    assert [one.driver_sequence for one, _ in rig.odometry] == list(range(1, len(rig.odometry) + 1))
    rates = len(rig.odometry) / 4.2
    assert 24 <= rates <= 26
    assert last.covariance[0] > 0 and last.covariance[8] > 0


def test_its_motion_is_ramped_and_its_course_does_not_bend() -> None:
    rig = driven(0.5, (0.3, 0.3, 0.0))
    sent = [
        {data[0]: int.from_bytes(data[1:3], "little", signed=True) for tag, data in found if tag == Tag.SET_MOTOR_SPEED}
        for found in (tags.unpacked(Decoder().feed(frame)[0].payload) for frame in rig.sent)
    ]
    twists = [ROBOTINO_3_4.twist((one[0], one[1], one[2])) for one in sent if one]
    speeds = np.array([np.hypot(vx, vy) for vx, vy, _ in twists])
    assert np.diff(speeds).max() <= 0.4 * 0.02 + 4e-4
    moving = [one for one in twists if np.hypot(*one[:2]) > 0.05]
    assert all(abs(vx - vy) < 1e-3 for vx, vy, _ in moving)


def test_ranges_are_the_tables_metres() -> None:
    rig = Rig()
    rig.plant.distances = (0.1, FARTHEST, 0.25, *[FARTHEST] * 6)
    rig.run(1.0)
    assert 8 <= len(rig.ranges) <= 11
    assert list(rig.ranges[-1].distance) == pytest.approx(rig.plant.distances, abs=1e-6)
    assert list(rig.ranges[-1].bearing) == infrared.bearings()


def test_the_start_up_says_versions_and_turns_the_emergency_bumper_on() -> None:
    rig = Rig()
    rig.run(0.1)
    assert rig.board.stops and rig.board.limit[:3] == [11500.0] * 3
    assert any("board 3.0.0, firmware 1.2.3" in one for one in rig.said)
    assert not rig.statuses or not rig.statuses[-1].link_down
    rig = Rig(config=SerialConfig(emergency_bumper=False))
    rig.run(0.1)
    assert not rig.board.stops


def test_a_command_that_is_not_renewed_stops_the_base() -> None:
    rig = driven()
    rig.wish, since = None, rig.now
    rig.run(1.0)
    # 0.2 s of the command, a poll, and the board's ramp from 0.28 m/s and 0.4 rad/s.
    assert 0.1 < rig.moving_after(since) < 0.2 + 0.05 + 0.2
    assert rig.service.state.gate.stale == 1


@pytest.mark.parametrize("later", [0.0, 0.04, 0.08])
def test_a_driver_that_hangs_is_stopped_by_the_board(later: float) -> None:
    """0.4 to 0.5 s after the last frame, by where in the board's tick that came; up to 20 ms before the driver hung."""
    rig = driven(2.0 + later)
    rig.hung, since = True, rig.now
    rig.run(1.0)
    assert 0.38 < rig.moving_after(since) <= 0.5
    rig.hung = False
    rig.run(1.5)
    assert rig.plant.twist == pytest.approx(AROUND, abs=0.002), "and goes on"
    assert rig.worst() < 1e-3


def test_a_base_whose_controller_goes_stops_at_once() -> None:
    rig = driven()
    rig.wish, since = None, rig.now
    rig.take(rig.service.call(Alive(nodes=["task"]), rig.now))
    rig.run(0.5)
    assert rig.moving_after(since) < 0.2


def test_a_line_that_is_unplugged_and_plugged_again() -> None:
    rig = driven()
    since = rig.now
    rig.plug(False)
    rig.run(1.0)
    assert rig.moving_after(since) <= 0.5
    assert rig.statuses[-1].link_down and not rig.statuses[-1].motors_enabled
    assert rig.faults("line") == 1
    count = len(rig.odometry)
    rig.plug(True)
    rig.run(2.0)
    assert not rig.statuses[-1].link_down
    assert len(rig.odometry) > count + 20
    assert rig.plant.twist == pytest.approx(AROUND, abs=0.002)
    # It coasted out of sight of us, but its encoders counted on: an arc in place of what it drove.
    last, there = rig.odometry[-1]
    assert np.hypot(last.pose.x - there[0], last.pose.y - there[1]) < 0.01
    assert last.pose.theta == pytest.approx(there[2], abs=1e-3)


def test_a_line_that_goes_is_said_at_once_and_what_keeps_it_away_too() -> None:
    rig = driven()
    rig.plug(False)
    assert rig.statuses[-1].link_down and rig.statuses[-1].stamp == rig.now
    rig.hear(b"", False, "no permission for it")
    assert any("no permission for it" in one for one in rig.said)
    assert rig.faults("line") == 1, "it went once"


@pytest.mark.parametrize("seed", range(3))
def test_bytes_lost_put_in_and_flipped(seed: int) -> None:
    """1 in 1,000 of each, both ways, over 10 s: what is published is where the base is, and it keeps moving."""
    generator = np.random.Generator(np.random.PCG64(seed))
    rig = driven(0.0)
    rig.down, rig.up = noisy(generator, 1e-3), noisy(generator, 1e-3)
    rig.plant.distances, before = (0.1, 0.2, 0.3, *[FARTHEST] * 6), len(rig.ranges)
    rig.run(10.0)
    assert rig.worst() < 1e-3
    for one in rig.ranges[before:]:
        assert list(one.distance) == pytest.approx(rig.plant.distances, abs=1e-6)
    assert rig.faults("checksum") + rig.faults("broken off") + rig.faults("board") > 3
    assert not any(one.bumper for one in rig.statuses)
    assert all(one.battery_voltage == pytest.approx(24.0) for one in rig.statuses[2:])
    assert rig.plant.twist == pytest.approx(AROUND, abs=0.01)
    moving = [speed > 0.1 for at, speed in rig.speeds if at > 2 * SECOND]
    assert np.mean(moving) > 0.95


@pytest.mark.parametrize("hung", [False, True])
def test_answers_that_are_heard_late_are_believed(hung: bool) -> None:
    """Several at once, from a line that was slow; or one, by a host that stood still and did not poll either."""
    rig, held = driven(wish=(0.4, 0.2, 0.8)), []
    hear, rig.hear = rig.hear, lambda data, up=True, fault="": held.append(data)  # type: ignore[method-assign]
    rig.run(0.02 if hung else 0.1)
    rig.hung = hung
    rig.run(0.3 if hung else 0.0)
    rig.hung, rig.hear = False, hear  # type: ignore[method-assign]
    for data in held:
        rig.hear(data)
    rig.run(0.5)
    assert rig.faults("encoders") == 0
    last, there = rig.odometry[-1]
    assert np.hypot(last.pose.x - there[0], last.pose.y - there[1]) < 1e-3
    assert last.pose.theta == pytest.approx(there[2], abs=1e-3)


@pytest.mark.parametrize("moved", [0.0, 0.4, 1.0, 2.0])
@pytest.mark.parametrize("wish", [(0.1, 0.0, 0.0), (0.0, 0.0, 0.3), None])
def test_a_board_that_is_reset_early_is_told_from_one_that_stands(
    moved: float, wish: tuple[float, float, float] | None
) -> None:
    """Its counters go back to where they were a moment ago: a jump that a base could have made."""
    rig = driven(moved, wish)
    before = rig.odometry[-1][0].pose
    rig.board.reset()
    rig.run(1.0)
    assert rig.faults("encoders") > 0
    assert rig.board.stops, "the emergency bumper is on again"
    assert rig.board.limit[0] == pytest.approx(11500.0)
    later = rig.odometry[-1][0].pose
    assert later.x >= before.x - 1e-6 and later.theta >= before.theta - 1e-6, "odometry does not go back"
    steps = [np.hypot(b.pose.x - a.pose.x, b.pose.y - a.pose.y) for (a, _), (b, _) in pairwise(rig.odometry)]
    assert max(steps) < 0.02


def test_a_board_that_takes_no_positions_is_driven_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(board._TABLE, Tag.SET_MOTOR_POSITION, (5, lambda *_: None))
    rig = driven(3.0)
    assert rig.plant.twist == pytest.approx(AROUND, abs=0.002)
    assert len(rig.odometry) > 40 and any("takes no positions" in one for one in rig.said)
    rig.board.reset()
    rig.run(2.0)
    assert rig.faults("encoders") > 0, "what is driven by then is told from none"


def test_what_a_charger_says_unasked_is_in_the_status_and_its_states_are_told() -> None:
    rig = driven(0.2)
    # By reference 2.4: u8 id, u32 time, 4 f32 (V, A, T1, T2), u8 state, text.
    said = struct.pack("<BI4fB", 1, 1000, 27.5, 1.5, 24.0, 25.0, 7) + b"bulk"
    rig.board.news = [(80, said), (80, struct.pack("<BI4fB", 0, 1000, 28.0, 0.0, 21.0, 22.0, 11))]
    rig.run(0.5)
    first, second = rig.statuses[-1].chargers
    assert (first.number, first.state, second.number, second.state) == (0, "error", 1, "stage 1")
    assert (second.voltage, second.current, list(second.temperature)) == (27.5, 1.5, [24.0, 25.0])
    assert [one for one in rig.said if one.startswith("charger")] == [
        "charger 1: stage 1, 27.5 V, 1.5 A bulk",
        "charger 0: error, 28.0 V, 0.0 A",
    ]
    rig.board.news = [(80, said), (80, said[:10])]
    rig.run(0.5)
    assert rig.faults("tag") == 1 and len([one for one in rig.said if one.startswith("charger")]) == 2
    again = RobotinoSerial(SerialConfig())
    again.restore(rig.service.snapshot(), {})
    assert again.state.chargers == rig.service.state.chargers  # type: ignore[attr-defined]


def test_a_board_that_only_complains_is_no_link() -> None:
    rig = driven()
    rig.board.receive = lambda data, plant: b""  # type: ignore[method-assign]
    for _ in range(50):
        rig.hear(
            encode(
                tags.packed(
                    [
                        (Tag.ERROR, b"no"),
                        tags.pack_power(tags.Power(24.0, 1.5, False, 1, 0, False, 60000)),
                        (Tag.POWER_BUTTON, b"\0"),
                    ]
                )
            )
        )
        rig.run(0.02)
    assert rig.statuses[-1].link_down and not rig.statuses[-1].motors_enabled


def test_ramps_never_ask_motors_for_more_than_they_can() -> None:
    """The turn comes sooner than the way ends: the rear wheel would have to do both."""
    rig = driven(2.0, (0.0, -0.57, 0.0))
    most, speeds = ROBOTINO_3_4.max_rpm, []
    rig.wish = (0.0, 0.0, 1.5)
    for _ in range(300):
        rig.run(0.01)
        speeds.append(max(map(abs, rig.board.wish[:3])))
    assert max(speeds) <= most + 1.0


def test_a_board_that_is_reset() -> None:
    rig = driven()
    rig.board.reset()
    since, before = rig.now, rig.odometry[-1][0]
    rig.run(0.3)
    assert rig.moving_after(since) > 0.0
    rig.run(2.0)
    assert rig.faults("encoders") > 0
    assert rig.board.stops, "its settings are told again"
    assert rig.plant.twist == pytest.approx(AROUND, abs=0.002)
    steps = [one for one, _ in rig.odometry if one.driver_sequence >= before.driver_sequence]
    # Odometry never jumps: at 0.23 m/s and 25 Hz it goes on by less than 4 cm at a time.
    for a, b in zip(steps[:-1], steps[1:], strict=True):
        seconds = (b.stamp - a.stamp) / SECOND
        assert np.hypot(b.pose.x - a.pose.x, b.pose.y - a.pose.y) < 0.3 * seconds + 0.01


def test_a_pressed_bumper_stops_the_base_by_the_board_alone() -> None:
    rig = driven()
    rig.plant.bumper, since = True, rig.now
    rig.run(0.5)
    assert rig.moving_after(since) < 0.01
    assert rig.statuses[-1].bumper and rig.statuses[-1].emergency_stop
    rig.plant.bumper = False
    rig.run(1.5)
    assert rig.plant.twist == (0.0, 0.0, 0.0), "for 2 s after it is released"
    rig.run(2.0)
    assert rig.plant.twist == pytest.approx(AROUND, abs=0.002)


def test_speeds_stay_with_a_board_that_is_only_polled() -> None:
    """The board latches: so without the driver's own deadline the base would go on for ever."""
    rig = driven()
    poll = encode(tags.packed(tags.request(Tag.GET_BUMPER)))
    rig.hung = True
    for _ in range(100):
        rig.run(0.02)
        rig.board.receive(poll, rig.plant)
    assert rig.plant.twist == pytest.approx(AROUND, abs=0.002)


def test_the_last_words_are_zero() -> None:
    rig = driven()
    rig.take(rig.service.finish(rig.now))
    rig.hung, since = True, rig.now
    rig.run(0.3)
    assert rig.moving_after(since) < 0.2


def test_a_board_with_a_gyro_turns_by_it() -> None:
    rig = driven(3.0, (0.0, 0.0, 1.0), config=SerialConfig(gyro=True), board=Board(gyro=True))
    last, there = rig.odometry[-1]
    assert last.pose.theta == pytest.approx(there[2], abs=1e-3)


def test_a_restored_driver_goes_on_alike_to_the_byte() -> None:
    rig = driven()
    other = RobotinoSerial(rig.config)
    other.restore(rig.service.snapshot(), {})
    answer = rig.board.receive(encode(tags.packed(tags.request(Tag.GET_ALL_MOTOR_READINGS))), rig.plant)
    rig.board.receive(b"", rig.plant)

    def work(service: RobotinoSerial) -> list[bytes]:
        made = [*service.ask(rig.now), *service.hear(SerialData(data=answer, open=True), rig.now + 1)]
        return [one.message.SerializeToString() for one in made]  # type: ignore[union-attr]

    assert work(rig.service) == work(other)
    assert rig.service.snapshot() == other.snapshot()
