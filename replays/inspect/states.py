"""Draws states as lanes over time: the push, its target, the object, contact, the base."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from replays.inspect import palette
from replays.inspect.canvas import Canvas
from replays.inspect.session import Session
from runtime.messages import (
    FailureCause,
    ObjectState,
    PushOutcome,
    PushPhase,
    PushStatus,
    PushTarget,
    RobotStatus,
    Truth,
    VelocityCommand,
    Visibility,
)

_COLOURS = {
    "idle": palette.QUIET, "planning": palette.BUSY, "pushing": palette.GOOD, "waiting": palette.WARN,
    "ended": palette.QUIET, "delivered": palette.DELIVERED, "cancelled": palette.WARN, "failed": palette.BAD,
    "visible": palette.GOOD, "predicted": palette.WARN, "lost": palette.BAD, "fallback": palette.WARN,
    "apart": palette.QUIET, "touch": palette.GOOD, "robot hit": palette.BAD, "object hit": palette.BAD,
    "limited": palette.WARN, "free": palette.QUIET, "ready": palette.GOOD, "bumper": palette.BAD,
    "emergency stop": palette.BAD, "motors off": palette.WARN,
}  # fmt: skip


def _lane(canvas: Canvas, entity: str, times: NDArray[np.int64], states: Sequence[str]) -> None:
    """One lane; a row only where the state changes."""
    if not len(times):
        return
    before = [canvas.states.get(entity), *states[:-1]]
    changes = [index for index, state in enumerate(states) if before[index] != state]
    canvas.states[entity] = states[-1]
    values = sorted(canvas.values.setdefault(entity, set()) | set(states))
    canvas.values[entity].update(values)
    colours = [_COLOURS.get(value.split(":")[0], palette.BUSY) for value in values]
    canvas.fixed(entity, rr.StateConfiguration(values=values, labels=values, colors=colours))
    canvas.columns(entity, times[changes], rr.StateChange.columns(state=[states[index] for index in changes]))


def outcome(status: PushStatus) -> str:
    """Return the phase, or how the push ended."""
    if status.phase != PushPhase.ENDED:
        return PushPhase.Name(status.phase).lower()
    ending = PushOutcome.Name(status.outcome).lower()
    cause = FailureCause.Name(status.cause).lower().replace("_", " ")
    return ending if status.cause == 0 else f"{ending}: {cause}"


def draw_states(canvas: Canvas, session: Session) -> None:
    """Draw a lane for every topic that has states."""
    statuses = session.track("push/status", PushStatus)
    _lane(canvas, "/states/push", statuses.times, [outcome(m) for m in statuses.messages])
    targets = session.track("push/target", PushTarget)
    _lane(
        canvas,
        "/states/target",
        targets.times,
        ["fallback" if m.fallback else m.strategy for m in targets.messages],
    )
    objects = session.track("object/state", ObjectState)
    _lane(
        canvas,
        "/states/object",
        objects.times,
        [Visibility.Name(m.visibility).lower() for m in objects.messages],
    )
    truths = session.track("truth", Truth)
    _lane(canvas, "/states/contact", truths.times, [_contact(m) for m in truths.messages])
    commands = session.track("command", VelocityCommand)
    _lane(
        canvas,
        "/machine/command",
        commands.times,
        ["limited" if m.limited else "free" for m in commands.messages],
    )
    bases = session.track("status", RobotStatus)
    _lane(canvas, "/machine/base", bases.times, [_base(m) for m in bases.messages])


def _contact(truth: Truth) -> str:
    if truth.robot_hit:
        return "robot hit"
    if truth.object_hit:
        return "object hit"
    return "touch" if truth.touching else "apart"


def _base(status: RobotStatus) -> str:
    if status.emergency_stop:
        return "emergency stop"
    if status.bumper:
        return "bumper"
    return "ready" if status.motors_enabled else "motors off"
