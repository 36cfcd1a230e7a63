"""What is known of an object before it is touched: kept from an earlier push of the same object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from services.predictive.model import (
    ANISOTROPY,
    COASTING,
    CONTOUR,
    FRICTION,
    LENGTH,
    RESPONSE,
    basis,
    prior_contour,
    radius,
)

Array = NDArray[np.float64]

SPREAD = CONTOUR * (CONTOUR + 1) // 2
"""numbers in the lower triangle of the contour's covariance"""

DIAMETER_OFF, ROBOT_OFF = 0.2, 0.01
"""shares by which the tracked object's diameter, and the robot's, may differ from the known ones"""

_SURE = 0.02
_WAVES = 10
_SLACK = 0.015
_BEARINGS = np.linspace(-np.pi, np.pi, 72, endpoint=False)


class Known(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Experience of an object, as `pushlane experience save` keeps it. The yaw that it counts from is the tracker's."""

    object: Annotated[str, Meta(max_length=200, description="its name, for people")] = ""
    diameter: Annotated[float, Meta(gt=0, le=1000, description="m, d_o, as the tracker had it")]
    robot_diameter: Annotated[float, Meta(gt=0, le=1000, description="m, d_r, of the base that pushed it")]
    contour: Annotated[
        tuple[float, ...],
        Meta(
            min_length=CONTOUR,
            max_length=CONTOUR,
            description="m, distance of the centres in touch, a spline's coefficients",
        ),
    ]
    spread: Annotated[
        tuple[float, ...],
        Meta(min_length=SPREAD, max_length=SPREAD, description="m^2, its covariance, lower triangle row by row"),
    ]
    response: Annotated[
        tuple[float, ...],
        Meta(min_length=RESPONSE, max_length=RESPONSE, description="limit surface, friction, coasting"),
    ]
    touches: Annotated[int, Meta(ge=0, lt=2**53, description="observations of the contour")] = 0
    windows: Annotated[int, Meta(ge=0, lt=2**53, description="observations of the response")] = 0

    def __post_init__(self) -> None:
        numbers = np.array([self.diameter, self.robot_diameter, *self.contour, *self.spread, *self.response])
        if not np.isfinite(numbers).all():
            raise ValueError("experience is to be of finite numbers")
        contour, response = np.array(self.contour), np.array(self.response)
        reach = [radius(contour, float(bearing))[0] for bearing in _BEARINGS]
        least, most = 0.25 * self.robot_diameter, 0.5 * self.robot_diameter + self.diameter
        if min(reach) < least or max(reach) > most:
            raise ValueError(
                f"the contour goes from {min(reach):.3f} to {max(reach):.3f} m, expected within {least:.3f} and "
                f"{most:.3f} m"
            )
        smallest = float(np.linalg.eigvalsh(self.covariance())[0])
        if smallest < -1e-9:
            raise ValueError(f"spread has the eigenvalue {smallest:g} m^2: it is no covariance")
        if response[[LENGTH, FRICTION, COASTING]].min() <= 0.0 or abs(response[ANISOTROPY]) > 4.0:
            raise ValueError(
                "response is to have length, friction and coasting above 0 and an anisotropy within 4, "
                f"found {', '.join(f'{one:g}' for one in response)}"
            )

    def covariance(self) -> Array:
        """Return the covariance of the contour, (CONTOUR, CONTOUR), m^2."""
        return square(self.spread)

    def misfit(self, robot_diameter: float, object_diameter: float) -> str:
        """Return why this is of no use for a base and an object of these diameters, m; empty if it is."""
        if abs(object_diameter - self.diameter) > DIAMETER_OFF * self.diameter:
            return f"it is of an object of {self.diameter:.3f} m, this one has {object_diameter:.3f} m"
        if abs(robot_diameter - self.robot_diameter) > ROBOT_OFF * self.robot_diameter:
            return f"it was made with a base of {self.robot_diameter:.3f} m, this one has {robot_diameter:.3f} m"
        return ""


def prior_spread(object_diameter: float) -> Array:
    """Return how unsure `model.prior_contour` is: its covariance, (CONTOUR, CONTOUR), m^2."""
    # The size, and waves around of which the shorter are the smaller.
    apart = 2.0 * np.pi * np.arange(CONTOUR) / CONTOUR
    row = (0.05 * object_diameter / 0.25) ** 2 + sum((0.03 / k) ** 2 * np.cos(k * apart) for k in range(1, _WAVES + 1))
    return np.asarray(row)[abs(np.subtract.outer(np.arange(CONTOUR), np.arange(CONTOUR)))]


def plausible(contour: Array, spread: Array, robot_diameter: float, object_diameter: float) -> tuple[Array, Array]:
    """Return a contour, (CONTOUR,), m, and its covariance, m^2, that can be those of an object in its bounding circle.

    A series fitted on one side may say nonsense of the others, and be sure of it. If it goes beyond what base and
    bounding circle allow, only the bearings where it does not are believed, and the rest is as before any touch.
    """
    rows, _ = basis(_BEARINGS)
    reach = rows @ contour
    low, high = 0.5 * robot_diameter - _SLACK, 0.5 * (robot_diameter + object_diameter) + _SLACK
    possible = (reach > low) & (reach < high)
    if possible.all():
        return contour, spread
    contour, spread = prior_contour(robot_diameter, object_diameter), prior_spread(object_diameter)
    for row, distance in zip(rows[possible], reach[possible], strict=True):
        contour, spread = observed(contour, spread, row, distance, _SURE)
    return contour, spread


def observed(contour: Array, spread: Array, row: Array, distance: float, noise: float) -> tuple[Array, Array]:
    """Return contour and covariance after `row` @ contour was seen to be `distance`, m, to within `noise`, m.

    One step of recursive least squares.
    """
    column = spread @ row
    gain = column / (float(row @ column) + noise**2)
    contour = contour + gain * (distance - float(row @ contour))
    spread = spread - np.outer(gain, column)
    return contour, 0.5 * (spread + spread.T)


def triangle(spread: Array) -> list[float]:
    """Return the lower triangle of a covariance, row by row, as messages and `Known` hold it."""
    found: list[float] = spread[np.tril_indices(CONTOUR)].tolist()
    return found


def square(triangle: Sequence[float]) -> Array:
    """Return the covariance, (CONTOUR, CONTOUR), of which `triangle` is the lower triangle, row by row."""
    full = np.zeros((CONTOUR, CONTOUR))
    full[np.tril_indices(CONTOUR)] = triangle
    return full + np.tril(full, -1).T
