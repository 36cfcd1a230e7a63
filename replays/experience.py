"""`pushlane experience save`: what a recorded push learned of its object, for the next push of the same object."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.errors import PushlaneError
from runtime.outputs import CannotWrite, check_file, writing

if TYPE_CHECKING:
    from replays.recording import Recording
    from services.predictive.known import Known

experience = typer.Typer(no_args_is_help=True, help="Keep what pushes learn of an object.")


class NoExperience(PushlaneError):
    """The recording holds nothing about an object that could be kept."""


def register(root: typer.Typer) -> None:
    """Add the verbs of this module to `root`."""
    root.add_typer(experience, name="experience")


@experience.callback()
def _group() -> None:
    pass


@experience.command()
def save(
    file: Annotated[Path, typer.Argument(metavar="FILE.mcap", help="A recorded session.", show_default=False)],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.json", help="The new file.")],
    name: Annotated[str, typer.Option(help="What to call the object.", show_default="as the session does")] = "",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it is there.")] = False,
) -> None:
    """Keep what the predictive method knew of the object at the end of a recording: contour and response.

    [bold]pushlane sim --experience FILE.json[/bold] and [bold]pushlane run --experience FILE.json[/bold] begin with it.
    """
    from replays.recording import load
    from runtime.cli.experience import encoded

    with writing(output):
        if output.is_file() and not overwrite:
            raise CannotWrite(f"{output} is there already: choose another name, or --overwrite")
    check_file(output, replace=True)
    known = learned(load(file), name)
    with writing(output):
        output.write_bytes(encoded(known))
    typer.echo(
        f"{known.object or 'object'} of {known.diameter:.3f} m: {known.touches} touches, {known.windows} windows; "
        f"written to {output}"
    )


def learned(recording: Recording, name: str = "") -> Known:
    """Return what the last push/response of `recording` knew.

    Args:
        name: of the object; by default what the recorded configuration says.

    Raises:
        NoExperience: nothing was learned, or it could not be used again; the message says why.
    """
    import msgspec
    import numpy as np

    from runtime.messages import ObjectState, PushResponse, RobotStatus
    from services.predictive.known import SPREAD, Known, plausible, square, triangle

    last: dict[str, bytes] = {}
    for (topic, _), sample in recording.samples.items():
        last[topic] = sample.payload
    path = recording.path
    if recording.corrupt:
        raise NoExperience(f"{path} was changed or damaged: {recording.damage}")
    missing = [topic for topic in ("push/response", "object/state", "status") if topic not in last]
    if missing:
        hint = "; only pushes with strategy or controller predictive learn" if missing[0] == "push/response" else ""
        raise NoExperience(f"{path} has no message of '{missing[0]}'{hint}")
    response = PushResponse.FromString(last["push/response"])
    seen, base = ObjectState.FromString(last["object/state"]), RobotStatus.FromString(last["status"])
    if not response.touches and not response.windows:
        raise NoExperience(f"{path}: the robot never touched the object, so nothing was learned of it")
    if len(response.spread) != SPREAD:
        raise NoExperience(f"{path} was recorded before push/response said how sure it is: push the object again")
    if not seen.HasField("yaw"):
        raise NoExperience(f"{path}: the tracker saw no yaw, so nobody could know again which way round the object is")
    contour, spread = plausible(np.array(response.contour), square(response.spread), base.diameter, seen.diameter)
    sections = recording.config["sections"].values()
    body: dict[str, object] = next((one["body"] for one in sections if "body" in one), {})
    try:
        return Known(
            object=name or str(body.get("name", "")),
            diameter=seen.diameter,
            robot_diameter=base.diameter,
            contour=tuple(contour.tolist()),
            spread=tuple(triangle(spread)),
            response=tuple(response.response),
            touches=response.touches,
            windows=response.windows,
        )
    except (ValueError, msgspec.ValidationError) as error:
        raise NoExperience(f"{path}: what was learned is of no use: {error}") from error
