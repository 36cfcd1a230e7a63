"""Plane shapes that objects and scenes are made of, and the smallest circle around them."""

from __future__ import annotations

from itertools import combinations
from math import cos, hypot, sin, sqrt
from typing import Annotated

import msgspec

Size = Annotated[float, msgspec.Meta(gt=0.0, le=100.0)]
"""A length of a shape, m."""
Coordinate = Annotated[float, msgspec.Meta(ge=-100.0, le=100.0)]
"""A coordinate, m."""
Yaw = Annotated[float, msgspec.Meta(ge=-6.2832, le=6.2832)]
"""An orientation as written in a file, rad."""
Colour = Annotated[str, msgspec.Meta(pattern="^#[0-9a-f]{6}$")]

_SLACK = 1e-9


class Box(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="box", tag_field="shape"):
    """A rectangle: centre (x, y) m, yaw rad, full length along its own x and width along its own y, m."""

    length: Size
    width: Size
    x: Coordinate = 0.0
    y: Coordinate = 0.0
    yaw: Yaw = 0.0


class Disc(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="disc", tag_field="shape"):
    """A disc: centre (x, y) m, radius m."""

    radius: Size
    x: Coordinate = 0.0
    y: Coordinate = 0.0


Shape = Box | Disc
Circle = tuple[float, float, float]
"""Centre x, y and radius, m."""


def corners(box: Box) -> list[tuple[float, float]]:
    """Return the four corners of `box`, counter-clockwise, m."""
    c, s = cos(box.yaw), sin(box.yaw)
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    halves = [(i * box.length / 2, j * box.width / 2) for i, j in signs]
    return [(box.x + c * a - s * b, box.y + s * a + c * b) for a, b in halves]


def moved(shape: Shape, x: float, y: float, yaw: float) -> Shape:
    """Return `shape`, given in a frame with pose (x, y, yaw), in the outer frame."""
    c, s = cos(yaw), sin(yaw)
    position = {"x": x + c * shape.x - s * shape.y, "y": y + s * shape.x + c * shape.y}
    if isinstance(shape, Box):
        return msgspec.structs.replace(shape, **position, yaw=shape.yaw + yaw)
    return msgspec.structs.replace(shape, **position)


def bounding_circle(shapes: tuple[Shape, ...]) -> Circle:
    """Return the smallest circle that holds all `shapes`; its diameter is the paper's d_o.

    The circle touches one, two or three of the discs and corners, so all such circles are tried.
    """
    circles: list[Circle] = []
    for shape in shapes:
        if isinstance(shape, Disc):
            circles.append((shape.x, shape.y, shape.radius))
        else:
            circles += [(x, y, 0.0) for x, y in corners(shape)]
    candidates = list(circles)
    candidates += [_around_two(a, b) for a, b in combinations(circles, 2)]
    for a, b, c in combinations(circles, 3):
        candidates += _around_three(a, b, c)
    holding = [one for one in candidates if all(_holds(one, other) for other in circles)]
    return min(holding, key=lambda one: one[2])


def _holds(outer: Circle, inner: Circle) -> bool:
    return hypot(outer[0] - inner[0], outer[1] - inner[1]) + inner[2] <= outer[2] + _SLACK


def _around_two(a: Circle, b: Circle) -> Circle:
    """Return the smallest circle around two; where one holds the other it is that one."""
    distance = hypot(b[0] - a[0], b[1] - a[1])
    if distance + b[2] <= a[2]:
        return a
    if distance + a[2] <= b[2]:
        return b
    radius = (distance + a[2] + b[2]) / 2
    share = (radius - a[2]) / distance
    return (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), radius)


def _around_three(a: Circle, b: Circle, c: Circle) -> list[Circle]:
    """Return the circles that touch three from outside (problem of Apollonius): none, one or two.

    The centre is linear in the radius R, |centre - centre_i| = R - r_i; a's equation then gives R.
    """
    bx, by, cx, cy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    determinant = 2 * (bx * cy - by * cx)
    if abs(determinant) < _SLACK:
        return []
    # 2 p_i . x = p_i . p_i - r_i^2 + r_a^2 + 2 R (r_i - r_a), x relative to a's centre.
    kb, kc = bx * bx + by * by - b[2] ** 2 + a[2] ** 2, cx * cx + cy * cy - c[2] ** 2 + a[2] ** 2
    lb, lc = 2 * (b[2] - a[2]), 2 * (c[2] - a[2])
    x0, x1 = (kb * cy - kc * by) / determinant, (lb * cy - lc * by) / determinant
    y0, y1 = (bx * kc - cx * kb) / determinant, (bx * lc - cx * lb) / determinant
    # |x|^2 = (R - r_a)^2 with x = x0 + x1 R.
    p, q, r = x1 * x1 + y1 * y1 - 1, x0 * x1 + y0 * y1 + a[2], x0 * x0 + y0 * y0 - a[2] ** 2
    if abs(p) < _SLACK:
        radii = [] if abs(q) < _SLACK else [-r / (2 * q)]
    else:
        root = q * q - p * r
        radii = [] if root < 0 else [(-q + sign * sqrt(root)) / p for sign in (1, -1)]
    largest = max(a[2], b[2], c[2])
    return [(a[0] + x0 + x1 * R, a[1] + y0 + y1 * R, R) for R in radii if largest <= R]
