"""`pushlane router SYSTEM.toml`: the hub's settings for a Zenoh router that is not ours.

The output is JSON, which is JSON5: `zenohd --config FILE` reads it. `pushlane run --join` then meets there.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from runtime.bus.session import hub_settings
from runtime.cli.options import Assignments, bus_of


def register(root: typer.Typer) -> None:
    """Add the verb of this module to `root`."""
    root.command(name="router")(router)


def router(
    system: Annotated[Path, typer.Argument(metavar="SYSTEM.toml", help="The system, as in deploy/.")],
    assignments: Assignments = None,
) -> None:
    """Print the settings of the meeting point, access control included, for a Zenoh router (zenohd --config FILE)."""
    tree: dict[str, object] = {}
    for path, value in hub_settings(bus_of(system, assignments)).items():
        inner = tree
        *folders, name = path.split("/")
        for folder in folders:
            found = inner.setdefault(folder, {})
            assert isinstance(found, dict)
            inner = found
        inner[name] = value
    typer.echo(json.dumps(tree, indent=2))
