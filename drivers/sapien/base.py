"""The simulated mobile base: a disc that follows velocity commands as far as motors and wheels can."""

from __future__ import annotations

from math import exp, hypot, isfinite, pi
from typing import Annotated

import msgspec
import numpy as np
from numba import njit
from numpy.typing import NDArray

Positive = Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0, le=10.0)]


class CommandNotFinite(ValueError):
    """A velocity command holds a number that is not finite."""


class BaseModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A holonomic base. The defaults are a Robotino (Sec. 6.1, d_r = 0.46 m).

    diameter: d_r, m. mass: kg. speed: m/s, in any direction. angular_speed: rad/s. acceleration: m/s^2, of
    the ramp, in any direction. angular_acceleration: rad/s^2. lag: s, first-order lag behind the ramp.
    traction: N, most that the wheels can push. traction_torque: N m, most that they can turn.
    """

    diameter: Positive = 0.46
    mass: Positive = 20.0
    speed: Positive = 0.58
    angular_speed: Positive = pi / 2
    acceleration: Positive = 0.4
    angular_acceleration: Positive = pi
    lag: NotNegative = 0.1
    traction: Positive = 60.0
    traction_torque: Positive = 9.0

    @property
    def inertia(self) -> float:
        """Return the moment of inertia of an even disc about the vertical, kg m^2."""
        return self.mass * self.diameter**2 / 8

    def parameters(self, duration: float) -> NDArray[np.float64]:
        """Return what `drive` needs for substeps of `duration` s, (5,) float64."""
        keep = exp(-duration / self.lag) if self.lag > 0 else 0.0
        return np.array([
            self.acceleration * duration,
            self.angular_acceleration * duration,
            1.0 - keep,
            self.traction * duration / self.mass,
            self.traction_torque * duration / self.inertia,
        ])  # fmt: skip

    def within(self, vx: float, vy: float, omega: float) -> tuple[tuple[float, float, float], bool]:
        """Return the command the motors can follow, and whether it differs from the one given.

        vx, vy: m/s, omega: rad/s, base frame. Too fast a translation is scaled down, so its direction is kept.

        Raises:
            CommandNotFinite: a number is NaN or infinite.
        """
        if not (isfinite(vx) and isfinite(vy) and isfinite(omega)):
            raise CommandNotFinite(f"velocity command ({vx}, {vy}, {omega}), expected finite numbers")
        slower = min(1.0, self.speed / max(hypot(vx, vy), 1e-300))
        spin = min(max(omega, -self.angular_speed), self.angular_speed)
        return (slower * vx, slower * vy, spin), slower < 1.0 or spin != omega


@njit("void(f4[::1], f4[::1], f4[::1], f8[::1], f8[::1], f8[::1], f8[::1])", cache=True)
def drive(
    quaternion: NDArray[np.float32],
    velocity: NDArray[np.float32],
    spin: NDArray[np.float32],
    wish: NDArray[np.float64],
    ramp: NDArray[np.float64],
    reference: NDArray[np.float64],
    parameters: NDArray[np.float64],
) -> None:
    """Let the base act for one substep; changes `velocity`, `spin`, `ramp` and `reference` in place.

    quaternion: (4,), w x y z, rotation about z only. velocity: (3,), m/s, map frame. spin: (3,), rad/s.
    wish, ramp, reference: (3,) vx, vy, omega, base frame: what was commanded, the ramp towards it, and what
    the wheels aim at, a lag behind the ramp. parameters: of `BaseModel.parameters`.

    The wheels give the impulse that makes the aim come true at once, as far as their traction reaches; so the
    base is not infinitely strong, and slows down when what it pushes is too heavy.
    """
    dx, dy, dw = wish[0] - ramp[0], wish[1] - ramp[1], wish[2] - ramp[2]
    size = np.sqrt(dx * dx + dy * dy)
    if size > parameters[0]:
        dx, dy = dx * parameters[0] / size, dy * parameters[0] / size
    ramp[0] += dx
    ramp[1] += dy
    ramp[2] += min(max(dw, -parameters[1]), parameters[1])
    for i in range(3):
        reference[i] += parameters[2] * (ramp[i] - reference[i])
    qw, qz = float(quaternion[0]), float(quaternion[3])
    c, s = qw * qw - qz * qz, 2.0 * qw * qz
    gx = c * reference[0] - s * reference[1] - velocity[0]
    gy = s * reference[0] + c * reference[1] - velocity[1]
    gw = reference[2] - spin[2]
    size = np.sqrt(gx * gx + gy * gy)
    if size > parameters[3]:
        gx, gy = gx * parameters[3] / size, gy * parameters[3] / size
    velocity[0] += gx
    velocity[1] += gy
    spin[2] += min(max(gw, -parameters[4]), parameters[4])
