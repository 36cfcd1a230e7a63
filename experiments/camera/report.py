"""What a calibration says, as lines for people and as TOML for the camera's section."""

from __future__ import annotations

import msgspec

from drivers.camera.advice import advice
from drivers.camera.calibration import Calibration
from drivers.camera.config import CalibrationConfig
from drivers.camera.gather import Gathering
from drivers.camera.service import CameraService
from runtime.errors import PushlaneError

_NAMED = 3


class BadResult(PushlaneError):
    """The calibration came out as no camera can be."""

    exit_code = 1


def lines(gathering: Gathering, found: Calibration) -> list[str]:
    """Return the result with what was used, what was not and why, and what is doubtful."""
    used = f"{len(found.views)} of {gathering.looked} pictures used, {found.width} x {found.height} pixels"
    text = [used, *left_out([*gathering.left_out, *found.left_out])]
    text.append(f"error {found.error:.3f} pixels, root mean square; the worst view has {found.errors.max():.3f}")
    (fx, fy), (cx, cy) = found.matrix[[0, 1], [0, 1]], found.matrix[[0, 1], [2, 2]]
    for name, value, deviation in zip(("fx", "fy", "cx", "cy"), (fx, fy, cx, cy), found.deviations[:4], strict=True):
        text.append(f"  {name} {value:10.3f} +- {deviation:.3f} pixels")
    numbers = zip(("k1", "k2", "p1", "p2", "k3"), found.distortion, found.deviations[4:], strict=True)
    for name, value, deviation in numbers:
        known = f"+- {deviation:.6f}" if deviation else "not estimated"
        text.append(f"  {name} {value:10.6f} {known}")
    return [*text, *(f"doubtful: {line}" for line in advice(found))]


def left_out(pictures: list[tuple[str, str]]) -> list[str]:
    """Return how many pictures were left out for which reason, with the names of a few."""
    by_reason: dict[str, list[str]] = {}
    for name, reason in pictures:
        by_reason.setdefault(reason, []).append(name)
    text = []
    for reason, names in by_reason.items():
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        text.append(f"not used, {reason}: {', '.join(names[:_NAMED])}{more}")
    return text


def toml(found: Calibration, section: str = CameraService.name) -> str:
    """Return the calibration as the section of the camera service reads it.

    Raises:
        BadResult: a number is out of the range that the section takes.
    """
    values = {
        "width": found.width,
        "height": found.height,
        "focal": [round(float(found.matrix[i, i]), 4) for i in (0, 1)],
        "centre": [round(float(found.matrix[i, 2]), 4) for i in (0, 1)],
        "distortion": [round(float(number), 8) for number in found.distortion],
    }
    try:
        msgspec.convert(values, CalibrationConfig)
    except msgspec.ValidationError as error:
        raise BadResult(f"this is no camera: {error}; take more views, tilted every way") from error
    said = f"# pushlane calibrate: {len(found.views)} views, error {found.error:.3f} pixels\n"
    return f"{said}[{section}.calibration]\n" + "".join(f"{key} = {value}\n" for key, value in values.items())
