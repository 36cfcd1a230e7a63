"""Odometry that drifts: errors come with motion only, and stay."""

from __future__ import annotations

from math import cos, hypot, sin, sqrt

import msgspec
import numpy as np
from numpy.typing import NDArray

from drivers.angles import wrap
from drivers.sapien.scene import SensorNoise

Vector = tuple[float, float, float]


class OdometryState(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What odometry goes on from.

    true: x, y, theta, map frame, at the last reading. reading: x, y, theta, odom frame. travelled: m.
    turned: rad, both since the start.
    """

    true: Vector
    reading: Vector
    travelled: float = 0.0
    turned: float = 0.0


class DriftingOdometry:
    """Adds up the base's motion with errors that grow with the root of the way.

    distance: m per root of a metre, along and across the motion. turn: rad per root of a radian turned.
    heading: rad per root of a metre travelled. The odom frame is where the base started.
    """

    def __init__(self, distance: float, turn: float, heading: float, start: NDArray[np.float64]) -> None:
        self._distance, self._turn, self._heading = distance, turn, heading
        self.state = OdometryState(true=_vector(start), reading=(0.0, 0.0, 0.0))

    @classmethod
    def of(cls, noise: SensorNoise, start: NDArray[np.float64]) -> DriftingOdometry:
        """Return the odometry of a scene's noise, of a base that begins at `start`, (3,), map frame."""
        return cls(noise.odometry_distance, noise.odometry_turn, noise.odometry_heading, start)

    def read(self, robot_pose: NDArray[np.float64], generator: np.random.Generator) -> NDArray[np.float64]:
        """Return the pose odometry shows now, (3,) x, y, theta, odom frame, m and rad, theta in (-pi, pi].

        robot_pose: (3,), the true one, map frame. Read often: between two readings the base is taken to go
        straight.
        """
        x, y, theta = self.state.true
        c, s = cos(theta), sin(theta)
        gone_x, gone_y = float(robot_pose[0]) - x, float(robot_pose[1]) - y
        ahead, aside = c * gone_x + s * gone_y, -s * gone_x + c * gone_y
        turned = wrap(float(robot_pose[2]) - theta)
        way = hypot(ahead, aside)
        draw_x, draw_y, draw_turn = (float(one) for one in generator.standard_normal(3))
        error_turn = sqrt(self._turn**2 * abs(turned) + self._heading**2 * way) * draw_turn
        ahead += self._distance * sqrt(way) * draw_x
        aside += self._distance * sqrt(way) * draw_y
        rx, ry, rt = self.state.reading
        c, s = cos(rt), sin(rt)
        reading = (rx + c * ahead - s * aside, ry + s * ahead + c * aside, wrap(rt + turned + error_turn))
        self.state = OdometryState(
            true=_vector(robot_pose),
            reading=reading,
            travelled=self.state.travelled + way,
            turned=self.state.turned + abs(turned),
        )
        return np.array(reading)


def _vector(pose: NDArray[np.float64]) -> Vector:
    return float(pose[0]), float(pose[1]), float(pose[2])
