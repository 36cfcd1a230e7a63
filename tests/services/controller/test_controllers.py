import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import vonmises

from services.controller import centroid, dipole, push_law
from services.controller.activation import PRIOR_KAPPA, PRIOR_MU, activations
from services.controller.barrier import guard
from services.controller.heading import HeadingState, turn
from services.controller.push_law import Behaviour, Gains, non_adaptive, reference
from services.geometry.angles import DegenerateDirection
from services.geometry.field import Field
from services.learner.von_mises import estimate, prior

angle = st.floats(-math.pi, math.pi)
ORIGIN = np.zeros(2)


@given(angle, angle, st.floats(0.01, 200))
def test_psi_push_is_scipys_density_over_its_peak(alpha: float, mu: float, kappa: float) -> None:
    push, relocate = activations(alpha, mu, kappa)
    expected = vonmises.logpdf(alpha, kappa, loc=mu) - vonmises.logpdf(mu, kappa, loc=mu)
    assert push == pytest.approx(math.exp(expected), rel=1e-6, abs=1e-12)
    assert push * push + relocate * relocate == pytest.approx(1.0)


def test_the_priors_mode_is_the_learners() -> None:
    mode = estimate(prior())
    assert mode.mu == PRIOR_MU
    assert mode.kappa == pytest.approx(PRIOR_KAPPA, rel=1e-12)


@given(angle, angle, st.floats(0.1, 50))
def test_the_reference_is_a_unit_vector(alpha: float, alpha_p: float, kappa: float) -> None:
    v = reference(alpha, alpha_p, *activations(alpha, alpha_p, kappa))
    assert np.hypot(*v) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("alpha", "push", "relocate"),
    [(0.3, 1, -1), (-0.3, 1, 1), (2.0, -1, -1), (-2.0, -1, 1), (1.0, 1, -1)],
)
def test_signs_of_9_and_10(alpha: float, push: int, relocate: int) -> None:
    v = reference(alpha, 0.0, 0.6, 0.8)
    assert v == pytest.approx((0.6 * push, 0.8 * relocate))


def test_relocation_goes_the_way_that_brings_alpha_to_alpha_p() -> None:
    # Kinematics alone: a robot that only relocates round a fixed object ends with alpha = alpha_p.
    for alpha_p in (0.0, 0.4):
        for bearing in np.linspace(-3, 3, 13):
            r, o, t = np.array((math.cos(bearing), math.sin(bearing))), ORIGIN, np.array((3.0, 0.0))
            for _ in range(500):
                alpha = math.remainder(math.atan2(*(t - o)[::-1]) - math.atan2(*(o - r)[::-1]), math.tau)
                u = push_law.command(r, o, alpha, Behaviour(alpha_p, 0.0, 1.0, 0.0, 0.0), Gains())
                r = r + 0.05 * u
                r /= np.hypot(*r)
            assert math.remainder(alpha - alpha_p, math.tau) == pytest.approx(0.0, abs=0.03)


@given(angle, angle, st.floats(-1, 1), st.floats(-1, 1))
def test_command_is_8_written_with_complex_numbers(heading: float, alpha: float, gamma: float, mean: float) -> None:
    push, relocate = activations(alpha, 0.2, 3.0)
    o = 0.5 * np.array((math.cos(heading), math.sin(heading)))
    u = push_law.command(ORIGIN, o, alpha, Behaviour(0.2, push, relocate, gamma, mean), Gains(0.3, 0.07, 0.25))
    sign = 1.0 if math.cos(alpha) >= 0 else -1.0
    side = 1.0 if math.sin(0.2 - alpha) >= 0 else -1.0
    expected = 0.25 * (sign * push + 1j * side * relocate) * np.exp(1j * (heading - 0.07 * mean - 0.3 * gamma))
    assert complex(*u) == pytest.approx(expected, abs=1e-9)


def test_an_object_that_veers_left_is_answered_by_steering_left() -> None:
    # Veering left: executed > desired, gamma < 0. Steering left gets the robot behind the side it drifts to.
    u = push_law.command(ORIGIN, np.array((0.5, 0.0)), 0.0, Behaviour(0.0, 1.0, 0.0, -0.5, 0.0), Gains())
    assert u[1] > 0


@given(angle, st.floats(-1, 1))
def test_non_adaptive_holds_the_prior(alpha: float, gamma: float) -> None:
    found = non_adaptive(alpha, gamma)
    assert (found.alpha_p, found.gamma, found.mean_gamma) == (0.0, gamma, 0.0)
    assert found.psi_push == pytest.approx(math.exp(PRIOR_KAPPA * (math.cos(alpha) - 1)))


