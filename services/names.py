"""The strategies and controllers that a goal can ask for, by the names users type."""

from typing import Literal, get_args

Strategy = Literal["strict", "relaxed", "fixed-lookahead", "switching", "predictive"]
Controller = Literal["adaptive", "non-adaptive", "centroid", "dipole", "predictive"]

STRATEGIES: tuple[str, ...] = get_args(Strategy)
CONTROLLERS: tuple[str, ...] = get_args(Controller)
