"""Which way an object is turned whose yaw no tracker sees: told from where it goes, with the response as it is known.

What rolls or slides unevenly answers one push in one way and not in another, by how it is turned. A belief over yaw, on
bins all around, goes on with each window of the past (`experience`): every bin is carried through the window by the
model, weighed by how far from the object's true end it comes out, and moved on by the turn that the model gives it (a
histogram filter; Thrun, Burgard and Fox 2005, Sec. 4.1). Where nothing can be told, as of a disc, the belief grows
wider around dead reckoning. The object's frame is as it lay at the first window. All in m, s, rad, map frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.predictive.fit import OFF_CONTOUR, carry
from services.predictive.model import radius

Array = NDArray[np.float64]

BINS = 72
"""5 degrees each"""
_WIDTH = 2.0 * math.pi / BINS
_ANYWHERE, _UNBELIEVED = 1e-15, 1e-9
"""belief in every bin; belief below which a bin is not looked at"""
_NOISE, _ROBUST = 0.010, 4.0
"""m that ends of windows are off by their noise and the model's faults; deviations at which more tells no more"""
_LEAST, _OF_TURN, _OF_WAY = 0.02, 0.3, 0.4
"""rad, share of a turn, and rad/m of the object's way, that the model's turn is off from window to window"""
_FAR = 0.6
"""rad around the likeliest bin over which the mean is taken"""


@dataclass
class Heading:
    """A belief.

    Attributes:
        belief: (BINS,), that yaw at the start of the last window lies in the bin around 2 pi k / BINS; sums to 1.
        turns: (SAMPLES, BINS), rad, how far the model turns it from there until each observation of that window.
        way: m that the object went in it.
    """

    belief: Array = field(default_factory=lambda: np.eye(1, BINS)[0])
    turns: Array = field(default_factory=lambda: np.zeros((0, BINS)))
    way: float = 0.0

    def observe(
        self, lag: int, rows: Array, start: Array, end: Array, base: Array, contour: Array, response: Array
    ) -> tuple[float, float]:
        """Take a window, and return yaw at its start and at its end.

        Args:
            lag: at which observation of the last window this one begins; of no account for the first.
            rows: (SAMPLES, 5), x, y of the robot, of the object, rate of the robot's turn.
            start: (7,), as in `experience`; its yaw and how far beyond the contour they touched are of no account.
            end: (2,), where the object ended.
        """
        if len(self.turns):
            self.belief = _moved(self.belief, self.turns[lag], self.way)
        misses, self.turns = _carried(self.belief, rows, start, end, base, contour, response)
        self.belief *= _likelihood(misses)
        self.belief /= self.belief.sum()
        self.way = math.dist(rows[0, 2:4], rows[-1, 2:4])
        best = int(np.argmax(self.belief))
        off = (np.arange(BINS) - best + BINS // 2) % BINS - BINS // 2
        share = np.where(np.abs(off) * _WIDTH < _FAR, self.belief, 0.0)
        share /= share.sum()
        first = _WIDTH * (best + float(share @ off))
        return first, first + float(share @ self.turns[-1])


@njit("f8[::1](f8[::1])", cache=True)
def _likelihood(misses: Array) -> Array:
    least = misses.min()
    found = np.empty(len(misses))
    for b in range(len(misses)):
        square = min((misses[b] / _NOISE) ** 2, _ROBUST**2) - min((least / _NOISE) ** 2, _ROBUST**2)
        found[b] = math.exp(-0.5 * square)
    return found


@njit("f8[::1](f8[::1],f8[::1],f8)", cache=True)
def _moved(belief: Array, turns: Array, way: float) -> Array:
    """Return the belief after each bin has turned by `turns`, (BINS,), less sure by what the model does not know."""
    after = np.full(len(belief), _ANYWHERE)
    for b in range(len(belief)):
        if belief[b] <= _ANYWHERE:
            continue
        # All in bins from here.
        off = math.sqrt(_LEAST**2 + (_OF_TURN * turns[b]) ** 2 + (_OF_WAY * way) ** 2 + _WIDTH**2 / 12.0)
        sigma, middle = off / _WIDTH, b + turns[b] / _WIDTH
        nearest, reach = math.floor(middle + 0.5), int(3.0 * sigma) + 1
        total = 0.0
        for j in range(nearest - reach, nearest + reach + 1):
            total += math.exp(-0.5 * ((j - middle) / sigma) ** 2)
        for j in range(nearest - reach, nearest + reach + 1):
            after[j % len(after)] += belief[b] * math.exp(-0.5 * ((j - middle) / sigma) ** 2) / total
    return after / after.sum()


@njit("Tuple((f8[::1],f8[:,::1]))(f8[::1],f8[:,::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[::1])", cache=True)
def _carried(
    belief: Array, rows: Array, start: Array, end: Array, base: Array, contour: Array, response: Array
) -> tuple[Array, Array]:
    """Return how far, m, from its end each bin brings the object, (BINS,), and how it turns, rad, (SAMPLES, BINS)."""
    misses, turns = np.full(BINS, np.inf), np.zeros((len(rows), BINS))
    robots, yaws = np.empty((len(rows), 3)), np.empty(len(rows))
    robots[:, 0], robots[:, 1], robots[:, 2] = rows[:, 0], rows[:, 1], rows[:, 4]
    for b in range(BINS):
        if belief[b] < _UNBELIEVED:
            continue
        yaw = b * _WIDTH
        # Where they touch is the contour's to know: else its faults would be taken for the yaw's.
        beyond = np.inf
        for k in range(len(rows)):
            dx, dy = rows[k, 0] - rows[k, 2], rows[k, 1] - rows[k, 3]
            gap = math.sqrt(dx * dx + dy * dy) - radius(contour, math.atan2(dy, dx) - yaw)[0]
            beyond = min(beyond, gap)
        beyond = min(max(beyond, -OFF_CONTOUR), OFF_CONTOUR)
        x, y, _ = carry(response, robots, start, yaw, beyond, base, contour, yaws)
        turns[:, b] = yaws - yaw
        dx, dy = x - end[0], y - end[1]
        misses[b] = math.sqrt(dx * dx + dy * dy)
    return misses, turns
