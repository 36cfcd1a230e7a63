"""Logs are read as their formats say, what is wrong is named, and errors of trajectories are what they are."""

from __future__ import annotations

import gzip
import math
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.slam.logs import BadLog, read
from experiments.slam.metric import agreement, apart, revisits, successive
from services.geometry.pose import between, compose
from services.mapping.scan import Scan
from tests.services.mapping.rooms import ANGLES, MOUNT, ranges_at


def flaser(pose: np.ndarray, odometry: np.ndarray | None = None, beams: int = 181, far: float = 2.0) -> str:
    own = pose if odometry is None else odometry
    numbers = [*[far] * beams, *pose, *own]
    return f"FLASER {beams} {' '.join(f'{one:.6f}' for one in numbers)} 1.0 host 1.0"


def odom(pose: np.ndarray) -> str:
    return f"ODOM {' '.join(f'{one:.6f}' for one in pose)} 0 0 0 1.0 host 1.0"


def test_raw_odometry_is_rebuilt_from_a_corrected_log(tmp_path: Path) -> None:
    """Between scans the odometry goes on from the corrected pose: what it says there is still raw."""
    corrected = [np.array([0.0, 0.0, 0.2]), np.array([0.5, 0.1, 0.4]), np.array([1.0, 0.3, 0.4])]
    raw = [np.array([0.52, 0.0, 0.1]), np.array([0.55, 0.02, 0.05])]
    lines = ["# a comment", "PARAM robot_width 1 host 0", odom(corrected[0] + 0.01), flaser(corrected[0])]
    for k in (0, 1):
        lines += [odom(corrected[k]), odom(compose(corrected[k], raw[k])), flaser(corrected[k + 1]), "NEFF 30"]
    file = tmp_path / "a.log.gz"
    file.write_bytes(gzip.compress("\n".join(lines).encode()))
    log = read(file)
    assert log.reference is not None
    assert log.reference == pytest.approx(np.array(corrected), abs=1e-5)
    assert log.steps == pytest.approx(np.array([np.zeros(3), *raw]), abs=1e-5)
    assert len(log.ranges) == 3 and log.ranges[0].shape == (181,)
    assert log.angles[0][[0, 90, 180]] == pytest.approx([-math.pi / 2, 0.0, math.pi / 2])
    assert len(log.cut(2).ranges) == len(log.cut(2).steps) == 2


def test_a_raw_log_has_nothing_to_compare_with(tmp_path: Path) -> None:
    poses = [np.array([0.4 * k, 0.0, 0.1 * k]) for k in range(4)]
    file = tmp_path / "a.log"
    file.write_text("\n".join(line for pose in poses for line in (odom(pose), flaser(pose, beams=360))))
    log = read(file)
    assert log.reference is None
    assert log.steps[1:] == pytest.approx(
        np.array([between(a, b) for a, b in zip(poses, poses[1:], strict=False)]), abs=1e-5
    )


def test_a_laser_that_says_how_it_looks(tmp_path: Path) -> None:
    """ROBOTLASER1: type, start, field of view, resolution, maximum...; then the laser's pose and the robot's."""
    lines = []
    for x in (0.0, 0.1):
        lines += [odom(np.array([x - 0.04, 0.0, 0.0]))] if x else []
        lines += [f"ROBOTLASER1 0 -1.0 2.0 0.5 5 0.01 0 5 1 2 3 4 5 0 {x + 0.2} 0 0 {x} 0 0 0 0 0 0 0 1.0 host 1.0"]
    file = tmp_path / "a.log"
    file.write_text("\n".join(lines))
    log = read(file)
    assert log.ranges[1].tolist() == [1, 2, 3, 4, math.inf], "5 m is the most it measures: nothing was met"
    assert log.angles[0] == pytest.approx([-1.0, -0.5, 0.0, 0.5, 1.0])
    assert log.mount == pytest.approx([0.2, 0.0, 0.0])
    # The base's own pose, as the laser's line has it: the odometry before it is older.
    assert log.steps[1] == pytest.approx([0.1, 0.0, 0.0])
    assert log.reference is None


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "a.log: is empty; expected a CARMEN log"),
        ("x,y,z\n1,2,3\n", "0 laser scans: no line begins with FLASER or ROBOTLASER1; line 1 begins with 'x,y,z'"),
        ("# nothing\n", "0 laser scans: no line begins with FLASER or ROBOTLASER1$"),
        ("FLASER 2 1 1\n", "line 1: FLASER cannot be read: 2 beams"),
        ("FLASER 181 1 2 3", "line 1: FLASER cannot be read: 3 numbers; expected 181"),
        ("FLASER x 1 2 3", "line 1: FLASER cannot be read: invalid literal"),
        ("FLASER 7 1 1 1 1 1 1 1 0 0 0 0 0 0", "7 beams; expected one of 180, 181, 360, 361"),
        ("ODOM 1 nan 2", "line 1: ODOM cannot be read: a number is not finite"),
        ("ODOM 1 2", "line 1: ODOM cannot be read: 2 numbers; expected 3"),
        ("ODOM 1 2", "the format is ODOM x y theta"),
        (
            "ROBOTLASER1 0 1",
            "line 1: ROBOTLASER1 cannot be read: it ends too early; the format is ROBOTLASER1 type start",
        ),
    ],
)
def test_what_is_wrong_is_named(text: str, why: str, tmp_path: Path) -> None:
    file = tmp_path / "a.log"
    file.write_text(text)
    with pytest.raises(BadLog, match=why.replace("(", r"\(")):
        read(file)


