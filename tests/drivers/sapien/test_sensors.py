from __future__ import annotations

from math import atan2, cos, hypot, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from drivers.sapien.odometry import DriftingOdometry
from drivers.sapien.rays import cast, outlines
from drivers.sapien.sensors import Laser, RangeRing, laser_scan, ring_ranges
from drivers.sapien.shapes import Box, Disc, Shape

QUIET = 0.0


def inside(shape: Shape, x: NDArray[np.float64], y: NDArray[np.float64], grown: float = 0.0) -> NDArray[np.bool_]:
    dx, dy = x - shape.x, y - shape.y
    if isinstance(shape, Disc):
        return np.hypot(dx, dy) < shape.radius + grown
    along = cos(shape.yaw) * dx + sin(shape.yaw) * dy
    across = -sin(shape.yaw) * dx + cos(shape.yaw) * dy
    return (np.abs(along) < shape.length / 2 + grown) & (np.abs(across) < shape.width / 2 + grown)


def marched(shapes: list[Shape], x: float, y: float, bearing: float, maximum: float) -> float:
    """Walk along the ray in steps of 1 mm until inside something."""
    way = np.arange(0.0, maximum, 0.001)
    met = np.any([inside(shape, x + way * cos(bearing), y + way * sin(bearing)) for shape in shapes], axis=0)
    return float(way[met.argmax()]) if met.any() else maximum


place = st.floats(-1, 1)
size = st.floats(0.05, 0.6)
shapes = st.lists(
    st.builds(Disc, x=place, y=place, radius=size)
    | st.builds(Box, x=place, y=place, yaw=st.floats(-3, 3), length=size, width=size),
    min_size=1,
    max_size=3,
)


@settings(max_examples=60, deadline=None)
@given(shapes, place, place)
def test_ray_agrees_with_walking_along_it(seen: list[Shape], x: float, y: float) -> None:
    outline = outlines(tuple(seen))
    fan = np.linspace(-pi, pi, 25)
    found = cast(np.tile([x, y], (25, 1)), fan, 1.5, outline.boxes, outline.discs)
    for way, bearing in zip(found.tolist(), fan.tolist(), strict=True):
        walked = marched(seen, x, y, bearing, 1.5)
        if abs(way - walked) > 0.002:
            # A ray that clips a corner or grazes a rim may pass between two steps: then it touches something there.
            assert way < walked
            at = np.array([x + way * cos(bearing)]), np.array([y + way * sin(bearing)])
            assert any(inside(shape, *at, 1e-6).all() for shape in seen)


def test_ray_meets_box_and_disc_at_the_closed_form() -> None:
    seen = outlines((Box(x=2.0, y=0.0, yaw=pi / 4, length=1.0, width=1.0), Disc(x=0.0, y=3.0, radius=0.5)))
    bearing = np.array([0.0, pi / 2, pi, atan2(0.25, 1.0)])
    found = cast(np.zeros((4, 2)), bearing, 10.0, seen.boxes, seen.discs)
    # The turned box shows its corner at 2 - sqrt(1/2); off axis the face x + y = 2 - sqrt(1/2) ... with slope 1/4.
    corner = 2 - sqrt(0.5)
    face = corner / (1 - 0.25) * hypot(1.0, 0.25)
    assert found == pytest.approx([corner, 2.5, 10.0, face])


def test_ray_from_inside_a_shape_gets_nowhere() -> None:
    seen = outlines((Box(length=1.0, width=1.0),))
    assert cast(np.zeros((1, 2)), np.zeros(1), 5.0, seen.boxes, seen.discs)[0] == 0.0
    seen = outlines((Disc(radius=1.0),))
    assert cast(np.zeros((1, 2)), np.zeros(1), 5.0, seen.boxes, seen.discs)[0] == 0.0


def test_laser_sees_the_walls_of_a_square_room(generator: np.random.Generator) -> None:
    walls = outlines(
        tuple(Box(x=3.5 * cos(a), y=3.5 * sin(a), yaw=a, length=1.0, width=9.0) for a in (0, pi / 2, pi, -pi / 2))
    )
    laser = Laser(x=0.1, y=0.05, step=1e-9)
    scan = laser_scan(laser, np.array([0.5, -0.2, 0.3]), walls, QUIET, generator)
    x, y = 0.5 + 0.1 * cos(0.3) - 0.05 * sin(0.3), -0.2 + 0.1 * sin(0.3) + 0.05 * cos(0.3)
    assert scan.shape == (271,)
    for index in range(271):
        bearing = 0.3 + radians(-135 + index)
        to_x = (3 - x) / cos(bearing) if cos(bearing) > 0 else (-3 - x) / cos(bearing)
        to_y = (3 - y) / sin(bearing) if sin(bearing) > 0 else (-3 - y) / sin(bearing)
        assert scan[index] == pytest.approx(min(to_x, to_y), abs=2e-9)


def test_laser_sees_the_object_and_says_maximum_where_nothing_is(generator: np.random.Generator) -> None:
    laser = Laser(x=0.0)
    thing = outlines((Disc(radius=0.1),), (1.0, 0.0, 0.7))
    scan = laser_scan(laser, np.zeros(3), thing, 0.02, generator)
    # Half angle of the disc: asin(0.1 / 1) = 5.7 degrees, so beams -5..5.
    assert np.flatnonzero(scan < laser.maximum).tolist() == list(range(130, 141))
    assert scan[135] == pytest.approx(0.9, abs=0.1)


