"""Measures how the object answers pushes and learns which push angles are good (Sec. 5.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from runtime import topics
from runtime.messages import PushBehaviour, PushGoal, PushTarget
from runtime.service import Effects, Input, Output, Service, on
from runtime.time import Time, seconds
from services.geometry.angles import direction
from services.geometry.wire import vector
from services.learner.config import LearnerConfig
from services.learner.movement import Accept, MovementState, alpha, observe
from services.learner.von_mises import Posterior, estimate, prior, update


@dataclass
class LearnerState:
    """What was learned in the current push."""

    posterior: Posterior
    movement: MovementState = field(default_factory=MovementState)
    goal_id: int = 0
    samples: int = 0


class LearnerService(Service):
    """Answers every push target with what is known of the object's behaviour."""

    name = "learner"
    Config = LearnerConfig

    goal = Input(topics.PUSH_GOAL)
    robot = Input(topics.ROBOT_POSE)
    target = Input(topics.PUSH_TARGET)
    behaviour = Output(topics.PUSH_BEHAVIOUR)

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

    @on(target)
    def learn(self, target: PushTarget, now: Time) -> Effects:
        """Take one observation."""
        if self.robot is None:
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

    def _untaught(self, goal_id: int) -> LearnerState:
        config = self.config
        return LearnerState(prior(config.r0, config.c, config.phi), goal_id=goal_id)
