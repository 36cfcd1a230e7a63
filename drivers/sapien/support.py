"""Where an object stands on the floor: points that share its weight, centred on the centre of mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.sapien.shapes import Box, Disc, Shape

_FINE_DISC = (4, 12)
_COARSE_DISC = (3, 8)
_FINE_BOX = (6, 6)
_LONG_BOX = (8, 4)
_SPACING = 0.04
_LONG = 2.0
_ROUNDS = 64


class SupportError(ValueError):
    """The centre of mass lies where the object would tip over: outside the hull of its support points."""


@dataclass(frozen=True)
class Area:
    """Points with quadrature weights over an object's floor area.

    position: (N, 2) float64, object frame, m. weight: (N,) float64, m^2, all positive.
    """

    position: NDArray[np.float64]
    weight: NDArray[np.float64]

    def centroid(self) -> NDArray[np.float64]:
        """Return the centre of the area, (2,), object frame, m."""
        return np.asarray(self.weight @ self.position / self.weight.sum())

    def gyration(self) -> float:
        """Return the radius of gyration about the centroid, m."""
        offset = self.position - self.centroid()
        return float(np.sqrt(self.weight @ (offset**2).sum(axis=1) / self.weight.sum()))


def disc_points(radius: float, rings: int, spokes: int) -> Area:
    """Return a quadrature of `rings` times `spokes` points over a disc of `radius` m at the origin.

    Rings are Gauss-Legendre nodes in r^2, so that area and second moments are exact; each ring is turned by a
    fraction of a spoke against the one inside, which evens out the directions.
    """
    node, share = np.polynomial.legendre.leggauss(rings)
    r = radius * np.sqrt((node + 1) / 2)
    turn = np.arange(spokes) / spokes
    angle = 2 * np.pi * (turn[None, :] + (np.arange(rings) / (rings * spokes))[:, None])
    position = np.stack([r[:, None] * np.cos(angle), r[:, None] * np.sin(angle)], axis=-1).reshape(-1, 2)
    weight = np.repeat(share / 2, spokes) * np.pi * radius**2 / spokes
    return Area(position, weight)


def box_points(length: float, width: float, columns: int, rows: int) -> Area:
    """Return a Gauss-Legendre tensor quadrature over a rectangle of `length` by `width` m at the origin."""
    node_x, share_x = np.polynomial.legendre.leggauss(columns)
    node_y, share_y = np.polynomial.legendre.leggauss(rows)
    x, y = np.meshgrid(node_x * length / 2, node_y * width / 2, indexing="ij")
    weight = np.outer(share_x, share_y).ravel() * length * width / 4
    return Area(np.stack([x.ravel(), y.ravel()], axis=1), weight)


def area(parts: tuple[Shape, ...]) -> Area:
    """Return a quadrature over the union of `parts`; a single part gets a finer one.

    A point that lies in an earlier part is left out: floor is covered once.
    """
    fine = len(parts) == 1
    positions: list[NDArray[np.float64]] = []
    weights: list[NDArray[np.float64]] = []
    for index, part in enumerate(parts):
        piece = _quadrature(part, fine)
        position = _placed(piece.position, part)
        new = np.ones(len(position), dtype=bool)
        for earlier in parts[:index]:
            new &= ~_inside(position, earlier)
        positions.append(position[new])
        weights.append(piece.weight[new])
    return Area(np.concatenate(positions), np.concatenate(weights))


def loads(floor: Area, centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each point's share of the weight, (N,) float64, summing to 1, so that their centroid is `centre`.

    Pressure is linear over the area, which is the least-norm answer in the area's own measure; points where it
    would pull are let go and the rest is solved again.

    centre: (2,), object frame, m.

    Raises:
        SupportError: `centre` is outside the hull of the points.
    """
    centroid = floor.centroid()
    basis = np.column_stack([np.ones(len(floor.position)), floor.position - centroid])
    wanted = np.array([1.0, *(centre - centroid)])
    weight = floor.weight / floor.weight.sum()
    standing = np.ones(len(weight), dtype=bool)
    for _ in range(_ROUNDS):
        held = basis[standing]
        moments = held.T @ (weight[standing, None] * held)
        pressure = np.linalg.lstsq(moments, wanted, rcond=1e-12)[0]
        share = np.zeros(len(weight))
        share[standing] = weight[standing] * (held @ pressure)
        if not np.allclose(basis.T @ share, wanted, rtol=0.0, atol=1e-9):
            break
        pulling = share < 0
        if not pulling.any():
            return share
        standing &= ~pulling
    raise SupportError(f"centre of mass {centre} m is outside the hull of the {len(weight)} support points")


def _quadrature(part: Shape, fine: bool) -> Area:
    if isinstance(part, Disc):
        return disc_points(part.radius, *(_FINE_DISC if fine else _COARSE_DISC))
    if not fine:
        columns, rows = (min(max(round(size / _SPACING), 3), 8) for size in (part.length, part.width))
        return box_points(part.length, part.width, columns, rows)
    if part.length > _LONG * part.width:
        return box_points(part.length, part.width, *_LONG_BOX)
    if part.width > _LONG * part.length:
        return box_points(part.length, part.width, *reversed(_LONG_BOX))
    return box_points(part.length, part.width, *_FINE_BOX)


def _placed(position: NDArray[np.float64], part: Shape) -> NDArray[np.float64]:
    yaw = part.yaw if isinstance(part, Box) else 0.0
    c, s = np.cos(yaw), np.sin(yaw)
    return position @ np.array([[c, s], [-s, c]]) + np.array([part.x, part.y])


def _inside(position: NDArray[np.float64], part: Shape) -> NDArray[np.bool_]:
    offset = position - np.array([part.x, part.y])
    if isinstance(part, Disc):
        return np.asarray((offset**2).sum(axis=1) < part.radius**2)
    c, s = np.cos(part.yaw), np.sin(part.yaw)
    own = offset @ np.array([[c, -s], [s, c]])
    return np.asarray((np.abs(own[:, 0]) < part.length / 2) & (np.abs(own[:, 1]) < part.width / 2))
