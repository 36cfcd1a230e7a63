"""Draws the log: what services said, requests and replies, changes of the push, corridors not found."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import rerun as rr

from replays.inspect.canvas import Canvas
from replays.inspect.session import Session
from replays.inspect.states import outcome
from runtime.messages import Corridor, Log, PushStatus, Reply, Request

Line = tuple[str, int, str, str]  # who, ns, level, text

_LEVELS = {Log.DEBUG: "DEBUG", Log.INFO: "INFO", Log.WARNING: "WARN", Log.ERROR: "ERROR", Log.FATAL: "CRITICAL"}


def draw_log(canvas: Canvas, session: Session) -> None:
    """Draw every line; the line says its time and who said it."""
    lines = [*_said(session), *_requests(session), *_push(canvas, session), *_corridors(session)]
    for who in sorted({line[0] for line in lines}):
        own = [line for line in lines if line[0] == who]
        canvas.columns(
            f"/log/{who.replace('/', '_') or 'unnamed'}",
            np.array([time for _, time, _, _ in own], np.int64),
            rr.TextLog.columns(
                text=[f"{time / 1e9:8.2f} s  {who}: {text}" for _, time, _, text in own],
                level=[level for _, _, level, _ in own],
            ),
        )


def _said(session: Session) -> Iterator[Line]:
    for topic in session.tracks:
        if topic == "log" or topic.startswith("log/"):
            track = session.track(topic, Log)
            for time, line in zip(track.times.tolist(), track.messages, strict=True):
                who = line.name or topic.removeprefix("log/")
                yield who, time, _LEVELS.get(line.level, "TRACE"), line.message


def _requests(session: Session) -> Iterator[Line]:
    for topic in session.tracks:
        if topic.startswith("request/"):
            asked = session.track(topic, Request)
            for time, request in zip(asked.times.tolist(), asked.messages, strict=True):
                yield "request", time, "INFO", f"{request.name} #{request.id}"
        elif topic.startswith("reply/"):
            answered = session.track(topic, Reply)
            for time, reply in zip(answered.times.tolist(), answered.messages, strict=True):
                verdict = "accepted" if reply.accepted else f"refused: {reply.reason}"
                yield "reply", time, "INFO" if reply.accepted else "WARN", f"{reply.name} #{reply.id} {verdict}"


def _push(canvas: Canvas, session: Session) -> Iterator[Line]:
    track = session.track("push/status", PushStatus)
    before = canvas.states.get("log/push", "")
    for time, status in zip(track.times.tolist(), track.messages, strict=True):
        state = outcome(status)
        if state != before:
            level = "ERROR" if state.startswith("failed") else "INFO"
            yield "push", time, level, f"{state}, {status.reason}" if status.reason else state
        before = canvas.states["log/push"] = state


def _corridors(session: Session) -> Iterator[Line]:
    track = session.track("corridor", Corridor)
    for time, corridor in zip(track.times.tolist(), track.messages, strict=True):
        if not corridor.found:
            yield "no corridor", time, "WARN", f"version {corridor.version}: {corridor.reason}"
