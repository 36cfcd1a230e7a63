"""Friction between an object and the floor, as impulses over weighted support points.

PhysX is right about sliding but not about turning: its pure-spin torque on a box is 1.8 times that of uniform
pressure, and mixed motion drifts sideways. So gravity is off there, and this module takes momentum from each
body once a substep. Each point resists with at most mu times its load: a disc of impulses where friction is
the same all ways, a rectangle in the wheel's frame for wheels. The impulses are implicit (they answer the
velocity after them), so a body comes to rest exactly and does not creep.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

SWEEPS = 40
"""Most sweeps. Three or four do while sliding; where 40 do not, a body just about to stop, 0.00005 m/s are left."""
TOLERANCE = 1e-4
GRAVITY = 9.81
REST = 1e-6
"""m/s and rad/s. What friction leaves slower than this, it holds: sweeps alone only come ever closer to rest."""


@dataclass(frozen=True)
class Floor:
    """What the floor can do to one body: float64, C-contiguous arrays in the body's frame about its centre of mass.

    position: (N, 2), m. limit: (N, 2), newton, largest friction along and across each point's axis; both are
    equal where friction is the same all ways. axis: (N, 2), unit vector along which a wheel rolls.
    isotropic: the limit is a disc, not a rectangle.
    """

    position: NDArray[np.float64]
    limit: NDArray[np.float64]
    axis: NDArray[np.float64]
    isotropic: bool


@njit("f8(f8[::1], f8[:, ::1], f8, f8, f8, f8[:, ::1], f8[:, ::1], f8[:, ::1], b1)", cache=True)
def _sweep(
    motion: NDArray[np.float64],
    impulse: NDArray[np.float64],
    mass: float,
    inertia: float,
    duration: float,
    position: NDArray[np.float64],
    limit: NDArray[np.float64],
    axis: NDArray[np.float64],
    isotropic: bool,
) -> float:
    """Give each point in turn the impulse that would stop it, cut to its limit; return how much that changed, N s.

    motion: (3,) vx, vy, omega, body frame, and impulse: (N, 2), N s, of each point along and across its axis,
    are changed in place. An isotropic point's step uses the largest eigenvalue of its inverse mass, so that a
    sliding point's impulse ends exactly against its velocity.
    """
    change = 0.0
    for i in range(position.shape[0]):
        x, y = position[i, 0], position[i, 1]
        ax, ay = axis[i, 0], axis[i, 1]
        # Lever arms of an impulse along and across the axis.
        along, across = x * ay - y * ax, x * ax + y * ay
        u = ax * motion[0] + ay * motion[1] + motion[2] * along
        v = -ay * motion[0] + ax * motion[1] + motion[2] * across
        if isotropic:
            step = 1.0 / (1.0 / mass + (x * x + y * y) / inertia)
            a, b = impulse[i, 0] - step * u, impulse[i, 1] - step * v
            size, cap = np.sqrt(a * a + b * b), limit[i, 0] * duration
            if size > cap:
                a, b = a * cap / size, b * cap / size
            da, db = a - impulse[i, 0], b - impulse[i, 1]
        else:
            cap = limit[i, 0] * duration
            a = impulse[i, 0] - u / (1.0 / mass + along * along / inertia)
            da = min(max(a, -cap), cap) - impulse[i, 0]
            # What acts along the axis also moves the point across it.
            v += da * along * across / inertia
            cap = limit[i, 1] * duration
            b = impulse[i, 1] - v / (1.0 / mass + across * across / inertia)
            db = min(max(b, -cap), cap) - impulse[i, 1]
        motion[0] += (da * ax - db * ay) / mass
        motion[1] += (da * ay + db * ax) / mass
        motion[2] += (da * along + db * across) / inertia
        impulse[i, 0] += da
        impulse[i, 1] += db
        change += abs(da) + abs(db)
    return change


@njit("i8(f4[::1], f4[::1], f4[::1], f8, f8, f8, f8[:, ::1], f8[:, ::1], f8[:, ::1], b1)", cache=True)
def resist(
    quaternion: NDArray[np.float32],
    velocity: NDArray[np.float32],
    spin: NDArray[np.float32],
    mass: float,
    inertia: float,
    duration: float,
    position: NDArray[np.float64],
    limit: NDArray[np.float64],
    axis: NDArray[np.float64],
    isotropic: bool,
) -> int:
    """Take one substep's friction from `velocity` and `spin`, in place. Return the number of sweeps used.

    quaternion: (4,), w x y z, rotation about z only. velocity: (3,), m/s, of the centre of mass, map frame.
    spin: (3,), rad/s. mass: kg. inertia: kg m^2 about the vertical through the centre of mass. duration: s.
    The other arguments are those of `Floor`.

    Projected Gauss-Seidel until a whole sweep changes less than TOLERANCE of what all points can do.
    """
    qw, qz = float(quaternion[0]), float(quaternion[3])
    c, s = qw * qw - qz * qz, 2.0 * qw * qz
    motion = np.empty(3)
    motion[0] = c * velocity[0] + s * velocity[1]
    motion[1] = -s * velocity[0] + c * velocity[1]
    motion[2] = float(spin[2])
    if motion[0] == 0.0 and motion[1] == 0.0 and motion[2] == 0.0:
        return 0
    impulse = np.zeros_like(position)
    enough = 0.0
    for i in range(position.shape[0]):
        enough += max(limit[i, 0], limit[i, 1])
    enough *= duration * TOLERANCE
    used, change = 0, np.inf
    while used < SWEEPS and change > enough:
        change = _sweep(motion, impulse, mass, inertia, duration, position, limit, axis, isotropic)
        used += 1
    if abs(motion[0]) < REST and abs(motion[1]) < REST and abs(motion[2]) < REST:
        motion[:] = 0.0
    velocity[0] = c * motion[0] - s * motion[1]
    velocity[1] = s * motion[0] + c * motion[1]
    spin[2] = motion[2]
    return used


def wrench(floor: Floor, twist: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the friction (fx, fy, torque) of `floor` on a body that slides steadily with `twist`, N and N m.

    twist: (3,) vx, vy, omega of the centre of mass, body frame. Every point pulls against its own velocity
    with all it has: a point of the limit surface.
    """
    x, y = floor.position.T
    velocity = np.stack([twist[0] - twist[2] * y, twist[1] + twist[2] * x], axis=1)
    if floor.isotropic:
        speed = np.hypot(*velocity.T)[:, None]
        force = -floor.limit * np.divide(velocity, speed, out=np.zeros_like(velocity), where=speed > 0)
    else:
        across = np.stack([-floor.axis[:, 1], floor.axis[:, 0]], axis=1)
        along = -floor.limit[:, 0] * np.sign((velocity * floor.axis).sum(axis=1))
        side = -floor.limit[:, 1] * np.sign((velocity * across).sum(axis=1))
        force = along[:, None] * floor.axis + side[:, None] * across
    return np.array([force[:, 0].sum(), force[:, 1].sum(), (x * force[:, 1] - y * force[:, 0]).sum()])
