"""`pushlane replay`, `inspect` and `goldens`: what can be done with a recorded session."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.bus.config import BusConfig
from runtime.cli.options import Assignments, ConfigFile, bus_of
from runtime.outputs import check_file

if TYPE_CHECKING:
    from replays.recording import Recording

Session = Annotated[Path, typer.Argument(metavar="FILE.mcap", help="A recorded session.", show_default=False)]


def register(root: typer.Typer) -> None:
    """Add the verbs of this module to `root`."""
    root.command(name="replay")(replay)
    root.command(name="inspect")(inspect)
    root.command(name="goldens")(goldens)


def replay(
    file: Session,
    service: Annotated[
        list[str] | None,
        typer.Option("--service", help="Only this service; may be given again.", show_default="all"),
    ] = None,
    start: Annotated[
        float,
        typer.Option(metavar="S", help="Begin at the last snapshot before this time.", show_default="its beginning"),
    ] = 0.0,
    assignments: Assignments = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
    overlay: Annotated[
        Path | None,
        typer.Option("--overlay", metavar="OUT.rrd", help="Write recorded against replayed, for Rerun."),
    ] = None,
) -> None:
    """Re-execute services from a recording and compare every byte they give with what was recorded.

    Exits with 0 if all is identical, 1 if anything differs, 2 if the file cannot be used or was altered.
    With --set it answers "what if": the report then shows what the changed setting changes.
    """
    from replays import recording, report
    from replays.replay import replay as execute
    from runtime.config.layers import read_assignments
    from runtime.time import nanoseconds

    if overlay is not None:
        check_file(overlay, replace=True)
    if not math.isfinite(start):
        _refuse_nonfinite("--start", start)
    loaded = recording.load(file)
    _refuse_outside(loaded, start)
    changes = read_assignments(assignments).values if assignments else {}
    result = execute(loaded, service, changes, nanoseconds(start), keep=overlay is not None)
    if as_json:
        typer.echo(json.dumps(report.as_json(result), indent=1))
    else:
        for line in report.text(result):
            typer.echo(line)
    if overlay is not None:
        from replays.overlay import write

        write(result, overlay)
        typer.echo(f"overlay written to {overlay}", err=as_json)
    if loaded.corrupt:
        raise typer.Exit(2)
    raise typer.Exit(0 if result.identical else 1)


def inspect(
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE.mcap", help="A recorded session.", show_default=False)
    ] = None,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="OUT.rrd", help="Write a Rerun file, view included.")
    ] = None,
    screenshot: Annotated[
        Path | None, typer.Option("--screenshot", metavar="OUT.png", help="Draw the view; needs no screen.")
    ] = None,
    at: Annotated[
        float | None, typer.Option(metavar="S", help="Time of the screenshot.", show_default="three fifths")
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Open the viewer in a browser.")] = False,
    live: Annotated[bool, typer.Option("--live", help="Look at the running system instead of a file.")] = False,
    connect_to: Annotated[
        str,
        typer.Option(
            metavar="HOST[:PORT]", help="With --live: feed a viewer that runs already, as on another machine."
        ),
    ] = "",
    bind: Annotated[
        str, typer.Option(metavar="ADDRESS", help="With --live --web: where the page is served.")
    ] = "127.0.0.1",
    duration: Annotated[
        float, typer.Option("--for", metavar="S", help="With --live: this long.", show_default="until Ctrl-C")
    ] = 0.0,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Look at a session in Rerun: map, corridors, push-line, trails, what was learned, commands, phases, log.

    Without --save or --screenshot the viewer opens. With --live it shows a running system, from any machine of it,
    and can never slow that down.
    """
    _refuse_nonfinite("--at", at)
    _refuse_nonfinite("--for", duration)
    for out in (save, screenshot):
        if out is not None:
            check_file(out, replace=True)
    if live == (file is not None):
        raise typer.BadParameter("expected either FILE.mcap or --live")
    if live:
        if screenshot is not None or at is not None:
            raise typer.BadParameter("--screenshot and --at are for files: --save a live session, and look at that")
        _inspect_live(bus_of(config, assignments), save, web, bind, connect_to, duration)
    elif file is not None:
        from replays.inspect.show import show

        show(file, save, screenshot, at, web)


def _inspect_live(bus: BusConfig, save: Path | None, web: bool, bind: str, connect_to: str, duration: float) -> None:
    import signal
    import threading

    from replays.inspect.live import show_live

    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    fed = show_live(bus, stop, typer.echo, save, web, bind, connect_to, duration)
    dropped = f", {fed.dropped} given up because the viewer was too slow" if fed.dropped else ""
    where = f" written to {save}" if save is not None else ""
    typer.echo(f"{fed.messages} messages in {fed.seconds:.1f} s, {len(fed.rows)} entities{where}{dropped}")


def _refuse_outside(loaded: Recording, start: float) -> None:
    """Raise unless a replay can begin at `start`, s. What is before the first message is its beginning.

    Raises:
        OutsideRecording: it is below 0, or after the last message.
    """
    from replays.recording import OutsideRecording

    times = [sample.time for sample in loaded.samples.values()]
    if times and not 0.0 <= start <= max(times) / 1e9:
        raise OutsideRecording(
            f"--start {start:g}: {loaded.path} goes from {min(times) / 1e9:.2f} s to {max(times) / 1e9:.2f} s"
        )


def _refuse_nonfinite(option: str, value: float | None) -> None:
    """Raise unless `value` is a time.

    Raises:
        ConfigError: it is NaN, infinite or below 0.
    """
    from runtime.config.layers import ConfigError

    if value is not None and not (math.isfinite(value) and value >= 0):
        raise ConfigError(f"{option}: expected a time in s, 0 or more (found {value})")


def goldens(
    record: Annotated[bool, typer.Option("--record", help="Make them anew, and say what changed.")] = False,
) -> None:
    """Re-execute the golden pushes of replays/recordings, or record them anew.

    Exits with 0 if all are identical, 1 if any differs.
    """
    from replays import goldens as work

    same = work.record_all(typer.echo) if record else work.check_all(typer.echo)
    raise typer.Exit(0 if same or record else 1)
