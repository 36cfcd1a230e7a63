"""Options that several verbs share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from runtime.bus.config import BusConfig
from runtime.config.layers import ConfigError, Layer, effective, read_assignments, read_toml

_LEAST_PRECISE = 5.0
"""m"""
_LONGEST = 36000.0
"""s"""

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
    found = [_completed(read_toml(config), config.parent)] if config is not None else []
    return [*found, read_assignments(assignments)] if assignments else found


def batch_layers(
    config: Path | None, assignments: Sequence[str] | None, own: str, overridden: Sequence[str] = ("seed",)
) -> list[Layer]:
    """Return the layers of a verb that makes many pushes, and decides some keys of [sim] for each of them itself.

    Args:
        own: what decides them, in words.
        overridden: the keys. A file that serves `sim` as well may have them; it is said that they are not used.

    Raises:
        ConfigError: --set gives one of them, or see `layers`.
    """
    given = layers(config, assignments)
    for one in given:
        sim = one.values.get("sim")
        for key in (key for key in overridden if isinstance(sim, dict) and key in sim):
            if one.origin == "--set":
                raise ConfigError(f"--set sim.{key}: has no effect here: {own}")
            typer.echo(f"{one.origin}: sim.{key} is not used here: {own}", err=True)
    return given


def check_goal(
    position: tuple[float, float] | None,
    option: str,
    precision: float | None = None,
    yaw: float | None = None,
    time_limit: float | None = None,
) -> None:
    """Raise unless the options of a goal, None where not given, say one.

    In messages and in configuration 0 leaves precision and time to the task; who types 0 does not mean that.

    Args:
        position: m, that `option` gives.
        yaw: degrees.

    Raises:
        ConfigError: a number is not finite or out of its range.
    """
    if position is not None and not all(map(math.isfinite, position)):
        raise ConfigError(
            f"{option} {position[0]:g} {position[1]:g}: expected a place on the map, two finite numbers in m"
        )
    for name, value, what, most in (
        ("--precision", precision, "a distance in m", _LEAST_PRECISE),
        ("--time-limit", time_limit, "a time in s", _LONGEST),
    ):
        if value is not None and not 0.0 < value <= most:
            raise ConfigError(f"{name} {value:g}: expected {what}, above 0 and at most {most:g}")
    if yaw is not None and not abs(yaw) <= 360.0:
        raise ConfigError(f"--yaw {yaw:g}: expected degrees from -360 to 360")


def bus_of(config: Path | None, assignments: Sequence[str] | None) -> BusConfig:
    """Return the [bus] section that these options give.

    Raises:
        ConfigError: it is wrong.
    """
    given = [
        Layer(one.origin, {"bus": one.values["bus"]}) for one in layers(config, assignments) if "bus" in one.values
    ]
    found = effective({"bus": BusConfig}, given).sections["bus"]
    assert isinstance(found, BusConfig)
    return found


def _completed(layer: Layer, folder: Path) -> Layer:
    """Return the layer of a file with its [bus] made whole by what only the file knows.

    Paths of certificates are relative to the file, and who runs which services stands once, in [hosts].
    """
    bus = layer.values.get("bus")
    tls, access = (bus.get(name) for name in ("tls", "access")) if isinstance(bus, dict) else (None, None)
    if isinstance(tls, dict):
        tls.update({name: str(folder / path) for name, path in tls.items() if isinstance(path, str) and path})
    if isinstance(access, dict) and "hosts" in layer.values:
        access.setdefault("hosts", layer.values["hosts"])
    return layer
