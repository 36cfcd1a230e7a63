"""Stretches of floor along bearings from the point below the camera, and where something stands at their end.

A thing on the floor takes the same bearings in the picture as its footprint, and its nearest pixel along each is where
it meets the floor (services.vision.floor_view). What it hides is not seen; behind it the floor may begin anew. So what
stands behind a low thing is seen over it, which a laser close to the floor cannot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.vision.floor_view import FloorView

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TURN, STEP = 0.02, 0.02
"""rad and m between the places that are looked at: cells of the map are 0.05 m"""
_SHORTEST = 4
"""places that are a stretch: fewer are noise at an edge"""
_BEHIND = 1.15
"""times the distance of a thing from which on another is behind it"""
_DEEPEST = 2
"""places in a row that have to show something, for it to stand there"""


@dataclass(frozen=True)
class Fan:
    """Places on the floor in polar coordinates around the point below the camera, and the pixels that look at them.

    Attributes:
        bearings: (B,), rad, base frame; distances: (D,), m.
        rows, columns: (B, D), the pixel; seen: (B, D), whether there is one.
    """

    view: FloorView
    bearings: Array
    distances: Array
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    seen: Mask

    @classmethod
    def of(cls, view: FloorView, furthest: float) -> Fan:
        """Return the fan out to `furthest`, m."""
        count = math.ceil(2.0 * math.pi / TURN)
        bearings = -math.pi + (np.arange(count) + 0.5) * (2.0 * math.pi / count)
        distances = (np.arange(int(furthest / STEP)) + 0.5) * STEP
        ways = np.column_stack([np.cos(bearings), np.sin(bearings)])
        places = view.below + distances[None, :, None] * ways[:, None, :]
        at, seen = view.looks_at(places.reshape(-1, 2))
        shape = (count, len(distances))
        at, seen = at.reshape(*shape, 2), seen.reshape(shape)
        some = seen.any(axis=1)
        return cls(view, np.asarray(bearings[some]), np.asarray(distances), at[some, :, 0], at[some, :, 1], seen[some])


@dataclass(frozen=True)
class Stretches:
    """N stretches of floor from the point below the camera: bearing, rad, from first to last, m, and what ends them."""

    bearing: Array
    first: Array
    last: Array
    met: Mask


def stretches(fan: Fan, standing: Mask, shown: Mask) -> Stretches:
    """Return the stretches of floor that a picture shows.

    Args:
        standing: (h, w), the view's pixels that do not show floor. shown: (h, w), those that show anything.
    """
    seen = fan.seen & shown[fan.rows, fan.columns]
    other = standing[fan.rows, fan.columns] & seen
    floor = seen & ~other
    edges = np.diff(np.pad(floor, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    ray, begin = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)  # the place after the last, of the same stretches in the same order
    beyond = np.pad(other, ((0, 0), (0, _DEEPEST)))
    met = np.all([beyond[ray, end + k] for k in range(_DEEPEST)], axis=0)
    long = end - begin >= _SHORTEST
    ray, begin, end, met = ray[long], begin[long], end[long], met[long]
    met &= ~_slivers(ray, end, other)
    # What is met is met within the first place that shows it.
    last = np.asarray(end * STEP + np.where(met, STEP / 2.0, 0.0))
    return Stretches(fan.bearings[ray], np.asarray(begin * STEP), last, met)


def _slivers(ray: NDArray[np.int64], end: NDArray[np.int64], other: Mask) -> Mask:
    """Return which stretches, (N,), end at no more than the upright edge of a nearer thing.

    An edge is seen along one bearing, and pixels of it on the floor behind as well. So at the bearing at which a thing
    ends, beside one that shows it and one that does not, what is met farther off is not believed.

    Args:
        ray, end: (N,), numbers of the bearing and of the place. other: (B, D), the places that do not show floor.
    """
    nearest = np.where(other.any(axis=1), other.argmax(axis=1), np.inf)
    padded = np.pad(nearest, 1, constant_values=np.inf)
    low, high = np.minimum(padded[:-2], padded[2:]), np.maximum(padded[:-2], padded[2:])
    ends_here = high > _BEHIND * low
    return np.asarray(ends_here[ray] & (end > _BEHIND * low[ray]))
