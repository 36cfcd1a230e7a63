"""Draws what the predictive strategy expects against what came: paths on the map, and errors over time."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from replays.inspect import palette
from replays.inspect.canvas import Canvas
from replays.inspect.places import Places
from replays.inspect.plan import lines_over_time
from replays.inspect.session import Session
from runtime.messages import ObjectState, Polyline, PushResponse, PushTarget, Truth
from runtime.recorder.header import CONFIG_NAME
from services.predictive.plan import COARSE, FINE, SHOWN, STEP

Floats = NDArray[np.float64]

EXPECTED, TAKEN = 0.034, 0.032
AHEAD = 1.0  # s: how far ahead plan and motion are compared
FEWEST = 2


def draw_expected(canvas: Canvas, session: Session, where: Places, taken: bool = True) -> None:
    """Plans and the learner's errors. What was `taken` after a plan needs the whole session."""
    _plot_errors(canvas, session)
    track = session.track("push/target", PushTarget)
    rows = [index for index, m in enumerate(track.messages) if len(m.plan.object_path.x) >= FEWEST]
    if not rows:
        return
    times = track.times[rows]
    plans = [track.messages[index].plan for index in rows]
    for name, path, lines, colour in (
        ("object", _object(session, where), [_points(plan.object_path) for plan in plans], palette.OBJECT_EXPECTED),
        ("robot", _robot(session, where), [_points(plan.robot_path) for plan in plans], palette.ROBOT_EXPECTED),
    ):
        lines_over_time(canvas, f"/map/plan/{name}", times, [[line] for line in lines], EXPECTED, colour, 2.4)
        if not taken or len(path[0]) < FEWEST:
            continue
        begins = times + _lead(session)
        ways = [_way(begin + after(len(line)), *path) for begin, line in zip(begins, lines, strict=True)]
        lines_over_time(canvas, f"/map/taken/{name}", times, [[way] for way in ways], TAKEN, palette.TAKEN, 1.6)
        if name == "object":
            _plot_miss(canvas, times, begins, lines, path)


def after(count: int) -> NDArray[np.int64]:
    """Return when a plan expects the `count` points of its paths, ns after its beginning, (count)."""
    step = SHOWN * np.arange(count) + 1
    fine = np.minimum(step, round(FINE / STEP))
    return np.rint(1e9 * (fine * STEP + (step - fine) * COARSE)).astype(np.int64)


def _plot_errors(canvas: Canvas, session: Session) -> None:
    track = session.track("push/response", PushResponse)
    # Before the first observation there is no error.
    known = np.array([m.prior_error > 0.0 for m in track.messages], bool)
    times, messages = track.times[known], [m for m in track.messages if m.prior_error > 0.0]
    prior = [m.prior_error for m in messages]
    canvas.series("/prediction/prior", times, prior, palette.GONE, "nothing learned")
    learned = [m.error for m in messages]
    canvas.series("/prediction/learned", times, learned, palette.LEARNED, "learned", 2.0)
    for name, values, colour in (
        ("windows", [m.windows for m in track.messages], palette.LEARNED),
        ("touches", [m.touches for m in track.messages], palette.EASY_AXIS),
    ):
        canvas.series(f"/samples/{name}", track.times, values, colour, name)


def _plot_miss(
    canvas: Canvas,
    times: NDArray[np.int64],
    begins: NDArray[np.int64],
    lines: Sequence[Floats],
    path: tuple[NDArray[np.int64], Floats],
) -> None:
    """How far the object was from where a plan had it a second ahead, at the plan's time."""
    ahead = round(1e9 * AHEAD)
    rows = [
        row for row, line in enumerate(lines) if after(len(line))[-1] >= ahead and begins[row] + ahead <= path[0][-1]
    ]
    misses = np.empty(len(rows))
    for number, row in enumerate(rows):
        came = _way(np.array([begins[row] + ahead]), *path)[0]
        place = after(len(lines[row]))
        planned = [np.interp(ahead, place, column) for column in lines[row].T]
        misses[number] = np.hypot(*(came - planned))
    canvas.series("/expectation/plan", times[rows], misses, palette.OBJECT_EXPECTED, "plan, 1 s ahead")


def _points(path: Polyline) -> Floats:
    return np.column_stack([path.x, path.y]).astype(np.float64).reshape(-1, 2)


def _object(session: Session, where: Places) -> tuple[NDArray[np.int64], Floats]:
    """Where the object was and when: the simulation's truth, or else what the tracker saw."""
    truths = session.track("truth", Truth)
    if len(truths):
        return _stamped(truths.messages, np.array([(m.object.x, m.object.y) for m in truths.messages]))
    return _stamped(session.track("object/state", ObjectState).messages, where.object)


def _robot(session: Session, where: Places) -> tuple[NDArray[np.int64], Floats]:
    truths = session.track("truth", Truth)
    if len(truths):
        return _stamped(truths.messages, np.array([(m.robot.x, m.robot.y) for m in truths.messages]))
    return where.robot_stamps, where.robot[:, :2]


def _stamped(messages: Sequence[Truth] | Sequence[ObjectState], points: Floats) -> tuple[NDArray[np.int64], Floats]:
    return np.array([m.stamp for m in messages], np.int64), points


def _way(at: NDArray[np.int64], times: NDArray[np.int64], points: Floats) -> Floats:
    """Return the places at the times `at`, as far as `times` reach, (M, 2)."""
    at = at[(at >= times[0]) & (at <= times[-1])]
    since, known = (at - times[0]).astype(np.float64), (times - times[0]).astype(np.float64)
    return np.column_stack([np.interp(since, known, column) for column in points.T])


def _lead(session: Session) -> int:
    """Return the ns between a plan and its beginning, as the session's configuration has it."""
    found = json.loads(session.attachments.get(CONFIG_NAME, b"{}"))
    lead = found.get("sections", {}).get("strategy", {}).get("predictive", {}).get("lead", 0.0)
    return round(1e9 * lead)
