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

    Projected Gauss-Seidel: each point in turn is given the impulse that would stop it, cut to its limit, until
    a whole sweep changes less than TOLERANCE of what all points can do. The step of a point uses the largest
    eigenvalue of its inverse mass, so a sliding point's impulse ends exactly against its velocity.
    """
    qw, qz = float(quaternion[0]), float(quaternion[3])
    c, s = qw * qw - qz * qz, 2.0 * qw * qz
    vx = c * velocity[0] + s * velocity[1]
    vy = -s * velocity[0] + c * velocity[1]
    w = float(spin[2])
    if vx == 0.0 and vy == 0.0 and w == 0.0:
        return 0
    count = position.shape[0]
    px, py = np.zeros(count), np.zeros(count)
    enough = 0.0
    for i in range(count):
        enough += max(limit[i, 0], limit[i, 1])
    enough *= duration * TOLERANCE
    used = 0
    for _ in range(SWEEPS):
        used += 1
        change = 0.0
        for i in range(count):
            x, y = position[i, 0], position[i, 1]
            ux, uy = vx - w * y, vy + w * x
            nx, ny = 0.0, 0.0
            if isotropic:
                step = 1.0 / (1.0 / mass + (x * x + y * y) / inertia)
                nx, ny = px[i] - step * ux, py[i] - step * uy
                size, cap = np.sqrt(nx * nx + ny * ny), limit[i, 0] * duration
                if size > cap:
                    nx, ny = nx * cap / size, ny * cap / size
            else:
                ax, ay = axis[i, 0], axis[i, 1]
                along, across = x * ay - y * ax, x * ax + y * ay
                a = px[i] * ax + py[i] * ay - (ux * ax + uy * ay) / (1.0 / mass + along * along / inertia)
                cap = limit[i, 0] * duration
                a = min(max(a, -cap), cap)
                # The first axis acts before the second sees the velocity, as in any Gauss-Seidel sweep.
                da = a - (px[i] * ax + py[i] * ay)
                vx, vy, w = vx + da * ax / mass, vy + da * ay / mass, w + da * along / inertia
                change += abs(da)
                ux, uy = vx - w * y, vy + w * x
                b = -px[i] * ay + py[i] * ax
                px[i], py[i] = px[i] + da * ax, py[i] + da * ay
                b -= (-ux * ay + uy * ax) / (1.0 / mass + across * across / inertia)
                cap = limit[i, 1] * duration
                b = min(max(b, -cap), cap)
                nx, ny = a * ax - b * ay, a * ay + b * ax
            dx, dy = nx - px[i], ny - py[i]
            vx, vy, w = vx + dx / mass, vy + dy / mass, w + (x * dy - y * dx) / inertia
            px[i], py[i] = nx, ny
            change += abs(dx) + abs(dy)
        if change <= enough:
            break
    if abs(vx) < REST and abs(vy) < REST and abs(w) < REST:
        vx, vy, w = 0.0, 0.0, 0.0
    velocity[0] = c * vx - s * vy
    velocity[1] = s * vx + c * vy
    spin[2] = w
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
