"""Where the floor is, by what a laser's beams pass over."""

from __future__ import annotations

import math

import numpy as np
import pytest
from foxglove_schemas_protobuf.Pose_pb2 import Pose

from runtime.messages import LaserScan
from services.vision.beams import passed


def scan(ranges: list[float]) -> LaserScan:
    """Return a scan from (0.1, 0), beams 0.1 rad apart, the middle one straight ahead."""
    half = 0.05 * (len(ranges) - 1)
    message = LaserScan(start_angle=-half, end_angle=half, ranges=ranges, pose=Pose())
    message.pose.position.x, message.pose.orientation.w = 0.1, 1.0
    return message


def farthest(places: np.ndarray) -> dict[int, float]:
    """Return how far out, m from the laser, places are, by the beam from the middle."""
    off = places - (0.1, 0.0)
    beams = np.round(np.arctan2(off[:, 1], off[:, 0]) / 0.1).astype(int)
    return {int(beam): float(np.hypot(*off[beams == beam].T).max()) for beam in set(beams)}


def test_a_beam_passes_over_the_floor_up_to_shortly_before_what_it_meets() -> None:
    found = farthest(passed(scan([2.0, 2.0, 1.0, 2.0, 20.0])))
    assert found == pytest.approx({-2: 1.7, -1: 1.7, 0: 0.7, 1: 1.7, 2: 2.9}, abs=1e-9)


def test_beside_what_a_beam_meets_nothing_behind_it_is_taken_for_floor() -> None:
    """The camera looks from elsewhere: there it may see the thing where the beams beside it pass."""
    found = farthest(passed(scan([2.0] * 4 + [1.0] + [2.0] * 4), aside=2))
    assert found == pytest.approx({k: 0.7 if abs(k) <= 2 else 1.7 for k in range(-4, 5)}, abs=1e-9)


def test_without_a_scan_there_are_no_places() -> None:
    assert passed(None).shape == passed(LaserScan()).shape == (0, 2)
    assert passed(scan([0.3, 0.3, 0.3])).shape == (0, 2)
    turned = scan([2.0])
    turned.pose.orientation.z, turned.pose.orientation.w = math.sin(0.5), math.cos(0.5)
    off = passed(turned) - (0.1, 0.0)
    assert np.arctan2(off[:, 1], off[:, 0]) == pytest.approx(1.0)
