"""Turns a session into a Rerun recording with its views."""

from __future__ import annotations

from pathlib import Path

from replays.inspect.bodies import draw_bodies
from replays.inspect.canvas import Canvas
from replays.inspect.expected import draw_expected
from replays.inspect.facts import draw_facts
from replays.inspect.layout import Layout
from replays.inspect.learning import draw_learning
from replays.inspect.log import draw_log
from replays.inspect.places import ground, places
from replays.inspect.plan import draw_plan
from replays.inspect.plots import draw_plots
from replays.inspect.response import draw_response
from replays.inspect.sensing import draw_sensing
from replays.inspect.session import read_session
from replays.inspect.states import draw_states
from replays.inspect.summary import InspectSummary


def convert(path: Path, out: Path) -> InspectSummary:
    """Reads `path` and writes `out`; see `replays.inspect.to_rrd`."""
    session = read_session(path)
    where = places(session)
    canvas = Canvas("pushlane", recording_id=path.stem)
    draw_plan(canvas, session)
    draw_bodies(canvas, session, where)
    draw_sensing(canvas, session, where)
    draw_learning(canvas, session, where)
    draw_response(canvas, session, where)
    draw_expected(canvas, session, where)
    draw_plots(canvas, session, where)
    draw_states(canvas, session)
    draw_log(canvas, session)
    draw_facts(canvas, session, path.stem)
    canvas.save(out, Layout(canvas, ground(session, where), session.span).blueprint())
    messages = {topic: len(track) for topic, track in session.tracks.items()}
    return InspectSummary(canvas.rows, messages, session.undecoded, *session.span, session.damage)
