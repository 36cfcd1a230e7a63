from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from replays.inspect import to_rrd
from replays.inspect.sensing import met_by
from replays.inspect.session import read_session
from runtime.messages import LaserScan, OccupancyGrid, PushBehaviour, RobotPose, SeenFloor
from tests.replays.inspect.rrd import column
from tests.replays.inspect.synthetic_session import CELL, SIDE, Push, grid, write_session

TOPICS = (
    "odometry", "scan", "ranges", "status", "robot/pose", "map", "object/state", "push/goal", "corridor", "push/target",
    "push/behaviour", "command", "push/status", "truth", "log/corridor",
)  # fmt: skip


@pytest.fixture(scope="module")
def rrd(push: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("rrd") / "push.rrd"
    to_rrd(push, out)
    return out


def test_plotted_numbers_are_the_messages_own(push: Path, rrd: Path) -> None:
    track = read_session(push).track("push/behaviour", PushBehaviour)
    for entity, name in (("/angles/alpha", "alpha"), ("/learned/kappa", "kappa"), ("/angles/mu", "mu")):
        times, rows = column(rrd, entity, "Scalars:scalars")
        assert times.tolist() == track.times.tolist()
        assert rows == [[getattr(message, name)] for message in track.messages]


def test_gamma_is_plotted_only_where_the_object_moved(push: Path, rrd: Path) -> None:
    track = read_session(push).track("push/behaviour", PushBehaviour)
    _, rows = column(rrd, "/angles/gamma", "Scalars:scalars")
    assert rows == [[m.gamma] for m in track.messages if m.moving]
    assert len(rows) < len(track)


def test_the_robot_is_drawn_at_its_poses(push: Path, rrd: Path) -> None:
    track = read_session(push).track("robot/pose", RobotPose)
    times, rows = column(rrd, "/map/robot", "Transform3D:translation")
    assert times.tolist() == track.times.tolist()
    drawn = np.array(rows)[:, 0, :2]
    assert drawn == pytest.approx(np.array([(m.pose.x, m.pose.y) for m in track.messages]), abs=1e-6)


def test_scans_lie_on_occupied_cells(rrd: Path) -> None:
    cells = grid()
    _, rows = column(rrd, "/map/scan", "Points3D:positions")
    points = np.array([point for row in rows for point in row])[:, :2]
    assert len(points) > 1000
    index = (points / CELL).astype(int).clip(0, SIDE - 1)
    # Rays end up to a step of 3 cm, and poses lie some millimetres off, beside the cell.
    near = np.max(
        [
            cells[(index[:, 1] + dy).clip(0, SIDE - 1), (index[:, 0] + dx).clip(0, SIDE - 1)] == 100
            for dx in (-1, 0, 1)
            for dy in (-1, 0, 1)
        ],
        axis=0,
    )
    assert near.mean() > 0.99


def test_scans_are_placed_by_where_the_robot_was_not_by_what_was_known(push: Path, rrd: Path) -> None:
    truth = Push(8.0)
    _, rows = column(rrd, "/map/scan", "Points3D:positions")
    for scan, row in zip(read_session(push).track("scan", LaserScan).messages, rows, strict=True):
        x, y, theta = truth.robot(scan.timestamp.ToNanoseconds() / 1e9)
        reach = np.array(scan.ranges)
        bearing = theta + np.linspace(scan.start_angle, scan.end_angle, len(reach))
        hit = np.isfinite(reach)
        expected = np.column_stack([x + reach * np.cos(bearing), y + reach * np.sin(bearing)])[hit]
        # Poses are given with a noise of some millimetres, and linear over 20 ms.
        assert np.array(row)[:, :2] == pytest.approx(expected, abs=0.03)


def test_what_the_camera_meets_on_the_floor_is_placed_by_where_the_robot_was(push: Path, rrd: Path) -> None:
    truth = Push(8.0)
    _, rows = column(rrd, "/map/floor", "Points3D:positions")
    messages = read_session(push).track("floor", SeenFloor).messages
    assert len(rows) == len(messages) > 50
    for floor, row in zip(messages, rows, strict=True):
        x, y, theta = truth.robot(floor.stamp / 1e9)
        ahead, aside = 0.12 + 0.9 * np.cos(0.3), 0.9 * np.sin(0.3)
        expected = [
            x + ahead * np.cos(theta) - aside * np.sin(theta),
            y + ahead * np.sin(theta) + aside * np.cos(theta),
        ]
        assert np.array(row)[:, :2] == pytest.approx(np.array([expected]), abs=0.03)


def test_floor_whose_columns_do_not_fit_together_is_not_drawn_and_ends_nothing() -> None:
    assert len(met_by(SeenFloor(bearing=[0.1], first=[0.2], last=[1.0], met=[True]))) == 1
    assert len(met_by(SeenFloor(bearing=[0.1, 0.2], first=[0.2], last=[1.0], met=[True]))) == 0
    assert len(met_by(SeenFloor(bearing=[0.1], first=[0.2], met=[True, True, True]))) == 0


def test_the_map_has_its_lowest_row_last(push: Path, rrd: Path) -> None:
    message = read_session(push).track("map", OccupancyGrid).messages[0]
    _, rows = column(rrd, "/map/grid", "GridMap:data")
    picture = np.frombuffer(bytes(rows[0][0]), np.uint8).reshape(message.height, message.width, 4)  # type: ignore[arg-type]
    cells = np.frombuffer(message.cells, np.uint8).reshape(message.height, message.width)
    for x, y in ((20, 30), (80, 7), (58, 52), (2, 2)):
        same = (picture[SIDE - 1 - y, x] == picture[::-1][cells == cells[y, x]]).all(axis=1)
        assert same.all()
    assert len(np.unique(picture.reshape(-1, 4), axis=0)) == 3


def test_phases_change_where_the_status_says(rrd: Path) -> None:
    times, rows = column(rrd, "/states/push", "StateChange:state")
    assert [row[0] for row in rows] == ["idle", "planning", "pushing", "waiting", "pushing", "delivered"]
    assert times[0] == 0
    assert np.all(np.diff(times) > 0)


def test_the_log_says_who_spoke_and_when(rrd: Path) -> None:
    times, rows = column(rrd, "/log/tracker", "TextLog:text")
    assert rows == [["    3.36 s  tracker: object predicted: no detection for 0.2 s"]]
    assert times.tolist() == [3_360_000_000]
    _, ends = column(rrd, "/log/push", "TextLog:text")
    assert ends[-1][0].endswith("push: delivered, object within precision")  # type: ignore[attr-defined]


def test_the_depth_is_that_of_the_corridor_in_force(rrd: Path) -> None:
    times, rows = column(rrd, "/depth/object", "Scalars:scalars")
    values = np.array([row[0] for row in rows])
    # The generator's object keeps within 6.3 cm of Q, whose half widths are at most 0.75 - 0.23 m.
    assert values.max() <= 0.52
    assert times[0] >= 0.03 * 8e9
    assert len(times) > 150


@pytest.mark.parametrize("missing", TOPICS)
def test_a_session_without_a_topic_is_shown(missing: str, tmp_path: Path) -> None:
    counts = write_session(tmp_path / "a.mcap", 1.2, frozenset({missing}))
    summary = to_rrd(tmp_path / "a.mcap", tmp_path / "a.rrd")
    assert missing not in counts
    assert summary.messages == counts
    assert summary.rows


@pytest.mark.parametrize("kept", TOPICS)
def test_a_session_of_one_topic_is_shown(kept: str, tmp_path: Path) -> None:
    others = frozenset({*TOPICS, "request/task", "reply/task"} - {kept})
    write_session(tmp_path / "a.mcap", 1.2, others)
    summary = to_rrd(tmp_path / "a.mcap", tmp_path / "a.rrd")
    assert kept in summary.messages


def test_pictures_of_the_camera_are_shown(tmp_path: Path) -> None:
    counts = write_session(tmp_path / "a.mcap", 1.0, images=True)
    assert to_rrd(tmp_path / "a.mcap", tmp_path / "a.rrd").rows["/camera/image"] == counts["image"]


def test_a_cut_session_is_shown_up_to_the_cut(push: Path, tmp_path: Path) -> None:
    (tmp_path / "cut.mcap").write_bytes(push.read_bytes()[: push.stat().st_size // 2])
    summary = to_rrd(tmp_path / "cut.mcap", tmp_path / "cut.rrd")
    assert summary.damage != ""
    assert 1_000_000_000 < summary.last < 7_000_000_000
    assert summary.rows["/map/robot"] == summary.messages["robot/pose"]


def test_only_returns_of_a_scan_are_drawn(push: Path, rrd: Path) -> None:
    scans = read_session(push).track("scan", LaserScan).messages
    _, rows = column(rrd, "/map/scan", "Points3D:positions")
    returns = [int(np.isfinite(scan.ranges).sum()) for scan in scans]
    assert [len(row) for row in rows] == returns
    assert min(returns) < len(scans[0].ranges)


def test_rerun_is_imported_only_when_it_is_needed() -> None:
    code = "import sys, replays.inspect, replays.cli; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
