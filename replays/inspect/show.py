"""The command `pushlane inspect`: a session as a Rerun file, as a picture, or in a window."""

from __future__ import annotations

import tempfile
from pathlib import Path

import typer

from replays.inspect import InspectSummary, open_viewer, screenshot, to_rrd
from runtime.errors import PushlaneError
from runtime.outputs import writing


class OutsideSession(PushlaneError):
    """The time asked for is not in the session."""


def show(session: Path, save: Path | None, picture: Path | None, at: float | None, web: bool = False) -> InspectSummary:
    """Convert `session`; write it to `save` and draw it to `picture` where given, else open the viewer.

    `at` is the time of the picture, s; by default three fifths through the session.

    Raises:
        Unreadable, NoVulkan, NoDisplay, ViewError: see `replays.inspect`.
    """
    with tempfile.TemporaryDirectory() as folder:
        rrd = save or Path(folder) / f"{session.stem}.rrd"
        summary = to_rrd(session, rrd)
        if at is not None and not summary.first <= at * 1e9 <= summary.last:
            raise OutsideSession(
                f"--at {at:g}: the session goes from {summary.first / 1e9:.2f} s to {summary.last / 1e9:.2f} s"
            )
        if summary.damage:
            typer.echo(f"the file ends early, at {summary.last / 1e9:.2f} s ({summary.damage})", err=True)
        if save is not None:
            typer.echo(f"{len(summary.rows)} entities, {sum(summary.rows.values())} rows written to {save}")
        if picture is not None:
            middle = (summary.first + 0.6 * (summary.last - summary.first)) / 1e9
            with writing(picture):
                screenshot(rrd, picture, middle if at is None else at)
            typer.echo(f"picture written to {picture}")
        if save is None and picture is None:
            open_viewer(rrd, web)
    return summary
