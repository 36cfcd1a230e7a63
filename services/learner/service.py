"""Measures how the object answers pushes and learns which push angles are good (Sec. 5.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from runtime import topics
from runtime.messages import (
    ObjectState,
    PushBehaviour,
    PushGoal,
    PushResponse,
    PushTarget,
    RobotPose,
    VelocityCommand,
    Visibility,
)
from runtime.service import Effects, Input, Output, Service, on
from runtime.time import Time, seconds
from runtime.topics import Delivery
from services.geometry.angles import direction
from services.geometry.wire import vector
from services.learner.config import LearnerConfig
from services.learner.movement import Accept, MovementState, alpha, observe
from services.learner.von_mises import Posterior, estimate, prior, update
from services.predictive.estimate import Track
from services.predictive.experience import Experience
from services.predictive.heading import Heading
from services.predictive.known import Known, triangle
from services.predictive.model import TURN, YAW
from services.predictive.situation import base_of

_MOST_PENDING = 8

_UNSEEN = (Visibility.PREDICTED, Visibility.LOST)
"""What is only thought of the object teaches nothing."""


@dataclass
class LearnerState:
    """What was learned in the current push."""

    posterior: Posterior
    movement: MovementState = field(default_factory=MovementState)
    goal_id: int = 0
    samples: int = 0
    experience: Experience | None = None
    track: Track = field(default_factory=Track)
    pending: list[tuple[int, float, float, float, float]] = field(default_factory=list)


class LearnerService(Service):
    """Answers every push target with what is known of the object's behaviour."""

    name = "learner"
    Config = LearnerConfig

    goal = Input(topics.PUSH_GOAL)
    robot = Input(topics.ROBOT_POSE, Delivery.RELIABLE)
    object = Input(topics.OBJECT_STATE, Delivery.RELIABLE)
    command = Input(topics.COMMAND, Delivery.RELIABLE)
    status = Input(topics.STATUS)
    target = Input(topics.PUSH_TARGET)
    behaviour = Output(topics.PUSH_BEHAVIOUR)
    response = Output(topics.PUSH_RESPONSE)

    config: LearnerConfig
    state: LearnerState

    def __init__(self, config: LearnerConfig) -> None:
        super().__init__(config)
        self.state = self._untaught(0)

    @on(goal)
    def forget(self, goal: PushGoal, now: Time) -> None:
        """Begin every push with the prior: the object may be another one."""
        if goal.active and goal.id != self.state.goal_id:
            self.state = self._untaught(goal.id)

    @on(robot)
    def localised(self, robot: RobotPose, now: Time) -> None:
        """Follow the robot."""
        self.state.track.robot_seen(robot)

    @on(command)
    def sent(self, command: VelocityCommand, now: Time) -> None:
        """Follow what the robot was sent."""
        if self.robot is not None:
            self.state.track.commanded(command, self.robot.pose.theta)

    @on(object)
    def answer(self, object: ObjectState, now: Time) -> Effects:
        """Learn how the object answers pushes, if the goal's method asks for it."""
        goal, status, state = self.goal, self.status, self.state
        if goal is None or status is None or not goal.active or object.visibility in _UNSEEN:
            return
        if "predictive" not in (goal.strategy, goal.controller) or not state.track.robots:
            return
        base = base_of(status)
        if state.experience is not None and state.experience.heading is not None and object.HasField("yaw"):
            yield self.say("the object's yaw is seen now: learning anew", now)
            state.experience = None  # what was learned is in a frame that nobody else knows
        if state.experience is None:
            before, said = self._before(status.diameter, object)
            if said:
                yield self.say(said, now, "INFO" if before else "WARNING")
            state.experience = Experience.of(status.diameter, object.diameter, self.config.seed, before)
            state.experience.heading = None if object.HasField("yaw") else Heading()
        known, track = state.experience, state.track
        track.object_seen(object, base, known.contour, known.response)
        turned = object.yaw if object.HasField("yaw") else float(track.state[YAW])
        seen = (object.stamp, object.position.x, object.position.y, turned, float(track.state[TURN]))
        state.pending = [*state.pending[-_MOST_PENDING:], seen]
        # The robot's position of that time may still be on its way.
        while state.pending and state.pending[0][0] <= track.robots[-1][0]:
            stamp, x, y, angle, turn = state.pending.pop(0)
            correction = known.observe(stamp, track.robot_at(stamp), (x, y), angle, turn, base)
            if correction:
                # Reckoned: what came since goes on from there.
                track.state[YAW] += correction
                state.pending = [(*one[:3], one[3] + correction, one[4]) for one in state.pending]
                turned += correction
        yield self.response(
            PushResponse(
                stamp=object.stamp,
                contour=known.contour.tolist(),
                response=known.response.tolist(),
                touches=known.touches,
                windows=known.seen,
                error=known.error,
                prior_error=known.prior_error,
                yaw=turned,
                spread=triangle(known.spread),
            )
        )

    @on(target)
    def learn(self, target: PushTarget, now: Time) -> Effects:
        """Take one observation."""
        if self.robot is None or (self.object is not None and self.object.visibility in _UNSEEN):
            return
        state, config = self.state, self.config
        r = np.array((self.robot.pose.x, self.robot.pose.y))
        o, t = vector(target.object), vector(target.target)
        known = state.movement.times
        late = len(known) > 0 and seconds(target.stamp) <= known[-1]
        if late or np.array_equal(o, t) or np.array_equal(o, r):
            return
        reading = observe(
            state.movement,
            seconds(target.stamp),
            o,
            direction(o, t),
            window=config.window,
            memory=config.memory,
            accept=Accept(config.accept),
            small=config.small_gamma,
        )
        angle = alpha(r, o, t)
        if reading.good:
            state.posterior = update(state.posterior, angle)
            state.samples += 1
        mode = estimate(state.posterior)
        yield self.behaviour(
            PushBehaviour(
                stamp=target.stamp,
                alpha=angle,
                gamma=reading.gamma,
                mean_gamma=reading.mean_gamma,
                mu=mode.mu,
                kappa=mode.kappa,
                alpha_p=mode.mu,
                sample_count=state.samples,
                reading_count=state.movement.readings,
                moving=reading.moving,
            )
        )

    def _before(self, robot_diameter: float, object: ObjectState) -> tuple[Known | None, str]:
        """Return what the configuration knows of this object, if that is of use here, and what to say of it."""
        known = self.config.known
        if known is None:
            return None, ""
        name = f" of '{known.object}'" if known.object else ""
        why = known.misfit(robot_diameter, object.diameter)
        if not object.HasField("yaw"):
            why = "the tracker sees no yaw, and without it nobody knows which way round the object stands"
        if why:
            return None, f"experience{name} is not used: {why}"
        return known, f"begins with experience{name}: {known.touches} touches, {known.windows} windows"

    def _untaught(self, goal_id: int) -> LearnerState:
        config = self.config
        return LearnerState(prior(config.r0, config.c, config.phi), goal_id=goal_id)
