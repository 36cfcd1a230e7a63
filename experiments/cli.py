"""`pushlane sim`: one push in simulation."""

from __future__ import annotations

import json
import math
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from runtime.cli.experience import ExperienceFile, with_experience
from runtime.cli.options import Assignments, ConfigFile, batch_layers, check_goal, layers
from runtime.outputs import check_folder


class Mode(StrEnum):
    """Where the services of a simulated push run."""

    LOCAL = "local"
    LOCKSTEP = "lockstep"


experiment = typer.Typer(no_args_is_help=True, help="Run many pushes and print figures with their intervals.")


def register(root: typer.Typer) -> None:
    """Add the verbs of this module to `root`."""
    root.command(name="sim")(sim)
    from experiments.beyond import cli as beyond
    from experiments.paper import cli as paper

    paper.register(experiment)
    beyond.register(experiment)
    root.add_typer(experiment, name="experiment")


def sim(
    scene: Annotated[str, typer.Option(help="Where: a scene of --list.", show_default="living-room")] = "",
    object_: Annotated[
        str, typer.Option("--object", help="What: an object of --list.", show_default="the scene's own")
    ] = "",
    goal: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="X Y", help="Where to, in m on the map.", show_default="the scene's own"),
    ] = None,
    strategy: Annotated[
        str,
        typer.Option(
            help="How the next target is chosen: one of --list.",
            show_default="predictive; strict with one of the paper's controllers",
        ),
    ] = "",
    controller: Annotated[
        str,
        typer.Option(
            help="How the base pushes: one of --list.",
            show_default="predictive; adaptive with one of the paper's strategies",
        ),
    ] = "",
    precision: Annotated[
        float | None, typer.Option(metavar="M", help="Delivered within this distance.", show_default="0.1")
    ] = None,
    yaw: Annotated[
        float | None,
        typer.Option(metavar="DEGREES", help="Delivered turned so, on the map; predictive only.", show_default="any"),
    ] = None,
    time_limit: Annotated[
        float | None, typer.Option(metavar="S", help="Give up after this time.", show_default="400")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Of everything drawn: same seed, same messages.", show_default="1")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE.mcap", help="Record the session here.", show_default="not recorded"
        ),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the file of --output if it is there.")
    ] = False,
    mode: Annotated[
        Mode, typer.Option(help="local: all services in this process; lockstep: each in its own, stepped over Zenoh.")
    ] = Mode.LOCAL,
    perception: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="sensors: camera, laser, infra-red and odometry; truth: the simulation's own, thirty times as fast.",
            show_default="sensors",
        ),
    ] = "",
    tags: Annotated[
        bool | None,
        typer.Option(
            "--tags/--no-tags", help="Whether the object bears tags, which sensors see.", show_default="--tags"
        ),
    ] = None,
    map_: Annotated[
        str,
        typer.Option(
            "--map",
            metavar="FILE.yaml|plan",
            help="Begin with a map made before, or with the scene's floor plan.",
            show_default="it is made while pushing",
        ),
    ] = "",
    link: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="What lies between base and driver: direct, or a Robotino's own serial or rest.",
            show_default="direct",
        ),
    ] = "",
    experience: ExperienceFile = None,
    config: ConfigFile = None,
    assignments: Assignments = None,
    list_: Annotated[
        bool, typer.Option("--list", help="Name scenes, objects, strategies and controllers, and stop.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print --list, or the result, as JSON.")] = False,
) -> None:
    """Push an object to a goal in simulation. Options override --set, and --set overrides --config.

    Everything has a default: [bold]pushlane sim --seed 1 -o a.mcap[/bold] is a whole run. Exits with 0 if the
    object was delivered, 1 if the push failed, 2 if it could not begin.
    """
    from experiments import catalogue

    if list_:
        typer.echo(json.dumps(catalogue.as_json(), indent=1) if as_json else catalogue.text())
        return
    from experiments import watching
    from experiments.session import prepare
    from runtime.config.layers import Layer

    check_goal(goal, "--goal", precision, yaw, time_limit)
    given = {
        "--scene": ("scene", scene),
        "--object": ("object", object_),
        "--goal": ("goal", list(goal) if goal else None),
        "--strategy": ("strategy", strategy),
        "--controller": ("controller", controller),
        "--precision": ("precision", precision),
        "--yaw": ("yaw", None if yaw is None else math.radians(yaw)),
        "--time-limit": ("time_limit", time_limit),
        "--seed": ("seed", seed),
        "--perception": ("perception", perception),
        "--no-tags" if tags is False else "--tags": ("tagged", tags),
        "--map": ("map", map_),
        "--link": ("link", link),
    }
    options = [Layer(flag, {"sim": {key: value}}) for flag, (key, value) in given.items() if value not in (None, "")]
    weakest = Layer("pushlane sim", {"sim": {"perception": "sensors"}})
    session = prepare([weakest, *with_experience(layers(config, assignments), experience), *options])
    if session.sim.perception == "truth":
        _refuse_of_sensors(session.effective.origins)
    delivered = watching.show(
        session,
        output,
        as_json=as_json,
        terminal=sys.stdout.isatty(),
        lockstep=mode is Mode.LOCKSTEP,
        overwrite=overwrite,
    )
    raise typer.Exit(0 if delivered else 1)


