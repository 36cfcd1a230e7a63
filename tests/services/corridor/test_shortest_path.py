from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from services.corridor.clearance import Clearance, measure
from services.corridor.dijkstra import cheapest, places, widest
from services.corridor.shortest_path import GoalBlocked, NoPath, PlanningError, Room, StartBlocked, find

ZERO = np.zeros(2)


def clearance_of(cells: np.ndarray) -> Clearance:
    return measure(cells, 0.05, ZERO, np.zeros((0, 3)))


def clutter(seed: int, ny: int = 40, nx: int = 50) -> np.ndarray:
    rng = np.random.default_rng(seed)
    cells = np.zeros((ny, nx), np.uint8)
    for _ in range(rng.integers(1, 8)):
        i, j = rng.integers(0, nx), rng.integers(0, ny)
        cells[j : j + rng.integers(1, 12), i : i + rng.integers(1, 12)] = 100
    return cells


def graph(xs, ys, cs, nx, need, comfort, weight):
    """The same graph for scipy, built anew with arrays."""
    n = len(cs)
    ny = n // nx
    k = np.arange(n)
    i, j = k % nx, k // nx
    price = 1 + weight * np.maximum(0, (comfort - cs) / (comfort - need)) ** 2
    rows, columns, costs = [], [], []
    reach = range(-2, 3)
    moves = [(a, b) for a in reach for b in reach if sorted((abs(a), abs(b))) in ([0, 1], [1, 1], [1, 2])]
    for a, b in moves:
        ok = (i + a >= 0) & (i + a < nx) & (j + b >= 0) & (j + b < ny) & (cs >= 0)
        u = k[ok]
        v = u + b * nx + a
        u, v = u[cs[v] >= 0], v[cs[v] >= 0]
        if max(abs(a), abs(b)) == 2:
            step = (np.sign(a), 0) if abs(a) == 2 else (0, np.sign(b))
            first, second = u + step[1] * nx + step[0], v - step[1] * nx - step[0]
            free = (cs[first] >= 0) & (cs[second] >= 0)
            u, v = u[free], v[free]
        rows.append(u)
        columns.append(v)
        # csgraph takes 0 for no edge; two places may coincide.
        costs.append(np.maximum(1e-12, np.hypot(xs[u] - xs[v], ys[u] - ys[v]) * 0.5 * (price[u] + price[v])))
    return coo_matrix((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), (n, n)).tocsr()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 1999), st.integers(0, 1999))
def test_the_cost_is_scipys(seed: int, start: int, goal: int) -> None:
    clearance = clearance_of(clutter(seed))
    xs, ys, cs = places(clearance.values, clearance.spacing, 0.12, 0.0, 0.0, 0.0, 0.0)
    assume(cs[start] >= 0 and cs[goal] >= 0)
    cost, nodes = cheapest(xs, ys, cs, 50, start, goal, 0.12, 0.5, 3.0)
    expected = dijkstra(graph(xs, ys, cs, 50, 0.12, 0.5, 3.0), indices=start)[goal]
    assert cost == pytest.approx(expected, abs=1e-8)
    if np.isfinite(cost):
        assert (nodes[0], nodes[-1]) == (start, goal)
        assert (cs[nodes] >= 0.12).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 1999), st.integers(0, 1999))
def test_the_widest_way_is_the_threshold_of_connection(seed: int, start: int, goal: int) -> None:
    clearance = clearance_of(clutter(seed))
    cs = places(clearance.values, clearance.spacing, np.inf, 0.0, 0.0, np.inf, 0.0)[2].reshape(40, 50)
    assume(cs.flat[start] > 0 and cs.flat[goal] > 0)
    found = widest(cs.ravel(), 50, start, goal)

    def connected(least: float) -> bool:
        k = np.arange(2000).reshape(40, 50)
        pairs = [
            (k[1:, :], k[:-1, :]), (k[:, 1:], k[:, :-1]), (k[1:, 1:], k[:-1, :-1]), (k[1:, :-1], k[:-1, 1:]),
        ]  # fmt: skip
        u, v = (np.concatenate([p[side].ravel() for p in pairs]) for side in (0, 1))
        ok = (cs.flat[u] >= least) & (cs.flat[v] >= least)
        edges = coo_matrix((np.ones(ok.sum()), (u[ok], v[ok])), (2000, 2000))
        labels = connected_components(edges, directed=False)[1]
        return bool(labels[start] == labels[goal]) and min(cs.flat[start], cs.flat[goal]) >= least

    if found > 0:
        assert connected(found)
    assert not connected(np.nextafter(max(found, 1e-9), 9))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.tuples(*[st.floats(0.2, 2.3), st.floats(0.2, 1.8)] * 2))
