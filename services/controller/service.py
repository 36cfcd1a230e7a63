"""Moves the base so that the object advances along the push-line (Sec. 5.1, 5.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime import topics
from runtime.messages import (
    Corridor,
    ObjectState,
    PushBehaviour,
    PushGoal,
    PushPhase,
    PushStatus,
    RobotPose,
    Twist2,
    VelocityCommand,
    Visibility,
)
from runtime.service import Effects, Input, Output, Publication, Service, Timer, on
from runtime.time import Time, nanoseconds, seconds
from runtime.topics import Delivery
from services.controller import barrier, centroid, dipole, predictive, push_law
from services.controller.activation import activations
from services.controller.config import ControllerConfig
from services.controller.heading import HeadingState, sweep, turn
from services.controller.push_law import Behaviour, Gains
from services.geometry.angles import difference
from services.geometry.corridor import CorridorGeometry
from services.geometry.wire import geometry, vector
from services.learner.movement import alpha
from services.predictive.estimate import Track
from services.predictive.situation import Lane, base_of, known

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Wish:
    """What a controller wants: velocity (2,), m/s, map frame, and its activations."""

    u: Array
    psi_push: float = 0.0
    psi_relocate: float = 0.0
    limited: bool = False


@dataclass
class ControllerState:
    """What the service goes on from.

    Attributes:
        heard: when the task last spoke of the push, ns.
        sought: since when a lost object has been looked for, ns; 0 while none is.
    """

    heading: HeadingState = field(default_factory=HeadingState)
    track: Track = field(default_factory=Track)
    walking: float = 0.0
    heard: Time = 0
    sought: Time = 0


class ControllerService(Service):
    """Sends velocity commands at a fixed rate while a goal is active, and zero when it cannot know better."""

    name = "controller"
    Config = ControllerConfig

    odometry = Input(topics.ODOMETRY, Delivery.LATEST)
    status = Input(topics.STATUS)
    robot = Input(topics.ROBOT_POSE)
    object = Input(topics.OBJECT_STATE)
    goal = Input(topics.PUSH_GOAL)
    corridor = Input(topics.CORRIDOR)
    target = Input(topics.PUSH_TARGET)
    behaviour = Input(topics.PUSH_BEHAVIOUR)
    response = Input(topics.PUSH_RESPONSE)
    push = Input(topics.PUSH_STATUS, Delivery.LATEST)
    command = Output(topics.COMMAND)
    tick = Timer(lambda config: 1 / config.rate)

    config: ControllerConfig
    state: ControllerState

    def __init__(self, config: ControllerConfig) -> None:
        super().__init__(config)
        self.state = ControllerState()
        self._geometry: CorridorGeometry | None = None
        self._lane: Lane | None = None

    def thaw(self) -> None:
        """Rebuild the geometry of the newest corridor."""
        self._take(self.corridor)

    @on(corridor)
    def prepare(self, corridor: Corridor, now: Time) -> None:
        """Make a new corridor ready for look-up."""
        self._take(corridor)

    @on(goal)
    def begin(self, goal: PushGoal, now: Time) -> None:
        """Take note of news from the task."""
        self.state.heard = now

    @on(push)
    def news(self, push: PushStatus, now: Time) -> None:
        """Take note of news from the task: who does not hear that a push has ended would go on with it."""
        self.state.heard = now

    @on(robot)
    def localised(self, robot: RobotPose, now: Time) -> None:
        """Follow the robot."""
        self.state.track.robot_seen(robot)

    @on(object)
    def seen(self, object: ObjectState, now: Time) -> None:
        """Follow the object. The paper's controllers act on what they see, and need not pay for it."""
        if self.goal is not None and self.goal.controller != "predictive":
            return
        if self.status is None or self.corridor is None or object.visibility == Visibility.LOST:
            return
        contour, response = known(self.response, self.corridor.robot_diameter, object.diameter)
        self.state.track.object_seen(object, base_of(self.status), contour, response, self.response)

    @on(tick)
    def control(self, now: Time) -> Effects:
        """Send the command for now."""
        if self.goal is None or self.odometry is None:
            return
        robot, object = self.robot, self.object
        if robot is None or object is None or not self._may_move(robot, object, now):
            self.state.heading, self.state.sought = HeadingState(), 0
            yield self._command(Wish(np.zeros(2)), 0.0, 0.0, now)
            return
        if object.visibility == Visibility.LOST:
            self.state.heading = HeadingState()
            yield self._command(Wish(np.zeros(2)), 0.0, self._seek(robot, object, now), now)
            return
        self.state.sought = 0
        r, o = np.array((robot.pose.x, robot.pose.y)), vector(object.position)
        if self.goal.controller == "predictive":
            wish, omega = self._planned(now)
            yield self._command(wish, robot.pose.theta, omega, now)
            return
        wish = self._filtered(self._wish(self.goal.controller, r, o), now)
        config = self.config
        omega, cut = turn(
            self.state.heading,
            robot.stamp * 1e-9,
            r,
            robot.pose.theta,
            o,
            config.heading_p,
            config.heading_d,
            config.heading_limit,
        )
        yield self._command(
            Wish(wish.u, wish.psi_push, wish.psi_relocate, wish.limited or cut), robot.pose.theta, omega, now
        )

    def finish(self, now: Time) -> Effects:
        """Stop the base: the driver need not wait until the last command runs out."""
        if self.goal is not None and self.odometry is not None:
            yield self._command(Wish(np.zeros(2)), 0.0, 0.0, now)

    def _may_move(self, robot: RobotPose, object: ObjectState, now: Time) -> bool:
        """Tell whether there is a push under way and everything it needs is fresh."""
        goal, corridor, target, behaviour = self.goal, self.corridor, self.target, self.behaviour
        assert goal is not None
        if corridor is None or target is None or behaviour is None or not goal.active:
            return False
        if corridor.goal_id != goal.id or not corridor.found or target.corridor_version != corridor.version:
            return False
        ended = self.push is not None and self.push.goal_id == goal.id and self.push.phase == PushPhase.ENDED
        if ended or now - self.state.heard > nanoseconds(self.config.silence):
            return False
        oldest = min(robot.stamp, object.stamp)
        coincide = object.position == target.target
        fresh = now - oldest <= nanoseconds(self.config.patience)
        return fresh and not coincide

    def _seek(self, robot: RobotPose, object: ObjectState, now: Time) -> float:
        """Return the turn, rad/s, that looks for a lost object: where it should be, then ever farther to both sides."""
        state, config = self.state, self.config
        if not config.seek:
            return 0.0
        if not state.sought:
            state.sought = now
        dx, dy = object.position.x - robot.pose.x, object.position.y - robot.pose.y
        aside = sweep(seconds(now - state.sought), config.seek)
        error = difference(math.atan2(dy, dx) + aside, robot.pose.theta)
        return min(max(config.heading_p * error, -config.seek), config.seek)

    def _wish(self, name: str, r: Array, o: Array) -> Wish:
        assert self.target is not None
        assert self.behaviour is not None
        t, config = vector(self.target.target), self.config
        if name == "centroid":
            u, limited = centroid.command(r, o, t, config.centroid_k_g, config.centroid_k_c, config.centroid_saturation)
            return Wish(u, limited=limited)
        angle = alpha(r, o, t)
        speed = self._speed(o)
        if name == "dipole":
            return Wish(dipole.command(r, o, angle, speed))
        known = self._learned(self.behaviour, angle) if name == "adaptive" else self._prior(self.behaviour, angle)
        gains = Gains(config.k_gamma, config.k_mu_gamma, speed)
        return Wish(push_law.command(r, o, angle, known, gains), known.psi_push, known.psi_relocate)

    def _planned(self, now: Time) -> tuple[Wish, float]:
        """Follow the plan, from where robot and object will be when the command takes effect."""
        assert self.target is not None
        assert self.corridor is not None
        state = self.state
        if self.status is None or self._geometry is None or self._lane is None or not self.target.HasField("plan"):
            return Wish(np.zeros(2)), 0.0
        base = base_of(self.status)
        contour, response = known(self.response, self.corridor.robot_diameter, self.corridor.object_diameter)
        there = state.track.at(now, base, contour, response)
        u, omega, state.walking = predictive.command(
            there, self.target.plan, state.walking, self._geometry, self._lane, base, contour
        )
        return Wish(u, 1.0 - state.walking, state.walking), omega

    def _take(self, corridor: Corridor | None) -> None:
        self._geometry = None if corridor is None else geometry(corridor)
        self._lane = None if self._geometry is None else Lane.of(self._geometry)

    def _speed(self, o: Array) -> float:
        """Return V, less near the goal.

        Not in the paper, whose V is constant (approach_deceleration = 0). A base that brakes at 0.4 m/s^2 needs
        0.11 m to stop from 0.3 m/s: with a precision of 0.1 m it carried the object through the goal and out
        again in 2 of 100 pushes (docs/decisions/0006).
        """
        assert self.goal is not None
        config = self.config
        if config.approach_deceleration == 0.0:
            return config.speed
        distance = math.hypot(self.goal.position.x - o[0], self.goal.position.y - o[1])
        return min(config.speed, max(config.approach_speed, math.sqrt(2 * config.approach_deceleration * distance)))

    def _learned(self, behaviour: PushBehaviour, angle: float) -> Behaviour:
        psi_push, psi_relocate = activations(angle, behaviour.mu, behaviour.kappa)
        return Behaviour(behaviour.alpha_p, psi_push, psi_relocate, behaviour.gamma, behaviour.mean_gamma)

    def _prior(self, behaviour: PushBehaviour, angle: float) -> Behaviour:
        return push_law.non_adaptive(angle, behaviour.gamma)

    def _filtered(self, wish: Wish, now: Time) -> Wish:
        if not self.config.barrier or self._geometry is None or self._lane is None or self.status is None:
            return wish
        base = base_of(self.status)
        u, limited = barrier.guard(
            self._geometry, self._lane, self.state.track, wish.u, now, base, self.config.barrier_margin
        )
        return Wish(u, wish.psi_push, wish.psi_relocate, wish.limited or limited)

    def _command(self, wish: Wish, theta: float, omega: float, now: Time) -> Publication:
        assert self.odometry is not None
        assert self.goal is not None
        scale, limit = 1.0, math.inf if self.status is None else self.status.limits.speed
        speed = math.hypot(wish.u[0], wish.u[1])
        if self.object is not None and self.object.visibility == Visibility.PREDICTED:
            scale, speed = self.config.predicted_share, self.config.predicted_share * speed
        if speed > limit:
            scale *= limit / speed
        c, s = math.cos(theta), math.sin(theta)
        vx, vy = scale * wish.u[0], scale * wish.u[1]
        command = VelocityCommand(
            stamp=now,
            twist=Twist2(vx=c * vx + s * vy, vy=-s * vx + c * vy, omega=omega),
            driver_sequence=self.odometry.driver_sequence,
            deadline=nanoseconds(self.config.deadline),
            controller=self.goal.controller,
            psi_push=wish.psi_push,
            psi_relocate=wish.psi_relocate,
            limited=wish.limited or scale < 1.0,
        )
        self.state.track.commanded(command, theta)
        return self.command(command)
