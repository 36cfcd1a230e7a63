"""Friction against exact limit surfaces and closed forms of stopping."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from drivers.sapien.friction import GRAVITY, Floor, resist, wrench
from drivers.sapien.shapes import Box, Disc, Shape
from drivers.sapien.support import area, loads
from tests.drivers.sapien.limit_surface import box_distance, box_spin, disc_curve, disc_spin

RADIUS, LENGTH, WIDTH = 0.15, 0.3, 0.2
SUBSTEP = 0.0025


def standing(shape: Shape, weight: float = 1.0) -> Floor:
    """The floor under a uniform shape of `weight` N at friction 1."""
    covered = area((shape,))
    middle = covered.centroid()
    load = weight * loads(covered, middle)
    axis = np.tile([1.0, 0.0], (len(load), 1))
    return Floor(covered.position - middle, np.stack([load, load], axis=1), axis, True)


def wheels(along: float, across: float, weight: float) -> Floor:
    """The floor under four wheels that roll along x."""
    position = np.array([[0.13, 0.1], [0.13, -0.1], [-0.13, 0.1], [-0.13, -0.1]])
    limit = np.tile([along * weight / 4, across * weight / 4], (4, 1))
    return Floor(position, limit, np.tile([1.0, 0.0], (4, 1)), False)


class Body:
    """A body with friction and nothing else, moved by plain Euler steps."""

    def __init__(self, floor: Floor, mass: float, inertia: float, twist: NDArray[np.float64], yaw: float = 0.0):
        self.floor, self.mass, self.inertia = floor, mass, inertia
        self.velocity = np.array([twist[0], twist[1], 0], np.float32)
        self.spin = np.array([0, 0, twist[2]], np.float32)
        self.pose = np.array([0.0, 0.0, yaw])

    def step(self) -> None:
        on, half = self.floor, self.pose[2] / 2
        quaternion = np.array([cos(half), 0, 0, sin(half)], np.float32)
        resist(
            quaternion, self.velocity, self.spin, self.mass, self.inertia, SUBSTEP,
            on.position, on.limit, on.axis, on.isotropic,
        )  # fmt: skip
        self.pose += SUBSTEP * np.array([self.velocity[0], self.velocity[1], self.spin[2]])

    def stopping_time(self) -> float:
        count = 0
        while self.velocity.any() or self.spin.any():
            self.step()
            count += 1
            assert count < 10_000, "does not come to rest"
        return count * SUBSTEP


def acting(floor: Floor, twist: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force and torque that `resist` really takes from a body too heavy to be slowed: (3,), N and N m."""
    heavy = 1000.0
    body = Body(floor, heavy, heavy, twist)
    # float32 velocities hold a small loss badly: let the loss be large and the body move fast.
    duration = 1e3
    body.velocity *= 1e3
    body.spin *= 1e3
    before = np.array([*body.velocity[:2], body.spin[2]], np.float64)
    quaternion = np.array([1, 0, 0, 0], np.float32)
    resist(
        quaternion, body.velocity, body.spin, heavy, heavy, duration,
        floor.position, floor.limit, floor.axis, floor.isotropic,
    )  # fmt: skip
    return heavy * (np.array([*body.velocity[:2], body.spin[2]], np.float64) - before) / duration


@pytest.mark.parametrize(
    ("shape", "exact"),
    [
        (Disc(radius=RADIUS), disc_spin(RADIUS)),
        (Box(length=LENGTH, width=WIDTH), box_spin(LENGTH, WIDTH)),
        (Box(length=0.1, width=0.1), box_spin(0.1, 0.1)),
        (Box(length=0.3, width=0.05), box_spin(0.3, 0.05)),
    ],
)
def test_pure_spin_torque_is_that_of_uniform_pressure(shape: Shape, exact: float) -> None:
    torque = -acting(standing(shape), np.array([0.0, 0.0, 1.0]))
    assert torque[2] == pytest.approx(exact, rel=0.01)
    assert torque[:2] == pytest.approx([0.0, 0.0], abs=1e-3)


def test_pure_spin_of_a_box_closed_form_agrees_with_quadrature() -> None:
    assert box_spin(LENGTH, WIDTH) == pytest.approx(box_distance(LENGTH, WIDTH, 0.0, 0.0), rel=1e-6)


