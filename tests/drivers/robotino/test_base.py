"""Infra-red sensors, dead reckoning, and the gate for commands."""

from __future__ import annotations

from math import cos, inf, nan, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.angles import wrap
from drivers.robotino import infrared
from drivers.robotino.gate import STILL, Gate
from drivers.robotino.kinematics import ROBOTINO_3_4
from drivers.robotino.odometry import DeadReckoning, counted, way
from drivers.sapien.sensors import RangeRing
from runtime.messages import Alive, MotionLimits, Twist2, VelocityCommand
from runtime.time import SECOND, Time

LIMITS = MotionLimits(speed=0.5, angular_speed=1.5, acceleration=0.4, angular_acceleration=3.0)


def test_the_manufacturers_table() -> None:
    table = {0.30: 0.41, 0.50: 0.25, 0.80: 0.16, 1.30: 0.10, 2.55: 0.04, 0.1: 0.41, 4.9: 0.04}
    for volts, metres in table.items():
        assert infrared.metres(volts) == pytest.approx(metres)
    assert infrared.metres(0.45) == pytest.approx(0.30 - 0.05 * 4 / 9)


@given(st.floats(infrared.NEAREST, infrared.FARTHEST))
def test_volts_and_metres_are_inverse(distance: float) -> None:
    assert infrared.metres(infrared.volts(distance)) == pytest.approx(distance, abs=1e-12)


def test_the_sensors_look_where_the_simulated_ones_do() -> None:
    assert infrared.bearings() == pytest.approx(RangeRing().bearings().tolist())
    assert infrared.bearings()[1] == pytest.approx(2 * pi / 9)


@given(st.floats(0.2, 2.0), st.floats(-3.0, 3.0), st.integers(1, 40))
def test_arcs_end_on_their_circle_however_they_are_cut(radius: float, turn: float, pieces: int) -> None:
    reckoning = DeadReckoning()
    for _ in range(pieces):
        reckoning.go((radius * turn / pieces, 0.0, turn / pieces))
    assert (reckoning.x, reckoning.y) == pytest.approx((radius * sin(turn), radius * (1 - cos(turn))), abs=1e-9)
    assert reckoning.theta == pytest.approx(wrap(turn), abs=1e-9)
    assert reckoning.travelled == pytest.approx(abs(radius * turn))


POSE = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1))


@given(POSE, POSE)
def test_the_way_between_two_poses_leads_from_one_to_the_other(
    before: tuple[float, float, float], after: tuple[float, float, float]
) -> None:
    reckoning = DeadReckoning(*before)
    reckoning.go(way(before, after))
    assert (reckoning.x, reckoning.y) == pytest.approx(after[:2], abs=1e-6)
    assert wrap(reckoning.theta - after[2]) == pytest.approx(0.0, abs=1e-9)


@given(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**30), 2**30))
def test_counters_go_round(before: int, way: int) -> None:
    now = (before + way + 2**31) % 2**32 - 2**31
    assert counted(before, now) == way


def command(sequence: int, vx: float = 0.2, deadline: float = 0.3) -> VelocityCommand:
    return VelocityCommand(twist=Twist2(vx=vx), driver_sequence=sequence, deadline=int(deadline * SECOND))


def offered(gate: Gate, one: VelocityCommand, now: float) -> str:
    return gate.offer(one, at(now), 0.5, LIMITS, ROBOTINO_3_4)


def at(seconds: float) -> Time:
    return round(seconds * SECOND)


def test_a_command_counts_from_the_odometry_it_is_based_on() -> None:
    gate = Gate()
    for k in range(5):
        gate.sensed(at(0.1 * k))
    assert offered(gate, command(5), 0.45) == ""
    assert gate.now(at(0.69)) == (0.2, 0.0, 0.0)
    assert gate.now(at(0.71)) == STILL and gate.stale == 1
    assert "age 0.410" in offered(gate, command(5), 0.81)
    assert "unknown" in offered(gate, command(6), 0.82), "no such odometry yet"
    assert (gate.accepted, gate.stale) == (1, 3)


def test_a_deadline_is_never_longer_than_the_drivers_own() -> None:
    gate = Gate()
    gate.sensed(at(0.0))
    assert offered(gate, command(1, deadline=60.0), 0.1) == ""
    assert gate.now(at(0.49)) != STILL and gate.now(at(0.51)) == STILL


@pytest.mark.parametrize("wrong", [nan, inf, -inf])
def test_what_is_not_finite_stops_the_base(wrong: float) -> None:
    gate = Gate()
    gate.sensed(0)
    offered(gate, command(1), 0.0)
    assert "expected finite" in offered(gate, command(1, vx=wrong), 0.01)
    assert gate.now(at(0.02)) == STILL and gate.refused == 1


def test_the_base_is_held_when_its_controller_goes() -> None:
    gate = Gate()
    gate.sensed(0)
    offered(gate, command(1), 0.0)
    assert not gate.call(Alive(nodes=["controller", "task"]))
    assert gate.call(Alive(nodes=["task"]))
    assert gate.now(at(0.01)) == STILL
    assert "gone" in offered(gate, command(1), 0.02)
    gate.call(Alive(nodes=["controller"]))
    assert offered(gate, command(1), 0.03) == ""


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-9, 9))
def test_what_goes_to_the_base_is_within_limits(vx: float, vy: float, omega: float) -> None:
    gate = Gate()
    gate.sensed(0)
    wish = VelocityCommand(twist=Twist2(vx=vx, vy=vy, omega=omega), driver_sequence=1, deadline=SECOND)
    assert offered(gate, wish, 0.0) == ""
    x, y, turn = gate.now(0)
    assert x * x + y * y <= 0.5**2 + 1e-12 and abs(turn) <= 1.5
    assert max(map(abs, ROBOTINO_3_4.motors((x, y, turn)))) <= 3000 + 1e-9
    assert gate.clamped == (gate.wish != (vx, vy, omega))
