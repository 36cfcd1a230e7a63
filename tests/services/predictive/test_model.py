"""The forward model against mechanics: least dissipation, closed forms, and the geometry of contact."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.optimize import minimize

from services.predictive import model as m

DT = 0.001


def touching(bearing: float, response: np.ndarray, contour: np.ndarray, yaw: float = 0.0) -> np.ndarray:
    """Return a state in which the robot just touches the object, which lies at the origin."""
    state = np.zeros(m.STATE)
    rho, _ = m.radius(contour, bearing)
    state[m.YAW] = yaw
    state[m.RX], state[m.RY] = rho * math.cos(bearing + yaw), rho * math.sin(bearing + yaw)
    return state


def pushed(
    state: np.ndarray, vx: float, vy: float, response: np.ndarray, contour: np.ndarray, turn: float = 0.0
) -> np.ndarray:
    """Return the object's twist when the robot moves with (vx, vy) and turns with `turn`."""
    base = np.array([0.4, 0.0, 0.23])
    state = state.copy()
    state[m.RVX], state[m.RVY], state[m.TURN] = vx, vy, turn
    m.answer(state, 1e-9, base, contour, response)
    return state[[m.VX, m.VY, m.OMEGA]]


def response_of(anisotropy: float, axis: float, x: float, y: float, length: float, friction: float) -> np.ndarray:
    response = m.prior_response(0.3)
    response[[m.ANISOTROPY, m.AXIS, m.CENTRE_X, m.CENTRE_Y]] = anisotropy, axis, x, y
    response[[m.LENGTH, m.FRICTION]] = length, friction
    return response


RESPONSES = st.builds(
    response_of,
    st.floats(-2.0, 2.0),
    st.floats(-1.5, 1.5),
    st.floats(-0.03, 0.03),
    st.floats(-0.03, 0.03),
    st.floats(0.05, 0.2),
    st.just(1e6),  # it sticks
)


def least_dissipation(response: np.ndarray, contact: np.ndarray, velocity: np.ndarray, yaw: float) -> np.ndarray:
    """Return the twist about the object's centre that moves `contact` with `velocity` and dissipates least.

    On an ellipsoidal limit surface the power of a twist is sqrt(t' D^-1 t); a quasi-static body takes the least
    (Peshkin and Sanderson 1989). Found by numerical optimisation.
    """
    angle = yaw + response[m.AXIS]
    turn = np.array(((math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))))
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = response[m.CENTRE_X], response[m.CENTRE_Y]
    centre = np.array((c * x - s * y, s * x + c * y))

    def power(omega: float) -> float:
        # Velocity of the centre of friction for this spin, with the contact moving as asked.
        arm = centre - contact
        v = turn @ (velocity + omega * np.array((-arm[1], arm[0])))
        across = math.exp(2.0 * response[m.ANISOTROPY])
        return float(v[0] ** 2 + across * (v[1] ** 2 + (response[m.LENGTH] * omega) ** 2))

    omega = float(minimize(lambda z: power(z[0]), [0.0], method="BFGS", options={"gtol": 1e-12}).x[0])
    v = velocity + omega * np.array((contact[1], -contact[0]))
    return np.array((*v, omega))


@given(RESPONSES, st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), st.floats(-0.9, 0.9), st.floats(-1.0, 1.0))
def test_a_contact_that_sticks_moves_the_object_with_least_dissipation(
    response: np.ndarray, yaw: float, bearing: float, aside: float, turn: float
) -> None:
    contour = m.prior_contour(0.46, 0.3)
    state = touching(bearing, response, contour, yaw)
    inward = -state[[m.RX, m.RY]] / np.hypot(*state[[m.RX, m.RY]])
    velocity = 0.2 * (math.cos(aside) * inward + math.sin(aside) * np.array((-inward[1], inward[0])))
    found = pushed(state, *velocity, response, contour, turn)
    # The side of a disc that turns goes with it.
    velocity = velocity + 0.23 * turn * np.array((-inward[1], inward[0]))
    contact = state[[m.RX, m.RY]] + 0.23 * inward
    expected = least_dissipation(response, contact, velocity, yaw)
    # Who would have to pull does not stick: the force on the object is along the gradient of the power.
    angle = yaw + response[m.AXIS]
    easy, hard = np.array((math.cos(angle), math.sin(angle))), np.array((-math.sin(angle), math.cos(angle)))
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = response[m.CENTRE_X], response[m.CENTRE_Y]
    v = expected[:2] + expected[2] * np.array((-(s * x + c * y), c * x - s * y))
    force = easy * (easy @ v) + hard * (hard @ v) * math.exp(2.0 * response[m.ANISOTROPY])
    assume(force @ inward > 1e-3)
    assert found == pytest.approx(expected, abs=2e-4)


