"""Pushes from sensors alone: recorded, replayed alike, and near the truth; the figures that are taken of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from drivers.sapien import scene
from experiments.beyond.cases import SENSES, sensing, tasks
from experiments.beyond.tables import sensors
from experiments.paper.trial import Outcome
from experiments.session import prepare, run
from experiments.systems import SYSTEMS
from experiments.tracking import NOT_SEEN, Run, Watched, off_surfaces, tables
from replays import report
from replays.recording import load
from replays.replay import replay
from runtime.config.layers import ConfigError, Layer
from runtime.messages import ObjectState, OccupancyGrid, Pose2, RobotPose, Truth, Vector2, Visibility
from runtime.sample import Sample
from tests.figures import Figures


@pytest.mark.render
@pytest.mark.parametrize("sense", ["tags", "appearance", "depth"])
def test_a_push_from_sensors_is_near_the_truth_and_replays(sense: str, tmp_path: Path, figures: Figures) -> None:
    values = {"seed": 2, "time_limit": 3.0, "strategy": "predictive", "controller": "predictive"}
    session = prepare([Layer("test", {"sim": values}), Layer(sense, SENSES[sense])])
    assert session.nodes == SYSTEMS["sensors", "direct"]
    watched, file = Watched(), tmp_path / "a.mcap"
    run(session, file, sinks=[watched])
    off = np.array(watched.object)
    robot = np.hypot(*np.array(watched.robot)[:, :2].T)
    figures(f"{sense}: object {1000 * off[:, 1].mean():.0f} mm off, robot {1000 * robot.mean():.0f} mm, on the mean")
    assert len(off) > 20 and off[:, 1].mean() < 0.06 and robot.mean() < 0.03
    assert not watched.times.get(Visibility.LOST)
    found = replay(load(file))
    assert found.identical, "\n".join(report.text(found))
    assert [one.node for one in found.nodes] == list(SYSTEMS["sensors", "direct"])


def test_watched_sets_each_message_beside_the_truth_of_its_time() -> None:
    watched = Watched()
    truth = Truth(stamp=5, robot=Pose2(x=1.0, y=2.0, theta=math.pi / 2), object=Pose2(x=1.0, y=3.0))
    pose = RobotPose(stamp=5, pose=Pose2(x=1.03, y=2.04, theta=math.pi / 2), covariance=np.diag([1e-4] * 3).ravel())
    spot = Vector2(x=1.03, y=3.02)
    state = ObjectState(stamp=5, position=spot, covariance=[0.01, 0, 0, 0.01], visibility=Visibility.VISIBLE)
    lost = ObjectState(stamp=5, visibility=Visibility.LOST)
    later = Truth(stamp=6)
    for topic, message in (
        ("truth", truth), ("robot/pose", pose), ("object/state", state), ("truth", later), ("object/state", lost),
        ("truth", later), ("truth", later),
    ):  # fmt: skip
        watched(Sample(topic, 1, 5, message.SerializeToString()))
    ((x, y, turn, normalised),) = watched.robot
    assert (x, y, turn, normalised) == pytest.approx((0.03, 0.04, 0.0, 25.0))
    ((distance, off, seen_off, squared),) = watched.object
    assert distance == pytest.approx(1.0)
    assert off == pytest.approx(math.hypot(0.03, 0.02))
    # Seen from the base it is 0.98 m straight ahead.
    assert seen_off == pytest.approx(0.02)
    assert squared == pytest.approx((0.03**2 + 0.02**2) / 0.01)
    assert watched.times == {NOT_SEEN: 1, Visibility.VISIBLE: 1, Visibility.LOST: 2}
    one = Run(np.array(watched.robot), np.array(watched.object), watched.times, np.array([0.01, 0.02]))
    of_object, others = tables({"tags": [one]})
    assert of_object.rows[0][:4] == ("tags", "all", "1", "20")
    assert of_object.rows[0][-3:] == ("0.0 %", "50.0 %", "25.0 %")
    assert others.rows[0][1:3] == ("1", "50") and others.rows[0][-3] == "2" and others.rows[0][-2] == "15"


def test_cells_are_as_far_off_as_the_nearest_surface() -> None:
    """The plan of a room with walls on cells: middles of the outermost cells are half a cell inside."""
    room = scene.get("1A")
    bounds = room.bounds
    cells = np.zeros((1, 3), np.uint8)
    cells[0, 0], cells[0, 2] = 100, 100
    origin = Vector2(x=bounds.min_x - 0.05, y=(bounds.min_y + bounds.max_y) / 2 - 0.025)
    off = off_surfaces(OccupancyGrid(resolution=0.05, width=3, height=1, origin=origin, cells=cells.tobytes()), room)
    assert off == pytest.approx([0.025, 0.075], abs=0.006)


def test_the_cases_of_sensing_are_the_same_pushes() -> None:
    found = list(tasks(sensing(), "predictive", 3, 10))
    assert len(found) == 3 * len(SENSES)
    for k in range(3):
        same = found[k * len(SENSES) : (k + 1) * len(SENSES)]
        assert len({(one.scene, one.object, one.seed, one.precision) for one in same}) == 1
        assert [one.case for one in same] == list(SENSES)
    with pytest.raises(ConfigError, match="'smell'; expected some of truth, tags"):
        sensing(["smell"])


def outcome(sense: str, seed: int, success: bool) -> Outcome:
    return Outcome(
        experiment="sensors", method="predictive", start="scene", scene="1A", object="can", strategy="predictive",
        controller="predictive", precision=0.1, seed=seed, case=sense, settings="", success=success,
        cause="" if success else "stall", distance=0.0, robot_length=2.0, object_length=1.0, time=9.0,
        robot_depth=0.1, object_depth=0.1, hits=0, to_go=None, turn=None, steep=None,
    )  # fmt: skip


def test_the_table_counts_points_on_the_seeds_that_truth_has_too() -> None:
    truth = [outcome("truth", seed, seed != 3) for seed in range(10)]
    tags = [outcome("tags", seed, seed > 1) for seed in range(12)]
    rates, places = sensors([*truth, *tags])
    assert [row[1] for row in rates.rows] == ["truth", "tags"]
    # Of ten seeds both have, tags fail two that truth delivers, and deliver one that it fails.
    assert rates.rows[1][-1] == "-10.0 of 10, truth"
    assert places.rows[1][2:] == ("10/12",)


def test_what_sees_no_yaw_stands_beside_truth_without_it() -> None:
    truth = [outcome("truth", seed, True) for seed in range(10)]
    blind = [outcome("no yaw", seed, seed > 0) for seed in range(10)]
    looks = [outcome("appearance", seed, seed > 1) for seed in range(10)]
    rows = {row[1]: row for row in sensors([*truth, *blind, *looks])[0].rows}
    assert rows["no yaw"][-1] == "-10.0 of 10, truth"
    assert rows["appearance"][-1] == "-10.0 of 10, no yaw"