@given(st.integers(0, 10_000), st.integers(0, 255))
def test_a_changed_byte_is_read_or_refused_with_words(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int
) -> None:
    text = "\n".join(line for k in range(3) for line in (odom(np.full(3, 0.1 * k)), flaser(np.full(3, 0.1 * k))))
    data = bytearray(gzip.compress(text.encode()))
    data[place % len(data)] = byte
    file = tmp_path_factory.mktemp("logs") / "a.log.gz"
    file.write_bytes(data)
    try:
        assert np.isfinite(read(file).steps).all()
    except BadLog as error:
        assert str(file) in str(error)


@given(st.binary(max_size=300))
def test_garbage_is_refused_with_words(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    folder = tmp_path_factory.mktemp("logs")
    for name in ("a.log", "a.log.gz", "a.npz"):
        (folder / name).write_bytes(data)
        with pytest.raises(BadLog):
            read(folder / name)


def test_arrays_are_read_and_their_shapes_checked(tmp_path: Path) -> None:
    odometry = np.array([[0.0, 0.0, 0.0], [0.2, 0.1, 0.3]])
    ranges = np.full((2, 5), 3.0)
    file = tmp_path / "a.npz"
    np.savez(file, ranges=ranges, odom=odometry, aperture=math.pi, right_to_left=0, valid=ranges > 0, sensor_pose=MOUNT)
    log = read(file)
    assert log.angles[0] == pytest.approx([math.pi / 2, math.pi / 4, 0.0, -math.pi / 4, -math.pi / 2])
    assert log.steps[1] == pytest.approx(odometry[1]) and log.mount == pytest.approx(MOUNT)
    np.savez(file, ranges=ranges, odom=odometry[:1], aperture=math.pi)
    with pytest.raises(BadLog, match=r"ranges \(2, 5\) and odom \(1, 3\)"):
        read(file)
    for name, bad in (
        ("aperture", np.nan),
        ("sensor_pose", [0.1, np.inf, 0.0]),
        ("max_range", "far"),
        ("aperture", [1, 2]),
    ):
        np.savez(file, **{"ranges": ranges, "odom": odometry, "aperture": math.pi, name: bad})
        with pytest.raises(BadLog):
            read(file)
    np.savez(file, ranges=ranges, odom=odometry * 1e9, aperture=math.pi)
    with pytest.raises(BadLog, match="within 10000 m"):
        read(file)
    np.save(tmp_path / "b.npy", ranges)
    (tmp_path / "b.npy").rename(tmp_path / "b.npz")
    with pytest.raises(BadLog):
        read(tmp_path / "b.npz")
    np.savez(file, ranges=ranges)
    with pytest.raises(BadLog, match="without aperture, odom"):
        read(file)


def test_errors_of_displacements_do_not_depend_on_where_a_trajectory_begins() -> None:
    """40 m there and back; the other way is turned, moved, and 1 % too long: an error of 1 % of each displacement."""
    x = np.concatenate([np.arange(0.0, 40.0, 0.5), np.arange(40.0, -0.1, -0.5)])
    reference = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    longer = reference * (1.01, 1.0, 1.0)
    moved = np.array([compose(np.array([3.0, -2.0, 0.7]), one) for one in longer])
    near = agreement(moved, reference, successive(len(x)))
    assert (near.mean, near.mean_turn) == (pytest.approx(0.005), pytest.approx(0.0, abs=1e-9))
    pairs = revisits(reference)
    again = agreement(moved, reference, pairs)
    assert all(abs(x[i] - x[j]) < 2.0 and j - i > 60 for i, j in pairs)
    assert again.pairs == len(pairs) > 100
    assert again.mean == pytest.approx(0.01 * np.mean([abs(x[i] - x[j]) for i, j in pairs]))
    assert again.deviation == pytest.approx(0.01 * np.std([abs(x[i] - x[j]) for i, j in pairs]))


def test_scans_lie_apart_by_what_a_trajectory_is_off() -> None:
    """A wall at 2 m and one aside at 3 m, seen again from 0.3 m on; the step is said to be 0.04 m too long."""

    def seen(ends: np.ndarray) -> Scan:
        return Scan(ends, np.ones(len(ends), np.bool_), np.zeros(2))

    aside = np.column_stack([np.arange(-1.5, 1.5, 0.1), np.full(30, 3.0)])
    ahead = np.column_stack([np.full(30, 2.0), np.arange(1.4, -1.6, -0.1)])
    scans = [seen(ahead - (x, 0.0)) for x in (0.0, 0.3)]
    steps = np.array([[5.0, 1.0, 0.0], [5.3, 1.0, 0.0]])

    def off(*last: float) -> np.ndarray:
        return steps + np.array([[0.0, 0.0, 0.0], last])

    assert apart(scans, steps) == pytest.approx(0.0, abs=1e-9)
    assert apart(scans, off(0.04, 0.0, 0.0)) == pytest.approx(0.04)
    # Turned by a quarter about where it stands, the second scan sees the same wall on its right.
    turned = seen(scans[1].ends @ np.array([[0.0, -1.0], [1.0, 0.0]]))
    assert apart([scans[0], turned], off(0.0, 0.0, math.pi / 2)) == pytest.approx(0.0, abs=1e-9)
    # What moves along a wall is not seen; what is far from every wall is no measurement.
    along = [seen(aside - (x, 0.0)) for x in (0.0, 0.3)]
    assert apart(along, off(0.04, 0.0, 0.0)) == pytest.approx(0.0, abs=0.005)
    assert np.isnan(apart(scans, off(5.0, 0.0, 0.0)))
    assert np.isnan(apart([scans[0], seen(np.empty((0, 2)))], steps))
    # What the first did not see has no part in it, and between two walls is no wall.
    more = np.vstack([ahead[:10] - (0.28, 0.0), np.column_stack([np.full(20, 7.0), np.arange(20.0)])])
    assert apart([scans[0], seen(more)], steps) == pytest.approx(0.02)
    gate = seen(ahead[np.abs(ahead[:, 1]) > 0.45])
    assert np.isnan(apart([gate, seen(np.array([[1.7, 0.1], [1.7, 0.0], [1.7, -0.1]]))], steps))


def test_the_command_maps_a_room(tmp_path: Path) -> None:
    """From its odometry, which turns too far, to the map: in words, as a picture, and for Rerun."""
    poses = [np.array([1.0 + 0.1 * k, 1.0, 0.02 * k]) for k in range(20)]
    steps = [between(a, b) + np.array([0.0, 0.0, 0.03]) for a, b in pairwise(poses)]
    odometry = [poses[0]]
    for step in steps:
        odometry.append(compose(odometry[-1], step))
    file = tmp_path / "room.npz"
    np.savez(
        file, ranges=np.array([ranges_at(pose) for pose in poses]), odom=np.array(odometry),
        aperture=2 * math.pi * 359 / 360, sensor_pose=np.array([MOUNT[0], 0.0, ANGLES[180] - math.pi / 360]),
    )  # fmt: skip
    out = str(tmp_path / "out")
    command = [sys.executable, "-m", "runtime.cli.main", "slam", str(file), "--particles", "5", "-o", out]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ran.stdout.startswith("20 scans over 2 m; particles drawn anew")
    assert (tmp_path / "out" / "map.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "out" / "map.rrd").stat().st_size > 1000
    command[4] = str(tmp_path / "none.log")
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr.strip()) == (2, f"pushlane: {tmp_path / 'none.log'}: there is no such file")
