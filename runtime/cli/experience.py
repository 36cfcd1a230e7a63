"""The option `--experience FILE`: what an earlier push learned of an object, as a layer of the configuration.

So it is in the session's recorded configuration, and a replay needs no file. `pushlane experience save` writes it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import typer

from runtime.config.layers import ConfigError, Layer

VERSION = 1

ExperienceFile = Annotated[
    Path | None,
    typer.Option(
        "--experience",
        metavar="FILE.json",
        help="Begin with what an earlier push learned of this object: a file of [bold]experience save[/bold].",
        show_default=False,
    ),
]


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    format: Literal["pushlane-experience"]
    version: int
    known: dict[str, Any]


def encoded(known: msgspec.Struct) -> bytes:
    """Return the file's content for what [learner] known is to be."""
    content = _File("pushlane-experience", VERSION, msgspec.to_builtins(known))
    return msgspec.json.format(msgspec.json.encode(content), indent=1) + b"\n"


def with_experience(layers: list[Layer], file: Path | None) -> list[Layer]:
    """Return `layers` and the one of `file`, if given: over configuration files, under --set.

    Raises:
        ConfigError: the file cannot be read, or is of no version known here.
    """
    if file is None:
        return layers
    try:
        found = msgspec.json.decode(file.read_bytes(), type=_File)
    except OSError as error:
        raise ConfigError(f"--experience: cannot read {file}: {error.strerror or error}") from error
    except msgspec.MsgspecError as error:
        raise ConfigError(f"--experience: {file} is no file of `pushlane experience save`: {error}") from error
    if found.version != VERSION:
        raise ConfigError(f"--experience: {file} has version {found.version}, expected {VERSION}")
    place = next((index for index, layer in enumerate(layers) if layer.origin == "--set"), len(layers))
    return [*layers[:place], Layer(str(file), {"learner": {"known": found.known}}), *layers[place:]]
