"""A forward model of robot and object in the plane: who moves where when the robot is sent a velocity.

The object is known by two things. Its contour rho(b): the distance between the centres of robot and object when they
touch and the robot stands at the bearing b from the object, in the object's frame; a periodic cubic B-spline. The
normal of this curve is the normal of the contact. And its response: an ellipsoidal limit surface (Howe and Cutkosky
1996) with the quasi-static closed form for a contact that sticks or slides (Lynch, Maekawa and Tanie 1992), and how
fast it comes to rest alone. What moves the contact is the robot's side: it goes with the robot's turn as well, and an
object on wheels is dragged a long way by that.

All quantities are in m, s, rad, map frame, unless said.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

CONTOUR = 24
"""coefficients of the contour: one every 15 degrees; a corner of the object is a bend of the contour that wide"""

ANISOTROPY, AXIS, CENTRE_X, CENTRE_Y, LENGTH, FRICTION, COASTING, RESPONSE = range(8)
"""Places in a response: log of friction across over along the easy axis, at least 0; rad, the axis in the object's
frame; m, the centre of friction in the object's frame; m, most friction torque over most friction force, which is the
one across: what turns must slide across its wheels; friction coefficient between robot and object; m/s^2, deceleration
along the easy axis. RESPONSE is their number."""

X, Y, YAW, VX, VY, OMEGA, RX, RY, RVX, RVY, RAMP_X, RAMP_Y, THETA, TURN, STATE = range(15)
"""Places in a state: the object's pose and velocity, the robot's position, velocity, the velocity its ramp has
reached, its orientation, and the rate at which it turns. STATE is their number."""

ACCELERATION, LAG, RADIUS, BASE = range(4)
"""Places in a base: m/s^2 of the ramp, s of the lag behind it, m of the robot's disc. BASE is their number."""

_TOUCH = 0.004
_EPSILON = 1e-9


def prior_contour(robot_diameter: float, object_diameter: float) -> Array:
    """Return the contour of a disc somewhat inside the bounding circle: (CONTOUR,)."""
    return np.full(CONTOUR, 0.5 * robot_diameter + 0.42 * object_diameter)


def prior_response(object_diameter: float) -> Array:
    """Return the response of an even disc on even ground: (RESPONSE,)."""
    response = np.zeros(RESPONSE)
    response[LENGTH] = 0.3 * object_diameter
    response[FRICTION] = 0.3
    response[COASTING] = 2.5
    return response


_PER_RADIAN = CONTOUR / (2.0 * math.pi)


@njit("UniTuple(f8,2)(f8[::1],f8)", cache=True)
def radius(contour: Array, bearing: float) -> tuple[float, float]:
    """Return rho and its derivative at `bearing`, object's frame."""
    place = bearing * _PER_RADIAN
    cell = math.floor(place)
    f = place - cell
    i = int(cell) % CONTOUR
    g = 1.0 - f
    a, b = contour[i - 1], contour[i]
    c, d = contour[(i + 1) % CONTOUR], contour[(i + 2) % CONTOUR]
    rho = a * g * g * g + b * (4.0 - 3.0 * f * f * (1.0 + g)) + c * (4.0 - 3.0 * g * g * (1.0 + f)) + d * f * f * f
    slope = 0.5 * (-a * g * g + b * f * (3.0 * f - 4.0) - c * g * (3.0 * g - 4.0) + d * f * f)
    return rho / 6.0, _PER_RADIAN * slope


@njit("UniTuple(f8[:,::1],2)(f8[::1])", cache=True)
def basis(bearings: Array) -> tuple[Array, Array]:
    """Return what each coefficient counts for in rho and its derivative at `bearings`, (N,): two (N, CONTOUR).

    The first has rows of sum 1, the second of sum 0.
    """
    share, change = np.empty((len(bearings), CONTOUR)), np.empty((len(bearings), CONTOUR))
    for k in range(CONTOUR):
        alone = np.zeros(CONTOUR)
        alone[k] = 1.0
        for i in range(len(bearings)):
            share[i, k], change[i, k] = radius(alone, bearings[i])
    return share, change


@njit("void(f8[::1],f8,f8,f8,f8,f8[::1])", cache=True)
def drive(state: Array, ux: float, uy: float, turn: float, dt: float, base: Array) -> None:
    """Let the robot follow the velocity (ux, uy) and the rate `turn` for `dt`: ramp, lag, motion. Changes `state`."""
    dx, dy = ux - state[RAMP_X], uy - state[RAMP_Y]
    change = math.sqrt(dx * dx + dy * dy)
    most = base[ACCELERATION] * dt
    share = 1.0 if change <= most else most / change
    state[RAMP_X] += share * dx
    state[RAMP_Y] += share * dy
    keep = math.exp(-dt / base[LAG]) if base[LAG] > 0.0 else 0.0
    before_x, before_y, before = state[RVX], state[RVY], state[TURN]
    state[TURN] = turn + keep * (before - turn)
    state[THETA] += 0.5 * dt * (before + state[TURN])
    state[RVX] = state[RAMP_X] + keep * (state[RVX] - state[RAMP_X])
    state[RVY] = state[RAMP_Y] + keep * (state[RVY] - state[RAMP_Y])
    state[RX] += 0.5 * dt * (before_x + state[RVX])
    state[RY] += 0.5 * dt * (before_y + state[RVY])


