from __future__ import annotations

import pytest

from runtime.scheduler import BadSystem, Timing
from runtime.timing import TimingConfig


def test_links_are_read_by_topic_and_by_topic_and_service() -> None:
    config = TimingConfig(
        latency={"odometry": 0.02, "odometry>corridor": 0.05, "robot/pose>learner": 0.001},
        duration={"corridor": 0.04},
        snapshot_period=2.0,
        journal_period=0.05,
    )
    timing = config.timing()
    assert timing.link("odometry", "strategy") == 20_000_000
    assert timing.link("odometry", "corridor") == 50_000_000
    assert timing.link("robot/pose", "learner") == 1_000_000
    assert timing.link("robot/pose", "strategy") == 0
    assert timing.duration == {"corridor": 40_000_000}
    assert (timing.snapshot_period, timing.journal_period) == (2_000_000_000, 50_000_000)


def test_the_defaults_are_the_schedulers() -> None:
    assert TimingConfig().timing() == Timing()


def test_an_unknown_topic_is_refused_by_name() -> None:
    with pytest.raises(BadSystem, match=r"timing\.latency: no topic 'odometri'"):
        TimingConfig(latency={"odometri": 0.1}).timing()
