"""The circle around a thing's footprint, from what one camera sees of it.

A thing with upright sides is bounded on the floor by where it meets it, the near contour, and its top's far edge is
seen before floor that is 1 / (1 - h / H) times as far from the point below the camera, for a height h below the
camera's H. At its two ends, where it is looked along, near side and far side meet: there the two contours are apart by
that factor only, and so it is known, and with it the far side.

A disc needs no top: at the distance D its bearings reach to +-beta with sin beta = R / D, and D - R is nearest.
Shadows and other things behind change the far contour, so a thing whose near contour is an arc is taken for a disc.

Measured on 150 pictures, none of which any number here was chosen on, of discs and boxes of 0.14 to 0.6 m (camera
0.9 m up, 45 degrees down, 640 x 480, noise of 3 grey levels), root mean square of the centre along the view, with the
bias, at 0.6-1.2, 1.2-1.8 and 1.8-2.4 m: discs 2, 3, 6 mm (-1, -2, -4); boxes at any angle 21, 33, 55 mm (-1, +12, +5);
square boxes face on, whose ends tell least of the height, 17, 58, 116 mm (0, -46, -105), the last more than their
covariance says. Across it was below 12 mm. The diameter was 8 mm off for discs, 29, 57, 87 mm for boxes and 24, 85,
179 mm for those face on.

From 1.8 m on a disc as small as 0.14 m cannot be told from a box: its diameter came out up to 70 mm too large.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from services.tracker.circle import smallest_circle
from services.tracker.contact import BIN, Contour
from services.tracker.region import Region, along_and_across
from services.vision.floor_view import SHRINK, FloorView

Array = NDArray[np.float64]

HEIGHT, HEIGHT_DEVIATION = 0.18, 0.08
"""m, of things, as they are expected"""
_OUTER = 0.35
"""Share of half a thing's width over which its ends are looked at."""
_WIDE = 10 * BIN
"""rad, half of what a thing takes for the slope at its ends to be told from what comes after."""
_ARC = 0.008
"""m, root mean square by which a near contour may be off an arc, beside the pixels' own."""
_ROUND = 0.7
"""An arc has to be that much closer to a near contour than a straight line. Of pictures of discs it was 0.1 to 0.65, of
boxes 0.75 and more."""
_FLAT = 0.12
"""Share of its width by which a front may stand out and still be flat."""
_DEEP = 0.3
"""m, the most that a flat front of which no top is seen is taken to be deep"""


def footprint(view: FloorView, contour: Contour) -> Region:
    """Return the circle around a thing."""
    pixel = _pixel(view, float(contour.near.min()))
    disc, off, straight = _as_disc(contour)
    height = 0.0
    if not contour.topless:
        height = view.camera_height * (1.0 - 1.0 / _growth(view, contour, off < straight))
    if off < math.hypot(_ARC, pixel / 2.0) and off < _ROUND * straight:
        centre, diameter = disc
        along = math.hypot(0.01, pixel)
    elif contour.topless:
        centre, diameter = _without_top(contour, disc)
        along = math.hypot(0.07, pixel)
    else:
        near = _without_spikes(contour.near, pixel)
        far = np.maximum(contour.far * (1.0 - height / view.camera_height), near)
        centre, diameter = smallest_circle(np.vstack([contour.points(near), contour.points(far)]))
        along = math.hypot(0.025, 2.0 * pixel)
    across = math.hypot(0.008, 0.4 * pixel)
    cut = contour.sideways or bool(contour.hidden.mean() > 0.2)
    if cut:
        along, across = along + 0.1, across + 0.1
    outermost = 0.0 if contour.topless else float(contour.far.max())
    return Region(
        view.below + centre, diameter, along_and_across(centre, along, across), float(contour.near.min()), outermost,
        height, contour.count, cut,
    )  # fmt: skip


def placed_by_top(view: FloorView, region: Region, height: float, diameter: float) -> Region:
    """Return a region whose near side is hidden, placed by the far edge of its top.

    Args:
        height, diameter: m, of the thing, as it was seen before.
    """
    if region.outermost == 0.0:
        return region
    away = region.centre - view.below
    distance = region.outermost * (1.0 - height / view.camera_height) - diameter / 2.0
    centre = away / np.hypot(*away) * distance
    pixel = _pixel(view, region.outermost)
    covariance = along_and_across(centre, math.hypot(0.03, pixel), 0.03)
    return replace(region, centre=view.below + centre, diameter=diameter, covariance=covariance, height=height)


