"""Options that several verbs share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from runtime.config.layers import Layer, read_assignments, read_toml

ConfigFile = Annotated[
    Path | None,
    typer.Option("--config", "-c", metavar="FILE.toml", help="Read settings from this file.", show_default=False),
]
Assignments = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="SECTION.KEY=VALUE",
        help="Set one value, as in [bold]controller.k_gamma=0.2[/bold]; may be given again. Overrides the file.",
        show_default=False,
    ),
]


def layers(config: Path | None, assignments: Sequence[str] | None) -> list[Layer]:
    """Return the configuration layers that these options name, weakest first.

    Raises:
        ConfigError: the file cannot be read, or an assignment is none.
    """
    found = [read_toml(config)] if config is not None else []
    return [*found, read_assignments(assignments)] if assignments else found
