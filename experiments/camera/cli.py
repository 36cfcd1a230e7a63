"""`pushlane camera feed`, and `pushlane calibrate camera`, `board` and `tags`."""

from __future__ import annotations

import signal
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.cli.options import Assignments, ConfigFile, bus_of
from runtime.config.layers import ConfigError
from runtime.outputs import check_file, writing

if TYPE_CHECKING:
    from drivers.camera.board import Board

_PATIENCE = 10.0

cameras = typer.Typer(no_args_is_help=True, help="Give a running system the pictures of a camera.")
calibration = typer.Typer(
    no_args_is_help=True,
    help="Find out what a camera's lens does, with a board of squares; draw tags for an object.",
)

Source = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE", help="Number of a device, http://ROBOT/cam0, a film, a picture, or a folder of pictures."
    ),
]
BoardKind = Annotated[str, typer.Option("--board", metavar="charuco|chessboard", help="Kind of board.")]
Columns = Annotated[int, typer.Option("--columns", help="Squares across; of a chessboard, one more than corners.")]
Rows = Annotated[int, typer.Option("--rows", help="Squares down.")]
Square = Annotated[float, typer.Option("--square", metavar="M", help="Side of a square, measured on the paper.")]
Marker = Annotated[
    float, typer.Option("--marker", metavar="M", help="Side of a marker, charuco only.", show_default="0.75 squares")
]
Markers = Annotated[str, typer.Option("--dictionary", help="OpenCV's name of the markers, without DICT_.")]


def register(app: typer.Typer) -> None:
    """Add the verbs to `pushlane`."""
    app.add_typer(cameras, name="camera")
    app.add_typer(calibration, name="calibrate")


