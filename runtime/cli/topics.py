"""`pushlane topics`, `nodes` and `doctor`: what a running system says, and what is wrong with it."""

from __future__ import annotations

import os
import sys
import time
from importlib import import_module
from typing import Annotated

import typer

from runtime.cli.options import Assignments, ConfigFile, bus_of

app = typer.Typer(no_args_is_help=True, help="Look at the topics of a running system.")

Duration = Annotated[float, typer.Option("--for", metavar="S", help="Listen this long; 0: until Ctrl-C.")]
TopicName = Annotated[str, typer.Argument(help="A topic, or a pattern such as 'push/*'.")]


def register(root: typer.Typer) -> None:
    """Add the verbs of this module to `root`."""
    root.add_typer(app, name="topics")
    root.command(name="nodes")(nodes)
    root.command(name="doctor")(doctor)


@app.command()
def ls(config: ConfigFile = None, assignments: Assignments = None, duration: Duration = 1.5) -> None:
    """List topics with their type, expected and measured rate."""
    from runtime.live.watch import listen
    from runtime.recorder.schema import message_type
    from runtime.topics import TOPICS

    tally = listen(bus_of(config, assignments), "**", duration)
    for name in sorted({*TOPICS, *tally.counts}):
        row = TOPICS.get(name)
        expected = f"{row.rate:g} Hz" if row is not None and row.rate else "on change"
        measured = f"{tally.rate(name):.1f} Hz" if name in tally.counts else "silent"
        try:
            kind = message_type(name).DESCRIPTOR.full_name
        except KeyError:
            kind = "no topic of ours"
        latched = "latched" if row is not None and row.latched else ""
        typer.echo(f"{name:<22} {kind:<26} {expected:<10} {measured:<10} {latched}")


@app.command()
def hz(
    topic: TopicName = "**", config: ConfigFile = None, assignments: Assignments = None, duration: Duration = 5.0
) -> None:
    """Measure rates, with the longest gap between two messages."""
    from runtime.live.watch import listen

    tally = listen(bus_of(config, assignments), topic, duration)
    for name in sorted(tally.counts):
        typer.echo(f"{name:<22} {tally.rate(name):7.2f} Hz, longest gap {1000 * tally.longest[name]:.0f} ms")


@app.command()
def bw(
    topic: TopicName = "**", config: ConfigFile = None, assignments: Assignments = None, duration: Duration = 5.0
) -> None:
    """Measure bandwidth."""
    from runtime.live.watch import listen

    tally = listen(bus_of(config, assignments), topic, duration)
    for name, size in sorted(tally.sizes.items(), key=lambda item: -item[1]):
        typer.echo(
            f"{name:<22} {size / tally.seconds / 1000:8.2f} kB/s, {size / tally.counts[name]:8.0f} bytes a message"
        )
    typer.echo(f"{'all':<22} {sum(tally.sizes.values()) / tally.seconds / 1000:8.2f} kB/s")


@app.command()
def echo(
    topic: TopicName, config: ConfigFile = None, assignments: Assignments = None, duration: Duration = 0.0
) -> None:
    """Print messages as they come. Exits with 1 if none came.

    A latched topic is told at once.
    """
    from google.protobuf.text_format import MessageToString

    from runtime.live.watch import listen
    from runtime.recorder.schema import message_type
    from runtime.sample import Sample

    def show(sample: Sample) -> None:
        # On a thread of Zenoh's, where nobody hears of a reader that is gone.
        try:
            tell(sample)
        except BrokenPipeError:
            os._exit(1)

    def tell(sample: Sample) -> None:
        text = MessageToString(message_type(sample.topic).FromString(sample.payload), as_one_line=True)
        typer.echo(f"{sample.topic} {sample.sequence} at {sample.time / 1e9:.3f} s: {text[:2000]}")
        sys.stdout.flush()

    def silent() -> None:
        typer.echo(_why_silent(topic), err=True)

    tally = listen(bus_of(config, assignments), topic, duration, show, silent, latched=True)
    if not tally.counts:
        raise typer.Exit(1)


