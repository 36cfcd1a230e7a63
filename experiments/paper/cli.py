"""`pushlane experiment strategies|free-area|controllers|all`: the paper's experiments."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from experiments.paper.cells import EXPERIMENTS, STARTS, TITLES, WHAT_A_CELL_IS
from runtime.cli.options import Assignments, ConfigFile, batch_layers

Trials = Annotated[int, typer.Option(min=1, help="Trials a cell.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]
Seed = Annotated[int, typer.Option(min=0, help="Of the first trial of every cell; the others follow on.")]
Output = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="FOLDER",
        help="Where report, trials and plots go; a run that is there is gone on with.",
    ),
]
Methods = Annotated[
    str,
    typer.Option(
        metavar="A,B", help="Only these strategies and controllers.", show_default="the paper's and predictive"
    ),
]
Starts = Annotated[
    str,
    typer.Option(metavar="A,B", help=f"Starts to tell apart: some of {', '.join(STARTS)}; empty: none."),
]
Failures = Annotated[
    int, typer.Option(min=-1, help="Recordings kept of each cell's failures, the first ones; -1: of all, 0: of none.")
]
Plots = Annotated[bool, typer.Option("--plots/--no-plots", help="Draw Fig. 7c, 9 and 10.")]

KEPT = (
    "Finished trials are kept: the same command goes on where it was stopped (Ctrl-C stops it and writes the report "
    "of what there is), and more --trials add to those there are. Results do not depend on --jobs."
)

DECIDED = ("scene", "object", "strategy", "controller", "precision", "seed", "start")
"""Keys of [sim] that every trial has its own of."""
DECIDES = "the experiment has its own, and seeds from --seed on"

_DEFAULT = Path("out/experiments")
_STARTS = ",".join(STARTS)
_HELP = (
    "Prints and writes the paper's tables and figures with ours beside them: report.md, trials.parquet, failures.md, "
    "plots.\n\n"
    f"{WHAT_A_CELL_IS}\n\n"
    f"{KEPT}"
)


def register(experiment: typer.Typer) -> None:
    """Add the verbs of this module to `pushlane experiment`."""
    for name, title in TITLES.items():
        experiment.command(name=name, help=f"{title} (Sec. 6.3).\n\n{_HELP}")(_verb((name,)))
    experiment.command(name="all", help=f"The paper's Experiments 1, 2 and 3 (Sec. 6.3).\n\n{_HELP}")(
        _verb(EXPERIMENTS)
    )


def _verb(experiments: Sequence[str]) -> Callable[..., None]:
    def verb(
        trials: Trials = 200,
        jobs: Jobs = 2,
        seed: Seed = 1,
        output: Output = _DEFAULT,
        methods: Methods = "",
        starts: Starts = _STARTS,
        failures: Failures = 3,
        plots: Plots = True,
        config: ConfigFile = None,
        assignments: Assignments = None,
    ) -> None:
        from experiments.paper.whole import Order, carry_out

        order = Order(
            experiments=tuple(experiments),
            trials=trials,
            jobs=jobs,
            first_seed=seed,
            folder=output,
            methods=names(methods),
            starts=names(starts),
            failures=failures,
            drawn=plots,
            layers=batch_layers(config, assignments, DECIDES, DECIDED),
            command=shlex.join(["pushlane", *sys.argv[1:]]),
        )
        whole = carry_out(order)
        raise typer.Exit(0 if whole else 130)

    return verb


def names(text: str) -> tuple[str, ...]:
    """Return the names of a list as an option gives it: A,B."""
    return tuple(part.strip() for part in text.split(",") if part.strip())
