"""The drive against the reference's figures and closed forms."""

from __future__ import annotations

from math import atan2, cos, hypot, pi, radians, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.robotino.kinematics import ROBOTINO_1_2, ROBOTINO_3_4, Geometry, NotFinite, ramped

SPEED = st.floats(-2.0, 2.0)
BOTH = st.sampled_from([ROBOTINO_1_2, ROBOTINO_3_4])


@given(BOTH, SPEED, SPEED, SPEED)
def test_there_and_back_is_exact(geometry: Geometry, vx: float, vy: float, omega: float) -> None:
    assert geometry.twist(geometry.motors((vx, vy, omega))) == pytest.approx((vx, vy, omega), abs=1e-12)


@given(BOTH, SPEED, SPEED, SPEED)
def test_a_wheel_rolls_along_its_tangent(geometry: Geometry, vx: float, vy: float, omega: float) -> None:
    """The wheel's point of the base moves by v + omega x r; the wheel takes of it what is along its tangent."""
    for degrees, motor in zip((60, 180, 300), geometry.motors((vx, vy, omega)), strict=True):
        angle = radians(degrees)
        x, y = geometry.wheel_distance * cos(angle), geometry.wheel_distance * sin(angle)
        along = -sin(angle) * (vx - omega * y) + cos(angle) * (vy + omega * x)
        rpm = along / (2 * pi * geometry.wheel_radius) * 60 * geometry.gear
        assert motor == pytest.approx(rpm, abs=1e-8)


def test_the_table_of_the_reference() -> None:
    assert 60 * ROBOTINO_1_2.turns_per_metre == pytest.approx(3820, abs=1)
    assert 60 * ROBOTINO_3_4.turns_per_metre == pytest.approx(5093, abs=1)
    # 3000 rpm: 0.68 m/s ahead, 0.589 aside, 3.37 rad/s.
    for course, most in (((1.0, 0.0, 0.0), 0.68), ((0.0, 1.0, 0.0), 0.589), ((0.0, 0.0, 1.0), 3.37)):
        fast, limited = ROBOTINO_3_4.within((10 * course[0], 10 * course[1], 10 * course[2]))
        assert limited
        assert hypot(*fast) == pytest.approx(most, abs=0.005)


def test_the_captured_triple_drives_straight() -> None:
    vx, vy, omega = ROBOTINO_3_4.twist((-1243.0, 426.0, 817.0))
    assert omega == 0.0
    assert hypot(vx, vy) == pytest.approx(0.248, abs=5e-4)


@given(BOTH, st.floats(-5, 5), st.floats(-5, 5), st.floats(-9, 9))
def test_what_is_too_fast_is_scaled_and_keeps_its_course(geometry: Geometry, vx: float, vy: float, w: float) -> None:
    followed, limited = geometry.within((vx, vy, w))
    assert max(map(abs, geometry.motors(followed))) <= geometry.max_rpm * (1 + 1e-12)
    assert limited == (max(map(abs, geometry.motors((vx, vy, w)))) > geometry.max_rpm)
    if limited and hypot(vx, vy) > 1e-3:
        assert atan2(followed[1], followed[0]) == pytest.approx(atan2(vy, vx), abs=1e-9)
        assert followed[2] * hypot(vx, vy) == pytest.approx(w * hypot(followed[0], followed[1]), abs=1e-9)


@pytest.mark.parametrize("wrong", [float("nan"), float("inf")])
def test_what_is_not_finite_is_refused(wrong: float) -> None:
    with pytest.raises(NotFinite):
        ROBOTINO_3_4.motors((wrong, 0.0, 0.0))
    with pytest.raises(NotFinite):
        ROBOTINO_3_4.twist((0.0, wrong, 0.0))


def test_a_ramp_is_straight_and_ends_exactly() -> None:
    now, wish = (0.0, 0.0, 0.0), (0.3, 0.4, -1.0)
    steps = 0
    while now != wish:
        now = ramped(now, wish, 0.02, 0.1)
        assert now[0] * 0.4 == pytest.approx(now[1] * 0.3)
        steps += 1
    assert steps == 25