@njit("UniTuple(f8,3)(f8,f8,f8,f8,f8,f8,f8,f8[::1])", cache=True)
def _pushed(
    yaw: float, px: float, py: float, nx: float, ny: float, rvx: float, rvy: float, response: Array
) -> tuple[float, float, float]:
    """Return the object's twist under a contact at (px, py) from its centre, moved with (rvx, rvy).

    (nx, ny): the contact's normal into the object. Works in the frame of the easy axis, about the centre of friction:
    twist = D w for a wrench w on the limit surface, D = diag(1, e^-2a, e^-2a / l^2) up to a factor.
    """
    angle = yaw + response[AXIS]
    c, s = math.cos(angle), math.sin(angle)
    cy, sy = math.cos(yaw), math.sin(yaw)
    fx = cy * response[CENTRE_X] - sy * response[CENTRE_Y]
    fy = sy * response[CENTRE_X] + cy * response[CENTRE_Y]
    qx, qy = px - fx, py - fy
    ax, ay = c * qx + s * qy, -s * qx + c * qy
    nax, nay = c * nx + s * ny, -s * nx + c * ny
    vax, vay = c * rvx + s * rvy, -s * rvx + c * rvy
    across = math.exp(-2.0 * response[ANISOTROPY])
    turn = across / (response[LENGTH] * response[LENGTH])
    # The contact point's velocity for a force f there is M f, M = J D J^T.
    mxx = 1.0 + turn * ay * ay
    mxy = -turn * ax * ay
    myy = across + turn * ax * ax
    det = mxx * myy - mxy * mxy
    forcex, forcey = (myy * vax - mxy * vay) / det, (mxx * vay - mxy * vax) / det
    normal = forcex * nax + forcey * nay
    tangent = -forcex * nay + forcey * nax
    mu = response[FRICTION]
    if normal <= 0.0 or abs(tangent) > mu * normal:
        # It slips: the force lies on the friction cone's edge, and only the normal velocity is shared.
        side = mu if tangent > 0.0 else -mu
        forcex, forcey = nax - side * nay, nay + side * nax
        reach = nax * (mxx * forcex + mxy * forcey) + nay * (mxy * forcex + myy * forcey)
        size = (vax * nax + vay * nay) / max(reach, _EPSILON)
        forcex, forcey = size * forcex, size * forcey
    tx, ty = forcex, across * forcey
    omega = turn * (ax * forcey - ay * forcex)
    vx, vy = c * tx - s * ty, s * tx + c * ty
    # From the centre of friction to the object's centre.
    return vx + omega * fy, vy - omega * fx, omega


@njit("void(f8[::1],f8,f8[::1])", cache=True)
def _coast(state: Array, dt: float, response: Array) -> None:
    """Slow the object down as its ground does."""
    angle = state[YAW] + response[AXIS]
    c, s = math.cos(angle), math.sin(angle)
    along, across = c * state[VX] + s * state[VY], -s * state[VX] + c * state[VY]
    brake = response[COASTING] * dt
    along = math.copysign(max(0.0, abs(along) - brake), along)
    brake *= math.exp(response[ANISOTROPY])
    across = math.copysign(max(0.0, abs(across) - brake), across)
    omega = state[OMEGA]
    omega = math.copysign(max(0.0, abs(omega) - brake / (2.0 * response[LENGTH])), omega)
    state[VX], state[VY], state[OMEGA] = c * along - s * across, s * along + c * across, omega


@njit("UniTuple(f8,3)(f8[::1],f8[::1])", cache=True)
def _contact(state: Array, contour: Array) -> tuple[float, float, float]:
    """Return the gap between robot and object and the contour's outward normal where they are closest."""
    dx, dy = state[RX] - state[X], state[RY] - state[Y]
    distance = math.sqrt(dx * dx + dy * dy) + _EPSILON
    rho, slope = radius(contour, math.atan2(dy, dx) - state[YAW])
    # Outward normal of the contour: radial less tangential slope.
    ex, ey = dx / distance, dy / distance
    nx, ny = rho * ex + slope * ey, rho * ey - slope * ex
    norm = math.sqrt(nx * nx + ny * ny) + _EPSILON
    return distance - rho, nx / norm, ny / norm


@njit("void(f8[::1],f8,f8[::1],f8[::1],f8[::1])", cache=True)
def answer(state: Array, dt: float, base: Array, contour: Array, response: Array) -> None:
    """Let the object move for `dt` beside the robot that has moved. Changes `state`."""
    _coast(state, dt, response)
    touching, nx, ny = _contact(state, contour)
    if touching < _TOUCH:
        dx, dy = state[RX] - state[X], state[RY] - state[Y]
        px, py = dx - base[RADIUS] * nx, dy - base[RADIUS] * ny  # contact, from the object's centre
        vx, vy, omega = state[VX] - state[OMEGA] * py, state[VY] + state[OMEGA] * px, state[OMEGA]
        # The side of a base that turns moves along with the turn.
        side = base[RADIUS] * state[TURN]
        rx, ry = state[RVX] + side * ny, state[RVY] - side * nx
        closing = -((state[RVX] - vx) * nx + (state[RVY] - vy) * ny)
        if closing > 0.0:
            vx, vy, omega = _pushed(state[YAW], px, py, -nx, -ny, rx, ry, response)
            state[VX], state[VY], state[OMEGA] = vx, vy, omega
    state[X] += dt * state[VX]
    state[Y] += dt * state[VY]
    state[YAW] += dt * state[OMEGA]
    if touching < _TOUCH:
        # What the robot moved within this step must not push the object twice: its own motion first.
        gap, nx, ny = _contact(state, contour)
        if gap < 0.0:
            state[X] += gap * nx
            state[Y] += gap * ny


@njit("void(f8[::1],f8,f8,f8,f8,f8[::1],f8[::1],f8[::1])", cache=True)
def step(
    state: Array, ux: float, uy: float, turn: float, dt: float, base: Array, contour: Array, response: Array
) -> None:
    """Let `dt` pass with the robot sent (ux, uy) and `turn`, rad/s. Changes `state`."""
    drive(state, ux, uy, turn, dt, base)
    answer(state, dt, base, contour, response)
