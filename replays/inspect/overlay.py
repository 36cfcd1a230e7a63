"""Recorded against replayed: every numeric field of every topic as two lines in one plot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from replays.inspect import palette
from replays.inspect.canvas import TIMELINE, Canvas

Row = tuple[str, int, Message]
Series = dict[tuple[str, str], list[tuple[int, float]]]

# Longer arrays are curves and grids, not numbers to follow over time.
LONGEST = 9
_WIDTHS = {"recorded": 3.2, "replayed": 1.4}  # the replayed line lies on the recorded one where they agree


def overlay(recorded: Sequence[Row], replayed: Sequence[Row], out: Path) -> dict[str, int]:
    """Write `out`: topics as tabs, those that differ first; fields as plots, those that differ marked with "≠".

    Rows are (topic, ns of logical time, message). Arrays of more than nine numbers are left out.
    Returns how many fields differ, per topic.
    """
    sides = {"recorded": _series(recorded), "replayed": _series(replayed)}
    canvas = Canvas("pushlane-overlay", recording_id=out.stem)
    colours = {"recorded": palette.GAMMA, "replayed": palette.CORRIDOR}
    for side, series in sides.items():
        for (topic, name), points in series.items():
            times = np.array([time for time, _ in points], np.int64)
            values = np.array([value for _, value in points])
            canvas.series(f"/{topic}/{name}/{side}", times, values, colours[side], side, _WIDTHS[side])
    names = sorted({key for series in sides.values() for key in series})
    differ = {key for key in names if sides["recorded"].get(key) != sides["replayed"].get(key)}
    topics = sorted({topic for topic, _ in names})
    counts = {topic: sum(key[0] == topic for key in differ) for topic in topics}
    tabs = [
        rrb.Grid(
            *[
                _plot(key, key in differ)
                for key in sorted(names, key=lambda key: (key not in differ, key))
                if key[0] == topic
            ],
            name=f"{'≠ ' if counts[topic] else ''}{topic}",
        )
        for topic in sorted(topics, key=lambda topic: (counts[topic] == 0, topic))
    ]
    canvas.save(
        out,
        rrb.Blueprint(
            rrb.Tabs(*tabs, active_tab=0),
            rrb.TimePanel(state="collapsed", timeline=TIMELINE),
            rrb.SelectionPanel(state="hidden"),
            rrb.BlueprintPanel(state="hidden"),
            rrb.TopPanel(state="hidden"),
            auto_views=False,
            auto_layout=False,
        ),
    )
    return counts


def _plot(key: tuple[str, str], differs: bool) -> rrb.TimeSeriesView:
    topic, name = key
    title = f"{'≠ ' if differs else ''}{name.replace('/', '.')}"
    return rrb.TimeSeriesView(origin=f"/{topic}/{name}", name=title, plot_legend=rrb.Corner2D.RightTop)


def _series(rows: Sequence[Row]) -> Series:
    found: Series = {}
    for topic, time, message in rows:
        for name, value in _numbers(message, ""):
            found.setdefault((topic, name), []).append((time, value))
    return found


def _numbers(message: Message, prefix: str) -> Iterator[tuple[str, float]]:
    """Give the numbers of a message by the path of their field; unset scalars are their default, as on the wire."""
    for descriptor in message.DESCRIPTOR.fields:
        value, name = getattr(message, descriptor.name), f"{prefix}{descriptor.name}"
        if descriptor.type == FieldDescriptor.TYPE_MESSAGE:
            if not descriptor.is_repeated and message.HasField(descriptor.name):
                yield from _numbers(value, f"{name}/")
        elif descriptor.type not in (FieldDescriptor.TYPE_STRING, FieldDescriptor.TYPE_BYTES):
            if not descriptor.is_repeated:
                if not descriptor.has_presence or message.HasField(descriptor.name):
                    yield name, float(value)
            elif len(value) <= LONGEST:
                yield from ((f"{name}/{index}", float(item)) for index, item in enumerate(value))