def _pixel(view: FloorView, distance: float) -> float:
    """Return what a pixel covers of the floor, along the distance, m."""
    h = view.camera_height
    return SHRINK * (distance**2 + h**2) / (h * float(view.camera.matrix[1, 1]))


def _without_spikes(near: Array, pixel: float) -> Array:
    """Return a near contour, (N,), m, whose two outermost bins at each end go on as those beside them.

    There may be a few pixels of the top only, which seem to stand where the floor behind the thing is.
    """
    near = near.copy()
    if len(near) >= 8:
        for ordered in (near, near[::-1]):
            slope = max(float(ordered[2] - ordered[4]) / 2.0, 0.0)
            ordered[1] = min(ordered[1], ordered[2] + slope + 2.0 * pixel)
            ordered[0] = min(ordered[0], ordered[1] + slope + 2.0 * pixel)
    return near


def _as_disc(contour: Contour) -> tuple[tuple[Array, float], float, float]:
    """Return centre, (2,), from below the camera, and diameter of the disc with such bearings and nearest distance.

    And the root mean squares, m, by which the contour is off its arc, and off a straight front.
    """
    sine = math.sin(min((contour.left - contour.right) / 2.0, 1.2))
    middle = (contour.left + contour.right) / 2.0
    nearest = float(np.median(np.sort(contour.near)[:3]))
    distance = nearest / (1.0 - sine)
    cosine = np.cos(contour.bearing - middle)
    arc = distance * (cosine - np.sqrt(np.maximum(sine**2 - 1.0 + cosine**2, 0.0)))
    centre = distance * np.array([math.cos(middle), math.sin(middle)])
    # At the very ends a pixel's bearing decides about centimetres.
    inner = np.abs(contour.bearing - middle) < 0.9 * (contour.left - contour.right) / 2.0
    if inner.sum() < 3:
        return (centre, 2.0 * distance * sine), 0.0, 1.0
    off = float(np.sqrt(np.mean((contour.near - arc)[inner] ** 2)))
    front = contour.points(contour.near)[inner]
    straight = float(np.linalg.svd(front - front.mean(axis=0), compute_uv=False)[1] / math.sqrt(len(front)))
    return (centre, 2.0 * distance * sine), off, straight


def _growth(view: FloorView, contour: Contour, rounded: bool) -> float:
    """Return 1 / (1 - h / H): how much farther than its far side the floor behind a thing's top is seen.

    At an angle t from an end, far / near is that factor times 1 + O(sqrt t) where the end is round, and 1 + O(t) where
    it is a corner. The logarithm is fitted with both at each end, none of them negative, by least squares.
    """
    half = (contour.left - contour.right) / 2.0
    t = np.minimum(contour.bearing - contour.right, contour.left - contour.bearing)
    use = (t > BIN / 4.0) & (t < max(_OUTER * half, 4.5 * BIN))
    t, near, far = t[use], contour.near[use], contour.far[use]
    on_left = contour.bearing[use] > (contour.left + contour.right) / 2.0
    h = view.camera_height
    share = SHRINK / (h * float(view.camera.matrix[1, 1]))
    deviation = 0.01 + 0.4 * share * np.hypot((near**2 + h**2) / near, (far**2 + h**2) / far)
    rise = np.sqrt(t) if rounded or half < _WIDE else t
    terms = np.column_stack([np.ones(len(t)), rise * on_left, rise * ~on_left])
    below = max(h - HEIGHT, 0.1)
    expected, known = math.log(h / below), below / HEIGHT_DEVIATION
    terms = np.vstack([terms / deviation[:, None], [known, 0.0, 0.0]])
    solution, _ = nnls(terms, np.append(np.log(far / near) / deviation, expected * known))
    return math.exp(float(solution[0]))


def _without_top(contour: Contour, disc: tuple[Array, float]) -> tuple[Array, float]:
    """Return centre, (2,), from below the camera, and diameter where only the near contour is known.

    Two sides of a box show its diagonal. Behind a flat front there is as much as it is wide, up to a limit.
    """
    points = contour.points(contour.near)
    first, last = points[0], points[-1]
    width = float(np.hypot(*(last - first)))
    if width < 1e-6:
        return disc
    normal = np.array([first[1] - last[1], last[0] - first[0]]) / width
    normal *= np.sign(normal @ (first + last))
    if float(((first - points) @ normal).max()) > _FLAT * width:
        return smallest_circle(points)
    depth = min(width, _DEEP)
    return smallest_circle(np.vstack([points, points + depth * normal]))
