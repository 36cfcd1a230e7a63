"""What the base's sensors would read: laser scanner and infra-red ring."""

from __future__ import annotations

from functools import cache
from math import cos, pi, radians, sin
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from drivers.sapien.rays import Outlines, cast

Length = Annotated[float, msgspec.Meta(ge=0.0, le=100.0)]
Offset = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]

Pose = NDArray[np.float64]
"""(3,) x, y, theta, map frame, m and rad."""


class Laser(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A scanner in the base's plane.

    x, y, yaw: m and rad, where it sits in the base frame. field: rad, from the first beam to the last, which
    lie evenly about its own forward direction. minimum, maximum: m. step: m, readings are whole steps, as those
    of the scanners on Robotinos were seen to be.
    """

    x: Offset = 0.1
    y: Offset = 0.0
    yaw: Annotated[float, msgspec.Meta(ge=-pi, le=pi)] = 0.0
    field: Annotated[float, msgspec.Meta(gt=0.0, le=2 * pi)] = radians(270)
    beams: Annotated[int, msgspec.Meta(ge=2, le=10_000)] = 271
    minimum: Length = 0.05
    maximum: Length = 10.0
    step: Annotated[float, msgspec.Meta(gt=0.0, le=0.1)] = 0.01

    def bearings(self) -> NDArray[np.float64]:
        """Return the direction of each beam, (beams,) rad, in the scanner's own frame."""
        return np.linspace(-self.field / 2, self.field / 2, self.beams)


class RangeRing(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Infra-red sensors evenly around the base, the first looking forward, then counter-clockwise.

    radius: m, from the base's centre. minimum, maximum: m, from the sensor. cone: rad, half opening angle;
    the nearest of three rays in it is what the sensor sees.
    """

    count: Annotated[int, msgspec.Meta(ge=1, le=100)] = 9
    radius: Length = 0.225
    minimum: Length = 0.04
    maximum: Length = 0.41
    cone: Annotated[float, msgspec.Meta(ge=0.0, le=0.5)] = radians(3)

    def bearings(self) -> NDArray[np.float64]:
        """Return where each sensor looks, (count,) rad, base frame, in (-pi, pi]."""
        angle = 2 * np.pi * np.arange(self.count) / self.count
        return np.where(angle > np.pi, angle - 2 * np.pi, angle)


def laser_scan(
    laser: Laser, robot_pose: Pose, seen: Outlines, noise: float, generator: np.random.Generator
) -> NDArray[np.float64]:
    """Return the distance along each beam, (beams,) m, from the scanner.

    `laser.maximum` where nothing was met; what is nearer than `laser.minimum` reads as that. noise: m,
    standard deviation of a beam that met something.
    """
    x, y, theta = robot_pose
    c, s = cos(theta), sin(theta)
    place = np.array([x + c * laser.x - s * laser.y, y + s * laser.x + c * laser.y])
    origin = np.ascontiguousarray(np.broadcast_to(place, (laser.beams, 2)))
    bearing = theta + laser.yaw + _laser_bearings(laser)
    distance = cast(origin, bearing, laser.maximum, seen.boxes, seen.discs)
    noisy = _noisy(distance, laser.minimum, laser.maximum, noise, generator)
    return np.asarray(np.where(noisy < laser.maximum, laser.step * np.rint(noisy / laser.step), laser.maximum))


def ring_ranges(
    ring: RangeRing, robot_pose: Pose, seen: Outlines, noise: float, generator: np.random.Generator
) -> NDArray[np.float64]:
    """Return each sensor's distance, (count,) m, from the sensor.

    `ring.maximum` where nothing was met; what is nearer than `ring.minimum` reads as that. noise: m, standard
    deviation of a sensor that met something.
    """
    x, y, theta = robot_pose
    bearing = theta + _ring_bearings(ring)
    place = np.array([x, y]) + ring.radius * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    spread = np.array([-ring.cone, 0.0, ring.cone])
    rays = np.ascontiguousarray((bearing[:, None] + spread).ravel())
    distance = cast(np.repeat(place, 3, axis=0), rays, ring.maximum, seen.boxes, seen.discs)
    return _noisy(distance.reshape(-1, 3).min(axis=1), ring.minimum, ring.maximum, noise, generator)


@cache
def _laser_bearings(laser: Laser) -> NDArray[np.float64]:
    return laser.bearings()


@cache
def _ring_bearings(ring: RangeRing) -> NDArray[np.float64]:
    return ring.bearings()


def _noisy(
    distance: NDArray[np.float64],
    minimum: float,
    maximum: float,
    noise: float,
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    # One draw per reading whether it met something or not: later draws do not depend on what is seen.
    drawn = noise * generator.standard_normal(len(distance))
    met = distance < maximum
    return np.asarray(np.where(met, np.clip(distance + drawn, minimum, maximum), maximum))
