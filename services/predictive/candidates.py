"""What the planner chooses from: the candidates, how they age as they are carried out, and what is near to them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AHEAD, BIAS_OF, SPEED_OF, SIDE_OF, BODY_OF, STAND_OF, LEAN_OF, AFTER, AFTER_STAND, AFTER_LEAN, CANDIDATE = range(11)
"""Places in a candidate: m along the path to its target, rad, share of the full speed, way around; s to push at a
place of the body first, its bearing, rad, object's frame, and the push's direction from the centre's, rad; the same of
a second such push."""

_BODY = 0.8
"""s of a push at a place of the body"""
_LEAN, _BIAS = 0.7, 0.7
"""rad, the largest of the variants"""


def candidates() -> Array:
    """Return the candidates, (N, CANDIDATE)."""
    rows: list[tuple[float, ...]] = [(0.1, 0.0, 0.0, 0.0)]  # wait: what is at the goal and still moves is to rest
    for ahead in (0.1, 0.3, 0.6, 1.0):
        rows += [(ahead, bias, 1.0, 0.0) for bias in (0.0, -0.25, 0.25, -0.55, 0.55)]
        rows.append((ahead, 0.0, 0.5, 0.0))
        for side in (-1.0, 1.0):
            rows.append((ahead, 0.0, 1.0, side))
            rows.append((ahead, 0.5 * side, 1.0, side))
    rows = [(*row, *[0.0] * 6) for row in rows]
    for stand in np.arange(12) * math.pi / 6:
        rows += [(0.3, 0.0, 0.7, 0.0, _BODY, float(stand), lean, *[0.0] * 3) for lean in (-0.5, 0.0, 0.5)]
    return np.array(rows)


def pairs(count: int, generator: np.random.Generator) -> Array:
    """Return `count` candidates, (count, CANDIDATE), of two pushes at places of the body, drawn evenly.

    Wheels are turned with the first, so that the second is along them: no single push does that.
    """
    rows = np.zeros((count, CANDIDATE))
    rows[:, [AHEAD, SPEED_OF]] = 0.3, 1.0
    rows[:, [STAND_OF, AFTER_STAND]] = generator.uniform(-math.pi, math.pi, (count, 2))
    rows[:, [LEAN_OF, AFTER_LEAN]] = generator.uniform(-0.6, 0.6, (count, 2))
    rows[:, [BODY_OF, AFTER]] = generator.uniform(0.4, 2.4, (count, 2))
    return rows


def pushed(candidate: Array, time: float) -> Array:
    """Return what is left of a candidate, (CANDIDATE,), after `time`, s, of pushing."""
    left = candidate.copy()
    left[BODY_OF] -= time
    if left[BODY_OF] <= 0.0:
        left[[BODY_OF, STAND_OF, LEAN_OF]] = left[[AFTER, AFTER_STAND, AFTER_LEAN]]
        left[[AFTER, AFTER_STAND, AFTER_LEAN]] = 0.0
    return left


def variants(candidate: Array, count: int, generator: np.random.Generator) -> Array:
    """Return `count` candidates, (count, CANDIDATE), that differ little from `candidate`, drawn normally."""
    rows = np.tile(candidate, (count, 1))
    draws = generator.standard_normal((count, 8))
    rows[:, AHEAD] = np.clip(rows[:, AHEAD] * np.exp(0.4 * draws[:, 0]), 0.05, 1.5)
    rows[:, BIAS_OF] = np.clip(rows[:, BIAS_OF] + 0.15 * draws[:, 1], -_BIAS, _BIAS)
    if candidate[BODY_OF] > 0.0:
        rows[:, STAND_OF] += 0.15 * draws[:, 2]
        rows[:, LEAN_OF] = np.clip(rows[:, LEAN_OF] + 0.15 * draws[:, 3], -_LEAN, _LEAN)
        rows[:, BODY_OF] = np.clip(rows[:, BODY_OF] + 0.3 * draws[:, 4], 0.1, 2.5)
    if candidate[AFTER] > 0.0:
        rows[:, AFTER_STAND] += 0.2 * draws[:, 5]
        rows[:, AFTER_LEAN] = np.clip(rows[:, AFTER_LEAN] + 0.2 * draws[:, 6], -_LEAN, _LEAN)
        rows[:, AFTER] = np.clip(rows[:, AFTER] + 0.3 * draws[:, 7], 0.1, 2.5)
    return rows
