"""Keeps the robot's centre inside the pushing corridor, whatever the controller wishes. Not in the paper.

The paper's law bounds the object and the push-line, not the robot's way around the object; on that way the robot
left the corridor in most failures. The bound is that of the predictive method, `law.inside`: no velocity from which
the base could not stop before the edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from runtime.time import Time
from services.geometry.corridor import CorridorGeometry
from services.predictive.estimate import Track
from services.predictive.law import inside, kept_margin
from services.predictive.model import ACCELERATION, RX, RY
from services.predictive.situation import Lane

Array = NDArray[np.float64]


def guard(
    corridor: CorridorGeometry, lane: Lane, track: Track, u: Array, now: Time, base: Array, margin: float
) -> tuple[Array, bool]:
    """Return `u`, changed as little as lets the robot stop inside the corridor, and whether it was changed.

    Args:
        track: has seen the robot, and what it was sent since.
        u: (2,), m/s, map frame. now: ns. base: (BASE,), see `model`.
        margin: m kept from the edge; less where the corridor is narrow.
    """
    state = track.robot_at_present(now, base)
    kept = kept_margin(margin, lane.width[lane.nearest(state[RX], state[RY])])
    found = np.array(inside(*corridor.field.grid, state, u[0], u[1], base[ACCELERATION], kept))
    return found, not np.array_equal(found, u)
