import numpy as np
import pytest

from services.corridor.corridor import LEAD_IN_MARGIN, build
from services.corridor.shortest_path import GoalBlocked, NoPath
from services.geometry.field import depth

ZERO = np.zeros(2)
D_R, D_O = 0.46, 0.3


def hall(ny: int = 60, nx: int = 120) -> np.ndarray:
    cells = np.zeros((ny, nx), np.uint8)
    cells[0] = cells[-1] = 100
    cells[:, 0] = cells[:, -1] = 100
    return cells


def test_the_corridor_of_a_straight_lane() -> None:
    # A lane between walls at y = 0.05 and y = 2.95 m: clearance 1.45 in its middle.
    r, o, g = (np.array(p) for p in ((1.6, 1.5), (2.2, 1.5), (4.5, 1.5)))
    found = build(hall(), 0.05, ZERO, r, o, g, D_R, D_O)
    assert found.start == 0
    assert (found.path[0] == o).all()
    assert (found.path[-1] == g).all()
    assert found.path[:, 1] == pytest.approx(1.5, abs=1e-6)
    assert found.clearance == pytest.approx(np.minimum(1.45, 5.95 - found.path[:, 0]), abs=1e-6)
    assert found.width_push == pytest.approx(found.clearance - 0.23)
    assert found.width_object == pytest.approx(found.clearance - 0.23 - 0.38)


def test_clearances_are_capped() -> None:
    r, o, g = (np.array(p) for p in ((1.6, 1.5), (2.2, 1.5), (4.5, 1.5)))
    found = build(hall(), 0.05, ZERO, r, o, g, D_R, D_O, cap=0.8)
    assert found.clearance == pytest.approx(0.8)


def test_the_object_and_the_robot_on_the_map_are_no_obstacles() -> None:
    cells = hall()
    cells[28:32, 42:46] = 100
    cells[29:31, 29:34] = 100
    r, o, g = (np.array(p) for p in ((1.6, 1.5), (2.2, 1.5), (4.5, 1.5)))
    found = build(cells, 0.05, ZERO, r, o, g, D_R, D_O)
    assert found.clearance.min() > 1.0


def test_a_robot_outside_of_the_discs_gets_a_lead_in() -> None:
    r, o, g = (np.array(p) for p in ((1.0, 1.0), (4.5, 1.5), (5.0, 1.5)))
    found = build(hall(), 0.05, ZERO, r, o, g, D_R, D_O)
    assert found.start > 10
    assert (found.path[0] == r).all()
    assert (found.path[found.start] == o).all()
    assert found.field.value(*r) > LEAD_IN_MARGIN
    on = found.path[found.start :], found.width_push[found.start :]
    assert depth(r[0], r[1], *on) < LEAD_IN_MARGIN
    assert found.width_push.min() > 0
    assert found.closest(r).index >= found.start


def test_a_robot_close_to_a_wall_gets_a_lead_in_too() -> None:
    r, o, g = (np.array(p) for p in ((0.27, 1.0), (2.5, 1.5), (5.0, 1.5)))
    found = build(hall(), 0.05, ZERO, r, o, g, D_R, D_O)
    assert (found.path[0] == r).all()


def test_a_robot_that_cannot_reach_the_object_is_named() -> None:
    cells = hall()
    cells[:, 40] = 100
    r, o, g = (np.array(p) for p in ((1.0, 1.5), (2.8, 1.5), (4.5, 1.5)))
    with pytest.raises(NoPath, match="from the robot to the object"):
        build(cells, 0.05, ZERO, r, o, g, D_R, D_O)


def test_the_larger_diameter_must_fit_at_the_goal() -> None:
    r, o = np.array((1.6, 1.5)), np.array((2.2, 1.5))
    build(hall(), 0.05, ZERO, r, o, np.array((5.65, 1.5)), D_R, D_O)
    with pytest.raises(GoalBlocked, match=r"0\.400 m are needed"):
        build(hall(), 0.05, ZERO, r, o, np.array((5.65, 1.5)), D_R, 0.8)


def test_the_discs_of_the_corridor_are_free_of_obstacles() -> None:
    rng = np.random.default_rng(3)
    cells = hall()
    for _ in range(12):
        i, j = rng.integers(30, 110), rng.integers(0, 55)
        cells[j : j + 6, i : i + 6] = 100
    r, o, g = (np.array(p) for p in ((0.8, 1.2), (1.0, 1.5), (5.3, 1.5)))
    cells[20:40, 10:26] = cells[22:38, 100:115] = 0
    found = build(cells, 0.05, ZERO, r, o, g, D_R, D_O)
    for j, i in zip(*np.nonzero(cells), strict=True):
        # In the corridor (Q, C), whose depth is that of (Q, W_p) + d_r/2, lies no occupied square.
        corner = found.path[np.argmin(np.hypot(*(found.path - 0.05 * (np.array((i, j)) + 0.5)).T))]
        x, y = np.clip(corner, 0.05 * np.array((i, j)), 0.05 * np.array((i + 1, j + 1)))
        assert depth(x, y, found.path, found.width_push) + 0.5 * D_R < 0.002
