"""`pushlane config`: the settings that hold, and where each came from."""

from __future__ import annotations

import json
import re
from importlib import import_module
from typing import Annotated

import msgspec
import typer

from runtime.cli.options import Assignments, ConfigFile, layers

_LIMITS = {"minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below"}
_BARE = re.compile(r"[A-Za-z0-9_-]+")

app = typer.Typer(no_args_is_help=True, help="Look at settings.")


def register(root: typer.Typer) -> None:
    """Add the verbs of this module to `root`."""
    root.add_typer(app, name="config")


@app.command()
def show(
    section: Annotated[str, typer.Argument(help="Only this section.", show_default=False)] = "",
    config: ConfigFile = None,
    assignments: Assignments = None,
    everything: Annotated[
        bool,
        typer.Option("--all", help="Also what the scene and the seed decide: furniture, the object's body."),
    ] = False,
    describe: Annotated[bool, typer.Option("--describe", help="With what each setting means, in what unit.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON: key, value, origin.")] = False,
) -> None:
    """Print every setting with the place its value came from: default, a file, --set, or scene and seed.

    The output is TOML that --config reads again.
    """
    given = layers(config, assignments)
    for layer in given:
        layer.values.pop("hosts", None)  # who runs what is no setting of a service
    session = import_module("experiments.session").prepare(given)
    rows = [
        (key, value, origin)
        for key, value, origin in session.effective.rows()
        if (not section or key.split(".")[0] == section) and (everything or not origin.startswith("scene "))
    ]
    if not rows:
        names = ", ".join(session.effective.sections)
        raise typer.BadParameter(f"no section is called '{section}'; expected one of {names}")
    if as_json:
        typer.echo(json.dumps([{"key": k, "value": v, "origin": o} for k, v, o in rows], indent=1))
        return
    current = ""
    for key, value, origin in rows:
        head, _, name = key.partition(".")
        if head != current:
            typer.echo(f"{'' if not current else chr(10)}[{head}]")
            current = head
        if describe and (meaning := _meaning(type(session.effective.sections[head]), name)):
            typer.echo(f"# {meaning}")
        name = ".".join(part if _BARE.fullmatch(part) else json.dumps(part) for part in name.split("."))
        text = f"{name} = {_toml(value)}" if value is not None else f"# {name} is not set"
        typer.echo(f"{text:<40} # {origin}")


def _meaning(kind: type[msgspec.Struct], name: str) -> str:
    """Return the description and the range of the setting `name`, as its structure declares them."""
    schema = msgspec.json.schema(kind)
    found = schema["$defs"][kind.__name__]["properties"].get(name.split(".", maxsplit=1)[0], {})
    limits = [f"{word} {found[key]:g}" for key, word in _LIMITS.items() if key in found]
    return ", ".join([*([found["description"]] if "description" in found else []), *limits])


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    return json.dumps(value)
