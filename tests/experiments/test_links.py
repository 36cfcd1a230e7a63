"""Pushes with the simulated robot behind its own protocols: delivered, recorded, replayed; odometry as directly."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from experiments.scoring import Judge
from experiments.session import prepare, run
from experiments.systems import SYSTEMS
from replays import report
from replays.recording import load
from replays.replay import replay
from runtime.config.layers import Layer
from runtime.messages import Odometry, RobotStatus, Truth
from runtime.sample import Sample
from tests.figures import Figures


class Watched:
    """Follows odometry beside the truth of its time, m."""

    def __init__(self) -> None:
        self.start: Truth | None = None
        self.truth: Truth | None = None
        self.off: list[float] = []
        self.deviation = 0.0
        self.faults: dict[str, int] = {}

    def __call__(self, sample: Sample) -> None:
        if sample.topic == "truth":
            self.truth = Truth.FromString(sample.payload)
            self.start = self.start or self.truth
        elif sample.topic == "odometry" and self.truth is not None and self.start is not None:
            found = Odometry.FromString(sample.payload)
            first, pose = self.start.robot, found.pose
            c, s = math.cos(first.theta), math.sin(first.theta)
            x, y = first.x + c * pose.x - s * pose.y, first.y + s * pose.x + c * pose.y
            self.off.append(math.dist((x, y), (self.truth.robot.x, self.truth.robot.y)))
            heading = found.covariance[8]
            travelled = math.hypot(pose.x, pose.y)
            self.deviation = math.sqrt(2 * found.covariance[0] + heading * travelled**2)
        elif sample.topic == "status":
            status = RobotStatus.FromString(sample.payload)
            self.faults = {one.name: one.value for one in status.faults}


@pytest.mark.parametrize("link", ["direct", "serial", "rest"])
def test_a_push_through_each_link_is_delivered_and_replays(link: str, tmp_path: Path, figures: Figures) -> None:
    push = {"scene": "2A", "object": "can", "seed": 3, "strategy": "predictive", "controller": "predictive"}
    session = prepare([Layer("test", {"sim": push | {"link": link}})])
    assert session.nodes == SYSTEMS["truth", link]
    judge, watched, file = Judge(), Watched(), tmp_path / "a.mcap"
    result = run(session, file, sinks=[judge, watched])
    score = judge.score(session, result)
    assert score.success and score.hits == 0, score
    figures(
        f"{link}: delivered in {score.time:.1f} s; odometry {1000 * watched.off[-1]:.0f} mm off at the end, "
        f"{1000 * watched.deviation:.0f} mm said; faults {watched.faults}"
    )
    assert watched.off[-1] < watched.deviation
    # Commands are refused only while there is no odometry yet to be based on.
    assert all(name in ("command", "no scan") and count < 10 for name, count in watched.faults.items())
    found = replay(load(file))
    assert found.identical, "\n".join(report.text(found))
