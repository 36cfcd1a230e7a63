"""What the report says of the paper's results, for trials made so that the answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from experiments.paper.claims import COMES_OUT, CONTRADICTED, REVERSED, UNDECIDED, findings
from experiments.paper.trial import STEEP, turning
from tests.experiments.trials import failed, outcome


def verdict(trials: list, start: str) -> str:  # type: ignore[type-arg]
    return next(one.verdict for one in findings(trials) if one.claim.startswith(start))


def many(method: str, good: int, bad: int) -> list:  # type: ignore[type-arg]
    return [
        *(outcome(method=method, seed=k) for k in range(good)),
        *(failed("robot out", method=method, seed=good + k) for k in range(bad)),
    ]


CLAIM = "adaptive succeeds more often than non-adaptive"


def test_a_clear_difference_comes_out_and_its_opposite_is_reversed() -> None:
    # The lady tasting tea on a larger scale: 19/21 against 8/21 has Fisher p = 0.0009 (R: fisher.test).
    assert verdict(many("adaptive", 19, 2) + many("non-adaptive", 8, 13), CLAIM) == COMES_OUT
    assert verdict(many("adaptive", 8, 13) + many("non-adaptive", 19, 2), CLAIM) == REVERSED


def test_the_papers_own_counts_of_strict_and_fixed_decide_nothing() -> None:
    # 38/42 against 36/42.
    trials = [
        one
        for scene, method, good in (
            ("corridor-1", "strict", 20),
            ("corridor-2", "strict", 18),
            ("corridor-1", "fixed-lookahead", 18),
            ("corridor-2", "fixed-lookahead", 18),
        )
        for one in [
            *(outcome(experiment="free-area", scene=scene, method=method, seed=k) for k in range(good)),
            *(failed("stall", experiment="free-area", scene=scene, method=method, seed=k) for k in range(good, 21)),
        ]
    ]
    claim = "strict is the best in wide corridors: it succeeds more often than fixed-lookahead"
    assert verdict(trials, claim) == UNDECIDED


def test_effort_is_compared_on_pushes_that_both_delivered() -> None:
    # Over its own successes strict looks shorter: it fails at the long pushes.
    facts = {"experiment": "free-area", "scene": "corridor-1"}
    trials = [
        *(outcome(**facts, method="strict", seed=k, robot_length=5.0 + 0.01 * k) for k in range(10)),
        *(outcome(**facts, method="relaxed", seed=k, robot_length=4.0) for k in range(10)),
        *(failed("stall", **facts, method="strict", seed=k) for k in range(10, 20)),
        *(outcome(**facts, method="relaxed", seed=k, robot_length=9.0) for k in range(10, 20)),
    ]
    assert verdict(trials, "strict takes a longer robot path than relaxed") == COMES_OUT


def test_centroid_at_steep_turns() -> None:
    claim = "centroid fails at steep turns"
    at_turns = [failed("object out", method="centroid", seed=k, turn=STEEP + 0.1, steep=0.1) for k in range(8)]
    elsewhere = [failed("object out", method="centroid", seed=k, turn=0.1, steep=0.1) for k in range(8)]
    assert verdict(at_turns, claim) == COMES_OUT
    assert verdict(elsewhere, claim) == UNDECIDED
    assert verdict([failed("stall", method="centroid")], claim) == CONTRADICTED


def test_dipole_orbiting_near_the_goal() -> None:
    claim = "dipole orbits"
    assert verdict([failed("orbit", method="dipole", distance=0.2)], claim) == COMES_OUT
    assert verdict([failed("orbit", method="dipole", distance=2.0)], claim) == CONTRADICTED
    assert verdict([failed("robot out", method="dipole", distance=0.2)], claim) == CONTRADICTED


def test_nothing_is_said_without_trials() -> None:
    assert findings([]) == []
    assert len(findings([outcome()])) == 0


def test_turning_looks_back_along_the_objects_way() -> None:
    # The object goes 1 m along x in steps of 0.1 m; the push direction jumps by 90 degrees at 0.35 m.
    x = np.arange(0.0, 1.01, 0.1)
    lines = np.column_stack([x, np.zeros(11), np.where(x > 0.35, math.pi / 2, 0.0)])
    found = turning(lines, reach=0.25)
    assert found == pytest.approx([0, 0, 0, 0, *[math.pi / 2] * 2, *[0] * 5])


def test_turning_is_never_more_than_half_a_turn() -> None:
    lines = np.array([[0.0, 0.0, math.radians(170.0)], [0.1, 0.0, math.radians(-170.0)]])
    assert turning(lines)[1] == pytest.approx(math.radians(20.0))