def radial(curve: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far `points` lie outside `curve`, both (K, 2), as a share of the radius at the same angle."""
    angle = np.arctan2(curve[:, 1], curve[:, 0])
    order = np.argsort(angle)
    reach = np.interp(np.arctan2(points[:, 1], points[:, 0]), angle[order], np.hypot(*curve.T)[order])
    return np.hypot(*points.T) / reach - 1


RATIOS = np.concatenate([np.linspace(0, 2, 81), np.geomspace(2.05, 50, 30)])


def disc_points(direction: float) -> NDArray[np.float64]:
    """Our disc in the normalised plane: force / (mu N), torque / (2/3 R mu N)."""
    floor = standing(Disc(radius=RADIUS))
    twists = [[d * RADIUS * cos(direction), d * RADIUS * sin(direction), 1.0] for d in RATIOS]
    found = np.array(
        [acting(floor, np.array(twist) * min(1.0, 1 / d)) for twist, d in zip(twists, RATIOS + 1e-9, strict=True)]
    )
    return np.stack([np.hypot(found[:, 0], found[:, 1]), -found[:, 2] / disc_spin(RADIUS)], axis=1)


@pytest.mark.parametrize("direction", [0.0, 0.1, 0.4, pi / 12])
def test_mixed_motion_of_a_disc_lies_on_the_exact_limit_surface(direction: float) -> None:
    off = radial(disc_curve(RADIUS, RATIOS), disc_points(direction))
    assert np.abs(off).max() < 0.005


def test_exact_disc_is_not_an_ellipsoid_and_ours_follows_the_exact_one() -> None:
    """Uniform pressure lies up to 6.6 % inside the ellipsoid through its axes, 3.4 % on average over the angle.

    So a model within 3 % of that ellipsoid is not within 3 % of uniform pressure. Ours follows the latter.
    """
    exact = np.hypot(*disc_curve(RADIUS, RATIOS).T) - 1
    assert exact.min() == pytest.approx(-0.0657, abs=0.001)
    assert exact.max() < 1e-4
    ours = np.hypot(*disc_points(0.0).T) - 1
    assert ours.min() == pytest.approx(-0.0657, abs=0.004)
    assert ours.max() < 0.004
    angle = np.arctan2(*disc_points(0.0).T[::-1])
    order = np.argsort(angle)
    assert np.trapezoid(np.abs(ours[order]), angle[order]) / (pi / 2) == pytest.approx(0.034, abs=0.002)


def test_no_scaled_ellipsoid_is_within_three_percent_of_the_exact_disc() -> None:
    curve = disc_curve(RADIUS, RATIOS)
    scales = np.linspace(0.93, 1.0, 29)
    worst = min(np.abs(np.hypot(curve[:, 0] / a, curve[:, 1] / b) - 1).max() for a in scales for b in scales)
    assert worst == pytest.approx(0.034, abs=0.001)


@pytest.mark.parametrize("direction", [0.0, 0.7, pi / 2])
def test_mixed_motion_of_a_box_takes_the_exact_power(direction: float) -> None:
    """Power is the support function of the limit surface: (f . v + torque omega) for turning about a point."""
    floor = standing(Box(length=LENGTH, width=WIDTH))
    for d in (0.03, 0.08, 0.15, 0.3, 1.0):
        # Turning about (d cos, d sin) with omega = 1: the middle moves at right angles to it.
        twist = np.array([d * sin(direction), -d * cos(direction), 1.0])
        power = -acting(floor, twist) @ twist
        assert power == pytest.approx(box_distance(LENGTH, WIDTH, d, direction), rel=0.01)


def test_mixed_motion_of_a_box_lies_on_the_exact_limit_surface() -> None:
    floor = standing(Box(length=LENGTH, width=WIDTH))
    spin = box_spin(LENGTH, WIDTH)
    distances = np.array([0.005, 0.015, 0.03, 0.045, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2, 0.3, 0.6, 1.5])
    h = 1e-4
    exact, ours = [], []
    for d in distances:
        slope = (box_distance(LENGTH, WIDTH, d + h, 0.0) - box_distance(LENGTH, WIDTH, d - h, 0.0)) / (2 * h)
        exact.append((slope, (box_distance(LENGTH, WIDTH, d, 0.0) - d * slope) / spin))
        found = acting(floor, np.array([0.0, -d, 1.0]))
        ours.append((np.hypot(found[0], found[1]), -found[2] / spin))
    assert np.abs(radial(np.array(exact), np.array(ours))[1:-1]).max() < 0.03


@pytest.mark.parametrize("direction", np.linspace(0, 2 * pi, 7))
def test_sliding_disc_stops_as_coulomb_says(direction: float) -> None:
    mass, speed = 2.0, 0.8
    floor = standing(Disc(radius=RADIUS), 0.4 * mass * GRAVITY)
    body = Body(floor, mass, mass * RADIUS**2 / 2, np.array([speed * cos(direction), speed * sin(direction), 0]))
    time = body.stopping_time()
    assert time == pytest.approx(speed / (0.4 * GRAVITY), rel=0.03)
    assert np.hypot(*body.pose[:2]) == pytest.approx(speed**2 / (2 * 0.4 * GRAVITY), rel=0.03)
    across = -body.pose[0] * sin(direction) + body.pose[1] * cos(direction)
    assert across == pytest.approx(0.0, abs=1e-4)
    assert body.pose[2] == pytest.approx(0.0, abs=1e-3)


def test_spinning_disc_stops_as_coulomb_says() -> None:
    mass, spin = 2.0, 12.0
    floor = standing(Disc(radius=RADIUS), 0.4 * mass * GRAVITY)
    body = Body(floor, mass, mass * RADIUS**2 / 2, np.array([0.0, 0.0, spin]))
    slowing = 4 / 3 * 0.4 * GRAVITY / RADIUS
    assert body.stopping_time() == pytest.approx(spin / slowing, rel=0.03)
    assert body.pose[2] == pytest.approx(spin**2 / (2 * slowing), rel=0.03)
    assert body.pose[:2] == pytest.approx([0.0, 0.0], abs=1e-4)


def test_sliding_and_spinning_disc_ends_both_at_once() -> None:
    """Known of uniform discs: whatever the start, sliding and spinning end at the same moment."""
    mass = 2.0
    floor = standing(Disc(radius=RADIUS), 0.4 * mass * GRAVITY)
    body = Body(floor, mass, mass * RADIUS**2 / 2, np.array([1.0, 0.0, 3.0]))
    slid, spun = 0, 0
    for count in range(1000):
        body.step()
        slid = count if np.hypot(*body.velocity[:2]) > 0.01 else slid
        spun = count if abs(body.spin[2]) > 0.01 / RADIUS else spun
    assert abs(slid - spun) * SUBSTEP < 0.02


def test_body_at_rest_stays_to_the_bit() -> None:
    body = Body(standing(Disc(radius=RADIUS), 8.0), 2.0, 0.02, np.array([0.5, 0.3, -2.0]))
    body.stopping_time()
    rest = body.pose.copy()
    for _ in range(1000):
        body.step()
    assert (body.pose == rest).all()


def test_push_below_the_limit_moves_nothing() -> None:
    """A force of 90 % of the limit, as velocity gained in each substep, is taken away whole."""
    mass = 2.0
    floor = standing(Disc(radius=RADIUS), 0.4 * mass * GRAVITY)
    body = Body(floor, mass, mass * RADIUS**2 / 2, np.zeros(3))
    for _ in range(400):
        body.velocity[0] += 0.9 * 0.4 * GRAVITY * SUBSTEP
        body.step()
    assert np.abs(body.pose).max() < 2e-5


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_wheels_roll_along_and_grip_across(yaw: float) -> None:
    mass, along, across = 1.5, 0.04, 0.5
    floor = wheels(along, across, mass * GRAVITY)
    for turn, mu in ((0.0, along), (pi / 2, across)):
        heading = yaw + turn
        body = Body(floor, mass, 0.03, np.array([0.4 * cos(heading), 0.4 * sin(heading), 0.0]), yaw)
        assert body.stopping_time() == pytest.approx(0.4 / (mu * GRAVITY), rel=0.03)


def test_wheels_turn_a_slanting_slide_into_rolling() -> None:
    floor = wheels(0.0, 0.5, 1.5 * GRAVITY)
    body = Body(floor, 1.5, 0.03, np.array([0.4, 0.3, 0.0]))
    for _ in range(200):
        body.step()
    assert body.velocity[0] == pytest.approx(0.4, abs=1e-6)
    assert body.velocity[1] == pytest.approx(0.0, abs=1e-9)


twists = st.tuples(*[st.floats(-2, 2, width=32)] * 3)


@given(twists, st.booleans(), st.floats(-3, 3))
def test_friction_never_gives_energy(twist: tuple[float, float, float], rolling: bool, yaw: float) -> None:
    mass, inertia = 1.5, 0.03
    floor = wheels(0.03, 0.5, 15.0) if rolling else standing(Box(length=LENGTH, width=WIDTH), 6.0)
    body = Body(floor, mass, inertia, np.array(twist), yaw)
    before = mass * float(body.velocity @ body.velocity) + inertia * float(body.spin @ body.spin)
    body.step()
    after = mass * float(body.velocity @ body.velocity) + inertia * float(body.spin @ body.spin)
    assert after <= before * (1 + 1e-6) + 1e-12


@given(twists, st.floats(-3, 3))
def test_resist_takes_the_steady_wrench_when_sliding_fast(twist: tuple[float, float, float], yaw: float) -> None:
    """The implicit answer equals the explicit one as the substep's loss gets small against the motion."""
    floor = standing(Disc(radius=RADIUS), 1e-3)
    if np.hypot(twist[0], twist[1]) < 0.5 or abs(twist[2]) > 1:
        return
    body = Body(floor, 1.0, 0.02, np.array(twist), 0.0)
    steady = wrench(floor, np.array([body.velocity[0], body.velocity[1], body.spin[2]], np.float64))
    duration = 10.0
    before = np.array([*body.velocity[:2], body.spin[2]], np.float64)
    one = np.array([1, 0, 0, 0], np.float32)
    resist(one, body.velocity, body.spin, 1.0, 0.02, duration, floor.position, floor.limit, floor.axis, True)
    lost = (np.array([*body.velocity[:2], body.spin[2]], np.float64) - before) * [1.0, 1.0, 0.02] / duration
    assert lost == pytest.approx(steady, abs=4e-5)