_OF_SENSORS = {"sim.tagged": ("--tags", "--no-tags"), "sim.map": ("--map",), "sim.depth": ()}
"""Settings that only perception from sensors reads -> the options that give them."""


def _refuse_of_sensors(origins: dict[str, str]) -> None:
    """Raise if the command line says what perception from truth would not look at. A file may serve both.

    Raises:
        ConfigError: it does.
    """
    from runtime.config.layers import ConfigError

    for key, options in _OF_SENSORS.items():
        origin = origins.get(key, "default")
        if origin == "--set" or origin in options:
            name = f"--set {key}" if origin == "--set" else origin
            why = f"sim.perception is truth ({origins.get('sim.perception', 'default')})"
            raise ConfigError(f"{name}: needs perception from sensors to have an effect; {why}")


@experiment.command()
def deliveries(
    trials: Annotated[int, typer.Option(min=1, help="How many seeds, from --first on.")] = 100,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    first: Annotated[int, typer.Option(min=0, help="First seed.")] = 1,
    failures: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Keep the recording of every failed push here.", show_default="none is kept"
        ),
    ] = None,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Deliver one object in one scene over many seeds, and print the success rate with its Wilson interval.

    Which: by --set, as in [bold]--set sim.scene=wide-bend --set sim.object=cylinder --set sim.strategy=strict[/bold].
    Success is judged by the simulation's truth: within the precision, in time, no centre out of the corridor.
    """
    from rich.console import Console
    from rich.progress import track

    from experiments.session import prepare
    from experiments.trials import Batch, deliver

    given = batch_layers(config, assignments, "seeds go from --first on")
    session = prepare(given)
    if failures is not None:
        check_folder(failures)
    seeds = range(first, first + trials)
    console = Console(stderr=True)
    done = list(track(deliver(given, seeds, jobs, failures), total=trials, description="pushing", console=console))
    sim_ = session.sim
    strategy, controller = session.method
    typer.echo(
        f"{sim_.object or 'its own object'} in {sim_.scene}, {strategy}, {controller}, "
        f"seeds {first} to {first + trials - 1}"
    )
    for line in Batch(done).text():
        typer.echo(line)


@experiment.command()
def tracking(
    runs: Annotated[int, typer.Option(min=1, help="Pushes in each way of seeing, from 0.5 to 2.5 m on.")] = 20,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    seed: Annotated[int, typer.Option(min=0, help="Of the first run.")] = 1,
    senses: Annotated[
        str, typer.Option(metavar="A,B", help="Only these: truth, tags, plan, appearance, depth, 'untagged plan'.")
    ] = "tags,appearance,depth",
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Print how far off the truth mapping and tracker say that robot and object are, and how often it is lost."""
    from rich.console import Console
    from rich.progress import track

    from experiments import tracking as measured
    from experiments.beyond.cases import sensing

    given = batch_layers(config, assignments, "seeds go from --seed on")
    wanted = [case.name for case in sensing(senses.split(","))]
    found: dict[str, list[measured.Run]] = {name: [] for name in wanted}
    done = measured.carried_out(wanted, runs, seed, jobs, given)
    console = Console(stderr=True)
    for sense, one in track(done, total=runs * len(wanted), description="pushing", console=console):
        found[sense].append(one)
    typer.echo("\n".join(one.markdown() for one in measured.tables(found)))
