"""Maps that end somewhere and have holes, and the corridors through them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.messages import OccupancyGrid, Vector2
from services.corridor.chart import BEYOND, Chart, apart
from services.corridor.clearance import FREE, OCCUPIED, UNKNOWN
from services.corridor.corridor import build
from services.corridor.shortest_path import StartBlocked

RESOLUTION = 0.05
D_R, D_O = 0.45, 0.3


def grid(cells: np.ndarray, x: float = 0.0, y: float = 0.0) -> OccupancyGrid:
    height, width = cells.shape
    origin = Vector2(x=x, y=y)
    return OccupancyGrid(resolution=RESOLUTION, width=width, height=height, origin=origin, cells=cells.tobytes())


def floor(width: float, height: float) -> np.ndarray:
    """Return a free floor of so many m within walls."""
    cells = np.full((round(height / RESOLUTION), round(width / RESOLUTION)), FREE, np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = OCCUPIED
    return cells


def rows(low: float, high: float) -> slice:
    return slice(round(low / RESOLUTION), round(high / RESOLUTION))


@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=5),
    st.floats(-1, 1),
    st.floats(-1, 1),
)
def test_a_chart_reaches_beyond_every_place_and_keeps_what_is_known(
    places: list[tuple[float, float]], x: float, y: float
) -> None:
    cells = floor(1.0, 0.8)
    cells[5, 5] = UNKNOWN
    within = np.array(places)
    chart = Chart.of(grid(cells, x, y), within, unknown_is_free=True)
    assert chart.doubtful is not None
    end = chart.origin + RESOLUTION * np.array(chart.cells.shape[::-1])
    assert (chart.origin <= within.min(axis=0) - BEYOND + 1e-9).all() and (
        end >= within.max(axis=0) + BEYOND - 1e-9
    ).all()
    i, j = np.rint((np.array((x, y)) - chart.origin) / RESOLUTION).astype(int)
    part = (slice(j, j + 16), slice(i, i + 20))
    assert np.array_equal(chart.cells[part] == OCCUPIED, cells == OCCUPIED)
    assert np.array_equal(chart.doubtful[part], cells == UNKNOWN)
    rest = np.ones(chart.cells.shape, bool)
    rest[part] = False
    assert chart.doubtful[rest].all() and (chart.cells[rest] == FREE).all()


def test_where_the_unknown_is_no_way_the_map_stays_as_it_is() -> None:
    cells = floor(1.0, 0.8)
    cells[5, 5] = UNKNOWN
    chart = Chart.of(grid(cells), np.array([[9.0, 9.0]]), unknown_is_free=False)
    assert np.array_equal(chart.cells, cells) and chart.doubtful is None
    assert not chart.doubts(np.array([[0.28, 0.28]]))


def test_a_path_is_doubted_where_nobody_has_seen() -> None:
    cells = floor(4.0, 2.0)
    cells[rows(0.0, 2.0), 40:50] = UNKNOWN
    chart = Chart.of(grid(cells), np.array([[1.0, 1.0]]), unknown_is_free=True)
    assert not chart.doubts(np.array([[0.5, 1.0], [1.9, 1.0]]))
    assert chart.doubts(np.array([[0.5, 1.0], [2.2, 1.0]]))


def test_paths_are_apart_by_their_farthest_point() -> None:
    straight = np.column_stack([np.linspace(0, 2, 41), np.zeros(41)])
    bent = straight + np.column_stack([np.zeros(41), np.linspace(0, 0.5, 41)])
    assert apart(straight, straight) == 0.0
    assert apart(bent, straight) == pytest.approx(0.5)


def two_ways() -> np.ndarray:
    """Return a wall across with a hole of 0.9 m straight ahead and one farther up, and the first of them unseen."""
    cells = floor(4.0, 4.0)
    cells[:, 40] = OCCUPIED
    cells[rows(0.6, 1.5), 40] = FREE
    cells[rows(2.0, 3.1), 40] = FREE
    return cells


def path_of(cells: np.ndarray) -> np.ndarray:
    r, o, g = np.array([0.5, 1.05]), np.array([1.0, 1.05]), np.array([3.2, 1.05])
    chart = Chart.of(grid(cells), np.stack([r, o, g]), unknown_is_free=True)
    return build(
        chart.cells, chart.resolution, chart.origin, r, o, g, D_R, D_O, apart=True, doubtful=chart.doubtful
    ).path  # fmt: skip


def through(path: np.ndarray) -> float:
    """Return where a path crosses the wall, y, m."""
    return float(np.interp(2.025, path[:, 0], path[:, 1]))


def test_a_way_that_is_seen_is_taken_rather_than_one_that_is_not() -> None:
    cells = two_ways()
    assert 0.6 < through(path_of(cells)) < 1.5
    # Behind the object nobody saw whether there is a wall.
    cells[rows(0.4, 1.7), 26:62] = UNKNOWN
    assert 2.0 < through(path_of(cells)) < 3.1


def test_where_no_way_is_seen_the_unseen_one_is_taken() -> None:
    cells = two_ways()
    cells[rows(2.0, 3.1), 40] = OCCUPIED
    cells[rows(0.4, 1.7), 26:62] = UNKNOWN
    assert 0.4 < through(path_of(cells)) < 1.7


def test_a_roomy_way_is_taken_before_a_tight_one_if_there_is_one() -> None:
    """The straight hole leaves 3 cm beside the robot, the one farther up 20 cm; alone, the tight one will do."""
    cells = floor(4.0, 4.0)
    cells[:, 40] = OCCUPIED
    cells[rows(0.8, 1.32), 40] = FREE
    cells[rows(2.2, 3.1), 40] = FREE
    r, o, g = np.array([0.5, 1.05]), np.array([1.0, 1.05]), np.array([3.2, 1.05])

    def crossing(spare: float) -> float:
        return through(build(cells, RESOLUTION, np.zeros(2), r, o, g, D_R, D_O, weight=0.5, spare=spare).path)

    assert 0.8 < crossing(0.0) < 1.32
    assert 2.2 < crossing(0.1) < 3.1
    cells[rows(2.2, 3.1), 40] = OCCUPIED
    assert 0.8 < crossing(0.1) < 1.32


def test_a_known_way_is_kept_unless_another_is_clearly_better_or_it_has_become_tight() -> None:
    """Two holes alike, one below the line to the goal, the other above and a little nearer."""
    cells = floor(4.0, 4.0)
    cells[:, 40] = OCCUPIED
    cells[rows(0.5, 1.5), 40] = FREE
    cells[rows(1.7, 2.7), 40] = FREE
    r, o, g = np.array([0.5, 1.65]), np.array([1.0, 1.65]), np.array([3.2, 1.65])
    low, high = (np.array([[1.3, y], [2.025, y], [2.7, y], g]) for y in (1.0, 2.2))

    def crossing(known: np.ndarray) -> float:
        built = build(cells, RESOLUTION, np.zeros(2), r, o, g, D_R, D_O, spare=0.1, known=known)
        return through(built.path[built.start :])

    assert crossing(low) == pytest.approx(1.0, abs=0.05)
    assert crossing(high) == pytest.approx(2.2, abs=0.05)
    detour = np.array([[1.0, 0.6], [2.025, 1.0], [2.7, 0.6], [3.4, 0.6], g])
    assert crossing(detour) > 1.7, "too long"
    cells[rows(0.8, 0.85), 39] = OCCUPIED
    assert crossing(low) > 1.7, "too tight"


def test_a_wall_beside_the_object_is_no_part_of_it_on_a_map_without_it() -> None:
    """The object stands before a wall: its circle, and a margin, reach into it; the way leads around."""
    cells = floor(4.0, 4.0)
    cells[rows(0.0, 2.6), 26:28] = OCCUPIED
    r, o, g = np.array([0.5, 1.05]), np.array([1.14, 1.05]), np.array([3.2, 1.05])
    around = build(cells, RESOLUTION, np.zeros(2), r, o, g, D_R, D_O, apart=True).path
    at_wall = around[np.abs(around[:, 0] - 1.35) < 0.06]
    assert at_wall[:, 1].min() > 2.6


def test_a_robot_and_an_object_that_both_stand_a_little_too_tight_can_go_on() -> None:
    """Both 0.2 m from a wall that a map has too thick: the robot touches nothing where it stands, and is inside."""
    cells = floor(4.0, 4.0)
    cells[rows(0.0, 0.8), 8:30] = OCCUPIED
    r, o, g = np.array([0.7, 1.0]), np.array([1.2, 0.98]), np.array([3.2, 2.05])
    built = build(cells, RESOLUTION, np.zeros(2), r, o, g, D_R, D_O, spare=0.1, apart=True)
    assert built.field.value(*r) >= 0.04
    assert built.field.value(*o) >= 0.04
    assert built.path[0] == pytest.approx(r) and built.path[-1] == pytest.approx(g)


def test_an_object_in_a_wall_cannot_begin() -> None:
    cells = floor(4.0, 4.0)
    cells[rows(0.5, 2.6), 20:28] = OCCUPIED
    r, o, g = np.array([0.5, 1.05]), np.array([1.2, 1.05]), np.array([3.2, 1.05])
    with pytest.raises(StartBlocked):
        build(cells, RESOLUTION, np.zeros(2), r, o, g, D_R, D_O, apart=True)
