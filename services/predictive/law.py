"""The closed-loop law of the predictive controller: push from behind, walk around at contact distance, stay inside.

One function gives the robot's velocity for a manoeuvre; rollouts and the controller both call it, so that what was
planned is what is done. A manoeuvre is a target for the object, a bias of the bearing to push from, a speed and a way
around. All in m, s, rad, map frame.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from services.geometry.angles import wrapped
from services.geometry.field import lookup, slope
from services.predictive.model import RAMP_X, RAMP_Y, RVX, RVY, RX, RY, THETA, VX, VY, YAW, X, Y, radius

Array = NDArray[np.float64]

TARGET_X, TARGET_Y, BIAS, SPEED, SIDE, BODY, STAND, LEAN, WALK, MANOEUVRE = range(10)
"""Places in a manoeuvre: m, where the object is to go; rad, bearing from exactly behind; m/s; -1 or 1, the way around
the object, 0 the shorter; 1 to push at a place of the body instead of behind: rad, its bearing in the object's frame;
rad, push direction from towards the object's centre; m/s, of the way around. MANOEUVRE is their number."""

WALK_FROM = 0.9
PUSH_FROM = 0.3
RING = 0.045
GAIN = 1.6
_STEER_MOST = 1.1
_RADIAL_GAIN = 3.0
_INWARD_GAIN = 1.5
_RIDGE = 0.2
_TURN_GAIN = 1.5
_TURN_MOST = 1.0
_TOUCHING = 0.03
_SLACK = 0.35
_AHEAD = 0.15
_TICK = 0.05
OBJECT_NEAR, _OBJECT_MARGIN = 0.15, 0.015
"""m from the corridor's edge within which rollouts look how fast the object is pushed outward; m kept there"""


@njit("UniTuple(f8,3)(f8[::1],f8[::1],f8[::1],f8)", cache=True)
def wish(state: Array, contour: Array, manoeuvre: Array, walking: float) -> tuple[float, float, float]:
    """Return the velocity to send, and whether the robot walks around (1.0) or pushes (0.0).

    Args:
        walking: what was returned last: between the two there is hysteresis.
    """
    dx, dy = state[RX] - state[X], state[RY] - state[Y]
    distance = math.sqrt(dx * dx + dy * dy) + 1e-9
    bearing = math.atan2(dy, dx)
    behind = math.atan2(state[Y] - manoeuvre[TARGET_Y], state[X] - manoeuvre[TARGET_X])
    lean = 0.0
    if manoeuvre[BODY] == 1.0:
        error, lean = wrapped(bearing - state[YAW] - manoeuvre[STAND]), manoeuvre[LEAN]
    else:
        error = wrapped(bearing - behind - manoeuvre[BIAS])
    gap = distance - radius(contour, bearing - state[YAW])[0]
    ex, ey = dx / distance, dy / distance
    speed = manoeuvre[SPEED]
    if abs(error) > WALK_FROM:
        walking = 1.0
    elif abs(error) < PUSH_FROM:
        walking = 0.0
    if walking == 0.0:
        steer = min(max(GAIN * error + lean, -_STEER_MOST), _STEER_MOST)
        inward, around = speed * math.cos(steer), -speed * math.sin(steer)
        return -inward * ex - around * ey, -inward * ey + around * ex, walking
    speed = manoeuvre[WALK]
    way = -1.0 if error > 0.0 else 1.0
    if manoeuvre[SIDE] != 0.0:
        way = manoeuvre[SIDE]
    # Inward no faster than the base can brake: it must not run into what it is to walk around.
    outward = (_RADIAL_GAIN if gap < RING else _INWARD_GAIN) * (RING - gap)
    outward = min(max(outward, -speed), speed)
    # In touch, first away: a robot that slides along the object turns it.
    free = min(max(gap / RING, 0.0), 1.0)
    around = way * free * math.sqrt(max(0.0, speed * speed - outward * outward))
    return outward * ex - around * ey, outward * ey + around * ex, walking


@njit("f8(f8[::1],f8[::1])", cache=True)
def turning(state: Array, contour: Array) -> float:
    """Return the rate, rad/s, at which to turn so that the object stays in view.

    A base that turns while it touches the object drags the object's side along; so in touch it turns only where
    the object is more than _SLACK off the middle of its view.
    """
    dx, dy = state[X] - state[RX], state[Y] - state[RY]
    bearing = math.atan2(dy, dx)
    error = wrapped(bearing - state[THETA])
    gap = math.sqrt(dx * dx + dy * dy) - radius(contour, bearing + math.pi - state[YAW])[0]
    if gap < _TOUCHING:
        error -= min(max(error, -_SLACK), _SLACK)
    return min(max(_TURN_GAIN * error, -_TURN_MOST), _TURN_MOST)