def _why_silent(topic: str) -> str:
    from runtime.recorder.schema import message_type
    from runtime.topics import TOPICS

    if "*" in topic:
        return f"nothing came that matches '{topic}'"
    try:
        message_type(topic)
    except KeyError:
        return f"nothing came, and no topic is called '{topic}'; the table has {', '.join(TOPICS)}"
    return f"nothing came on '{topic}': pushlane nodes says who is up, pushlane topics graph --text who publishes it"


@app.command()
def graph(
    config: ConfigFile = None,
    assignments: Assignments = None,
    duration: Duration = 2.0,
    text: Annotated[bool, typer.Option("--text", help="As a tree, for people.")] = False,
    declared: Annotated[
        bool, typer.Option("--declared", help="What the services declare, without a running system.")
    ] = False,
) -> None:
    """Print who publishes what to whom in the running system, with measured rates, for Graphviz."""
    registry = import_module("runtime.registry")
    drawing = import_module("runtime.live.graph")
    if declared:
        found = drawing.Graph.of(list(registry.SERVICES))
    else:
        found = drawing.running(bus_of(config, assignments), duration)
        if not found.nodes:
            typer.echo("no service is up; --declared prints what they would do", err=True)
            raise typer.Exit(1)
    for line in found.tree() if text else found.graphviz():
        typer.echo(line)


def doctor(
    config: ConfigFile = None,
    assignments: Assignments = None,
    duration: Annotated[float, typer.Option("--for", metavar="S", help="Measure rates for this long.")] = 3.0,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON: grade, subject, text, remedy.")] = False,
) -> None:
    """Examine this machine and the running system; each finding comes with its remedy.

    Versions, endpoints, certificates, clocks, disks, rates against the table, losses. Exits with 1 if anything fails.
    """
    import json

    from runtime.live.doctor import examine
    from runtime.live.finding import Grade

    findings = examine(bus_of(config, assignments), duration)
    if as_json:
        rows = [{"grade": f.grade.name, "subject": f.subject, "text": f.text, "remedy": f.remedy} for f in findings]
        typer.echo(json.dumps(rows, indent=1))
    else:
        colours = {Grade.OK: typer.colors.GREEN, Grade.WARN: typer.colors.YELLOW, Grade.FAIL: typer.colors.RED}
        for one in findings:
            grade = typer.style(f"{one.grade.value:<5}", fg=colours[one.grade])
            typer.echo(f"{grade}{one.subject}: {one.text}")
            if one.remedy:
                typer.echo(f"       -> {one.remedy}")
    raise typer.Exit(1 if any(one.grade is Grade.FAIL for one in findings) else 0)


def nodes(config: ConfigFile = None, assignments: Assignments = None) -> None:
    """List the services that are up, with what they report of themselves."""
    from runtime.bus.keys import Keys
    from runtime.bus.session import client
    from runtime.live.tape import RECORDER
    from runtime.messages import Health

    bus = bus_of(config, assignments)
    keys = Keys(bus.robot)
    newest: dict[str, Health] = {}
    with client(bus) as session:
        subscriber = session.declare_subscriber(
            keys.topic("health/*"),
            lambda sample: newest.__setitem__(
                str(sample.key_expr).rpartition("/")[2], Health.FromString(bytes(sample.payload))
            ),
        )
        alive = [str(one.ok.key_expr).rpartition("/")[2] for one in session.liveliness().get(keys.node("*")) if one.ok]
        time.sleep(1.3)
        subscriber.undeclare()
    for name in sorted(alive):
        health = newest.get(name)
        if name == RECORDER:
            typer.echo(f"{name:<12} up; pushlane recording status says whether it records")
            continue
        if health is None:
            typer.echo(f"{name:<12} up, no health report")
            continue
        # Dropped is no fault: a newer position came before it was handled.
        dropped = sum(row.dropped for row in health.inputs)
        lost = sum(row.lost + row.refused for row in health.inputs)
        typer.echo(
            f"{name:<12} up, {health.handled} events a second, handler {1000 * health.busy_mean:.2f} ms mean, "
            f"{1000 * health.busy_max:.2f} ms longest, queue {health.queue_length}, dropped {dropped}, lost {lost}"
        )
    if not alive:
        typer.echo(f"no service of robot '{bus.robot}' is up; another robot is named by --set bus.robot=NAME")
        raise typer.Exit(1)
