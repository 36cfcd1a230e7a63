"""Laser logs: CARMEN's text format and arrays in a .npz file, made by others, and our own sessions (`sessions`)."""

from __future__ import annotations

import gzip
import math
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.errors import PushlaneError
from services.mapping.filter import between

Array = NDArray[np.float64]

_NOTHING = 79.0
"""m; scanners that see 80 m say about that, or 81.9, where they see nothing"""
_CORRECTED = 1e-3
"""m or rad by which poses differ from the odometry before them if they were corrected"""
_BEAMS = {180: math.radians(1.0), 181: math.radians(1.0), 360: math.radians(0.5), 361: math.radians(0.5)}
"""rad between beams of an FLASER line, which does not say it: half a turn, from the right on"""


class BadLog(PushlaneError):
    """A log cannot be read."""

    exit_code = 2


@dataclass(frozen=True)
class Log:
    """A log of K scans.

    Attributes:
        ranges: (N,) each, m.
        angles: (N,) each, rad, sensor frame, counter-clockwise, 0 ahead.
        mount: (3,), m and rad, the sensor on the base.
        steps: (K, 3), m and rad, odometry from the scan before, in the frame of the pose before; the first is 0.
        start: (3,), first pose.
        reference: (K, 3), poses as another program corrected them; None if the log has none.
        nothing: m, ranges from which on a beam has met nothing.
        true: whether the reference is the simulation's truth.
    """

    ranges: list[Array]
    angles: list[Array]
    mount: Array
    steps: Array
    start: Array
    reference: Array | None
    nothing: float
    true: bool = False

    def cut(self, count: int) -> Log:
        """Return the first `count` scans."""
        reference = None if self.reference is None else self.reference[:count]
        ranges, angles, steps = self.ranges[:count], self.angles[:count], self.steps[:count]
        return Log(ranges, angles, self.mount, steps, self.start, reference, self.nothing, self.true)


def read(file: Path) -> Log:
    """Return the log in `file`: a session (.mcap), .npz, or CARMEN's text, plain or gzipped.

    Raises:
        BadLog: it cannot be read.
    """
    if not file.is_file():
        raise BadLog(f"{file}: there is no such file")
    if file.suffix == ".mcap":
        from experiments.slam.sessions import of_session  # heavy

        log = of_session(file)
    else:
        log = _arrays(file) if file.suffix == ".npz" else _carmen(file)
    if len(log.ranges) < 2:
        raise BadLog(f"{file}: {len(log.ranges)} laser scans; expected two at least")
    return log


def _arrays(file: Path) -> Log:
    try:
        with np.load(file) as found:
            data = {name: found[name] for name in found.files}
    except (OSError, ValueError, zipfile.BadZipFile, EOFError) as error:
        raise BadLog(f"{file}: no .npz file: {error}") from error
    missing = sorted({"ranges", "odom", "aperture"} - data.keys())
    if missing:
        raise BadLog(f"{file}: without {', '.join(missing)}; expected ranges (K, N), odom (K, 3), aperture")
    ranges, odometry = (np.asarray(data[name], np.float64) for name in ("ranges", "odom"))
    if ranges.ndim != 2 or odometry.shape != (len(ranges), 3) or not np.isfinite(odometry).all():
        raise BadLog(
            f"{file}: ranges {ranges.shape} and odom {odometry.shape}; expected (K, N) and (K, 3), the latter finite"
        )
    if "valid" in data:
        if data["valid"].shape != ranges.shape:
            raise BadLog(f"{file}: valid is {data['valid'].shape}; expected {ranges.shape}")
        ranges = np.where(data["valid"], ranges, np.inf)
    half = 0.5 * float(data["aperture"])
    angles = np.linspace(-half, half, ranges.shape[1]) * (1.0 if data.get("right_to_left", 1) else -1.0)
    mount = np.asarray(data.get("sensor_pose", np.zeros(3)), np.float64)
    if mount.shape != (3,):
        raise BadLog(f"{file}: sensor_pose is {mount.shape}; expected (3,)")
    steps = [np.zeros(3)] + [between(a, b) for a, b in pairwise(odometry)]
    nothing = float(data.get("max_range", _NOTHING)) * 0.999
    return Log(list(ranges), [angles] * len(ranges), mount, np.array(steps), odometry[0], None, nothing)


def _carmen(file: Path) -> Log:
    ranges: list[Array] = []
    angles: list[Array] = []
    poses: list[Array] = []
    steps: list[Array] = []
    odometry: Array | None = None
    apart = []
    for number, words in _lines(file):
        try:
            if words[0] == "ODOM":
                odometry = _numbers(words[1:4], 3)
                continue
            if words[0] == "FLASER":
                count = int(words[1])
                seen, bearings = _numbers(words[2 : 2 + count], count), _front(count)
                pose, own = _numbers(words[2 + count : 5 + count], 3), _numbers(words[5 + count : 8 + count], 3)
            elif words[0] == "ROBOTLASER1":
                count = int(words[8])
                start, _, between_beams = _numbers(words[2:5], 3)
                seen, bearings = _numbers(words[9 : 9 + count], count), start + between_beams * np.arange(count)
                after = 10 + count + int(words[9 + count])
                pose, own = _numbers(words[after : after + 3], 3), _numbers(words[after + 3 : after + 6], 3)
            else:
                continue
        except (ValueError, IndexError) as error:
            raise BadLog(f"{file}, line {number}: {words[0]} cannot be read: {error}") from error
        # Where corrected poses are written, odometry goes on from the corrected one: between scans it is still raw.
        newest = odometry if odometry is not None else own
        steps.append(between(poses[-1], newest) if poses else np.zeros(3))
        apart.append(float(np.abs(between(newest, pose)).max()))
        ranges.append(seen)
        angles.append(bearings)
        poses.append(pose)
        odometry = None
    corrected = len(apart) > 1 and float(np.median(apart[1:])) > _CORRECTED
    reference = np.array(poses) if corrected else None
    start = poses[0] if poses else np.zeros(3)
    return Log(ranges, angles, np.zeros(3), np.array(steps), start, reference, _NOTHING)


def _lines(file: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the lines that hold words, with their numbers, comments left out."""
    try:
        with gzip.open(file, "rt") if file.suffix == ".gz" else file.open() as lines:
            for number, line in enumerate(lines, 1):
                words = line.split()
                if words and not words[0].startswith("#"):
                    yield number, words
    except (OSError, EOFError, UnicodeDecodeError) as error:
        raise BadLog(f"{file}: not a CARMEN log: {error}") from error


def _front(count: int) -> Array:
    if count not in _BEAMS:
        raise ValueError(f"{count} beams; expected one of {', '.join(map(str, _BEAMS))}")
    return np.asarray(-0.5 * math.pi + _BEAMS[count] * np.arange(count), np.float64)


def _numbers(words: list[str], count: int) -> Array:
    if len(words) != count:
        raise ValueError(f"{len(words)} numbers; expected {count}")
    found = np.array([float(word) for word in words])
    if not np.isfinite(found).all():
        raise ValueError("a number is not finite")
    return found
