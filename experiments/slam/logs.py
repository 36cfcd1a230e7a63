"""Laser logs: CARMEN's text format and arrays in a .npz file, made by others, and our own sessions (`sessions`)."""

from __future__ import annotations

import gzip
import math
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.errors import PushlaneError
from services.geometry.pose import between
from services.mapping.scan import Scan

Array = NDArray[np.float64]

_NOTHING = 79.0
"""m; scanners that see 80 m say about that, or 81.9, where they see nothing"""
_FAR = 1e4
"""m, farther than which no base goes"""
_SANE = f"finite and within {_FAR:g} m"
_BEAMS = {180: math.radians(1.0), 181: math.radians(1.0), 360: math.radians(0.5), 361: math.radians(0.5)}
"""rad between beams of an FLASER line, which does not say it: half a turn, from the right on"""


_EXPECTED = "a CARMEN log (.log, .log.gz), arrays (.npz) or a session (.mcap)"
_FORMATS = {
    "ODOM": "ODOM x y theta ...",
    "FLASER": "FLASER count ranges... x y theta, of the laser, x y theta, of the base",
    "ROBOTLASER1": "ROBOTLASER1 type start field resolution maximum accuracy mode count ranges... count remissions... "
    "x y theta, of the laser, x y theta, of the base",
}


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

    def scan(self, k: int, furthest: float) -> Scan:
        """Return scan `k`, of which beams are looked at out to `furthest`, m."""
        return Scan.of(self.ranges[k], self.angles[k], self.mount, furthest, self.nothing)

    def scans(self, furthest: float) -> list[Scan]:
        """Return all of them."""
        return [self.scan(k, furthest) for k in range(len(self.ranges))]

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
    if file.is_dir():
        raise BadLog(f"{file}: is a folder; expected {_EXPECTED}")
    if not file.is_file():
        raise BadLog(f"{file}: there is no such file")
    if not file.stat().st_size:
        raise BadLog(f"{file}: is empty; expected {_EXPECTED}")
    if file.suffix == ".mcap":
        from experiments.slam.sessions import of_session  # heavy

        log = of_session(file)
    else:
        log = _arrays(file) if file.suffix == ".npz" else _carmen(file)
    if len(log.ranges) < 2:
        raise BadLog(f"{file}: {len(log.ranges)} laser scans; expected two at least")
    return log


