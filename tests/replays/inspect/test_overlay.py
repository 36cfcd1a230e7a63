from __future__ import annotations

from pathlib import Path

import numpy as np
from rerun.chunk import RrdReader

from replays.inspect.overlay import overlay
from runtime.messages import Corridor, Pose2, PushStatus, RobotPose
from runtime.messages import PushPhase as Phase


def poses(offset: float) -> list[tuple[str, int, RobotPose]]:
    return [
        (
            "robot/pose",
            t * 10,
            RobotPose(stamp=t, pose=Pose2(x=1.0 * t, y=2.0 + offset * (t > 2)), covariance=[0.1] * 9),
        )
        for t in range(5)
    ]


def scalars(rrd: Path, entity: str) -> list[float]:
    chunks = RrdReader(rrd).store().stream().filter(content=entity, components="Scalars:scalars").to_chunks()
    rows = [row for chunk in chunks for row in chunk.to_record_batch()["Scalars:scalars"].to_pylist()]
    return [row[0] for row in rows]


def test_only_the_field_that_differs_is_counted(tmp_path: Path) -> None:
    out = tmp_path / "o.rrd"
    assert overlay(poses(0.0), poses(0.5), out) == {"robot/pose": 1}
    assert scalars(out, "/robot/pose/pose/y/recorded") == [2.0] * 5
    assert scalars(out, "/robot/pose/pose/y/replayed") == [2.0, 2.0, 2.0, 2.5, 2.5]
    assert scalars(out, "/robot/pose/covariance/8/recorded") == [0.1] * 5


def test_a_missing_message_makes_its_fields_differ(tmp_path: Path) -> None:
    counts = overlay(poses(0.0), poses(0.0)[:-1], tmp_path / "o.rrd")
    assert counts["robot/pose"] == 14  # stamp, pose (3), covariance (9), driver_sequence


def test_states_are_numbers_and_curves_are_left_out(tmp_path: Path) -> None:
    out = tmp_path / "o.rrd"
    status, corridor = PushStatus(phase=Phase.PUSHING), Corridor(version=3, clearance=np.ones(50).tolist())
    rows = [("push/status", 0, status), ("corridor", 0, corridor)]
    assert overlay(rows, rows, out) == {"corridor": 0, "push/status": 0}
    assert scalars(out, "/push/status/phase/recorded") == [3.0]
    assert scalars(out, "/corridor/version/replayed") == [3.0]
    entities = {chunk.entity_path for chunk in RrdReader(out).store().stream().to_chunks()}
    assert not any("clearance" in entity for entity in entities)
