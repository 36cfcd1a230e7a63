import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from services.geometry.corridor import CorridorGeometry
from services.geometry.path import cumulative, resample
from services.strategy import lookahead, relaxed, strict, switching
from services.strategy.target import Target

D_R, D_O = 0.46, 0.3
OFFSET, BESIDE = 0.5 * (D_R + D_O), 0.5 * max(D_R, D_O)
TIE = 0.02


def straight(half: float = 0.9) -> CorridorGeometry:
    path = np.column_stack([np.arange(0, 4.01, 0.05), np.zeros(81)])
    return CorridorGeometry.of(path, 0, np.full(81, half + 0.5 * D_R), D_R, D_O)


def s_bend() -> CorridorGeometry:
    s = np.linspace(0, 5, 500)
    path = resample(np.column_stack([s, 0.8 * np.sin(1.6 * s)]), 0.05)
    width = 0.85 + 0.12 * np.sin(2.0 * cumulative(path))
    return CorridorGeometry.of(path, 8, width + 0.5 * D_R, D_R, D_O)


S = s_bend()
DENSE = np.linspace(0, len(S.path) - 1, 12 * (len(S.path) - 1) + 1)
DISCS = tuple(np.interp(DENSE, np.arange(len(S.path)), v) for v in (S.path[:, 0], S.path[:, 1], S.width_push))


def exact_depth(points: np.ndarray) -> np.ndarray:
    """Depth at `points` (M, 2) from many discs."""
    x, y, w = DISCS
    return np.asarray((w - np.hypot(x - points[:, :1], y - points[:, 1:])).max(axis=1))


def along(a: np.ndarray, b: np.ndarray) -> float:
    t = np.linspace(0, 1, max(2, int(np.hypot(*(b - a)) / 0.025)))[:, None]
    return float(exact_depth(a + t * (b - a)).min())


def nearest(o: np.ndarray) -> tuple[np.ndarray, float]:
    """c and its arc length, by sampling."""
    arcs = np.interp(DENSE, np.arange(len(S.path)), S.arc)
    ahead = S.start <= DENSE
    d = np.where(ahead, np.hypot(DISCS[0] - o[0], DISCS[1] - o[1]), np.inf)
    k = int(np.argmin(d))
    return np.array((DISCS[0][k], DISCS[1][k])), float(arcs[k])


