"""A Rao-Blackwellised particle filter over maps and poses: GMapping's method (Grisetti, Stachniss, Burgard 2007).

Each particle carries a pose and its own map. A scan is matched with the best particle's map, and settles on the
surfaces of each one's own; around that, scan and odometry together make a Gaussian, from which the new pose is drawn
and by whose mass the particle is weighted (the improved proposal, Sec. III.A). Their Gaussian is found from samples;
ours is that of the last step of a match of points to surfaces, which is finer. Particles are drawn anew only when their
weights have become uneven (Sec. III.B). All in m and rad, map frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from services.geometry.angles import wrap
from services.geometry.pose import between, compose
from services.mapping.grid import Maps
from services.mapping.matching import belief, climb, likelihood_field, search
from services.mapping.scan import Scan
from services.mapping.surfaces import settle

Array = NDArray[np.float64]

_COARSE, _FINE = 0.15, 0.04
"""m, deviations of beams' ends in the search over all poses nearby, and in the match"""
_WINDOW, _BOUNDS, _LATTICE = 3.0, (0.3, 0.4), (0.05, 0.02)
"""deviations of the odometry that the search goes to; m and rad to which at most; m and rad between its poses"""
_SURE = 30.0
"""independent beams that a scan is worth in the search: it has to find what the odometry got wrong"""
_STEP, _TURN = 0.03, 0.01
"""m and rad, first steps of the match"""
_WORTH = 60.0
"""independent beams that a scan is worth in the match: with fewer, poses that hardly fit are drawn"""
_FEW, _BEAMS = 90, 180
"""beams that are looked at in the search and in the match"""
_NOISE, _ROUNDS, _ASIDE = 0.015, 6, 0.06
"""m, deviation of beams' ends from surfaces; steps of the last match at most; m that it may go"""
_LEAST = (0.001, 0.001, 0.0003)
"""m, m, rad: least deviations of the Gaussian"""
_EVIDENCE = 0.1
"""share of a scan's likelihood that counts for the weights: what differs from map to map is mostly where noise has left
its cells. With all of it few particles were left in a passage, for no reason, and their errors were common to all"""
_TOGETHER = 0.5
"""m from the best particle within which others tell the same story"""


@dataclass
class Noise:
    """Deviations of the odometry: m per m, m per rad, rad per rad, rad per m, and what is added to every step."""

    along: float = 0.08
    by_turn: float = 0.05
    turn: float = 0.12
    by_way: float = 0.04
    least: float = 0.01
    least_turn: float = 0.01

    def covariance(self, step: Array) -> Array:
        """Return the covariance, (3, 3), base frame, of a step (3,)."""
        way, turn = math.hypot(step[0], step[1]), abs(step[2])
        place = self.least + self.along * way + self.by_turn * turn
        angle = self.least_turn + self.turn * turn + self.by_way * way
        return np.diag([place**2, place**2, angle**2])


_SINCE = Noise(least=0.0, least_turn=0.0)
"""That of the odometry between matches."""


