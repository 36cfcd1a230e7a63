"""Candidates age as they are carried out, vary a little, and the cheapest is taken; an orientation can be asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.geometry.field import Field
from services.predictive import candidates, law, plan
from services.predictive import model as m

PATH = np.column_stack([np.arange(0.0, 4.01, 0.05), np.zeros(81)])
WIDTH = np.full(81, 0.7)
FIELD = Field.build(PATH, WIDTH)
BASE = np.array([0.8, 0.1, 0.23])
CONTOUR = m.prior_contour(0.46, 0.4)
RESPONSE = m.prior_response(0.4)


def two_pushes(first: float, second: float) -> plan.Array:
    candidate = np.zeros(candidates.CANDIDATE)
    candidate[[candidates.BODY_OF, candidates.STAND_OF, candidates.LEAN_OF]] = first, 1.0, 0.1
    candidate[[candidates.AFTER, candidates.AFTER_STAND, candidates.AFTER_LEAN]] = second, 2.0, 0.2
    return candidate


@given(st.floats(0.1, 2.0), st.floats(0.1, 2.0), st.lists(st.floats(0.01, 0.2), max_size=60))
def test_pushes_follow_each_other_as_time_passes(first: float, second: float, ticks: list[float]) -> None:
    left = two_pushes(first, second)
    passed = 0.0
    for tick in ticks:
        left = candidates.pushed(left, tick)
        passed += tick
        longest = max(ticks)
        if passed < first - 1e-9:
            assert left[candidates.STAND_OF] == 1.0 and left[candidates.BODY_OF] == pytest.approx(first - passed)
        # A push ends with a tick: up to one of them late.
        if first + longest + 1e-9 < passed < first + second:
            assert left[candidates.STAND_OF] == 2.0 and 0.0 < left[candidates.BODY_OF] <= second
        if passed > first + second + 2 * longest:
            assert left[candidates.BODY_OF] <= 0.0
    assert (left[[candidates.BODY_OF, candidates.AFTER]] >= 0.0).all()


def test_variants_are_near_and_within_bounds() -> None:
    generator = np.random.Generator(np.random.PCG64(3))
    candidate = two_pushes(1.0, 1.0)
    candidate[[candidates.AHEAD, candidates.SPEED_OF]] = 0.3, 0.7
    found = candidates.variants(candidate, 4000, generator)
    # 4000 draws: the mean of each to within five standard errors.
    for place, deviation in ((candidates.STAND_OF, 0.15), (candidates.AFTER_STAND, 0.2), (candidates.BIAS_OF, 0.15)):
        assert found[:, place].mean() == pytest.approx(candidate[place], abs=5 * deviation / math.sqrt(4000))
        assert found[:, place].std() == pytest.approx(deviation, rel=0.1)
    assert (found[:, candidates.SPEED_OF] == 0.7).all()
    assert found[:, candidates.AHEAD].min() >= 0.05 and found[:, candidates.BODY_OF].min() > 0.0
    plain = np.zeros(candidates.CANDIDATE)
    plain[[candidates.AHEAD, candidates.SPEED_OF]] = 0.3, 1.0
    found = candidates.variants(plain, 50, generator)
    assert not found[:, candidates.BODY_OF :].any(), "a candidate that is one push stays one"


def situation(generator: np.random.Generator) -> plan.Array:
    state = np.zeros(m.STATE)
    state[m.X], state[m.Y], state[m.YAW] = *generator.uniform((0.5, -0.3), (3.0, 0.3)), generator.uniform(-3, 3)
    bearing = generator.uniform(-math.pi, math.pi)
    distance = CONTOUR.mean() + generator.uniform(0.01, 0.1)
    state[m.RX] = state[m.X] + distance * math.cos(bearing)
    state[m.RY] = np.clip(state[m.Y] + distance * math.sin(bearing), -0.6, 0.6)
    return state


def settings_() -> plan.Array:
    settings = np.zeros(plan.SETTINGS)
    settings[[plan.HORIZON, plan.SPEED_FULL, plan.APPROACH, plan.SLOWEST]] = 7.0, 0.3, 0.15, 0.06
    settings[[plan.MARGIN, plan.PRECISION, plan.SPEED_WALK, plan.TURNED]] = 0.02, 0.03, 0.3, math.pi
    return settings


def cost_of(state: plan.Array, row: plan.Array, settings: plan.Array) -> float:
    index = int(np.argmin(np.hypot(PATH[:, 0] - state[m.X], PATH[:, 1] - state[m.Y])))
    none = np.empty((0, 4))
    return plan.rollout(
        state, 0.0, row, BASE, CONTOUR, RESPONSE, settings, PATH, WIDTH, 0.05, index, *FIELD.grid, none, np.inf
    )


def test_what_is_given_up_early_would_not_have_been_cheaper() -> None:
    """The bound is a guess of what the rest of a rollout can save: the oracle rolls every candidate out to its end."""
    generator = np.random.Generator(np.random.PCG64(5))
    rows, settings = candidates.candidates(), settings_()
    dearer = []
    for _ in range(30):
        state = situation(generator)
        index = int(np.argmin(np.hypot(PATH[:, 0] - state[m.X], PATH[:, 1] - state[m.Y])))
        costs = [cost_of(state, row, settings) for row in rows]
        best, cheapest = plan.choose(
            state,
            0.0,
            rows,
            np.zeros(len(rows)),
            BASE,
            CONTOUR,
            RESPONSE,
            settings,
            PATH,
            WIDTH,
            0.05,
            index,
            *FIELD.grid,
            -1,
        )
        assert cheapest == pytest.approx(costs[int(best)])
        dearer.append(cheapest / min(costs) - 1.0)
    assert np.mean(np.array(dearer) > 1e-9) < 0.25
    assert max(dearer) < 0.02


def test_the_favourite_is_kept_unless_another_is_clearly_cheaper() -> None:
    generator = np.random.Generator(np.random.PCG64(6))
    rows, settings = candidates.candidates(), settings_()
    state = situation(generator)
    index = int(np.argmin(np.hypot(PATH[:, 0] - state[m.X], PATH[:, 1] - state[m.Y])))
    order = np.argsort([cost_of(state, row, settings) for row in rows])
    costs = [cost_of(state, rows[k], settings) for k in order]
    no_whims = np.zeros(len(rows))
    given = (BASE, CONTOUR, RESPONSE, settings, PATH, WIDTH, 0.05, index, *FIELD.grid)
    near = next(k for k, cost in enumerate(costs) if cost > costs[0])
    assert costs[near] - costs[0] < 0.6, "the second is to be close for this test to say anything"
    ahead = np.ascontiguousarray(rows[order[: near + 1]])
    assert plan.choose(state, 0.0, ahead, no_whims[: near + 1], *given, near)[0] == near
    assert plan.choose(state, 0.0, ahead, no_whims[: near + 1], *given, -1)[0] < near
    last = np.ascontiguousarray(rows[order[[0, -1]]])
    assert costs[-1] - costs[0] > 0.6 and plan.choose(state, 0.0, last, no_whims[:2], *given, 1)[0] == 0


def test_a_push_that_turns_the_object_as_wanted_is_the_cheaper_one() -> None:
    """The object is at the goal: pushed off its middle it turns one way or the other, and one of them is wanted."""
    state = np.zeros(m.STATE)
    state[m.X], state[m.RX] = 4.0, 4.0 - CONTOUR.mean() - 0.005
    costs = {}
    for wanted in (-1.0, 1.0):
        settings = settings_()
        settings[[plan.GOAL_YAW, plan.TURNED]] = wanted, 0.15
        for stand in (math.pi - 0.5, math.pi + 0.5):
            row = np.zeros(candidates.CANDIDATE)
            row[[candidates.AHEAD, candidates.SPEED_OF]] = 0.3, 0.7
            row[[candidates.BODY_OF, candidates.STAND_OF, candidates.LEAN_OF]] = (
                2.0,
                stand,
                0.6 if stand > math.pi else -0.6,
            )
            costs[wanted, stand > math.pi] = cost_of(state, row, settings)
    # Mirrored situations, mirrored costs.
    assert costs[1.0, True] == pytest.approx(costs[-1.0, False], rel=1e-3)
    assert costs[1.0, False] == pytest.approx(costs[-1.0, True], rel=1e-3)
    # Pushed along +x at a side of its middle with y < 0, it turns to the left.
    assert costs[1.0, True] < costs[1.0, False] - 1.0


def test_to_wait_is_chosen_only_for_what_comes_to_rest_at_the_goal() -> None:
    """A thing that rolls 17 mm further by itself, to within the precision; pushed on, it is not at rest there."""
    settings, rolls = settings_(), RESPONSE.copy()
    rolls[m.COASTING] = 0.3
    wait = next(row for row in candidates.candidates() if row[candidates.SPEED_OF] == 0.0)
    rows = np.ascontiguousarray(np.stack([candidates.candidates()[1], wait]))
    given = (BASE, CONTOUR, rolls, settings, PATH, WIDTH, 0.05)
    for x, index, chosen in ((3.985, 80, 1), (2.0, 40, 0)):
        state = np.zeros(m.STATE)
        state[m.X], state[m.RX], state[m.VX] = x, x - CONTOUR.mean() - 0.01, 0.1
        state[m.RVX] = state[m.RAMP_X] = 0.06
        assert plan.choose(state, 0.0, rows, np.zeros(2), *given, index, *FIELD.grid, -1)[0] == chosen


def test_a_whim_is_paid_for_like_time() -> None:
    generator = np.random.Generator(np.random.PCG64(8))
    rows, settings = candidates.candidates()[:10], settings_()
    state = situation(generator)
    index = int(np.argmin(np.hypot(PATH[:, 0] - state[m.X], PATH[:, 1] - state[m.Y])))
    given = (BASE, CONTOUR, RESPONSE, settings, PATH, WIDTH, 0.05, index, *FIELD.grid, -1)
    plain, cost = plan.choose(state, 0.0, rows, np.zeros(10), *given)
    whims = np.full(10, 3.0)
    assert plan.choose(state, 0.0, rows, whims, *given) == (plain, pytest.approx(cost + 3.0))
    whims[int(plain)] = 1000.0
    assert plan.choose(state, 0.0, rows, whims, *given)[0] != plain


def test_the_narrowest_place_of_the_next_steps_sets_the_speed() -> None:
    """Full from 0.4 m of half width on, half from 0.2 m down, in between in proportion (docs/predictive)."""
    state, settings, found = np.zeros(m.STATE), settings_(), {}
    row = np.zeros(candidates.CANDIDATE)
    row[[candidates.AHEAD, candidates.SPEED_OF]] = 0.3, 1.0
    for narrow in (0.5, 0.3, 0.1):
        for place in (20, 24, 28, 29):
            width = np.full(81, 0.7)
            width[place] = narrow
            out = np.empty(law.MANOEUVRE)
            plan.manoeuvre_of(PATH, width, 0.05, 20, state, row, settings, out)
            found[narrow, place] = out[law.SPEED]
    assert found == {
        (narrow, place): pytest.approx(0.3 * (share if place < 29 else 1.0))
        for narrow, share in ((0.5, 1.0), (0.3, 0.75), (0.1, 0.5))
        for place in (20, 24, 28, 29)
    }
