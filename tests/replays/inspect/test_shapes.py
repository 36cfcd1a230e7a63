from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import vonmises

from replays.inspect import shapes

angles = st.floats(-math.pi, math.pi)
metres = st.floats(-20.0, 20.0)


def test_depth_in_a_straight_corridor_is_half_width_less_the_way_from_the_middle() -> None:
    path = np.column_stack([np.linspace(0.0, 10.0, 1001), np.zeros(1001)])
    points = np.array([(2.0, 0.0), (3.0, 0.4), (5.0, -0.7), (8.0, 1.5)])
    depth = shapes.corridor_depth(points, path, np.full(1001, 0.7))
    assert depth == pytest.approx([0.7, 0.3, 0.0, -0.8], abs=1e-9)


@given(st.lists(st.tuples(metres, metres, st.floats(-0.5, 3.0)), min_size=1, max_size=12), metres, metres)
def test_depth_is_the_largest_over_the_path(nodes: list[tuple[float, float, float]], x: float, y: float) -> None:
    path = np.array([(qx, qy) for qx, qy, _ in nodes])
    width = np.array([w for _, _, w in nodes])
    expected = max(w - math.dist((x, y), (qx, qy)) for qx, qy, w in nodes)
    assert shapes.corridor_depth(np.array([[x, y]]), path, width)[0] == pytest.approx(expected, abs=1e-9)


@given(angles, angles, st.floats(0.0, 60.0))
def test_activation_is_the_von_mises_density_over_its_peak(alpha: float, mu: float, kappa: float) -> None:
    expected = 1.0 if kappa == 0.0 else vonmises.pdf(alpha, kappa, loc=mu) / vonmises.pdf(mu, kappa, loc=mu)
    got = shapes.psi_push(np.array([alpha]), np.array([mu]), np.array([kappa]))[0]
    assert got == pytest.approx(expected, rel=1e-9, abs=1e-12)


@given(angles, angles)
def test_the_lobe_points_to_where_a_robot_pushes_best(theta_ot: float, mu: float) -> None:
    o = np.array([[1.0, -2.0]])
    t = o + 3.0 * np.array([[math.cos(theta_ot), math.sin(theta_ot)]])
    lobe = shapes.activation_lobe(o, t, np.array([mu]), np.array([8.0]), np.array([0.2]), reach=0.4, count=720)[0]
    away = np.hypot(*(lobe - o).T)
    best = (lobe - o)[np.argmax(away)] / away.max()
    # A robot at bearing beta pushes along r-o; the push-line then has orientation mu in its frame.
    theta_ro = math.atan2(-best[1], -best[0])
    assert math.remainder(theta_ot - theta_ro - mu, 2.0 * math.pi) == pytest.approx(0.0, abs=2.0 * math.pi / 720)
    assert away.max() == pytest.approx(0.6, abs=1e-3)
    assert away.min() >= 0.2 - 1e-12


def test_a_straight_ribbon_covers_its_rectangle() -> None:
    path = np.column_stack([np.linspace(0.0, 4.0, 9), np.zeros(9)])
    corners, triangles = shapes.ribbon(path, np.full(9, 0.5))
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    areas = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert areas.sum() == pytest.approx(4.0)


@given(st.lists(st.tuples(metres, metres, st.floats(-1.0, 2.0)), min_size=2, max_size=10))
def test_a_ribbon_stays_within_its_width(nodes: list[tuple[float, float, float]]) -> None:
    path = np.array([(x, y) for x, y, _ in nodes])
    width = np.array([w for _, _, w in nodes])
    corners, _ = shapes.ribbon(path, width)
    away = np.hypot(*(corners - np.repeat(path, 2, axis=0)).T)
    assert np.all(away <= np.repeat(np.maximum(width, 0.0), 2) + 1e-9)


def test_a_path_of_one_point_has_no_ribbon() -> None:
    corners, triangles = shapes.ribbon(np.zeros((1, 2)), np.ones(1))
    assert len(corners) == 0
    assert len(triangles) == 0


@given(st.lists(st.tuples(metres, metres, st.floats(-1.0, 2.0)), min_size=1, max_size=10))
def test_a_band_stays_in_its_corridor(nodes: list[tuple[float, float, float]]) -> None:
    path = np.array([(x, y) for x, y, _ in nodes])
    width = np.array([w for _, _, w in nodes])
    corners, triangles = shapes.band(path, width)
    reach = np.maximum(width, 0.0)
    depth = [max(w - math.dist(c, q) for q, w in zip(path, reach, strict=True)) for c in corners]
    assert min(depth, default=0.0) >= -1e-9
    assert triangles.max(initial=0) < max(len(corners), 1)


def test_a_band_has_round_ends() -> None:
    path = np.column_stack([np.linspace(0.0, 4.0, 41), np.zeros(41)])
    corners, triangles = shapes.band(path, np.full(41, 0.5))
    finder = [corners[triangles[:, k]] for k in range(3)]

    def covered(x: float, y: float) -> bool:
        a, b, c = ((p - (x, y)) for p in finder)
        turns = np.stack([u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] for u, v in ((a, b), (b, c), (c, a))])
        return bool((np.all(turns >= 0.0, axis=0) | np.all(turns <= 0.0, axis=0)).any())

    inside = [(-0.48, 0.0), (4.48, 0.0), (-0.33, 0.33), (4.33, -0.33), (2.0, 0.49)]
    outside = [(-0.52, 0.0), (4.52, 0.0), (-0.38, 0.38), (2.0, 0.51)]
    assert [covered(*point) for point in inside + outside] == [True] * 5 + [False] * 4


def test_the_fan_covers_the_disc() -> None:
    corners, triangles = shapes.fan(96)
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert areas.sum() == pytest.approx(math.pi, rel=1e-2)


@given(st.lists(st.tuples(metres, metres, angles), min_size=1, max_size=5))
def test_turning_is_multiplication_by_a_unit_complex_number(rows: list[tuple[float, float, float]]) -> None:
    vectors, theta = np.array([r[:2] for r in rows]), np.array([r[2] for r in rows])
    expected = (vectors[:, 0] + 1j * vectors[:, 1]) * np.exp(1j * theta)
    got = shapes.rotated(vectors, theta)
    assert got[:, 0] + 1j * got[:, 1] == pytest.approx(expected, abs=1e-9)


@given(st.lists(angles, min_size=1, max_size=5))
def test_quaternions_turn_about_the_vertical(theta: list[float]) -> None:
    expected = Rotation.from_euler("z", np.array(theta)[:, None]).as_matrix()
    assert Rotation.from_quat(shapes.quaternions(np.array(theta))).as_matrix() == pytest.approx(expected, abs=1e-12)


def test_poses_between_two_turn_the_short_way() -> None:
    wall_clock = 1_800_000_000_000_000_000
    known = np.array([(0.0, 1.0, 3.1), (2.0, 3.0, -3.1)])
    times = np.array([wall_clock, wall_clock + 1000], np.int64)
    middle = shapes.pose_at(np.array([wall_clock + 500]), times, known)[0]
    assert middle[:2] == pytest.approx([1.0, 2.0])
    assert math.cos(middle[2]) == pytest.approx(-1.0)