def _arrays(file: Path) -> Log:
    if not zipfile.is_zipfile(file):
        raise BadLog(f"{file}: no .npz file; expected one as numpy.savez writes it, with ranges, odom and aperture")
    try:
        with np.load(file) as found:
            data = {name: found[name] for name in found.files}
        missing = sorted({"ranges", "odom", "aperture"} - data.keys())
        if missing:
            raise BadLog(f"{file}: without {', '.join(missing)}; expected ranges (K, N), odom (K, 3), aperture")
        ranges, odometry = (np.asarray(data[name], np.float64) for name in ("ranges", "odom"))
        aperture, furthest = float(data["aperture"]), float(data.get("max_range", _NOTHING))
        mount = np.asarray(data.get("sensor_pose", np.zeros(3)), np.float64)
        way = 1.0 if int(data.get("right_to_left", 1)) else -1.0
    except (OSError, ValueError, TypeError, AttributeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise BadLog(f"{file}: no .npz file of numbers: {error}") from error
    if ranges.ndim != 2 or odometry.shape != (len(ranges), 3) or not _sane(odometry):
        raise BadLog(f"{file}: ranges {ranges.shape} and odom {odometry.shape}; expected (K, N) and (K, 3), {_SANE}")
    if mount.shape != (3,) or not _sane(mount) or not 0.0 < aperture <= math.tau or not furthest > 0.0:
        raise BadLog(
            f"{file}: sensor_pose {mount}, aperture {aperture}, max_range {furthest}; expected (3,), a turn, above 0"
        )
    if "valid" in data:
        if data["valid"].shape != ranges.shape:
            raise BadLog(f"{file}: valid is {data['valid'].shape}; expected {ranges.shape}")
        ranges = np.where(data["valid"], ranges, np.inf)
    angles = way * np.linspace(-0.5 * aperture, 0.5 * aperture, ranges.shape[1])
    steps = [np.zeros(3)] + [between(a, b) for a, b in pairwise(odometry)]
    start = odometry[0] if len(odometry) else np.zeros(3)
    return Log(list(ranges), [angles] * len(ranges), mount, np.array(steps), start, None, 0.999 * furthest)


@dataclass(frozen=True)
class _Scan:
    """A laser line: what was seen, where the laser and the base were said to be, and the newest odometry before it."""

    ranges: Array
    angles: Array
    laser: Array
    base: Array
    odometry: Array | None


def _carmen(file: Path) -> Log:
    scans: list[_Scan] = []
    odometry: Array | None = None
    corrected = False
    for number, words in _lines(file):
        try:
            if words[0] == "ODOM":
                odometry = _pose(words[1:4])
            elif words[0] == "NEFF":  # by GMapping, in logs that it has corrected
                corrected = True
            elif words[0] in _LASERS:
                scans.append(_LASERS[words[0]](words, odometry))
                odometry = None
        except (ValueError, IndexError, OverflowError) as error:
            why = "it ends too early" if isinstance(error, IndexError) else error
            raise BadLog(
                f"{file}, line {number}: {words[0]} cannot be read: {why}; the format is {_FORMATS[words[0]]}"
            ) from error
    if not scans:
        raise BadLog(f"{file}: 0 laser scans: no line begins with {' or '.join(_LASERS)}{_first_of(file)}")
    poses = np.array([one.base for one in scans]).reshape(-1, 3)
    steps = [np.zeros(3)]
    for before, after in pairwise(scans):
        # Where corrected poses are written, odometry goes on from the corrected one: between scans it is still raw.
        raw = after.odometry if corrected and after.odometry is not None else after.base
        steps.append(between(before.base, raw))
    mount = np.zeros(3)
    if scans and not corrected:
        mount = np.median([between(one.base, one.laser) for one in scans], axis=0)
    start = poses[0] if scans else np.zeros(3)
    seen, angles = [one.ranges for one in scans], [one.angles for one in scans]
    return Log(seen, angles, mount, np.array(steps), start, poses if corrected else None, _NOTHING)


def _flaser(words: list[str], odometry: Array | None) -> _Scan:
    """FLASER: count, ranges, the laser's pose, the base's."""
    count = int(words[1])
    ranges, rest = _numbers(words[2 : 2 + count], count), words[2 + count :]
    return _Scan(ranges, _front(count), _pose(rest[:3]), _pose(rest[3:6]), odometry)


def _robotlaser(words: list[str], odometry: Array | None) -> _Scan:
    """ROBOTLASER1: type, start, field, resolution, maximum, accuracy, mode, ranges, remissions, both poses."""
    count = int(words[8])
    start, _, each, furthest = _numbers(words[2:6], 4)
    ranges = _numbers(words[9 : 9 + count], count)
    if furthest > 0.0:
        ranges = np.where(ranges >= 0.999 * furthest, np.inf, ranges)
    rest = words[10 + count + int(words[9 + count]) :]
    return _Scan(ranges, start + each * np.arange(count), _pose(rest[:3]), _pose(rest[3:6]), odometry)


_LASERS = {"FLASER": _flaser, "ROBOTLASER1": _robotlaser}


def _lines(file: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the lines that hold words, with their numbers, comments left out."""
    number = 0
    try:
        with gzip.open(file, "rt") if file.suffix == ".gz" else file.open() as lines:
            for number, line in enumerate(lines, 1):
                words = line.split()
                if words and not words[0].startswith("#"):
                    yield number, words
    except (OSError, EOFError, UnicodeDecodeError, zlib.error) as error:
        why = "no text" if isinstance(error, UnicodeDecodeError) else error
        raise BadLog(f"{file}, after line {number}: not a CARMEN log: {why}; expected {_EXPECTED}") from error


def _first_of(file: Path) -> str:
    """Return what the first line begins with, in words: what is no CARMEN log shows it there."""
    number, words = next(_lines(file), (0, [""]))
    return f"; line {number} begins with {words[0][:40]!r}" if number else ""


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


def _pose(words: list[str]) -> Array:
    found = _numbers(words, 3)
    if not _sane(found):
        raise ValueError(f"a pose of {found}; expected {_SANE}")
    return found


def _sane(poses: Array) -> bool:
    return bool(np.isfinite(poses).all() and np.abs(poses).max(initial=0.0) <= _FAR)