@njit("f8(f8,f8)", cache=True)
def kept_margin(margin: float, width: float) -> float:
    """Return the m to keep from the edge where the corridor's half width is `width`: less where it is narrow."""
    return min(margin, 0.3 * max(width, 0.0))


@njit("UniTuple(f8,3)(f8[:,::1],f8,f8,f8,f8,f8)", cache=True)
def _edge(values: Array, x0: float, y0: float, resolution: float, x: float, y: float) -> tuple[float, float, float]:
    """Return how deep inside the corridor a place is, m, and the way inward, of length 1; (0, 0) along its middle."""
    gx, gy = slope(values, x0, y0, resolution, x, y)
    norm = math.sqrt(gx * gx + gy * gy)
    if norm < _RIDGE:
        gx, gy, norm = 0.0, 0.0, 1.0
    return lookup(values, x0, y0, resolution, x, y), gx / norm, gy / norm


@njit("f8(f8,f8)", cache=True)
def _stoppable(depth: float, acceleration: float) -> float:
    """Return how fast, m/s, a base may go outward `depth` m, above 0, before an edge: half of what it could brake from;
    at most depth / 0.5 s where that is less."""
    return min(math.sqrt(acceleration * depth), 2.0 * depth)


@njit("UniTuple(f8,2)(f8[:,::1],f8,f8,f8,f8[::1],f8,f8,f8,f8)", cache=True)
def inside(
    values: Array, x0: float, y0: float, resolution: float,
    state: Array, ux: float, uy: float, acceleration: float, margin: float,
) -> tuple[float, float]:  # fmt: skip
    """Return the velocity changed as little as lets the robot stop before the corridor's edge.

    Judged where its velocity takes it within the lag of the base. Outward at most sqrt(a depth), half of what the
    base could brake from; at most depth / 0.5 s where that is less; inward at least where it stands outside of the
    margin. The base's ramp divides its acceleration between braking and turning: while it is to brake, it turns with
    what is left.
    """
    x, y = state[RX] + _AHEAD * state[RVX], state[RY] + _AHEAD * state[RVY]
    depth, nx, ny = _edge(values, x0, y0, resolution, x, y)
    if nx == ny == 0.0:
        return ux, uy
    depth -= margin
    outward, along = -(ux * nx + uy * ny), ux * ny - uy * nx
    allowed = _stoppable(depth, acceleration) if depth > 0.0 else max(2.0 * depth, -0.15)
    brake = -(state[RAMP_X] * nx + state[RAMP_Y] * ny) - allowed
    if brake > 0.0:
        most = acceleration * _TICK
        turn = math.sqrt(most * most - brake * brake) if brake < most else 0.0
        before = state[RAMP_X] * ny - state[RAMP_Y] * nx
        along = min(max(along, before - turn), before + turn)
    elif outward <= allowed:
        return ux, uy
    outward = min(outward, allowed)
    return along * ny - outward * nx, -along * nx - outward * ny


@njit("UniTuple(f8,2)(f8[:,::1],f8,f8,f8,f8[::1],f8,f8,f8,f8)", cache=True)
def sparing(
    values: Array, x0: float, y0: float, resolution: float,
    state: Array, ux: float, uy: float, acceleration: float, width: float,
) -> tuple[float, float]:  # fmt: skip
    """Return the velocity of a robot that pushes, changed so that it can stop before the object leaves the corridor.

    Whether an object comes round before the edge is only thought: it may be pushed along the edge, and not over it. The
    bound is that of `inside`, where the object's velocity takes it; an object that drifts outward faster is pushed more
    slowly, wherever to.

    Args:
        width: m, half width of the corridor there.
    """
    x, y = state[X] + _AHEAD * state[VX], state[Y] + _AHEAD * state[VY]
    depth, nx, ny = _edge(values, x0, y0, resolution, x, y)
    if nx == ny == 0.0:
        return ux, uy
    depth -= kept_margin(_OBJECT_MARGIN, width)
    allowed = _stoppable(depth, acceleration) if depth > 0.0 else 0.0
    excess = max(0.0, -(ux * nx + uy * ny) - allowed)
    ux, uy = ux + excess * nx, uy + excess * ny
    drift = -(state[VX] * nx + state[VY] * ny)
    slower = allowed / drift if drift > allowed else 1.0
    return slower * ux, slower * uy
