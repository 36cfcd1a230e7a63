"""Follows one object over the floor: a Kalman filter that knows that only what is pushed moves, and where contact is.

Constant velocity with a drag: the floor's friction stops an object that nobody pushes within a fraction of a second, so
what was seen last is the best guess of one that is out of sight. A base that would stand in a hidden object pushes it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime.messages import Visibility
from runtime.time import SECOND, Time
from services.geometry.angles import difference, wrap
from services.tracker.config import FilterConfig

Array = NDArray[np.float64]

_GATE = 13.8
"""squared normalised error of two numbers that one reading in a thousand exceeds"""
_GATE_YAW = 10.8
"""the same of one number"""
_ANEW, _ALIKE = 4, 0.25
"""readings in a row beyond the gate, and m from one to the next, at which they are believed: somebody has moved the
object"""
_CORRELATED = 0.1
"""s for which an acceleration lasts: `shove` is its deviation over so long"""
_NEAR = 0.06
"""m between base and object within which it may be pushed"""


@dataclass(frozen=True)
class Reading:
    """Where an object was seen.

    Attributes:
        place: (2,), m, a frame that stands still: o. covariance: (2, 2), m^2, the same.
        yaw: rad, the same; None where it was not seen. yaw_variance: rad^2.
        diameter: m, d_o; 0 where it was not seen.
    """

    place: Array
    covariance: Array
    yaw: float | None
    yaw_variance: float
    diameter: float


@dataclass
class Track:
    """What is known of the object.

    Attributes:
        stamp: ns, of everything else.
        mean: (4,), x, y, m, vx, vy, m/s, a frame that stands still; covariance: (4, 4).
        yaw: (2,), rad and rad/s; yaw_covariance: (2, 2); oriented: whether it was ever seen.
        diameter: m. readings: how many there were of it.
        seen: ns, when it was seen last. strange: readings in a row that were beyond the gate,
            and alike; strange_at: (2,), m, the last of them.
        strange_yaw: the same of the yaw.
        robot: (2,), m, where the base was at `stamp`. nearest: m, least distance from there to o while it was seen: an
            object that is no disc comes nearer than its bounding circle.
    """

    stamp: Time
    mean: Array
    covariance: Array
    yaw: Array = field(default_factory=lambda: np.zeros(2))
    yaw_covariance: Array = field(default_factory=lambda: np.diag([math.pi**2, 1.0]))
    oriented: bool = False
    diameter: float = 0.0
    readings: int = 0
    seen: Time = 0
    strange: int = 0
    strange_at: tuple[float, float] = (0.0, 0.0)
    strange_yaw: int = 0
    robot: Array = field(default_factory=lambda: np.full(2, 1e6))
    nearest: float = 1e6

    @classmethod
    def begin(cls, reading: Reading, stamp: Time, config: FilterConfig) -> Track:
        """Return the track of an object that is seen for the first time."""
        covariance = np.zeros((4, 4))
        covariance[:2, :2] = reading.covariance
        covariance[2:, 2:] = np.eye(2) * config.speed**2
        track = cls(stamp, np.array([*reading.place, 0.0, 0.0]), covariance)
        track._take_yaw(reading)
        track._note(reading, stamp, config)
        return track

    def carry(self, before: Array, after: Array) -> None:
        """Move everything with the robot, whose pose, (3,), is `after` by now and was `before`: it stays beside it."""
        turn = float(after[2] - before[2])
        c, s = math.cos(turn), math.sin(turn)
        turned = np.array([[c, -s], [s, c]])
        whole = np.kron(np.eye(2), turned)
        self.mean = np.concatenate([after[:2] + turned @ (self.mean[:2] - before[:2]), turned @ self.mean[2:]])
        self.covariance = whole @ self.covariance @ whole.T
        self.yaw[0] = wrap(float(self.yaw[0]) + turn)
        self.robot = after[:2]
        self.strange = 0

    def visibility(self, now: Time, config: FilterConfig) -> Visibility:
        """Return whether the object is seen, only predicted, or lost, at `now`, ns."""
        age = (now - self.seen) / SECOND
        if age <= config.visible_for:
            return Visibility.VISIBLE
        return Visibility.PREDICTED if age <= config.predicted_for else Visibility.LOST

    def predict(self, stamp: Time, robot: Array, robot_diameter: float, config: FilterConfig) -> None:
        """Go on to `stamp`.

        Args:
            robot: (2,), m, the same frame, where the base is then.
            robot_diameter: d_r, m.
        """
        dt = (stamp - self.stamp) / SECOND
        if dt <= 0.0:
            return
        touch = 0.5 * (robot_diameter + self.diameter)
        near = math.hypot(*(self.mean[:2] - robot)) < touch + _NEAR
        drag, shove = (config.drag_pushed, config.shove_pushed) if near else (config.drag, config.shove)
        kept = math.exp(-dt / drag)
        way = drag * (1.0 - kept)
        step = np.array([[1.0, 0.0, way, 0.0], [0.0, 1.0, 0.0, way], [0.0, 0.0, kept, 0.0], [0.0, 0.0, 0.0, kept]])
        self.mean = step @ self.mean
        self.covariance = step @ self.covariance @ step.T + _noise(dt, drag, shove)
        turned = np.array([[1.0, way], [0.0, kept]])
        self.yaw = turned @ self.yaw
        self.yaw[0] = wrap(float(self.yaw[0]))
        spin = shove / max(0.5 * self.diameter, 0.05)
        self.yaw_covariance = turned @ self.yaw_covariance @ turned.T + _noise(dt, drag, spin)[::2, ::2]
        self.robot = robot
        off = self.mean[:2] - robot
        distance, least = math.hypot(off[0], off[1]), min(touch, self.nearest)
        if 0.0 < distance < least and (stamp - self.seen) / SECOND > config.visible_for:
            # It is not in the base: it was pushed on, the shortest way.
            self.mean[:2] = robot + off * (least / distance)
        self.stamp = stamp

    def correct(self, reading: Reading, config: FilterConfig) -> bool:
        """Take a reading of now. Returns whether it was believed."""
        look = self.covariance[:2, :2] + reading.covariance
        off = reading.place - self.mean[:2]
        if float(off @ np.linalg.solve(look, off)) > _GATE:
            agrees = self.strange > 0 and math.dist(reading.place, self.strange_at) < _ALIKE
            self.strange = self.strange + 1 if agrees else 1
            self.strange_at = (float(reading.place[0]), float(reading.place[1]))
            if self.strange < _ANEW:
                return False
            anew = Track.begin(reading, self.stamp, config)
            self.mean, self.covariance = anew.mean, anew.covariance
        else:
            gain = np.linalg.solve(look, self.covariance[:2]).T
            self.mean = self.mean + gain @ off
            kept = np.eye(4)
            kept[:, :2] -= gain
            # Joseph's form stays symmetric and positive.
            self.covariance = kept @ self.covariance @ kept.T + gain @ reading.covariance @ gain.T
        self.strange = 0
        self.nearest = min(self.nearest, math.hypot(*(self.mean[:2] - self.robot)))
        self._take_yaw(reading)
        self._note(reading, self.stamp, config)
        return True

    def _take_yaw(self, reading: Reading) -> None:
        if reading.yaw is None:
            return
        off = difference(reading.yaw, float(self.yaw[0]))
        look = float(self.yaw_covariance[0, 0]) + reading.yaw_variance
        if not self.oriented or (off * off / look > _GATE_YAW and self.strange_yaw + 1 >= _ANEW):
            self.yaw = np.array([reading.yaw, 0.0])
            self.yaw_covariance = np.diag([reading.yaw_variance, 1.0])
            self.oriented, self.strange_yaw = True, 0
            return
        if off * off / look > _GATE_YAW:
            self.strange_yaw += 1
            return
        gain = self.yaw_covariance[:, 0] / look
        self.yaw = self.yaw + gain * off
        self.yaw[0] = wrap(float(self.yaw[0]))
        kept = np.eye(2)
        kept[:, 0] -= gain
        self.yaw_covariance = kept @ self.yaw_covariance @ kept.T + np.outer(gain, gain) * reading.yaw_variance
        self.strange_yaw = 0

    def _note(self, reading: Reading, stamp: Time, config: FilterConfig) -> None:
        self.seen = stamp
        if reading.diameter > 0.0:
            self.readings += 1
            share = max(1.0 / self.readings, config.diameter_share)
            self.diameter += share * (reading.diameter - self.diameter)


def _noise(dt: float, drag: float, shove: float) -> Array:
    """Return the covariance, (4, 4), that white accelerations add over `dt` s to what drags to a stop in `drag` s.

    That of an Ornstein-Uhlenbeck velocity and its integral: one step adds what many do.
    """
    q, kept = shove**2 * _CORRELATED, math.exp(-dt / drag)
    place = q * drag**2 * (dt - 2.0 * drag * (1.0 - kept) + 0.5 * drag * (1.0 - kept**2))
    both, speed = 0.5 * q * drag**2 * (1.0 - kept) ** 2, 0.5 * q * drag * (1.0 - kept**2)
    one = np.array([[max(place, 0.0), both], [both, speed]])
    out = np.zeros((4, 4))
    out[np.ix_((0, 2), (0, 2))] = one
    out[np.ix_((1, 3), (1, 3))] = one
    return out
