"""The pushing corridor as data: path, clearances, half widths, and its field (Definitions 1 and 2)."""

from __future__ import annotations

from dataclasses import dataclass

import contourpy
import numpy as np
from numpy.typing import NDArray

from services.geometry.field import Field
from services.geometry.path import Closest, closest_in_sight, cumulative

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CorridorGeometry:
    """A corridor (Q, C) made ready for look-up. Widths are half widths: from Q to the edge."""

    path: Array
    """Q, (N, 2), m, map frame: a lead-in from the robot, then from o to g"""
    start: int
    """index of the first point of Q after the lead-in"""
    clearance: Array
    """C, (N,), m"""
    robot_diameter: float
    """d_r, m"""
    object_diameter: float
    """d_o, m"""
    arc: Array
    """(N,), m along Q from its first point"""
    field: Field
    """the depth for W_p: positive inside the pushing corridor, 0 on E, (d_r + d_o)/2 on E_o"""

    @classmethod
    def of(
        cls, path: Array, start: int, clearance: Array, robot_diameter: float, object_diameter: float
    ) -> CorridorGeometry:
        """Return the corridor of `path` (N, 2) and `clearance` (N,), m.

        Raises:
            services.geometry.path.BadPath: path or clearance cannot be used.
        """
        # Own copies: the kernels take no read-only arrays, which is what a decoded message may hold.
        path, clearance = np.array(path, np.float64, order="C"), np.array(clearance, np.float64)
        field = Field.build(path, clearance - 0.5 * robot_diameter)
        return cls(path, start, clearance, robot_diameter, object_diameter, cumulative(path), field)

    @property
    def width_push(self) -> Array:
        """W_p, (N,), m: c_i - d_r/2; negative where the robot does not fit."""
        return self.clearance - 0.5 * self.robot_diameter

    @property
    def width_object(self) -> Array:
        """W_o, (N,), m: W_p - (d_r + d_o)/2; negative where the object corridor vanishes."""
        return self.width_push - self.edge_offset

    @property
    def edge_offset(self) -> float:
        """m from E to E_o: (d_r + d_o)/2."""
        return 0.5 * (self.robot_diameter + self.object_diameter)

    def edge_push(self) -> list[Array]:
        """Return E as closed polylines (M, 2), m, map frame."""
        return contour(self.field, 0.0)

    def edge_object(self) -> list[Array]:
        """Return E_o as closed polylines (M, 2), m, map frame; none where it vanishes."""
        return contour(self.field, self.edge_offset)

    def closest(self, o: Array) -> Closest:
        """Return c, the point of Q after the lead-in that is closest to `o` (2,), with no obstacle between."""
        return closest_in_sight(self.path, self.clearance, o, self.start)

    def distance_to_go(self, o: Array) -> float:
        """Return the arc length, m, along Q from the point closest to `o` to g."""
        return float(self.arc[-1]) - self.closest(o).arc


def contour(field: Field, level: float) -> list[Array]:
    """Return where the depth is `level` m, as polylines (M, 2), m, map frame."""
    ny, nx = field.values.shape
    x = field.origin[0] + field.resolution * np.arange(nx)
    y = field.origin[1] + field.resolution * np.arange(ny)
    lines = contourpy.contour_generator(x, y, field.values, line_type=contourpy.LineType.Separate).lines(level)
    return [np.asarray(line, np.float64) for line in lines]
