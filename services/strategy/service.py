"""Chooses the intermediate pushing target inside the corridor (Sec. 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime import topics
from runtime.messages import Corridor, ObjectState, PushTarget, Vector2, Visibility
from runtime.service import Effects, Input, Output, Service, on
from runtime.time import Time
from services.geometry.corridor import CorridorGeometry
from services.geometry.wire import geometry, vector
from services.strategy import lookahead, relaxed, strict, switching
from services.strategy.config import StrategyConfig
from services.strategy.target import Target


class UnknownStrategy(ValueError):
    """A goal asks for a strategy that there is not. The task refuses such goals."""


@dataclass
class StrategyState:
    """What the service goes on from: all it knows are its inputs."""


class StrategyService(Service):
    """Answers every object state with a target, while a goal is active and its corridor is known."""

    name = "strategy"
    Config = StrategyConfig

    goal = Input(topics.PUSH_GOAL)
    corridor = Input(topics.CORRIDOR)
    object = Input(topics.OBJECT_STATE)
    target = Output(topics.PUSH_TARGET)

    config: StrategyConfig
    state: StrategyState

    def __init__(self, config: StrategyConfig) -> None:
        super().__init__(config)
        self.state = StrategyState()
        self._geometry: CorridorGeometry | None = None

    def thaw(self) -> None:
        """Rebuild the geometry of the newest corridor."""
        self._geometry = None if self.corridor is None else geometry(self.corridor)

    @on(corridor)
    def prepare(self, corridor: Corridor, now: Time) -> None:
        """Make a new corridor ready for look-up."""
        self._geometry = geometry(corridor)

    @on(object)
    def choose(self, object: ObjectState, now: Time) -> Effects:
        """Choose the target for where the object is now."""
        goal, corridor = self.goal, self.corridor
        if goal is None or corridor is None or self._geometry is None or object.visibility == Visibility.LOST:
            return
        if not goal.active or corridor.goal_id != goal.id:
            return
        o = vector(object.position)
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