@cameras.command()
def feed(
    source: Source,
    rate: Annotated[float, typer.Option(metavar="HZ", min=0.01, max=120, help="Pictures a second, at most.")] = 10.0,
    quality: Annotated[int, typer.Option(min=10, max=100, help="Of JPEG, where the source gives none.")] = 90,
    loop: Annotated[bool, typer.Option("--loop", help="Begin files again after their end.")] = False,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Read a camera and give its pictures to the camera service, until Ctrl-C or the end of the file.

    A camera that is gone is waited for. Exits with 1 if the service took no picture.
    """
    from drivers.camera import feed as work  # heavy
    from drivers.camera.source import opened
    from experiments.camera.bus import expected_size, give
    from runtime.bus.keys import Keys
    from runtime.bus.session import client

    bus = bus_of(config, assignments)
    opened(source, time.monotonic).close()  # a mistake in the name shows before anything is waited for
    stop = _stopped_by_signals()
    with client(bus) as session:
        keys = Keys(bus.robot)
        size = expected_size(session, keys, _PATIENCE)
        typer.echo(f"feeding {size[0]} x {size[1]} pixels from {source}; Ctrl-C ends it")
        tally = work.feed(
            opened(source, time.monotonic, size, loop),
            lambda picture: give(session, keys, picture),
            rate,
            time.monotonic,
            stop.wait,
            typer.echo,
            quality,
        )
    typer.echo(f"{tally.taken} pictures taken, {tally.refused} refused, {tally.failed} tries without a picture")
    raise typer.Exit(0 if tally.taken else 1)


@calibration.command()
def camera(
    source: Source,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.toml", help="Write the camera's section here.")
    ] = None,
    kind: BoardKind = "charuco",
    columns: Columns = 9,
    rows: Rows = 6,
    square: Square = 0.03,
    marker: Marker = 0.0,
    dictionary: Markers = "5X5_100",
    most: Annotated[int, typer.Option("--views", min=5, max=200, help="Enough: stop looking.")] = 40,
    wide: Annotated[bool, typer.Option("--wide", help="A wide lens: estimate k3 as well.")] = False,
) -> None:
    """Calibrate a camera from pictures of a board: near, tilted every way, and in every corner of the picture.

    Of a device or a film, move the board slowly; each pose counts once. Ctrl-C ends the looking, not the calibration.
    Exits with 1 if too few pictures show the board.
    """
    from drivers.camera.calibration import TooFewViews, calibrate  # heavy
    from drivers.camera.gather import gather
    from drivers.camera.source import opened
    from experiments.camera import report

    board = _board(kind, columns, rows, square, marker, dictionary)
    if output is not None:
        check_file(output)
    found = gather(opened(source, time.monotonic), board, most, _stopped_by_signals().wait, typer.echo)
    if found.size is None:
        raise TooFewViews(f"{source} gave no picture that can be read")
    try:
        result = calibrate(found.views, found.size, wide)
    except TooFewViews:
        for line in report.left_out(found.left_out):
            typer.echo(line)
        raise
    for line in report.lines(found, result):
        typer.echo(line)
    text = report.toml(result)
    if output is None:
        typer.echo(text, nl=False)
    else:
        with writing(output):
            output.write_text(text)
        typer.echo(f"{output}: add it to the system file")


@calibration.command(name="board")
def draw(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.png", help="The new picture.")],
    kind: BoardKind = "charuco",
    columns: Columns = 9,
    rows: Rows = 6,
    square: Square = 0.03,
    marker: Marker = 0.0,
    dictionary: Markers = "5X5_100",
    resolution: Annotated[float, typer.Option("--dpi", min=30, max=2400, help="Dots an inch.")] = 300.0,
) -> None:
    """Draw a board to print at 100 %. Glue it to something flat and stiff, and measure a square."""
    from drivers.camera import sheet  # heavy

    board = _board(kind, columns, rows, square, marker, dictionary)
    if output.suffix.lower() != ".png":
        raise ConfigError(f"--output {output}: expected a name that ends in .png")
    check_file(output)
    drawn, side = sheet.page(board, resolution)
    with writing(output):
        output.write_bytes(sheet.png(drawn, side / board.square))
    height, width = (1000 * pixels * board.square / side for pixels in drawn.shape)
    typer.echo(f"{output}: {sheet.described(board)}; the sheet has {width:.0f} x {height:.0f} mm")
    typer.echo(f"print at 100 %: a square has {side} pixels, the bar below the board 100 mm")


@calibration.command()
def tags(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where the five pictures go.")],
    cube: Annotated[float, typer.Option(metavar="M", min=0.02, max=1, help="Side of the cube, tracker.cube.")] = 0.14,
    first: Annotated[int, typer.Option("--first", min=0, help="Id of the tag on top, tracker.first_tag.")] = 0,
    dictionary: Annotated[str, typer.Option("--dictionary", help="tracker.dictionary, OpenCV's name.")] = "DICT_4X4_50",
    resolution: Annotated[float, typer.Option("--dpi", min=30, max=2400, help="Dots an inch.")] = 300.0,
) -> None:
    """Draw the tags of the cube that stands on a pushed object, to print at 100 %, cut out and glue on.

    The tops of the four on the sides are up; that of the one on top is where the front is.
    """
    from drivers.camera import sheet  # heavy
    from drivers.camera.tags import FACES, face
    from runtime.outputs import check_folder

    drawn = [face(first + k, dictionary, cube, resolution) for k in range(len(FACES))]
    check_folder(output)
    for k, (name, (picture, density)) in enumerate(zip(FACES, drawn, strict=True)):
        file = output / f"{k}-{name}.png"
        file.write_bytes(sheet.png(picture, density))
        typer.echo(f"{file}: tag {first + k} of {dictionary}, {1000 * cube:g} mm, its marker {750 * cube:g} mm")


def _board(kind: str, columns: int, rows: int, square: float, marker: float, dictionary: str) -> Board:
    """Return the board of these options.

    Raises:
        BadBoard: see there. ConfigError: there is no such kind.
    """
    from drivers.camera.board import Board, Kind

    if kind not in list(Kind):
        raise ConfigError(f"--board {kind}: expected one of {', '.join(Kind)}")
    return Board(Kind(kind), columns, rows, square, marker or 0.75 * square, dictionary)


def _stopped_by_signals() -> threading.Event:
    """Return what SIGINT and SIGTERM set."""
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    return stop
