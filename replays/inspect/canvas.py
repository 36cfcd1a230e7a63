"""Where the drawings go: one Rerun recording, columns at a time, with a count of what was drawn."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from replays.inspect.palette import Colour
from runtime.outputs import CannotWrite

TIMELINE = "t"


class Canvas:
    """A recording of one session, on the timeline `t` of logical time. `rows` counts rows per entity.

    `states` holds the last state of each lane, `values` those it has had: what is drawn in pieces goes on from there.
    """

    def __init__(self, name: str, recording_id: str) -> None:
        self.recording = rr.RecordingStream(name, recording_id=recording_id)
        self.recording.set_log_time_enabled(False)
        self.recording.set_log_tick_enabled(False)
        self.rows: dict[str, int] = {}
        self.states: dict[str, str] = {}
        self.values: dict[str, set[str]] = {}

    def save(self, out: Path, blueprint: rr.blueprint.Blueprint) -> None:
        """Writes everything drawn so far, and closes the recording."""
        try:
            self.recording.save(out, default_blueprint=blueprint)
            self.recording.flush()
        except RuntimeError as error:  # Rerun's for a full disk and the like
            raise CannotWrite(f"cannot write {out}: {error}") from error
        self.recording.disconnect()

    def columns(self, entity: str, times: NDArray[np.int64], *columns: Iterable[rr.ComponentColumn]) -> None:
        """Draws an entity over time; `times` are ns of logical time, one per row of each column."""
        if len(times) == 0:
            return
        index = rr.TimeColumn(TIMELINE, duration=times.astype("timedelta64[ns]"))
        self.recording.send_columns(entity, [index], [column for group in columns for column in group])
        self._count(entity, len(times))

    def fixed(self, entity: str, *what: rr.AsComponents) -> None:
        """Draws what holds at all times."""
        self.recording.log(entity, *what, static=True)

    def row(self, entity: str, time: int, what: rr.AsComponents) -> None:
        """Draws one row, for what has no columns (bar charts)."""
        self.recording.set_time(TIMELINE, duration=np.timedelta64(time, "ns"))
        self.recording.log(entity, what)
        self._count(entity, 1)

    def series(
        self,
        entity: str,
        times: NDArray[np.int64],
        values: NDArray[np.float64] | Sequence[float],
        colour: Colour,
        name: str,
        width: float = 1.6,
    ) -> None:
        """Plots `values` against `times` as a line; nothing where there is no value."""
        if len(times) == 0:
            return
        self.fixed(entity, rr.SeriesLines(colors=[colour], names=[name], widths=[width]))
        self.columns(entity, times, rr.Scalars.columns(scalars=np.asarray(values, np.float64)))

    def dots(
        self,
        entity: str,
        times: NDArray[np.int64],
        values: NDArray[np.float64] | Sequence[float],
        colour: Colour,
        name: str,
        size: float = 2.0,
    ) -> None:
        """Plots `values` against `times` as separate points."""
        if len(times) == 0:
            return
        self.fixed(entity, rr.SeriesPoints(colors=[colour], names=[name], markers=["circle"], marker_sizes=[size]))
        self.columns(entity, times, rr.Scalars.columns(scalars=np.asarray(values, np.float64)))

    def has(self, *prefixes: str) -> bool:
        """Whether anything was drawn at or below one of these entities."""
        return any(entity == p or entity.startswith(f"{p}/") for entity in self.rows for p in prefixes)

    def _count(self, entity: str, rows: int) -> None:
        self.rows[entity] = self.rows.get(entity, 0) + rows


def raised(points: NDArray[np.float64], height: float) -> NDArray[np.float32]:
    """(..., 3) plane points (..., 2) put on a layer of the picture, m above the floor."""
    z = np.full((*points.shape[:-1], 1), height)
    return np.concatenate([points, z], axis=-1).astype(np.float32)