@given(st.floats(-3.1, 3.1), st.floats(-0.8, 0.8), st.floats(0.0, 0.5))
def test_a_contact_that_slides_shares_the_normal_velocity_and_leans_on_the_friction_cone(
    bearing: float, aside: float, friction: float
) -> None:
    contour = m.prior_contour(0.46, 0.3)
    response = response_of(0.0, 0.0, 0.0, 0.0, 0.09, friction)
    state = touching(bearing, response, contour)
    inward = -state[[m.RX, m.RY]] / np.hypot(*state[[m.RX, m.RY]])
    tangent = np.array((-inward[1], inward[0]))
    velocity = 0.2 * (math.cos(aside) * inward + math.sin(aside) * tangent)
    vx, vy, omega = pushed(state, *velocity, response, contour)
    arm = state[[m.RX, m.RY]] + 0.23 * inward
    at_contact = np.array((vx - omega * arm[1], vy + omega * arm[0]))
    assert at_contact @ inward == pytest.approx(velocity @ inward, abs=1e-9)
    # On an isotropic surface about the centre the force is along the velocity of the centre.
    force = np.array((vx, vy))
    assert abs(force @ tangent) <= friction * (force @ inward) + 1e-9
    assert omega == pytest.approx((arm[0] * force[1] - arm[1] * force[0]) / 0.09**2, abs=1e-7)


def test_a_disc_pushed_through_its_centre_goes_straight_on() -> None:
    contour, response = m.prior_contour(0.46, 0.3), m.prior_response(0.3)
    state, base = np.zeros(m.STATE), np.array([0.4, 0.1, 0.23])
    state[m.RX] = -0.5
    for _ in range(4000):
        m.step(state, 0.3, 0.0, 0.0, DT, base, contour, response)
    rho, _ = m.radius(contour, math.pi)
    assert state[m.X] - state[m.RX] == pytest.approx(rho, abs=0.005)
    assert (state[m.VX], state[m.VY], state[m.OMEGA]) == pytest.approx((0.3, 0.0, 0.0), abs=1e-6)


def test_an_object_left_alone_stops_after_v_squared_over_2a() -> None:
    contour, response = m.prior_contour(0.46, 0.3), m.prior_response(0.3)
    response[m.COASTING] = 0.5
    state, base = np.zeros(m.STATE), np.array([0.4, 0.1, 0.23])
    state[m.RX], state[m.VX] = -5.0, 0.3
    for _ in range(2000):
        m.step(state, 0.0, 0.0, 0.0, DT, base, contour, response)
    assert state[m.X] == pytest.approx(0.3**2 / (2 * 0.5), abs=2e-4)
    assert state[m.VX] == 0.0


def test_the_base_ramps_and_lags() -> None:
    base, state = np.array([0.4, 0.1, 0.23]), np.zeros(m.STATE)
    for _ in range(500):
        m.drive(state, 0.3, 0.0, 0.6, DT, base)
    # The ramp has reached 0.2 m/s; behind a lag T a ramp a t has a (t - T (1 - exp(-t / T))).
    assert state[m.RAMP_X] == pytest.approx(0.2, abs=1e-9)
    assert state[m.RVX] == pytest.approx(0.4 * (0.5 - 0.1 * (1 - math.exp(-5.0))), abs=1e-3)
    # A step to w behind a lag T: w (1 - exp(-t / T)), and its integral.
    assert state[m.TURN] == pytest.approx(0.6 * (1 - math.exp(-5.0)), abs=1e-9)
    assert state[m.THETA] == pytest.approx(0.6 * (0.5 - 0.1 * (1 - math.exp(-5.0))), abs=1e-3)


@given(st.lists(st.floats(-0.05, 0.05), min_size=m.CONTOUR - 1, max_size=m.CONTOUR - 1), st.floats(-7.0, 7.0))
def test_the_contour_has_the_slope_that_differences_have(rest: list[float], bearing: float) -> None:
    contour = 0.35 + np.array([0.0, *rest])
    h = 1e-6
    rho, slope = m.radius(contour, bearing)
    # Coefficient 0 is that of bearing 0; scipy's first basis spline begins two knots before its middle.
    knot = math.tau / m.CONTOUR
    whole = BSpline(knot * np.arange(-5, m.CONTOUR + 6), np.r_[contour[-3:], contour, contour[:4]], 3)
    assert rho == pytest.approx(float(whole(bearing % math.tau)), abs=1e-12)
    share, change = m.basis(np.array([bearing]))
    assert (share @ contour)[0] == pytest.approx(rho, abs=1e-12)
    assert (change @ contour)[0] == pytest.approx(slope, abs=1e-12)
    difference = (m.radius(contour, bearing + h)[0] - m.radius(contour, bearing - h)[0]) / (2 * h)
    assert slope == pytest.approx(difference, abs=1e-6)


@pytest.mark.parametrize("dt", [0.1, 0.05, 0.025, 0.005])
def test_an_object_pushed_straight_goes_as_far_as_the_robot_whatever_the_step(dt: float) -> None:
    contour, response = m.prior_contour(0.46, 0.3), m.prior_response(0.3)
    state = touching(math.pi, response, contour)
    state[m.RVX] = state[m.RAMP_X] = 0.3
    begin = state[m.RX]
    for _ in range(round(0.4 / dt)):
        m.step(state, 0.3, 0.0, 0.0, dt, np.array([0.4, 0.1, 0.23]), contour, response)
    assert state[m.RX] - begin == pytest.approx(0.12, abs=1e-9)
    assert state[m.X] == pytest.approx(0.12, abs=0.004)
