"""Chooses the intermediate pushing target inside the corridor (Sec. 4)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime import topics
from runtime.messages import (
    Corridor,
    ObjectState,
    PushGoal,
    PushTarget,
    RobotPose,
    Vector2,
    VelocityCommand,
    Visibility,
)
from runtime.service import Effects, Input, Output, Service, on
from runtime.time import Time, nanoseconds
from runtime.topics import Delivery
from services.geometry.corridor import CorridorGeometry
from services.geometry.wire import geometry, vector
from services.predictive.situation import Lane, base_of, known
from services.strategy import lookahead, predictive, relaxed, strict, switching
from services.strategy.config import StrategyConfig
from services.strategy.predictive import PlannerState
from services.strategy.target import Target, push_position


class UnknownStrategy(ValueError):
    """A goal asks for a strategy that there is not. The task refuses such goals."""


@dataclass
class StrategyState:
    """What the service goes on from. Only the predictive strategy knows more than its inputs."""

    planner: PlannerState = field(default_factory=PlannerState)
    goal_id: int = 0


class StrategyService(Service):
    """Answers every object state with a target, while a goal is active and its corridor is known."""

    name = "strategy"
    Config = StrategyConfig

    goal = Input(topics.PUSH_GOAL)
    corridor = Input(topics.CORRIDOR)
    object = Input(topics.OBJECT_STATE)
    robot = Input(topics.ROBOT_POSE)
    status = Input(topics.STATUS)
    command = Input(topics.COMMAND, Delivery.RELIABLE)
    response = Input(topics.PUSH_RESPONSE)
    target = Output(topics.PUSH_TARGET)

    config: StrategyConfig
    state: StrategyState

    def __init__(self, config: StrategyConfig) -> None:
        super().__init__(config)
        self.state = StrategyState()
        self._geometry: CorridorGeometry | None = None
        self._lane: Lane | None = None

    def thaw(self) -> None:
        """Rebuild the geometry of the newest corridor."""
        self._take(self.corridor)

    @on(corridor)
    def prepare(self, corridor: Corridor, now: Time) -> None:
        """Make a new corridor ready for look-up."""
        self._take(corridor)

    @on(robot)
    def localised(self, robot: RobotPose, now: Time) -> None:
        """Follow the robot."""
        self.state.planner.track.robot_seen(robot)

    @on(command)
    def sent(self, command: VelocityCommand, now: Time) -> None:
        """Follow what the robot was sent."""
        planner = self.state.planner
        if self.robot is not None:
            planner.track.commanded(command, self.robot.pose.theta)
        planner.walking, planner.pushing = float(command.psi_relocate > 0.5), command.psi_push > 0.5

    @on(object)
    def choose(self, object: ObjectState, now: Time) -> Effects:
        """Choose the target for where the object is now."""
        goal, corridor = self.goal, self.corridor
        if goal is None or corridor is None or self._geometry is None or object.visibility == Visibility.LOST:
            return
        if not goal.active or corridor.goal_id != goal.id:
            return
        o = vector(object.position)
        if goal.strategy == "predictive":
            yield from self._plan(goal, corridor, object, now)
            return
        name, target = self._choose(goal.strategy, self._geometry, o, corridor.robot_diameter, object.diameter)
        yield self.target(
            PushTarget(
                stamp=object.stamp,
                corridor_version=corridor.version,
                target=Vector2(x=target.t[0], y=target.t[1]),
                object=object.position,
                push_position=Vector2(x=target.p[0], y=target.p[1]),
                strategy=name,
                fallback=not target.feasible,
                distance_to_go=target.distance_to_go,
            )
        )

    def _plan(self, goal: PushGoal, corridor: Corridor, object: ObjectState, now: Time) -> Effects:
        if self.status is None or self._geometry is None or self._lane is None or self.robot is None:
            return
        state, planner = self.state, self.state.planner
        if state.goal_id != goal.id:
            state.goal_id, planner.favourite, planner.rolls = goal.id, [], False
            planner.since = planner.planned = now
        base = base_of(self.status)
        contour, response = known(self.response, corridor.robot_diameter, object.diameter)
        o = vector(object.position)
        planner.track.object_seen(object, base, contour, response, self.response)
        config = self.config.predictive
        windows = 0 if self.response is None else self.response.windows
        then = now + nanoseconds(config.lead)
        t, plan = predictive.choose(
            planner, config, self._geometry, self._lane, base, contour, response, windows, goal, then
        )
        p = push_position(o, t, corridor.robot_diameter, object.diameter, t - o)
        yield self.target(
            PushTarget(
                stamp=object.stamp,
                corridor_version=corridor.version,
                target=Vector2(x=t[0], y=t[1]),
                object=object.position,
                push_position=Vector2(x=p[0], y=p[1]),
                strategy="predictive",
                distance_to_go=self._geometry.distance_to_go(o),
                plan=plan,
            )
        )

    def _take(self, corridor: Corridor | None) -> None:
        self._geometry = None if corridor is None else geometry(corridor)
        self._lane = None if self._geometry is None else Lane.of(self._geometry)

    def _choose(
        self, name: str, corridor: CorridorGeometry, o: NDArray[np.float64], d_r: float, d_o: float
    ) -> tuple[str, Target]:
        config = self.config
        if name == "strict":
            return name, strict.choose(corridor, o, d_r, d_o, config.strict_fallback)
        if name == "relaxed":
            return name, relaxed.choose(corridor, o, d_r, d_o, config.relaxed_fallback)
        if name == "switching":
            return switching.choose(
                corridor,
                o,
                d_r,
                d_o,
                switch_ratio=config.switch_ratio,
                strict_fallback=config.strict_fallback,
                relaxed_fallback=config.relaxed_fallback,
            )
        if name == "fixed-lookahead":
            return name, lookahead.choose(corridor, o, d_r, d_o, config.lookahead)
        raise UnknownStrategy(f"no strategy is called '{name}'")
