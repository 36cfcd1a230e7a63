"""Where robot and object are now, from observations that are 50 to 100 ms old.

The forward model carries the state from stamp to stamp with the commands that were sent, and on to the present; each
observation corrects it by constant gains. All in m, s, rad, map frame; times in ns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime.messages import ObjectState, PushResponse, RobotPose, VelocityCommand
from services.geometry.angles import wrapped
from services.predictive.model import (
    OMEGA,
    RAMP_X,
    RAMP_Y,
    RVX,
    RVY,
    RX,
    RY,
    STATE,
    THETA,
    VX,
    VY,
    YAW,
    X,
    Y,
    drive,
    step,
)

Array = NDArray[np.float64]

_STEP = 0.025
_LONGEST_GAP = 1_000_000_000
_REMEMBERED = 24
_POSITION, _VELOCITY, _YAW, _SPIN, _ROBOT = 0.45, 1.6, 0.4, 1.0, 0.5


@dataclass
class Sent:
    """A velocity that was sent, map frame, and the rate of turning."""

    time: int
    ux: float
    uy: float
    turn: float


@dataclass
class Track:
    """What is known of robot and object.

    Attributes:
        time: ns, of `state`; 0 before the first observation.
        state: (STATE,), see `model`.
        sent: the newest commands, oldest first.
        robots: the newest positions of the robot by their stamps, ns: (stamp, x, y, theta).
        yaws: of the object lately, by their stamps, ns: (stamp, yaw).
    """

    time: int = 0
    state: Array = field(default_factory=lambda: np.zeros(STATE))
    sent: list[Sent] = field(default_factory=list)
    robots: list[tuple[int, float, float, float]] = field(default_factory=list)
    yaws: list[tuple[int, float]] = field(default_factory=list)

    def commanded(self, command: VelocityCommand, theta: float) -> None:
        """Take a command that was sent with the robot heading `theta`."""
        c, s = math.cos(theta), math.sin(theta)
        vx, vy = command.twist.vx, command.twist.vy
        sent = Sent(command.stamp, c * vx - s * vy, s * vx + c * vy, command.twist.omega)
        self.sent = [*self.sent[-_REMEMBERED + 1 :], sent]

    def robot_seen(self, robot: RobotPose) -> None:
        """Take a position of the robot."""
        seen = (robot.stamp, robot.pose.x, robot.pose.y, robot.pose.theta)
        self.robots = [*self.robots[-_REMEMBERED + 1 :], seen]

    def robot_at(self, stamp: int) -> tuple[float, float]:
        """Return the robot's position at `stamp`, between the two observations around it."""
        times = [one[0] - stamp for one in self.robots]
        x = np.interp(0, times, [one[1] for one in self.robots])
        y = np.interp(0, times, [one[2] for one in self.robots])
        return float(x), float(y)

    def robot_at_present(self, time: int, base: Array) -> Array:
        """Return a state, (STATE,), with the robot where it is at `time`: from its newest position on, as it was sent.

        What was in force then, it is taken to have reached.
        """
        state = np.zeros(STATE)
        stamp, state[RX], state[RY], state[THETA] = self.robots[-1]
        sent = [one for one in self.sent if one.time <= stamp][-1:]
        if sent:
            state[[RVX, RVY]] = state[[RAMP_X, RAMP_Y]] = sent[0].ux, sent[0].uy
        sent += [one for one in self.sent if stamp < one.time < time]
        ends = [one.time for one in sent[1:]] + [max(time, stamp)]
        for one, end in zip(sent, ends, strict=False):
            drive(state, one.ux, one.uy, one.turn, (end - max(one.time, stamp)) * 1e-9, base)
        return state

    def object_seen(
        self, object: ObjectState, base: Array, contour: Array, response: Array, told: PushResponse | None = None
    ) -> None:
        """Take a position of the object, and the robot's of that time.

        Args:
            told: what the learner said last: where no yaw is seen, its yaw is everybody's.
        """
        stamp, x, y = object.stamp, object.position.x, object.position.y
        yaw = object.yaw if object.HasField("yaw") else None
        robot = min(self.robots, key=lambda one: abs(one[0] - stamp), default=None)
        if robot is None or stamp <= self.time:
            return
        if yaw is None and told is not None:
            self._turned(told)
        if self.time == 0 or stamp - self.time > _LONGEST_GAP:
            thought = float(self.state[YAW]) if yaw is None else yaw
            self.state = np.zeros(STATE)
            self.state[[X, Y, YAW, RX, RY, THETA]] = x, y, thought, robot[1], robot[2], robot[3]
            self.time, self.yaws = stamp, [(stamp, thought)]
            return
        state = self._carried(stamp, base, contour, response)
        dx, dy = x - state[X], y - state[Y]
        state[X] += _POSITION * dx
        state[Y] += _POSITION * dy
        state[VX] += _VELOCITY * dx
        state[VY] += _VELOCITY * dy
        if yaw is not None:
            turn = wrapped(yaw - state[YAW])
            state[YAW] += _YAW * turn
            state[OMEGA] += _SPIN * turn
        if abs(robot[0] - stamp) < 20_000_000:
            state[RX] += _ROBOT * (robot[1] - state[RX])
            state[RY] += _ROBOT * (robot[2] - state[RY])
            state[THETA] += _ROBOT * wrapped(robot[3] - state[THETA])
        self.state, self.time = state, stamp
        self.yaws = [*self.yaws[-_REMEMBERED + 1 :], (stamp, float(state[YAW]))]

    def _turned(self, told: PushResponse) -> None:
        """Take the learner's yaw for this one's own: what it says is of a moment ago, and may be late."""
        own = next((yaw for stamp, yaw in self.yaws if stamp == told.stamp), None)
        if own is None:
            return
        off = wrapped(told.yaw - own)
        self.state[YAW] += off
        # Not twice, and what is told of later ones is off from there.
        self.yaws = [(stamp, yaw + off) for stamp, yaw in self.yaws if stamp >= told.stamp]

    def at(self, time: int, base: Array, contour: Array, response: Array) -> Array:
        """Return the state expected at `time`, not before the newest observation."""
        return self._carried(min(time, self.time + _LONGEST_GAP), base, contour, response)

    def _carried(self, until: int, base: Array, contour: Array, response: Array) -> Array:
        state, time = self.state.copy(), self.time
        sent = [one for one in self.sent if one.time < until]
        while time < until:
            following = [one.time for one in sent if one.time > time]
            end = min([*following, until, time + round(_STEP * 1e9)])
            ux, uy, turn = 0.0, 0.0, 0.0
            for one in sent:
                if one.time <= time:
                    ux, uy, turn = one.ux, one.uy, one.turn
            step(state, ux, uy, turn, (end - time) * 1e-9, base, contour, response)
            time = end
        return state
