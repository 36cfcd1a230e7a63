"""The facts of a session as a text: how it ended, who made it with what, and what was recorded."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable

import rerun as rr

from replays.inspect.canvas import Canvas
from replays.inspect.session import Session
from replays.inspect.states import outcome
from runtime.messages import PushStatus

LONGEST_CELL, LONGEST_TEXT = 200, 8_000  # characters


def draw_facts(canvas: Canvas, session: Session, name: str) -> None:
    """Draw them as one text document."""
    lines = [f"# {name}", "", *_ending(session), *_push(session)]
    for title, facts in sorted(session.metadata.items()):
        lines += _table((title, ""), ((key, _plain(value)) for key, value in sorted(facts.items())))
    lines += _topics(session)
    for attachment, data in session.attachments.items():
        lines += [f"## {attachment}", "", "```", _text(data), "```", ""]
    canvas.fixed("/session", rr.TextDocument("\n".join(lines), media_type=rr.MediaType.MARKDOWN))


def _ending(session: Session) -> list[str]:
    first, last = session.span
    count = sum(len(track) for track in session.tracks.values())
    lines = [f"{(last - first) / 1e9:.2f} s, {count} messages", ""]
    return [*lines, f"**The file ends early: {session.damage}**", ""] if session.damage else lines


def _push(session: Session) -> list[str]:
    statuses = session.track("push/status", PushStatus).messages
    if not statuses:
        return []
    end = statuses[-1]
    rows = (
        ("state", f"{outcome(end)}, {end.reason}" if end.reason else outcome(end)),
        ("distance left", f"{end.distance_left:.3f} m"),
        ("elapsed", f"{end.elapsed:.1f} s"),
        ("L_Qr, L_Qo", f"{end.robot_path_length:.2f} m, {end.object_path_length:.2f} m"),
        ("ticks outside the corridor", f"robot {end.robot_violations}, object {end.object_violations}"),
    )
    return _table(("push", ""), rows)


def _topics(session: Session) -> list[str]:
    first, last = session.span
    seconds = (last - first) / 1e9
    rows = [
        (
            topic,
            str(len(track)),
            f"{(len(track) - 1) / seconds:.1f}" if seconds > 0.0 else "",
            track.messages[0].DESCRIPTOR.name,
        )
        for topic, track in session.tracks.items()
    ]
    rows += [(topic, str(count), "", "not decoded") for topic, count in session.undecoded.items()]
    return _table(("topic", "messages", "Hz", "type"), rows)


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    lines = [head, ("---",) * len(head), *rows]
    return [*(f"| {' | '.join(_cell(cell) for cell in row)} |" for row in lines), ""]


def _cell(value: str) -> str:
    """Return a value that stays inside its cell."""
    flat = " ".join(value.split()).replace("|", "\\|")
    return flat if len(flat) <= LONGEST_CELL else f"{flat[:LONGEST_CELL]}…"


def _plain(value: str) -> str:
    """Return a value of the header, which is JSON, as a person would write it."""
    try:
        found = json.loads(value)
    except ValueError:
        return value
    if isinstance(found, dict):
        return ", ".join(f"{key} {each}" for key, each in found.items())
    return ", ".join(map(str, found)) if isinstance(found, list) else str(found)


def _text(data: bytes) -> str:
    """Return an attachment's text, JSON laid out; or its size where it is no text."""
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return f"{len(data)} bytes"
    with contextlib.suppress(ValueError):
        text = json.dumps(json.loads(text), indent=2)
    return text if len(text) <= LONGEST_TEXT else f"{text[:LONGEST_TEXT]}…"