@given(angle, angle)
def test_dipole_is_the_field_of_a_dipole_at_the_object(heading: float, alpha: float) -> None:
    o = 0.4 * np.array((math.cos(heading), math.sin(heading)))
    u = dipole.command(ORIGIN, o, alpha, 0.3)
    # Igarashi: in the frame of the push-line the robot at angle phi from the object moves along 2 phi,
    # with phi = 0 ahead of the object; the robot is at phi = pi - alpha there.
    push_line = heading + alpha
    field = push_line + 2 * (math.pi - alpha)
    assert u == pytest.approx((0.3 * math.cos(field), 0.3 * math.sin(field)), abs=1e-9)


def test_centroid_alignment() -> None:
    o, t = np.array((1.0, 0.0)), np.array((3.0, 0.0))
    u, cut = centroid.command(np.array((0.5, 0.1)), o, t)
    assert u == pytest.approx((0.2 * 0.2, -0.4 * 0.1))
    assert not cut
    u, _ = centroid.command(np.array((0.5, 0.0)), o, np.array((1.05, 0.0)))
    assert u == pytest.approx((0.2 * 0.05, 0.0))
    u, cut = centroid.command(np.array((0.5, -2.0)), o, t)
    assert cut
    assert np.hypot(*u) == pytest.approx(0.2)
    assert math.atan2(u[1], u[0]) == pytest.approx(math.atan2(0.8, 0.04))
    with pytest.raises(DegenerateDirection):
        centroid.command(ORIGIN, o, o)


def test_heading_turns_to_the_object_and_settles() -> None:
    state, theta, omega = HeadingState(), -2.8, 0.0
    for k in range(200):
        omega, cut = turn(state, 0.05 * k, ORIGIN, theta, np.array((-1.0, 0.5)), 1.5, 0.2, 1.0)
        assert abs(omega) <= 1.0
        if k == 0:
            # The short way round: from -2.8 rad to 2.68 rad is -0.8 rad.
            assert omega == pytest.approx(-1.0)
            assert cut
        theta += 0.05 * omega
    assert math.remainder(theta - math.atan2(0.5, -1.0), math.tau) == pytest.approx(0.0, abs=1e-3)


def test_heading_forgets_a_stale_error() -> None:
    state = HeadingState()
    turn(state, 0.0, ORIGIN, 0.0, np.array((1.0, 0.0)), 1.0, 1.0, 10.0)
    omega, _ = turn(state, 0.1, ORIGIN, -0.1, np.array((1.0, 0.0)), 1.0, 1.0, 10.0)
    assert omega == pytest.approx(0.1 + 1.0)
    omega, _ = turn(state, 0.7, ORIGIN, -0.2, np.array((1.0, 0.0)), 1.0, 1.0, 10.0)
    assert omega == pytest.approx(0.2)


PATH = np.column_stack([np.arange(0, 6.01, 0.05), np.zeros(121)])
FIELD = Field.build(PATH, np.full(121, 0.5))


@given(st.floats(1, 5), st.floats(0.1, 0.6), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_barrier_in_a_straight_corridor(x: float, y: float, ux: float, uy: float) -> None:
    u, limited = guard(FIELD, np.array((x, y)), np.array((ux, uy)), 2.0, 0.02)
    allowed = max(2.0 * (0.5 - y - 0.02), -math.hypot(ux, uy))
    assert u == pytest.approx((ux, min(uy, allowed)), abs=1e-6)
    assert limited == (uy > allowed) or abs(uy - allowed) < 1e-9


def test_barrier_keeps_a_robot_inside_that_drives_at_the_edge() -> None:
    r = np.array((1.0, 0.1))
    for _ in range(400):
        u, _ = guard(FIELD, r, np.array((0.05, 0.3)), 2.0, 0.02)
        r = r + 0.05 * u
    assert FIELD.value(*r) == pytest.approx(0.02, abs=2e-3)


def test_barrier_lets_a_robot_through_where_there_is_less_than_the_margin() -> None:
    field = Field.build(PATH, np.full(121, 0.03))
    r, u = np.array((2.0, 0.012)), np.array((0.3, 0.0))
    assert guard(field, r, u, 2.0, 0.05, room=0.03)[0] == pytest.approx((0.3, 0.0), abs=1e-2)
    assert guard(field, r, u, 2.0, 0.05)[0] == pytest.approx((0.3, -0.064), abs=1e-2)
