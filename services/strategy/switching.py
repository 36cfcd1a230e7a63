"""Switches between strict and relaxed by the width of the corridor ahead (Sec. 7.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.geometry.corridor import CorridorGeometry
from services.strategy import relaxed, strict
from services.strategy.target import Target

Array = NDArray[np.float64]

HORIZON = 1.0
"""m of the path ahead of the object that are looked at."""


def ratio(geometry: CorridorGeometry, o: Array, d_r: float, d_o: float, horizon: float = HORIZON) -> float:
    """Return the least corridor width 2 W_p on the `horizon` m of Q ahead of `o`, over d_r + d_o.

    The object corridor is there throughout where this is above 1.
    """
    arc = geometry.closest(o).arc
    ends = np.interp((arc, min(arc + horizon, geometry.arc[-1])), geometry.arc, geometry.width_push)
    between = geometry.width_push[(geometry.arc > arc) & (geometry.arc < arc + horizon)]
    least = min(float(ends.min()), float(between.min(initial=np.inf)))
    return 2.0 * least / (d_r + d_o)


def choose(
    geometry: CorridorGeometry, o: Array, d_r: float, d_o: float, *,
    switch_ratio: float = 1.0, horizon: float = HORIZON,
    strict_fallback: float = strict.FALLBACK, relaxed_fallback: float = relaxed.FALLBACK,
) -> tuple[str, Target]:  # fmt: skip
    """Return the name of the strategy in force, `strict` where `ratio` is at least `switch_ratio`, and its target.

    Args:
        o: (2,), m, map frame.
        d_r, d_o: m, diameters of robot and object.
    """
    if ratio(geometry, o, d_r, d_o, horizon) >= switch_ratio:
        return "strict", strict.choose(geometry, o, d_r, d_o, strict_fallback)
    return "relaxed", relaxed.choose(geometry, o, d_r, d_o, relaxed_fallback)
