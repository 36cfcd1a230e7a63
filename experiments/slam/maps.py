"""Maps in the format of ROS's map_server: a picture, and a YAML file that says what it means."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from runtime.errors import PushlaneError
from services.mapping.grid import RESOLUTION

Array = NDArray[np.float64]
Cells = NDArray[np.uint8]

_FREE, _OCCUPIED, _UNKNOWN = 254, 0, 205
"""grey values that map_server writes"""
_THRESHOLDS = {"occupied_thresh": 0.65, "free_thresh": 0.196}


class BadMap(PushlaneError):
    """A map cannot be read."""

    exit_code = 2


def read(file: Path) -> tuple[Cells, Array]:
    """Return the map that the YAML file `file` describes: (H, W), row y first, and its corner, (2,), m.

    0 is free, 100 occupied, 255 unknown. Values between the thresholds are unknown (mode trinary).

    Raises:
        BadMap: it cannot be read, or is not of 0.05 m cells that lie along the axes.
    """
    try:
        said = YAML(typ="safe", pure=True).load(file.read_text())
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        why: object = "no text" if isinstance(error, UnicodeDecodeError) else " ".join(str(error).split())
        if isinstance(error, OSError):
            why = error.strerror
        raise BadMap(f"{file}: {why}; expected the YAML file of a map as map_server saves it") from error
    if not isinstance(said, dict) or not {"image", "resolution", "origin"} <= said.keys():
        raise BadMap(f"{file}: expected image, resolution and origin")
    try:
        resolution, negate = float(said["resolution"]), bool(int(said.get("negate", 0)))
        x, y, yaw = (float(one) for one in said["origin"])
        occupied, free = (float(said.get(name, usual)) for name, usual in _THRESHOLDS.items())
    except (TypeError, ValueError) as error:
        raise BadMap(f"{file}: resolution, origin, negate or a threshold is no number: {error}") from error
    if not all(map(math.isfinite, (x, y, yaw, occupied, free))) or not free < occupied:
        raise BadMap(
            f"{file}: origin {x, y, yaw}, thresholds {free} and {occupied}; expected finite ones in this order"
        )
    if not abs(resolution - RESOLUTION) <= 1e-6 or yaw != 0.0:
        raise BadMap(f"{file}: resolution {resolution} m and yaw {yaw} rad; expected {RESOLUTION} m and 0")
    if said.get("mode", "trinary") != "trinary":
        raise BadMap(f"{file}: mode {said['mode']}; expected trinary")
    picture = file.parent / str(said["image"])
    if not picture.is_file():
        raise BadMap(f"{picture}: there is no such file; {file} names it as its image")
    level = cv2.utils.logging.getLogLevel()
    try:
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what it says is not for users
        grey = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    finally:
        cv2.utils.logging.setLogLevel(level)
    if grey is None:
        raise BadMap(f"{picture}: no picture that can be read, or one that is cut off; {file} names it as its image")
    share = grey / 255.0 if negate else 1.0 - grey / 255.0
    cells = np.where(share > occupied, 100, np.where(share < free, 0, 255)).astype(np.uint8)
    return np.ascontiguousarray(cells[::-1]), np.array([x, y])


def write(folder: Path, cells: Cells, corner: Array, name: str = "map") -> Path:
    """Write a map, as `read` returns it, to `folder`; return the YAML file."""
    grey = np.select([cells == 0, cells == 100], [_FREE, _OCCUPIED], _UNKNOWN).astype(np.uint8)
    (folder / f"{name}.pgm").write_bytes(cv2.imencode(".pgm", np.ascontiguousarray(grey[::-1]))[1].tobytes())
    file = folder / f"{name}.yaml"
    lines = [
        f"image: {name}.pgm",
        f"resolution: {RESOLUTION}",
        f"origin: [{corner[0]:.6f}, {corner[1]:.6f}, 0.0]",
        "negate: 0",
        *(f"{key}: {value}" for key, value in _THRESHOLDS.items()),
    ]
    file.write_text("\n".join(lines) + "\n")
    return file
