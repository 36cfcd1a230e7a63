"""The `pushlane` command: collects the verbs and turns errors into one line and an exit code.

Verbs live beside what they run. Their modules are light: heavy imports (sapien, rerun, numba) happen inside them.
Exit codes: 0 as wished; 1 it ran, and the answer is no (push failed, replay differs); 2 it could not run.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.metadata import version
from typing import Annotated

import typer

from runtime.errors import PushlaneError

VERB_MODULES = (
    "experiments.cli",
    "experiments.slam.cli",
    "experiments.camera.cli",
    "experiments.robotino.cli",
    "replays.cli",
    "replays.experience",
    "runtime.cli.live",
    "runtime.cli.topics",
    "runtime.cli.config",
    "runtime.cli.router",
)

app = typer.Typer(
    name="pushlane",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help=(
        "Push unknown objects with a mobile base, record every session, and replay it byte for byte.\n\n"
        "Begin with [bold]pushlane sim --seed 1 -o a.mcap[/bold], then [bold]pushlane replay a.mcap[/bold] "
        "and [bold]pushlane inspect a.mcap[/bold]."
    ),
    epilog="Exit codes: 0 as wished, 1 the answer is no (push failed, replay differs), 2 it could not run, "
    "130 it was interrupted.",
)


def _show_version(value: bool) -> None:
    if value:
        typer.echo(version("pushlane"))
        raise typer.Exit


@app.callback()
def _root(
    show: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line of this process and exit."""
    for module in VERB_MODULES:
        import_module(module).register(app)
    try:
        app()
    except PushlaneError as error:
        typer.secho(f"pushlane: {error}", err=True, fg=typer.colors.RED)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        typer.secho("pushlane: interrupted", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)


if __name__ == "__main__":
    main()
