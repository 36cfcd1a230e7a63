"""A recorded push as a laser log: mapped from scans and odometry, judged by the truth."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from experiments.session import prepare, run
from experiments.slam.logs import BadLog, read
from experiments.slam.whole import run as map_log
from replays.inspect.session import read_session
from runtime.config.layers import Layer
from runtime.messages import LaserScan, Truth
from services.mapping.config import FilterConfig
from services.mapping.scan import Scan
from tests.figures import Figures


@pytest.fixture(scope="module")
def push(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("push") / "a.mcap"
    run(prepare([Layer("test", {"sim": {"scene": "living-room", "seed": 3, "strategy": "relaxed"}})]), file)
    return file


def test_a_push_is_mapped_from_its_scans(push: Path, figures: Figures) -> None:
    log = read(push)
    assert log.true and log.reference is not None
    found = map_log(log, FilterConfig(particles=10), lambda: None)
    errors, raw = (np.hypot(*(poses - log.reference)[:, :2].T) for poses in (found.poses, found.raw))
    figures(f"position: {errors.mean():.3f} m mean, {errors.max():.3f} m at most; odometry {raw.max():.3f} m at most")
    assert errors.mean() < 0.04
    assert errors.max() < 0.10 < raw.max()
    turns = np.abs((found.poses - log.reference)[:, 2] + math.pi) % math.tau - math.pi
    assert np.abs(turns).mean() < 0.02


def test_the_object_is_no_part_of_the_room(push: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the truth, no beam ends on the object; where nobody leaves it out, many do."""
    session = read_session(push)
    truth = session.track("truth", Truth).messages
    scans = session.track("scan", LaserScan).messages

    def on_the_object() -> int:
        log, found = read(push), 0
        assert log.reference is not None
        for k in range(0, len(log.ranges), 5):
            scan = Scan.of(log.ranges[k], log.angles[k], log.mount, 20.0, log.nothing)
            x, y, theta = log.reference[k]
            c, s = math.cos(theta), math.sin(theta)
            ends = scan.ends @ np.array([[c, s], [-s, c]]) + (x, y)
            stamp = scans[k].timestamp.seconds * 1_000_000_000 + scans[k].timestamp.nanos
            thing = min(truth, key=lambda one: abs(one.stamp - stamp)).object
            found += int((np.hypot(ends[:, 0] - thing.x, ends[:, 1] - thing.y) < 0.20).sum())
        return found

    assert on_the_object() == 0
    monkeypatch.setattr("experiments.slam.sessions._object", lambda *_: None)
    assert on_the_object() > 100


def test_what_is_no_session_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"garbage")
    with pytest.raises(BadLog):
        read(tmp_path / "a.mcap")
