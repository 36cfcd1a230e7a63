"""Trials made by hand."""

from __future__ import annotations

from experiments.paper.trial import Outcome


def outcome(**changes: object) -> Outcome:
    """Return a delivered push of the can in Corridor 3, with changes."""
    facts: dict[str, object] = {
        "experiment": "controllers",
        "method": "adaptive",
        "start": "scene",
        "scene": "corridor-3",
        "object": "can",
        "strategy": "relaxed",
        "controller": "adaptive",
        "precision": 0.1,
        "seed": 1,
        "success": True,
        "cause": "",
        "distance": 0.02,
        "robot_length": 5.0,
        "object_length": 4.0,
        "time": 20.0,
        "robot_depth": 0.1,
        "object_depth": 0.2,
        "hits": 0,
        "to_go": 0.02,
        "turn": 0.0,
        "steep": 0.1,
    }
    return Outcome(**(facts | changes))  # type: ignore[arg-type]


def failed(cause: str, **changes: object) -> Outcome:
    """Return a push that failed by `cause`."""
    return outcome(success=False, cause=cause, **changes)
