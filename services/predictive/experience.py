"""Learns contour and response of an object from how it moved beside the robot, from nothing, while pushing.

The contour is a spline fitted by recursive least squares to distances at which robot and object were seen to touch.
The response is found by random search: whatever explains short windows of the past better than what is held, with a
prior, is held from then on. All in m, s, rad, map frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from services.predictive.fit import OFF_CONTOUR, STEP, carried, median_error, search
from services.predictive.heading import Heading
from services.predictive.known import Known, observed, prior_spread
from services.predictive.model import CONTOUR, RESPONSE, basis, prior_contour, prior_response, radius

Array = NDArray[np.float64]

SAMPLES = 9
"""observations in a window, 0.05 s apart"""

_WINDOWS = 100
_EVERY = 4
_LONGEST_GAP = 0.16
_NEAR = 0.06
_LEAD = 4
_TRAIL = 2
_ROWS = _LEAD + SAMPLES + _TRAIL
_PROPOSALS = 48
_LOOKS = 1000
_TOUCH_NOISE = 0.02
_LIMIT_NOISE = 0.01
_SLACK = 0.015
_GOLDEN = 2.399963
_MOVED = 0.02
_TRUST = 2.0


@dataclass
class Experience:
    """What is known of an object.

    Attributes:
        contour, spread: (CONTOUR,) and its covariance (CONTOUR, CONTOUR).
        response, prior: (RESPONSE,).
        begun, trust: the response that it began with, (RESPONSE,), and how many times as much as of a stranger's
            prior it takes to leave it.
        rows: the newest observations, (stamp ns, robot x, y, object x, y, yaw, rate of the robot's turn).
        robots, starts, ends: windows: (W, SAMPLES, 3) x, y and rate of turn; (W, 7) pose, velocity and how far beyond
            the contour they touched, m; (W, 3) pose.
        reach: m, distance of the centres where robot and bounding circle touch.
        touches, seen: how many observations of the contour and windows were taken.
        error, prior_error: m, median over the windows, of what is held and of the prior.
        heading: how the object is turned, where no tracker sees it; stamps: (W,), ns, of the windows' beginnings then.
    """

    contour: Array
    spread: Array
    response: Array
    prior: Array
    begun: Array
    reach: float
    generator: np.random.Generator
    rows: list[tuple[int, float, float, float, float, float, float]] = field(default_factory=list)
    robots: Array = field(default_factory=lambda: np.zeros((0, SAMPLES, 3)))
    starts: Array = field(default_factory=lambda: np.zeros((0, 7)))
    ends: Array = field(default_factory=lambda: np.zeros((0, 3)))
    touches: int = 0
    seen: int = 0
    since: int = 0
    error: float = 0.0
    prior_error: float = 0.0
    trust: float = 1.0
    heading: Heading | None = None
    stamps: list[int] = field(default_factory=list)

    @classmethod
    def of(cls, robot_diameter: float, object_diameter: float, seed: int, known: Known | None = None) -> Experience:
        """Return what is known of an object of that bounding circle before it was touched in this push.

        Args:
            known: from an earlier push of the same object.
        """
        prior = prior_response(object_diameter)
        contour, spread = prior_contour(robot_diameter, object_diameter), prior_spread(object_diameter)
        begun, touches, seen, trust = prior, 0, 0, 1.0
        if known is not None:
            contour, spread, begun = np.array(known.contour), known.covariance(), np.array(known.response)
            touches, seen = known.touches, known.windows
            trust += _TRUST * min(known.windows / _WINDOWS, 1.0)
        generator = np.random.Generator(np.random.PCG64(seed))
        reach = 0.5 * (robot_diameter + object_diameter)
        return cls(
            contour, spread, begun.copy(), prior, begun, reach, generator, touches=touches, seen=seen, trust=trust
        )

    def observe(
        self, stamp: int, r: tuple[float, float], o: tuple[float, float], yaw: float, turn: float, base: Array
    ) -> float:
        """Take an observation of both at `stamp`, the robot turning with `turn`, and think about the past.

        Returns what yaw, which was reckoned, has to be corrected by, rad; 0 where it is seen.
        """
        self.rows = [*self.rows[-_ROWS + 1 :], (stamp, *r, *o, yaw, turn)]
        self._touch()
        self.since += 1
        correction = 0.0
        if len(self.rows) == _ROWS and self.since >= _EVERY:
            correction = self._window(base)
        if len(self.starts):
            self._think(base)
        return correction

    def _touch(self) -> None:
        """Learn the distance of the centres in touch."""
        if len(self.rows) < _LEAD + 1:
            return
        recent = np.array([row[1:] for row in self.rows[-_LEAD - 1 :]])
        away = recent[:, 0:2] - recent[:, 2:4]
        distances = np.hypot(away[:, 0], away[:, 1])
        # Of pairs: a single row's noise would often look like motion.
        moved = recent[-2:, 2:4].mean(axis=0) - recent[:2, 2:4].mean(axis=0)
        travel = math.hypot(*moved)
        mean = away.mean(axis=0)
        distance = float(distances.mean())
        bearing = math.atan2(mean[1], mean[0]) - float(recent[len(recent) // 2, 4])
        expected, _ = radius(self.contour, bearing)
        pushed = travel > _MOVED and float(moved @ mean) < -0.3 * travel * distance
        steady = float(np.ptp(distances)) < 0.03
        driven = math.hypot(*(recent[-1, 0:2] - recent[0, 0:2])) > 0.5 * travel
        touching = pushed and steady and driven and distance < min(expected + 0.12, self.reach + _SLACK)
        if not touching and distance > expected - 0.012:
            return
        # Touches follow each other faster than their errors change: each counts for little.
        self._reaches(bearing, distance, _TOUCH_NOISE)
        self.spread = self.spread + np.diag(np.full(CONTOUR, 1e-8))
        self.touches += 1
        # The object is within its bounding circle, also where it was never touched: there the series may say nonsense.
        elsewhere = self.touches * _GOLDEN
        if radius(self.contour, elsewhere)[0] > self.reach:
            self._reaches(elsewhere, self.reach, _LIMIT_NOISE)

    def _reaches(self, bearing: float, distance: float, noise: float) -> None:
        """Take the contour to be `distance`, m, away at `bearing`, to within `noise`, m, by recursive least squares."""
        share, _ = basis(np.array([bearing]))
        self.contour, self.spread = observed(self.contour, self.spread, share[0], distance, noise)

    def _window(self, base: Array) -> float:
        """Keep the newest rows as a window if the object was near the robot, or moved; return a correction of yaw."""
        stamps = np.array([row[0] - self.rows[-1][0] for row in self.rows]) * 1e-9
        seen = np.array([row[1:] for row in self.rows])
        if np.diff(stamps).max() > _LONGEST_GAP:
            return 0.0
        seen[:, 4] = np.unwrap(seen[:, 4])
        times = STEP * np.arange(-_ROWS + 1, 1)
        rows = np.column_stack([np.interp(times, stamps, column) for column in seen.T])
        own = np.array([_line(rows[k - 1 : k + 2])[0] for k in range(_LEAD, _LEAD + SAMPLES)])
        pose, velocity = _line(rows[: 2 * _LEAD + 1])
        end, _ = _line(rows[-2 * _TRAIL - 1 :])
        gaps = np.hypot(*(own[:, 0:2] - own[:, 2:4]).T)
        travel = math.hypot(*(own[-1, 2:4] - own[0, 2:4]))
        if gaps.min() > self.contour.mean() + _NEAR:
            return 0.0
        # Where they touch is the contour's to know: else its faults would be taken for the response's.
        beyond = self._closest(own)
        if travel < _MOVED:
            beyond = min(beyond, 0.0)
        beyond = min(max(beyond, -OFF_CONTOUR), OFF_CONTOUR)
        start = np.array([*pose[2:5], *velocity[2:5], beyond])
        # What lay still and was to lie still teaches nothing, and would crowd out what does.
        expected = carried(self.response, own[:, [0, 1, 5]].copy(), start, base, self.contour)
        if travel < _MOVED and math.hypot(expected[0] - start[0], expected[1] - start[1]) < _MOVED:
            return 0.0
        self.robots = np.concatenate([self.robots[-_WINDOWS + 1 :], own[None][..., [0, 1, 5]]])
        self.starts = np.concatenate([self.starts[-_WINDOWS + 1 :], start[None]])
        self.ends = np.concatenate([self.ends[-_WINDOWS + 1 :], end[None, 2:5]])
        self.seen += 1
        self.since = 0
        return 0.0 if self.heading is None else self._turned(own, start, base)

    def _turned(self, own: Array, start: Array, base: Array) -> float:
        """Find how the object was turned in the newest window, of rows `own`, (SAMPLES, 6), and `start`.

        Returns what yaw has to be corrected by.
        """
        assert self.heading is not None
        stamp = self.rows[-1][0] - round((_ROWS - 1 - _LEAD) * STEP * 1e9)
        self.stamps = [*self.stamps[-_WINDOWS + 1 :], stamp]
        rows, end = np.ascontiguousarray(own[:, [0, 1, 2, 3, 5]]), self.ends[-1]
        lag = int(self._lags()[-2]) if len(self.stamps) > 1 else 0
        first, last = self.heading.observe(lag, rows, start, end[:2].copy(), base, self.contour, self.response)
        correction = last - float(end[2])
        self.starts[-1, 2], self.ends[-1, 2] = first, last
        self.rows = [(*row[:5], row[5] + correction, row[6]) for row in self.rows]
        return correction

    def _lags(self) -> NDArray[np.int64]:
        """Return at which of its observations each window is followed by the next, (W,); (0,) where yaw is seen."""
        apart = np.diff(np.array(self.stamps, np.int64)) * 1e-9 / STEP
        lags = np.minimum(np.rint(apart), SAMPLES - 1).astype(np.int64)
        return lags if self.heading is None else np.append(lags, SAMPLES - 1)

    def _closest(self, rows: Array) -> float:
        """Return the least gap between robot and contour in `rows`, m."""
        away = rows[:, 0:2] - rows[:, 2:4]
        bearings = np.arctan2(away[:, 1], away[:, 0]) - rows[:, 4]
        gaps = [math.hypot(*a) - radius(self.contour, b)[0] for a, b in zip(away, bearings, strict=True)]
        return min(gaps)

    def _think(self, base: Array) -> None:
        """Try other responses, and hold the best."""
        # The more windows, the longer each takes; and the less is to be found.
        looks = _LOOKS if self.heading is None else _LOOKS // 2
        count = min(_PROPOSALS, max(1, looks // len(self.starts)))
        draws = self.generator.standard_normal((count, RESPONSE))
        scales = 10.0 ** self.generator.uniform(-1.7, 0.3, count)
        anew = self.generator.uniform(size=count) < 0.25
        best = search(
            self.response, self.begun, self.trust, draws, scales, anew,
            self.robots, self.starts, self.ends, self._lags(), base, self.contour,
        )  # fmt: skip
        self.response = best
        self.error = median_error(best, self.robots, self.starts, self.ends, base, self.contour)
        self.prior_error = median_error(self.prior, self.robots, self.starts, self.ends, base, self.contour)


def _line(rows: Array) -> tuple[Array, Array]:
    """Return value in the middle and rate, a s, of the straight lines that fit the columns of `rows` best."""
    times = STEP * (np.arange(len(rows)) - 0.5 * (len(rows) - 1))
    return rows.mean(axis=0), times @ rows / float(times @ times)
