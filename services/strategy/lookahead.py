"""The fixed-lookahead strategy (Sec. 6.3.2), and with it the fallback of the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.geometry.corridor import CorridorGeometry
from services.geometry.path import at_arc_kernel
from services.strategy.target import Target, make

Array = NDArray[np.float64]

LOOKAHEAD = 0.1
"""m of arc (Sec. 6.3.2)."""


def choose(geometry: CorridorGeometry, o: Array, d_r: float, d_o: float, lookahead: float = LOOKAHEAD) -> Target:
    """Return the point of Q that lies `lookahead` m of arc ahead of the one closest to `o`; g at the end.

    Args:
        o: (2,), m, map frame.
        d_r, d_o: m, diameters of robot and object.
    """
    return ahead(geometry, o, d_r, d_o, geometry.closest(o).arc, lookahead, feasible=True)


def ahead(
    geometry: CorridorGeometry, o: Array, d_r: float, d_o: float, arc: float, lookahead: float, *, feasible: bool
) -> Target:
    """Return the point `lookahead` m ahead of arc length `arc` m, with `feasible` as given."""
    x, y, index = at_arc_kernel(geometry.path, geometry.arc, arc + lookahead)
    return make(geometry, o, d_r, d_o, x, y, index, feasible, arc)
