"""The strategies and controllers that a goal can ask for, by the names users type."""

from typing import Literal, get_args

Strategy = Literal["strict", "relaxed", "fixed-lookahead", "switching", "predictive"]
Controller = Literal["adaptive", "non-adaptive", "centroid", "dipole", "predictive"]

STRATEGIES: tuple[str, ...] = get_args(Strategy)
CONTROLLERS: tuple[str, ...] = get_args(Controller)

_PAPER = ("strict", "adaptive")


def method(strategy: str, controller: str, usual: tuple[str, str]) -> tuple[str, str]:
    """Return strategy and controller of a goal, of which either may be left open, "".

    The predictive ones are one method: who names one of them means both. Who names only one of the paper's means no
    predictive other half; then it is the paper's usual one.

    Args:
        usual: where nothing is named, or the half that is left open if it goes with the other.
    """
    if not strategy and not controller:
        return usual
    named = strategy or controller
    halves = []
    for given, common, papers in zip((strategy, controller), usual, _PAPER, strict=True):
        if given:
            halves.append(given)
        elif named == "predictive":
            halves.append(named)
        else:
            halves.append(papers if common == "predictive" else common)
    return halves[0], halves[1]
