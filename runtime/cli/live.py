"""`pushlane run`, `push`, `cancel`, `record`, `recording` and `snapshot`: a system of services in real time."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from runtime.cli.experience import ExperienceFile, with_experience
from runtime.cli.options import Assignments, ConfigFile, bus_of, check_goal, layers
from runtime.config.layers import ConfigError
from runtime.outputs import check_file

recordings = typer.Typer(no_args_is_help=True, help="Let a running system record itself.")

Patterns = Annotated[
    list[str] | None, typer.Option("--topics", metavar="GLOB", help="Only these topics: to look at, not to replay.")
]


def register(root: typer.Typer) -> None:
    """Add the verbs of this module to `root`."""
    root.command(name="run")(run)
    root.command(name="push")(push)
    root.command(name="cancel")(cancel)
    root.command(name="record")(record)
    root.command(name="snapshot")(snapshot)
    root.add_typer(recordings, name="recording")


def run(
    system: Annotated[
        Path | None, typer.Argument(metavar="SYSTEM.toml", help="The system, as in deploy/.", show_default=False)
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="Only this service; may be given again.")
    ] = None,
    host: Annotated[
        str, typer.Option(metavar="HOST", help="Only what the section hosts of the system file gives to this host.")
    ] = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.mcap", help="Record the session here.")
    ] = None,
    join: Annotated[
        bool, typer.Option("--join", help="The meeting point is another launcher, or a Zenoh router, at bus.connect.")
    ] = False,
    experience: ExperienceFile = None,
    assignments: Assignments = None,
) -> None:
    """Start the services of this machine, each in its own process, and keep them alive until Ctrl-C.

    The first launcher is the meeting point of the system; others [bold]--join[/bold] it.
    """
    from rich.console import Console

    from runtime.live.launcher import Launcher
    from runtime.live.table import shown

    given = with_experience(layers(system, assignments), experience)
    hosts: dict[str, list[str]] = {}
    for layer in given:
        hosts |= layer.values.pop("hosts", {})
    session = import_module("experiments.session").prepare(given)
    plan = session.plan()
    names = _chosen(plan.nodes, only or [], hosts, host)
    if output is not None:
        check_file(output)
    _check_recordings(plan.sections["live"])
    bus = session.effective.sections["bus"]
    console = Console()
    on_terminal = console.is_terminal
    say = partial(console.print, markup=False, highlight=False) if on_terminal else typer.echo
    launcher = Launcher(plan, bus, names, output, join, say, recorder=not join)
    signal.signal(signal.SIGINT, lambda *_: launcher.stop())
    signal.signal(signal.SIGTERM, lambda *_: launcher.stop())
    typer.echo(f"starting {', '.join(names)}{f', recording to {output}' if output else ''}; Ctrl-C ends it")
    threading.Thread(target=_announce, args=(launcher, say), daemon=True).start()
    with shown(launcher, bus, console) if on_terminal else nullcontext():
        launcher.run()
    typer.echo("stopped")


def push(
    to: Annotated[tuple[float, float], typer.Option("--to", metavar="X Y", help="Where to, in m on the map.")],
    strategy: Annotated[str, typer.Option(help="How targets are chosen.", show_default="as the task says")] = "",
    controller: Annotated[str, typer.Option(help="How the base pushes.", show_default="as the task says")] = "",
    precision: Annotated[
        float | None, typer.Option(metavar="M", help="Delivered within this.", show_default="as the task says")
    ] = None,
    yaw: Annotated[
        float | None,
        typer.Option(metavar="DEGREES", help="Turned so, on the map; predictive only.", show_default="any"),
    ] = None,
    time_limit: Annotated[
        float | None, typer.Option(metavar="S", help="Give up after this.", show_default="as the task says")
    ] = None,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Ask a running system to push its object to a goal, and show the progress.

    Exits with 0 if the object was delivered, 1 if not, 2 if the goal was refused. Ctrl-C cancels the push.
    """
    from rich.console import Console
    from rich.live import Live

    from runtime.live.operate import follow_push
    from runtime.live.table import push_line
    from runtime.messages import PushGoal, Vector2

    check_goal(to, "--to", precision, yaw, time_limit)
    goal = PushGoal(
        position=Vector2(x=to[0], y=to[1]),
        strategy=strategy,
        controller=controller,
        precision=precision or 0.0,
        yaw=None if yaw is None else math.radians(yaw),
        time_limit=time_limit or 0.0,
    )
    bus = bus_of(config, assignments)
    console = Console()
    if not console.is_terminal:
        raise typer.Exit(0 if follow_push(bus, goal, typer.echo) else 1)
    with Live(console=console, transient=True) as live:
        say = partial(console.print, markup=False, highlight=False)
        delivered = follow_push(bus, goal, say, lambda status, start: live.update(push_line(status, start)))
    raise typer.Exit(0 if delivered else 1)


