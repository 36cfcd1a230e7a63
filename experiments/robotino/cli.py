"""`pushlane robotino check` and `emulate`."""

from __future__ import annotations

import re
import signal
import threading
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.cli.options import Assignments, ConfigFile, layers
from runtime.config.layers import ConfigError
from runtime.outputs import check_file

if TYPE_CHECKING:
    from drivers.robotino.health import Row


class Link(StrEnum):
    """What a base is reached by."""

    REST = "rest"
    SERIAL = "serial"


_ADDRESS = re.compile(r"[\w-]+(\.[\w-]+)+(:\d+)?")

robotino = typer.Typer(no_args_is_help=True, help="Look at a Robotino, or emulate one.")


def register(app: typer.Typer) -> None:
    """Add the verbs to `pushlane`."""
    app.add_typer(robotino, name="robotino")


@robotino.command()
def check(
    where: Annotated[
        str, typer.Argument(metavar="URL|DEVICE", help="http://ADDRESS, a serial device, or 'auto' to look for one.")
    ],
    timeout: Annotated[float, typer.Option(metavar="S", min=0.05, max=30, help="To wait for each answer.")] = 1.0,
    wiggle: Annotated[
        bool, typer.Option("--wiggle", help="After asking, move 5 cm forward and back, and compare odometry.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before --wiggle.")] = False,
) -> None:
    """Read everything that a base says once, and print it. Nothing moves without --wiggle.

    Exits with 1 if something that a push needs is missing or wrong.
    """
    from experiments.robotino import health

    if _ADDRESS.fullmatch(where) and not Path(where).exists():
        raise ConfigError(
            f"{where}: expected http://{where} for a base over REST, or a serial device as in /dev/ttyACM0"
        )
    over_rest = where.startswith("http")
    rows = _rows(where, over_rest, timeout)
    health.show(where, rows)
    lacking = health.lacks(rows, over_rest)
    if lacking:
        typer.echo(f"missing or wrong, before a push can begin: {', '.join(lacking)}")
    fit = not lacking
    if wiggle:
        if set(lacking) - {"laser"}:
            typer.echo("not moved: first what lacks")
            raise typer.Exit(1)
        if not yes and not typer.confirm(
            "Is there half a metre of free floor before and behind the base, and a hand on its switch?", default=False
        ):
            typer.echo("not moved")
            raise typer.Exit(1)
        fit = health.wiggle(where, over_rest, typer.echo) and fit
    raise typer.Exit(0 if fit else 1)


def _rows(where: str, over_rest: bool, timeout: float) -> list[Row]:
    if over_rest:
        from drivers.robotino.rest import check as rest

        return rest.read_all(where, timeout)
    from drivers.robotino.serial import check as serial

    return serial.read_all(where, timeout)


@robotino.command()
def emulate(
    link: Annotated[Link, typer.Argument(help="What the base is reached by.")],
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Of the REST server; over serial, of laser and camera. 0: a free one.")
    ] = 8080,
    address: Annotated[str, typer.Option(help="Of the REST server.")] = "127.0.0.1",
    device: Annotated[
        Path, typer.Option(metavar="LINK", help="Name of the serial device: a link to a pseudo-terminal.")
    ] = Path("robotino"),
    idle: Annotated[
        float,
        typer.Option(
            metavar="S", min=0.1, max=0.5, help="REST: it stops without a command for so long: 0.2 to 0.5 by image."
        ),
    ] = 0.5,
    system: Annotated[
        Path | None,
        typer.Option(metavar="FILE.toml", help="Write the system file of services that drive it.", show_default=False),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the file of --system if it is there.")
    ] = False,
    camera: Annotated[bool, typer.Option("--camera/--no-camera", help="Whether /cam0 has pictures.")] = True,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Run a simulated Robotino behind its own interface, until Ctrl-C: for who has no robot, and for tests.

    Scene, object and seed are those of \\[sim], as in [bold]--set sim.scene=1A --set sim.object=box[/bold].
    """
    from experiments.robotino import emulation
    from experiments.session import prepare

    session = prepare(layers(config, assignments))
    if session.effective.sections["system"].base != "simulated":  # type: ignore[attr-defined]
        raise ConfigError("system.base: expected simulated: an emulated base is one")
    if system is not None:
        check_file(system, replace=overwrite)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    place = emulation.Place(address, port, device, idle, camera, system)
    for line in emulation.run(session, link.value, place, stop.wait):
        typer.echo(line)