def edge_tangent(o: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """w, from the contour polylines of E_o, and the direction of l, from differences of the exact depth."""
    best, w = math.inf, o
    for line in S.edge_object():
        d = np.hypot(*(line - o).T)
        k = int(np.argmin(d))
        if d[k] < best:
            best, w = float(d[k]), line[k]
    x, y = np.array((1e-3, 0.0)), np.array((0.0, 1e-3))
    right, left, up, down = exact_depth(np.array([o + x, o - x, o + y, o - y]))
    tangent = np.array((down - up, right - left))
    return w, tangent / np.hypot(*tangent)


objects = st.tuples(st.floats(0.6, 4.9), st.floats(-0.6, 0.6)).map(
    lambda so: np.array((so[0], 0.8 * math.sin(1.6 * so[0]) + so[1]))
)


def check_place(target: Target, o: np.ndarray) -> None:
    """t is on Q, not behind c; p is behind o on the push-line."""
    assert (
        np.hypot(DISCS[0] - target.t[0], DISCS[1] - target.t[1]).min() < 2.5e-3
    )  # half the spacing of these samples is 2.1 mm
    _, arc = nearest(o)
    assert target.distance_to_go == pytest.approx(S.arc[-1] - arc, abs=5e-3)
    assert nearest(target.t)[1] >= arc - 5e-3
    back, push = target.p - o, target.t - o
    assert np.hypot(*back) == pytest.approx(OFFSET)
    assert back @ push == pytest.approx(-np.hypot(*back) * np.hypot(*push), abs=1e-6)


def strict_holds(t: np.ndarray, o: np.ndarray, slack: float) -> bool:
    c, _ = nearest(o)
    w, l_direction = edge_tangent(o)
    push = (t - o) / np.hypot(*(t - o))
    sine = abs(push[0] * l_direction[1] - push[1] * l_direction[0])
    ratio = np.hypot(*(o - c)) / np.hypot(*(w - c))
    return bool(sine >= ratio - 4 * slack and along(o, t) > OFFSET - slack)


def relaxed_holds(t: np.ndarray, o: np.ndarray, slack: float) -> bool:
    push = (t - o) / np.hypot(*(t - o))
    p = o - OFFSET * push
    return bool(exact_depth(p[None])[0] > -slack and along(o, t) > BESIDE - slack)


@settings(max_examples=25)
@given(objects)
def test_strict_conditions_hold_and_no_farther_candidate_meets_them(o: np.ndarray) -> None:
    # On the path both edges are as near: either may have w, and so either tangent be l.
    assume(np.hypot(*(o - nearest(o)[0])) > TIE)
    target = strict.choose(S, o, D_R, D_O)
    check_place(target, o)
    if target.feasible:
        assert strict_holds(target.t, o, TIE)
        if target.index > nearest_index(o) + 1:
            assert (target.t == S.path[target.index]).all()
    first = target.index + 1 if target.feasible else nearest_index(o) + 1
    for i in range(first, len(S.path)):
        assert not strict_holds(S.path[i], o, -TIE)


@settings(max_examples=25)
@given(objects)
def test_relaxed_conditions_hold_and_no_farther_candidate_meets_them(o: np.ndarray) -> None:
    target = relaxed.choose(S, o, D_R, D_O)
    check_place(target, o)
    if target.feasible:
        assert relaxed_holds(target.t, o, TIE)
    first = target.index + 1 if target.feasible else nearest_index(o) + 1
    for i in range(first, len(S.path)):
        assert not relaxed_holds(S.path[i], o, -TIE)


def nearest_index(o: np.ndarray) -> int:
    return int(np.searchsorted(S.arc, nearest(o)[1] + 1e-6)) - 1


@given(st.floats(0.3, 3.0), st.floats(0.0, 0.45))
def test_strict_in_a_straight_corridor_is_the_closed_form(x: float, y: float) -> None:
    # W_o = 0.52 m, so (2) reads y/sqrt(y^2 + d^2) >= y/0.52: d <= sqrt(0.52^2 - y^2) ahead.
    geometry = straight()
    target = strict.choose(geometry, np.array((x, y)), D_R, D_O)
    assert target.feasible
    if y < 1e-6:
        return
    reach = math.sqrt(0.52**2 - y * y)
    ahead = geometry.path[geometry.path[:, 0] > x, 0]
    expected = ahead[ahead <= x + reach].max(initial=x)
    assert target.t[0] == pytest.approx(expected, abs=0.0501 if abs(expected - x - reach) < 0.01 else 0.051)
    assert target.t[0] <= x + reach + 0.02


def test_on_the_path_of_a_straight_corridor_both_aim_at_the_goal() -> None:
    geometry = straight()
    for choose in (strict.choose, relaxed.choose):
        target = choose(geometry, np.array((1.0, 0.0)), D_R, D_O)
        assert target.feasible
        assert target.t.tolist() == [4.0, 0.0]
        assert target.p == pytest.approx((1.0 - OFFSET, 0.0))


def test_near_the_edge_strict_is_short_and_relaxed_is_long() -> None:
    # Fig. 5: both are alike on the path, and far apart near the object corridor's edge.
    o = np.array((1.0, 0.48))
    assert strict.choose(straight(), o, D_R, D_O).t[0] < 1.25
    assert relaxed.choose(straight(), o, D_R, D_O).t[0] == 4.0


@given(st.floats(0.3, 3.0), st.floats(0.53, 0.66))
def test_outside_of_the_object_corridor_strict_falls_back(x: float, y: float) -> None:
    target = strict.choose(straight(), np.array((x, y)), D_R, D_O)
    assert not target.feasible
    assert target.t == pytest.approx((x + 0.1, 0.0))


def test_in_a_passage_too_narrow_for_6_relaxed_falls_back() -> None:
    target = relaxed.choose(straight(0.2), np.array((1.0, 0.02)), D_R, D_O)
    assert not target.feasible
    assert target.t == pytest.approx((1.3, 0.0))
    assert relaxed.choose(straight(0.2), np.array((1.0, 0.02)), D_R, D_O, 0.1).t == pytest.approx((1.1, 0.0))


def test_relaxed_wants_the_robot_inside_behind_the_object() -> None:
    # At the start of the path p lies beyond the first disc when that is small.
    path = np.column_stack([np.arange(0, 4.01, 0.05), np.zeros(81)])
    geometry = CorridorGeometry.of(path, 0, np.full(81, 0.3 + 0.5 * D_R), D_R, D_O)
    assert not relaxed.choose(geometry, np.array((0.0, 0.0)), D_R, D_O).feasible
    assert relaxed.choose(geometry, np.array((0.5, 0.0)), D_R, D_O).feasible


@given(st.floats(0, 4), st.floats(-0.5, 0.5))
def test_fixed_lookahead_is_a_tenth_of_a_metre_beyond_the_projection(x: float, y: float) -> None:
    target = lookahead.choose(straight(), np.array((x, y)), D_R, D_O)
    assert target.feasible
    assert target.t == pytest.approx((min(x + 0.1, 4.0), 0.0), abs=1e-9)
    assert target.distance_to_go == pytest.approx(4 - x, abs=1e-9)


def test_candidates_start_after_the_lead_in() -> None:
    target = lookahead.choose(S, S.path[2], D_R, D_O)
    assert nearest(target.t)[1] == pytest.approx(S.arc[S.start] + 0.1, abs=3e-3)


def test_an_object_exactly_at_the_goal_still_has_a_push_position() -> None:
    geometry = straight()
    for choose in (strict.choose, relaxed.choose, lookahead.choose):
        target = choose(geometry, np.array((4.0, 0.0)), D_R, D_O)
        assert target.t.tolist() == [4.0, 0.0]
        assert target.p == pytest.approx((4.0 - OFFSET, 0.0))
        assert target.distance_to_go == 0.0


def test_switching_looks_a_metre_ahead() -> None:
    path = np.column_stack([np.arange(0, 6.01, 0.05), np.zeros(121)])
    half = np.where(path[:, 0] > 3.0, 0.3, 0.9)
    geometry = CorridorGeometry.of(path, 0, half + 0.5 * D_R, D_R, D_O)
    wide, narrow = np.array((1.0, 0.0)), np.array((2.2, 0.0))
    assert switching.ratio(geometry, wide, D_R, D_O) == pytest.approx(1.8 / 0.76)
    assert switching.ratio(geometry, narrow, D_R, D_O) == pytest.approx(0.6 / 0.76)
    for o, name, choose in ((wide, "strict", strict.choose), (narrow, "relaxed", relaxed.choose)):
        found, target = switching.choose(geometry, o, D_R, D_O)
        assert found == name
        assert (target.t == choose(geometry, o, D_R, D_O).t).all()
    assert switching.choose(geometry, narrow, D_R, D_O, switch_ratio=0.7)[0] == "strict"


@given(objects)
def test_the_ratio_ahead_is_the_least_of_interpolated_widths(o: np.ndarray) -> None:
    _, arc = nearest(o)
    assume(arc < S.arc[-1] - 1)
    arcs = np.linspace(arc, arc + 1, 2000)
    least = np.interp(arcs, S.arc, S.width_push).min()
    assert switching.ratio(S, o, D_R, D_O) == pytest.approx(2 * least / (D_R + D_O), abs=5e-3)
