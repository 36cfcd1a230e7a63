import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import vonmises

from runtime.messages import Pose2, RobotPose, Twist2, VelocityCommand
from services.controller import centroid, dipole, push_law
from services.controller.activation import PRIOR_KAPPA, PRIOR_MU, activations
from services.controller.barrier import guard
from services.controller.heading import HeadingState, turn
from services.controller.push_law import Behaviour, Gains, non_adaptive, reference
from services.geometry.angles import DegenerateDirection
from services.geometry.corridor import CorridorGeometry
from services.learner.von_mises import estimate, prior
from services.predictive.estimate import Track
from services.predictive.model import RAMP_Y, RX, RY
from services.predictive.situation import Lane

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
BASE = np.array([0.4, 0.1, 0.23])
TICK = 50_000_000


def straight(half_width: float) -> tuple[CorridorGeometry, Lane]:
    """A straight pushing corridor of this half width, and its lane."""
    corridor = CorridorGeometry.of(PATH, 0, np.full(len(PATH), half_width + 0.23), 0.46, 0.3)
    return corridor, Lane.of(corridor)


def tracked(x: float, y: float, ux: float = 0.0, uy: float = 0.0) -> Track:
    """A robot seen at (x, y) at 1 s, that was sent (ux, uy) before."""
    track = Track()
    track.robot_seen(RobotPose(stamp=20 * TICK, pose=Pose2(x=x, y=y)))
    track.commanded(VelocityCommand(stamp=19 * TICK, twist=Twist2(vx=ux, vy=uy)), 0.0)
    return track


def test_the_barrier_changes_nothing_in_the_middle() -> None:
    wish = np.array((0.1, 0.3))
    found, limited = guard(*straight(0.5), tracked(2.0, 0.05, 0.1, 0.3), wish, 21 * TICK, BASE, 0.02)
    assert (found.tolist(), limited) == (wish.tolist(), False)


def test_the_barrier_stops_what_leads_out_and_leaves_what_leads_along() -> None:
    found, limited = guard(*straight(0.5), tracked(2.0, 0.478), np.array((0.2, 0.3)), 21 * TICK, BASE, 0.02)
    assert found == pytest.approx((0.2, 0.0), abs=0.02)
    assert limited


def test_a_robot_seen_late_is_carried_on_with_what_it_was_sent() -> None:
    track = tracked(1.0, 0.5, 0.2, -0.1)
    found = track.robot_at_present(22 * TICK, BASE)
    assert found[[RX, RY]] == pytest.approx((1.0 + 0.2 * 0.1, 0.5 - 0.1 * 0.1))  # it goes on as it went
    track.commanded(VelocityCommand(stamp=21 * TICK, twist=Twist2(vx=0.2, vy=0.3)), 0.0)
    found = track.robot_at_present(23 * TICK, BASE)
    assert found[RAMP_Y] == pytest.approx(-0.1 + 0.4 * 0.1)  # the ramp, for the 0.1 s since the new command
    nowhere = Track(robots=[(TICK, 3.0, 4.0, 0.0)])
    assert nowhere.robot_at_present(3 * TICK, BASE)[[RX, RY]].tolist() == [3.0, 4.0]


@settings(max_examples=20)
@given(st.lists(st.tuples(st.floats(-0.1, 0.3), st.floats(-0.3, 0.3)), min_size=3, max_size=6))
def test_a_base_seen_late_stays_inside_whatever_its_controller_wishes(wishes: list[tuple[float, float]]) -> None:
    corridor, lane = straight(0.5)
    track = Track()
    # A base by itself: it ramps with 0.4 m/s^2 to what it was sent, and lags 0.1 s behind that; 1 ms steps.
    place, ramp, speed = np.array((1.0, 0.2)), np.zeros(2), np.zeros(2)
    past: list[np.ndarray] = []
    for tick in range(20 * len(wishes)):
        past.append(place.copy())
        late = max(tick - 2, 0)  # 0.1 s
        track.robot_seen(RobotPose(stamp=(late + 20) * TICK, pose=Pose2(x=past[late][0], y=past[late][1])))
        now = (tick + 20) * TICK
        u, _ = guard(corridor, lane, track, np.array(wishes[tick // 20]), now, BASE, 0.02)
        track.commanded(VelocityCommand(stamp=now, twist=Twist2(vx=u[0], vy=u[1])), 0.0)
        for _ in range(50):
            change = u - ramp
            ramp = ramp + change * min(1.0, 0.4e-3 / max(math.hypot(*change), 1e-12))
            speed = speed + (ramp - speed) * 1e-3 / 0.1
            place = place + 1e-3 * speed
            assert abs(place[1]) < 0.5


def test_the_barrier_lets_a_robot_through_where_there_is_less_than_the_margin() -> None:
    found, _ = guard(*straight(0.03), tracked(2.0, 0.012), np.array((0.3, 0.0)), 21 * TICK, BASE, 0.05)
    assert found == pytest.approx((0.3, 0.0), abs=2e-2)