def test_laser_noise_has_the_spread_asked_for_and_stays_in_range(generator: np.random.Generator) -> None:
    wall = outlines((Box(x=2.5, length=1.0, width=100.0),))
    laser = Laser(x=0.0, field=1e-6, beams=4000)
    scan = laser_scan(laser, np.zeros(3), wall, 0.01, generator)
    assert scan.std() == pytest.approx(0.01, rel=0.05)
    assert scan.mean() == pytest.approx(2.0, abs=0.001)
    close = laser_scan(laser, np.array([1.99, 0.0, 0.0]), wall, 0.01, generator)
    assert (close >= laser.minimum).all()


def test_laser_reads_whole_steps(generator: np.random.Generator) -> None:
    wall = outlines((Box(x=2.5, length=1.0, width=100.0),))
    scan = laser_scan(Laser(field=0.5, step=0.01), np.zeros(3), wall, 0.02, generator)
    exact = laser_scan(Laser(field=0.5, step=1e-9), np.zeros(3), wall, QUIET, generator)
    assert np.abs(100 * scan - np.rint(100 * scan)).max() < 1e-9
    assert np.abs(scan - exact).max() < 0.1
    assert len(np.unique(scan)) > 5


def test_ring_sees_around_counter_clockwise(generator: np.random.Generator) -> None:
    ring = RangeRing(cone=0.0)
    theta = 0.4
    for index in range(9):
        angle = theta + index * radians(40)
        post = outlines((Disc(x=1.0 + 0.45 * cos(angle), y=2.0 + 0.45 * sin(angle), radius=0.03),))
        read = ring_ranges(ring, np.array([1.0, 2.0, theta]), post, QUIET, generator)
        expected = np.full(9, 0.41)
        expected[index] = 0.45 - 0.225 - 0.03
        assert read == pytest.approx(expected)
    assert ring.bearings()[[1, 8]] == pytest.approx([radians(40), radians(-40)])


def test_ring_cone_sees_beside_its_axis(generator: np.random.Generator) -> None:
    beside = outlines((Disc(x=0.225 + 0.3 * cos(0.05), y=0.3 * sin(0.05), radius=0.005),))
    assert ring_ranges(RangeRing(cone=0.0), np.zeros(3), beside, QUIET, generator)[0] == 0.41
    assert ring_ranges(RangeRing(cone=0.05), np.zeros(3), beside, QUIET, generator)[0] == pytest.approx(0.295)


def test_ring_reads_its_minimum_when_touching(generator: np.random.Generator) -> None:
    wall = outlines((Box(x=0.73, length=1.0, width=3.0),))
    assert ring_ranges(RangeRing(), np.zeros(3), wall, QUIET, generator)[0] == 0.04


def driven(seed: int, steps: int, distance: float, heading: float) -> np.ndarray:
    generator = np.random.default_rng(seed)
    odometry = DriftingOdometry(distance, 0.0, heading, np.array([1.0, 2.0, 0.5]))
    for k in range(1, steps + 1):
        way = 4.0 * k / steps
        pose = np.array([1.0 + way * cos(0.5), 2.0 + way * sin(0.5), 0.5])
        reading = odometry.read(pose, generator)
    return reading


def test_odometry_without_noise_is_the_motion_from_its_start(generator: np.random.Generator) -> None:
    assert driven(0, 50, 0.0, 0.0) == pytest.approx([4.0, 0.0, 0.0], abs=1e-12)
    odometry = DriftingOdometry(0.0, 0.0, 0.0, np.array([0.0, 0.0, 3.0]))
    reading = odometry.read(np.array([0.0, 0.0, -3.0]), generator)
    assert reading[2] == pytest.approx(2 * pi - 6.0)


@pytest.mark.parametrize("steps", [8, 80])
def test_odometry_drift_grows_with_the_way_not_with_the_readings(steps: int) -> None:
    ends = np.array([driven(seed, steps, 0.02, 0.0) for seed in range(400)])
    assert (ends[:, 0] - 4.0).std() == pytest.approx(0.02 * sqrt(4.0), rel=0.15)
    assert ends[:, 1].std() == pytest.approx(0.02 * sqrt(4.0), rel=0.15)
    turned = np.array([driven(seed, steps, 0.0, 0.01)[2] for seed in range(400)])
    assert turned.std() == pytest.approx(0.01 * sqrt(4.0), rel=0.15)


def test_odometry_does_not_drift_at_rest(generator: np.random.Generator) -> None:
    odometry = DriftingOdometry(0.1, 0.1, 0.1, np.zeros(3))
    moved = odometry.read(np.array([0.5, 0.2, 0.3]), generator)
    for _ in range(100):
        assert (odometry.read(np.array([0.5, 0.2, 0.3]), generator) == moved).all()


def test_odometry_goes_on_from_its_state() -> None:
    one, two = (DriftingOdometry(0.1, 0.1, 0.1, np.zeros(3)) for _ in range(2))
    one.read(np.array([1.0, 0.0, 0.1]), np.random.default_rng(0))
    two.state = one.state
    at = np.array([1.5, 0.2, 0.3])
    assert (one.read(at, np.random.default_rng(1)) == two.read(at, np.random.default_rng(1))).all()
    assert one.state == two.state