@dataclass
class Particles:
    """P particles.

    Attributes:
        poses: (P, 3).
        log_weights: (P,), of which the largest is 0.
        maps: theirs.
        generator: draws.
        best: the particle with the largest weight; after a selection, one that comes from it.
    """

    poses: Array
    log_weights: Array
    maps: Maps
    generator: np.random.Generator = field(default_factory=lambda: np.random.Generator(np.random.PCG64(1)))
    best: int = 0

    @classmethod
    def at(cls, pose: Array, count: int, seed: int) -> Particles:
        """Return `count` particles at `pose`, that know nothing of the world."""
        generator = np.random.Generator(np.random.PCG64(seed))
        return cls(np.tile(pose, (count, 1)), np.zeros(count), Maps.of(count), generator)

    @property
    def weights(self) -> Array:
        """Return the weights, (P,), which add up to 1."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        return np.asarray(weights / weights.sum())

    def mean(self, poses: Array) -> Array:
        """Return the weighted mean, (3,), of a pose of each particle, (P, 3), over those that are near the best now.

        Each pose is drawn: along a passage, where beams say nothing of how far the robot has come, a single one walks
        at random.
        """
        near = np.hypot(*(self.poses - self.poses[self.best])[:, :2].T) < _TOGETHER
        weights = np.where(near, self.weights, 0.0)
        mean = poses[self.best] + weights @ _off(poses, poses[self.best]) / weights.sum()
        mean[2] = wrap(float(mean[2]))
        return np.asarray(mean)

    @property
    def pose(self) -> Array:
        """Return where the robot is now, (3,)."""
        return self.mean(self.poses)

    def after(self, step: Array, least: Array) -> tuple[Array, Array]:
        """Return the pose after a step, (3,), and its covariance, (3, 3), map frame.

        Args:
            step: of the odometry since the last match.
            least: (3, 3), of that match, what particles that agree do not know of.
        """
        pose = self.pose
        here = compose(pose, step)
        off = _off(self.poses, pose)
        # A heading that is off carries the robot aside on its way since the match; the odometry errs on that way too.
        lever = np.eye(3)
        lever[:2, 2] = pose[1] - here[1], here[0] - pose[0]
        c, s = math.cos(pose[2]), math.sin(pose[2])
        turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        since = turned @ _SINCE.covariance(step) @ turned.T
        return here, np.asarray(lever @ ((self.weights[:, None] * off).T @ off + least) @ lever.T + since)

    def move(self, step: Array, noise: Noise, scan: Scan) -> None:
        """Take a step of the odometry, (3,), base frame, and the scan after it."""
        covariance = noise.covariance(step)
        information: Array = np.linalg.inv(covariance).astype(np.float64)
        corrected = self._corrected(step, covariance, information, scan)
        for k in range(len(self.poses)):
            self._match(k, step, corrected, information, scan)
        self.best = int(np.argmax(self.log_weights))
        self.log_weights -= self.log_weights[self.best]

    def _corrected(self, step: Array, covariance: Array, information: Array, scan: Scan) -> Array:
        """Return the step, (3,), that the best particle's map makes likely. The odometry erred for all alike.

        So the search, and the match of beams to cells after it, are done once; each particle then settles on its own
        surfaces, which is a tenth of the work.
        """
        here = self.poses[self.best]
        expected = compose(here, step)
        shown, corner = self.maps.picture(self.best, expected[:2], scan.reach + 1.0)
        field = likelihood_field(shown, _COARSE)
        deviations = _WINDOW * np.sqrt(np.diag(covariance))
        steps = math.ceil(min(deviations[0], _BOUNDS[0]) / _LATTICE[0])
        turns = math.ceil(min(deviations[2], _BOUNDS[1]) / _LATTICE[1])
        pose, around = expected.copy(), (expected, _turned(information, expected[2]))
        search(field, *corner, pose, scan.thinned(_FEW), _SURE, *around, _LATTICE[0], steps, _LATTICE[1], turns)
        seen, ends = (self.maps.cells, self.maps.index[self.best], *self.maps.corner), scan.thinned(_BEAMS)
        climb(*seen, pose, ends, scan.start, _FINE, _WORTH, *around, _STEP, _TURN, 2)
        return between(here, pose)

    def _match(self, k: int, step: Array, corrected: Array, information: Array, scan: Scan) -> None:
        expected = compose(self.poses[k], step)
        around = (expected, _turned(information, expected[2]))
        seen = (self.maps.cells, self.maps.index[k], *self.maps.corner)
        pose, ends = compose(self.poses[k], corrected), scan.thinned(_BEAMS)
        begun = pose.copy()
        whole = settle(*seen, pose, ends, scan.start, _NOISE, _WORTH, *around, _ROUNDS)
        if not np.isfinite(pose).all() or math.hypot(*(pose - begun)[:2]) > _ASIDE:
            pose = begun  # what settled elsewhere found another surface
        covariance = np.linalg.inv(whole) + np.diag(np.square(_LEAST))
        self.poses[k] = self.generator.multivariate_normal(pose, covariance, method="cholesky")
        self.poses[k, 2] = wrap(float(self.poses[k, 2]))
        # The mass under the Gaussian around the match, by Laplace.
        mass = belief(*seen, pose, ends, scan.start, _FINE, _WORTH, *around)
        self.log_weights[k] += _EVIDENCE * (mass + 0.5 * math.log(float(np.linalg.det(covariance))))

    def draw(self, scan: Scan, cap: float) -> None:
        """Draw a scan on every particle's map."""
        for k, pose in enumerate(self.poses):
            self.maps.draw(k, pose, scan.ends, scan.returned, scan.start, cap)

    def select(self) -> NDArray[np.int64] | None:
        """Draw the particles anew, by their weights, if fewer than half of them count.

        Returns:
            Which each one comes from, (P,); None if all stay.
        """
        weights, count = self.weights, len(self.poses)
        if 1.0 / (weights**2).sum() >= 0.5 * count:
            return None
        # Systematic: one draw for all.
        marks = (self.generator.uniform() + np.arange(count)) / count
        chosen = np.minimum(np.searchsorted(np.cumsum(weights), marks), count - 1)
        self.poses, self.log_weights = self.poses[chosen], np.zeros(count)
        self.maps.take(chosen)
        # Systematic resampling passes over nobody who has more than an even share.
        self.best = int(np.argmax(chosen == self.best))
        return np.asarray(chosen)


def _off(poses: Array, pose: Array) -> Array:
    """Return what poses, (P, 3), are off one, (3,)."""
    off = poses - pose
    off[:, 2] = [wrap(float(angle)) for angle in off[:, 2]]
    return off


def _turned(information: Array, theta: float) -> Array:
    """Return an information matrix, (3, 3), of the base's frame in the map's."""
    c, s = math.cos(theta), math.sin(theta)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turned @ information @ turned.T)
