"""`pushlane experiment best|open|orientation|robustness|dynamic|sensors`: what lies past the paper's own tables."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.paper.cli import DECIDED, DECIDES, KEPT, Failures, Jobs, Seed, names
from runtime.cli.options import Assignments, ConfigFile, batch_layers

if TYPE_CHECKING:
    from experiments.beyond.cases import Case

Trials = Annotated[int, typer.Option(min=1, help="Trials a case.")]
Output = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="FOLDER",
        help="Where report, trials and plots go; a run that is there is gone on with, other methods beside it.",
    ),
]
Method = Annotated[str, typer.Option(metavar="NAME", help="predictive, or STRATEGY/CONTROLLER of any two.")]
WithoutYaw = Annotated[bool, typer.Option("--without-yaw", help="The object's orientation is not seen.")]
Parameters = Annotated[
    str,
    typer.Option(
        metavar="A,B", help="Only these: noise, latency, speed, size, mass, friction.", show_default="all of them"
    ),
]
Perception = Annotated[str, typer.Option(metavar="NAME", help="truth or sensors.")]
Senses = Annotated[
    str,
    typer.Option(
        metavar="A,B",
        help="Only these: truth, tags, plan, appearance, depth, 'untagged plan', 'no yaw'.",
        show_default="all of them",
    ),
]
Plots = Annotated[bool, typer.Option("--plots/--no-plots", help="Draw.")]

_KEPT = f"Writes report.md, trials.parquet, failures.md and plots, and prints the tables.\n\n{KEPT}"


def register(experiment: typer.Typer) -> None:
    """Add the verbs of this module to `pushlane experiment`."""
    experiment.command(
        name="best",
        help="Corridors 1 to 3 at four widths and the four rooms, with every object, at 0.05 m: success, path ratios "
        f"and hits beside the bar.\n\n{_KEPT}",
    )(best)
    experiment.command(
        name="open",
        help="Goals all around on an open floor: 24 directions, 3 objects, 2 floor frictions, as in Pushing in the "
        f"Dark.\n\n{_KEPT}",
    )(around)
    experiment.command(
        name="orientation",
        help="Goals with an orientation of the object, within 15 degrees: 8 orientations, 7 objects, Corridors 1 to 3 "
        f"and the open floor.\n\n{_KEPT}",
    )(orientation)
    experiment.command(
        name="robustness",
        help=f"Success over noise, latency, speed, size, mass and friction, one at a time.\n\n{_KEPT}",
    )(robustness)
    experiment.command(
        name="dynamic",
        help="Experiment 4: the children's room, where things are put into the corridor and taken away while the robot "
        f"pushes.\n\n{_KEPT}",
    )(dynamic)
    experiment.command(
        name="sensors",
        help=f"The same pushes seen by truth, by tags, by looks and by depth.\n\n{_KEPT}",
    )(sensors)


def best(
    trials: Trials = 200,
    jobs: Jobs = 2,
    seed: Seed = 1,
    output: Output = Path("out/best"),
    method: Method = "predictive",
    without_yaw: WithoutYaw = False,
    failures: Failures = 3,
    plots: Plots = True,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Run the cases of the bar."""
    from experiments.beyond import cases

    _carry_out(cases.best(not without_yaw), trials, jobs, seed, output, method, failures, plots, config, assignments)


def around(
    trials: Trials = 1,
    jobs: Jobs = 2,
    seed: Seed = 1,
    output: Output = Path("out/open"),
    method: Method = "predictive",
    failures: Failures = 3,
    plots: Plots = True,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Run the goals all around."""
    from experiments.beyond import cases

    _carry_out(cases.around(), trials, jobs, seed, output, method, failures, plots, config, assignments)


def orientation(
    trials: Trials = 7,
    jobs: Jobs = 2,
    seed: Seed = 1,
    output: Output = Path("out/orientation"),
    method: Method = "predictive",
    failures: Failures = 3,
    plots: Plots = True,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Run the goals with an orientation."""
    from experiments.beyond import cases

    _carry_out(cases.turned(), trials, jobs, seed, output, method, failures, plots, config, assignments)


def robustness(
    trials: Trials = 21,
    jobs: Jobs = 2,
    seed: Seed = 1,
    output: Output = Path("out/robustness"),
    method: Method = "predictive",
    parameters: Parameters = "",
    failures: Failures = 3,
    plots: Plots = True,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Run the sweep."""
    from experiments.beyond import cases

    _carry_out(cases.sweep(names(parameters)), trials, jobs, seed, output, method, failures, plots, config, assignments)


def dynamic(
    trials: Trials = 50,
    jobs: Jobs = 2,
    seed: Seed = 1,
    output: Output = Path("out/dynamic"),
    method: Method = "predictive",
    perception: Perception = "truth",
    failures: Failures = 3,
    plots: Plots = True,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Run Experiment 4."""
    from experiments.beyond import cases

    chosen = cases.changing(perception)
    _carry_out(chosen, trials, jobs, seed, output, method, failures, plots, config, assignments)


def sensors(
    trials: Trials = 100,
    jobs: Jobs = 2,
    seed: Seed = 1,
    output: Output = Path("out/sensors"),
    method: Method = "predictive",
    senses: Senses = "",
    failures: Failures = 3,
    plots: Plots = True,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Run the pushes from sensors."""
    from experiments.beyond import cases

    chosen = cases.sensing(names(senses))
    _carry_out(chosen, trials, jobs, seed, output, method, failures, plots, config, assignments)


def _carry_out(
    cases: Sequence[Case], trials: int, jobs: int, seed: int, output: Path, method: str, failures: int, plots: bool,
    config: Path | None, assignments: list[str] | None,
) -> None:  # fmt: skip
    from experiments.beyond.whole import DEFAULTS, Order, carry_out

    order = Order(
        cases=tuple(cases),
        method=method,
        trials=trials,
        jobs=jobs,
        first_seed=seed,
        folder=output,
        failures=failures,
        drawn=plots,
        layers=[*DEFAULTS.get(cases[0].experiment, []), *batch_layers(config, assignments, DECIDES, DECIDED)],
        command=shlex.join(["pushlane", *sys.argv[1:]]),
    )
    raise typer.Exit(0 if carry_out(order) else 130)
