"""What keeps the robot inside does so, whatever it wishes; and the law walks around and pushes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from services.geometry.angles import wrapped
from services.geometry.field import Field
from services.predictive import law
from services.predictive import model as m

PATH = np.column_stack([np.arange(0.0, 4.01, 0.05), np.zeros(81)])
HALF = 0.6
FIELD = Field.build(PATH, np.full(81, HALF))
WHERE = FIELD.grid
BASE = np.array([0.4, 0.1, 0.23])


@example(2.0, 0.0, [0.0, 0.0, 0.5, 0.25, 2.0])  # was out by 15 mm: turning took the acceleration that was to brake
@given(st.floats(0.3, 3.7), st.floats(-0.5, 0.5), st.lists(st.floats(-math.pi, math.pi), min_size=1, max_size=8))
def test_no_wish_takes_the_base_out_of_the_corridor(x: float, y: float, wishes: list[float]) -> None:
    state = np.zeros(m.STATE)
    state[m.RX], state[m.RY] = x, y
    deepest = FIELD.value(x, y)
    for angle in wishes:
        for _ in range(40):
            u = law.inside(
                *WHERE, state, 0.3 * math.cos(angle), 0.3 * math.sin(angle), 0.4, 0.02,
            )  # fmt: skip
            m.drive(state, *u, 0.0, 0.05, BASE)
            deepest = min(deepest, FIELD.value(state[m.RX], state[m.RY]))
    assert deepest > 0.0


@given(st.floats(0.5, 3.5), st.floats(0.0, 0.55), st.floats(-1.3, 1.3), st.floats(-0.3, 0.3))
def test_no_push_takes_the_object_out_of_the_corridor(x: float, y: float, aside: float, lean: float) -> None:
    """An object that stops when the base does is pushed towards the edge, straight or not, at 0.3 m/s."""
    contour, response = m.prior_contour(0.46, 0.3), m.prior_response(0.3)
    state = np.zeros(m.STATE)
    reach = m.radius(contour, -0.5 * math.pi + aside)[0]
    state[m.X], state[m.Y] = x, y
    state[m.RX], state[m.RY] = x + reach * math.sin(aside), y - reach * math.cos(aside)
    least = FIELD.value(x, y)
    for _ in range(80):
        way = math.atan2(state[m.Y] - state[m.RY], state[m.X] - state[m.RX]) + lean
        u = law.sparing(*WHERE, state, 0.3 * math.cos(way), 0.3 * math.sin(way), 0.4, HALF)
        m.step(state, *u, 0.0, 0.05, BASE, contour, response)
        least = min(least, FIELD.value(state[m.X], state[m.Y]))
    assert least > 0.0


def test_a_push_inward_or_along_the_edge_goes_on() -> None:
    state = np.zeros(m.STATE)
    state[m.X], state[m.Y] = 2.0, HALF - 0.005
    assert law.sparing(*WHERE, state, 0.3, -0.1, 0.4, HALF) == (0.3, -0.1)
    assert law.sparing(*WHERE, state, 0.3, 0.1, 0.4, HALF) == pytest.approx((0.3, 0.0), abs=1e-3)
    state[m.VX], state[m.VY] = 0.2, 0.02  # drifts outward
    assert law.sparing(*WHERE, state, 0.3, 0.0, 0.4, HALF) == pytest.approx((0.0, 0.0), abs=1e-3)
    state[m.Y] = 0.0
    assert law.sparing(*WHERE, state, 0.1, 0.3, 0.4, HALF) == (0.1, 0.3)


def test_in_the_middle_nothing_is_changed() -> None:
    state = np.zeros(m.STATE)
    state[m.RX], state[m.RY] = 2.0, 0.1
    assert law.inside(*WHERE, state, 0.3, 0.0, 0.4, 0.02) == (0.3, 0.0)
    state[m.RY] = 0.55
    assert law.inside(*WHERE, state, 0.3, -0.2, 0.4, 0.02) == (0.3, -0.2)  # inward


def driven(bearing: float, side: float = 0.0, seconds: float = 14.0) -> tuple[np.ndarray, float]:
    """Return the state after the law has had a disc at the origin pushed towards +x, and the least gap."""
    contour, response = m.prior_contour(0.46, 0.3), m.prior_response(0.3)
    state = np.zeros(m.STATE)
    state[m.RX], state[m.RY] = 0.5 * math.cos(bearing), 0.5 * math.sin(bearing)
    manoeuvre = np.zeros(law.MANOEUVRE)
    manoeuvre[law.TARGET_X], manoeuvre[law.SPEED], manoeuvre[law.SIDE] = 5.0, 0.3, side
    manoeuvre[law.WALK] = 0.3
    walking, swept, before = 0.0, 0.0, bearing
    for _ in range(round(seconds / 0.05)):
        ux, uy, walking = law.wish(state, contour, manoeuvre, walking)
        m.step(state, ux, uy, law.turning(state, contour), 0.05, BASE, contour, response)
        now = math.atan2(state[m.RY] - state[m.Y], state[m.RX] - state[m.X])
        swept += wrapped(now - before)
        before = now
    return state, swept


@pytest.mark.parametrize("bearing", [0.0, 0.4, 1.5, -1.5, 3.0])
def test_from_every_side_the_robot_comes_behind_and_pushes_on(bearing: float) -> None:
    state, _ = driven(bearing)
    assert state[m.X] > 0.5
    assert abs(state[m.Y]) < 0.25


def test_the_way_around_can_be_chosen() -> None:
    assert driven(0.1, side=1.0)[1] > 2.0
    assert driven(0.1, side=-1.0)[1] < -2.0


@pytest.mark.parametrize(("gap", "off", "least", "most"), [
    (0.2, 0.1, 0.1, 0.2), (0.2, -2.5, -1.0, -1.0), (0.0, 0.3, 0.0, 0.0), (0.0, 0.9, 0.5, 1.0), (0.0, -0.9, -1.0, -0.5),
])  # fmt: skip
def test_the_base_turns_to_the_object_and_in_touch_only_where_it_must(
    gap: float, off: float, least: float, most: float
) -> None:
    contour, state = m.prior_contour(0.46, 0.3), np.zeros(m.STATE)
    state[m.RX] = -(contour[0] + gap)  # the object is towards 0 rad
    state[m.THETA] = -off
    assert least <= law.turning(state, contour) <= most


def test_the_base_keeps_the_object_in_view_while_it_walks_around_and_pushes() -> None:
    state, _ = driven(0.4, seconds=20.0)
    bearing = math.atan2(state[m.Y] - state[m.RY], state[m.X] - state[m.RX])
    assert abs(wrapped(bearing - state[m.THETA])) < 0.4


@given(st.floats(-50.0, 50.0))
def test_wrapped_is_the_same_direction_within_a_turn(angle: float) -> None:
    found = wrapped(angle)
    assert -math.pi <= found < math.pi
    assert (math.cos(found), math.sin(found)) == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-9)