def test_paths_are_exact_at_their_ends_dense_and_clear(seed: int, ends: tuple[float, ...]) -> None:
    clearance = clearance_of(clutter(seed))
    start, goal = np.array(ends[:2]), np.array(ends[2:])
    try:
        path = find(clearance, start, goal, Room(0.15, 0.5))
    except PlanningError:
        return
    assert (path[0] == start).all()
    assert (path[-1] == goal).all()
    steps = np.hypot(*np.diff(path, axis=0).T)
    assert steps.max() <= 0.05 + 1e-9
    assert steps.min() > 0
    t = np.linspace(0, 1, 6)[:, None]
    dense = np.vstack([a + t * (b - a) for a, b in pairwise(path)])
    assert clearance.along(dense).min() >= 0.15 - 0.008


def test_in_an_empty_hall_the_path_is_straight() -> None:
    clearance = clearance_of(np.zeros((120, 120), np.uint8))
    start, goal = np.array((1.03, 1.01)), np.array((4.87, 3.11))
    path = find(clearance, start, goal, Room(0.23, 0.8))
    unit = (goal - start) / np.hypot(*(goal - start))
    off = np.abs((path - start) @ np.array((-unit[1], unit[0])))
    assert off.max() < 1e-6


def test_without_a_penalty_the_path_is_a_taut_string() -> None:
    # Round a single cell: two tangents to circles of radius 0.23 about its upper (or lower) corners.
    cells = np.zeros((41, 81), np.uint8)
    cells[20, 40] = 100
    start, goal = np.array((0.525, 1.025)), np.array((3.525, 1.025))
    path = find(clearance_of(cells), start, goal, Room(0.23, 0.8, 0.0))
    to_corner = np.hypot(1.475, 0.025)
    tangent = np.sqrt(to_corner**2 - 0.23**2)
    arc = 0.23 * (np.arcsin(0.23 / to_corner) + np.arctan2(0.025, 1.475))
    taut = 2 * (tangent + arc) + 0.05
    assert np.hypot(*np.diff(path, axis=0).T).sum() == pytest.approx(taut, abs=0.012)


def test_through_a_passage_the_path_keeps_to_its_middle() -> None:
    cells = np.zeros((60, 100), np.uint8)
    cells[:20, 40:60] = cells[40:, 40:60] = 100
    path = find(clearance_of(cells), np.array((0.7, 1.1)), np.array((4.3, 1.1)), Room(0.23, 0.76, 6.0))
    inside = path[(path[:, 0] > 2.3) & (path[:, 0] < 2.7)]
    assert np.abs(inside[:, 1] - 1.5).max() < 0.16
    assert path[len(path) // 2, 1] > 1.3


@pytest.mark.parametrize(("diameter", "fits"), [(0.46, True), (0.5, True), (0.502, False), (0.54, False)])
def test_a_passage_of_half_a_metre_takes_what_is_narrower(diameter: float, fits: bool) -> None:
    cells = np.zeros((40, 120), np.uint8)
    cells[:15, 50:60] = cells[25:, 50:60] = 100
    clearance = clearance_of(cells)
    start, goal, room = np.array((1.0, 1.0)), np.array((5.0, 1.3)), Room(0.5 * diameter, 0.8)
    if fits:
        assert clearance.along(find(clearance, start, goal, room)).min() >= 0.5 * diameter - 0.005
    else:
        with pytest.raises(NoPath, match=r"the widest one takes 0\.500 m"):
            find(clearance, start, goal, room)


def test_why_there_is_no_path() -> None:
    cells = np.zeros((40, 120), np.uint8)
    cells[:, 50:60] = 100
    clearance = clearance_of(cells)
    start, room = np.array((1.0, 1.0)), Room(0.23, 0.8)
    with pytest.raises(NoPath, match="part them"):
        find(clearance, start, np.array((5.0, 1.0)), room)
    with pytest.raises(GoalBlocked, match=r"0\.100 m from the nearest obstacle; 0\.230 m are needed"):
        find(clearance, start, np.array((2.4, 1.0)), room)
    with pytest.raises(StartBlocked, match=r"start \(2\.60, 1\.00\) m is in an obstacle, or where nothing is known"):
        find(clearance, np.array((2.6, 1.0)), start, room)
    outside = (
        r"goal \(-3\.00, 1\.00\) m is outside of the map, which has x from 0\.00 to 6\.00 m and y from 0\.00 to 2\."
    )
    with pytest.raises(GoalBlocked, match=outside):
        find(clearance, start, np.array((-3.0, 1.0)), room)
    with pytest.raises(NoPath, match="coincide"):
        find(clearance, start, start.copy(), room)


def test_a_robot_that_stands_tight_may_leave() -> None:
    cells = np.zeros((40, 80), np.uint8)
    start, goal = np.array((0.15, 1.0)), np.array((3.0, 1.0))
    with pytest.raises(StartBlocked):
        find(clearance_of(cells), start, goal, Room(0.23, 0.5))
    path = find(clearance_of(cells), start, goal, Room(0.23, 0.5, escape=0.3))
    assert (path[0] == start).all()
    assert clearance_of(cells).along(path[path[:, 0] > 0.5]).min() >= 0.225
