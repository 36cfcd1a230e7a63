"""`pushlane run`, `push`, `cancel` and `record`: a system of services in real time."""

from __future__ import annotations

import signal
import sys
import threading
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from runtime.cli.options import Assignments, ConfigFile, bus_of, layers
from runtime.config.layers import ConfigError


def register(root: typer.Typer) -> None:
    """Add the verbs of this module to `root`."""
    root.command(name="run")(run)
    root.command(name="push")(push)
    root.command(name="cancel")(cancel)
    root.command(name="record")(record)


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
    assignments: Assignments = None,
) -> None:
    """Start the services of this machine, each in its own process, and keep them alive until Ctrl-C.

    The first launcher is the meeting point of the system; others [bold]--join[/bold] it.
    """
    from runtime.live.launcher import Launcher

    given = layers(system, assignments)
    hosts: dict[str, list[str]] = {}
    for layer in given:
        hosts |= layer.values.pop("hosts", {})
    session = import_module("experiments.session").prepare(given)
    plan = session.plan()
    names = _chosen(plan.nodes, only or [], hosts, host)
    if output is not None and not output.parent.is_dir():
        raise ConfigError(f"cannot write {output}: there is no folder {output.parent}")
    if output is not None and output.exists():
        raise ConfigError(f"{output} is there already: choose another name")
    launcher = Launcher(plan, session.effective.sections["bus"], names, output, join)
    signal.signal(signal.SIGINT, lambda *_: launcher.stop())
    signal.signal(signal.SIGTERM, lambda *_: launcher.stop())
    typer.echo(f"starting {', '.join(names)}{f', recording to {output}' if output else ''}; Ctrl-C ends it")
    threading.Thread(target=_announce, args=(launcher,), daemon=True).start()
    launcher.run()
    typer.echo("stopped")


def push(
    to: Annotated[tuple[float, float], typer.Option("--to", metavar="X Y", help="Where to, in m on the map.")],
    strategy: Annotated[str, typer.Option(help="How targets are chosen.", show_default="as the task says")] = "",
    controller: Annotated[str, typer.Option(help="How the base pushes.", show_default="as the task says")] = "",
    precision: Annotated[float, typer.Option(metavar="M", help="Delivered within this; 0: as the task says.")] = 0.0,
    time_limit: Annotated[float, typer.Option(metavar="S", help="Give up after this; 0: as the task says.")] = 0.0,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Ask a running system to push its object to a goal, and show the progress.

    Exits with 0 if the object was delivered, 1 if not, 2 if the goal was refused. Ctrl-C cancels the push.
    """
    from runtime.live.operate import follow_push
    from runtime.messages import PushGoal, Vector2

    goal = PushGoal(
        position=Vector2(x=to[0], y=to[1]),
        strategy=strategy,
        controller=controller,
        precision=precision,
        time_limit=time_limit,
    )
    delivered = follow_push(bus_of(config, assignments), goal, typer.echo, live=sys.stdout.isatty())
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
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.mcap", help="The new recording.")],
    topics: Annotated[
        list[str] | None, typer.Option("--topics", metavar="GLOB", help="Only these topics; journals always.")
    ] = None,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Record a running system, from any machine of it, until Ctrl-C.

    The file begins with the latched values and a snapshot of every service, so that it replays by itself.
    """
    from runtime.live.record import record as work

    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    count = work(bus_of(config, assignments), output, topics or ["*"], stop)
    typer.echo(f"{count} messages recorded to {output}")


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


def _announce(launcher: Any) -> None:
    import time

    while not launcher.ready():
        time.sleep(0.1)
    typer.echo("all services are up")