def cancel(
    reason: Annotated[str, typer.Option(help="Is recorded.")] = "cancelled by the operator",
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """End the push that is under way. Exits with 2 if there is none."""
    from runtime.live.operate import ask
    from runtime.messages import CancelRequest

    ask(bus_of(config, assignments), "push/cancel", CancelRequest(reason=reason))
    typer.echo("cancelled")


def record(
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE.mcap", help="The new recording.", show_default="ROBOT-DATE-TIME.mcap"
        ),
    ] = None,
    topics: Patterns = None,
    split: Annotated[
        str, typer.Option(metavar="SIZE|TIME", help="Begin a new part after 200MB, 60s, 10min.", show_default="never")
    ] = "",
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Record a running system, from any machine of it, until Ctrl-C.

    Every file, also every part of one that is split, begins with the latched values and a snapshot of every service,
    so that it replays by itself, unless --topics left something out.
    """
    from runtime.live.deck import default_name
    from runtime.live.record import record as work
    from runtime.live.split import Split

    bus, limit = bus_of(config, assignments), Split.parse(split)
    path = output or Path(default_name(bus.robot))
    check_file(path)
    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    tape = work(bus, path, topics or [], limit, stop, typer.echo)
    for line in tape.summary():
        typer.echo(line)


@recordings.command()
def start(
    name: Annotated[
        str, typer.Argument(help="Of the file, without a folder.", show_default="ROBOT-DATE-TIME.mcap")
    ] = "",
    topics: Patterns = None,
    split: Annotated[
        str, typer.Option(metavar="SIZE|TIME", help="Begin a new part after this.", show_default="as [live] split says")
    ] = "",
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Let the system record itself, on the machine of its first launcher. Exits with 2 if that is refused."""
    from runtime.live.operate import ask, recording_status
    from runtime.messages import RecordingStart

    bus = bus_of(config, assignments)
    ask(bus, "recording/start", RecordingStart(name=name, topics=topics or [], split=split))
    typer.echo(f"recording to {recording_status(bus).file}")


@recordings.command()
def stop(config: ConfigFile = None, assignments: Assignments = None) -> None:
    """End the recording that runs. Exits with 2 if there is none."""
    from runtime.live.operate import ask, recording_status
    from runtime.messages import RecordingStop

    bus = bus_of(config, assignments)
    ask(bus, "recording/stop", RecordingStop())
    deadline = time.monotonic() + 10.0
    found = recording_status(bus)
    while found.recording and time.monotonic() < deadline:
        time.sleep(0.2)
        found = recording_status(bus)
    typer.echo(_recording_text(found))


@recordings.command()
def status(config: ConfigFile = None, assignments: Assignments = None) -> None:
    """Say what is being recorded."""
    from runtime.live.operate import recording_status

    typer.echo(_recording_text(recording_status(bus_of(config, assignments))))


def _recording_text(status: Any) -> str:
    if not status.file:
        return "nothing is being recorded"
    missed = f", {status.missed} missed" if status.missed else ""
    parts = f" in {status.parts} parts" if status.parts > 1 else ""
    failure = f"; it broke off: {status.failure}" if status.failure else ""
    verb = "recording to" if status.recording else "not recording; the last was"
    return f"{verb} {status.file}: {status.messages} messages{parts} in {status.seconds:.1f} s{missed}{failure}"


def snapshot(
    node: Annotated[str, typer.Argument(help="A service.", show_default="all")] = "*",
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Ask services for a snapshot of their state. They publish it, and so it is in a recording that runs."""
    from runtime.live.operate import ask_for_snapshots

    for found in ask_for_snapshots(bus_of(config, assignments), node):
        size = len(found.service) + len(found.host)
        typer.echo(f"{found.node:<12} accepted: snapshot {found.number} at entry {found.entry}, {size} bytes")


def _check_recordings(live: dict[str, Any]) -> None:
    """Raise unless the system can record as [live] says.

    Raises:
        ConfigError: the folder is missing. BadSplit: the limit of a part is none.
    """
    from runtime.live.split import Split

    if not Path(live["recordings"]).is_dir():
        raise ConfigError(f"live.recordings: there is no folder {live['recordings']}")
    Split.parse(live["split"])


def _chosen(names: list[str], only: list[str], hosts: dict[str, Any], host: str) -> list[str]:
    """Return the services to run here.

    Raises:
        ConfigError: a name is unknown.
    """
    for name in [*only, *(one for group in hosts.values() for one in group)]:
        if name not in names:
            raise ConfigError(f"no service is called '{name}'; expected one of {', '.join(names)}")
    if host:
        if host not in hosts:
            raise ConfigError(f"--host {host}: the system file has [hosts] {', '.join(hosts) or 'empty'}")
        names = [name for name in names if name in hosts[host]]
    return [name for name in names if not only or name in only]


def _announce(launcher: Any, say: Callable[[str], None]) -> None:
    while not launcher.ready():
        time.sleep(0.1)
    say("all services are up")
