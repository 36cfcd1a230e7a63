"""Where robot and object are over the session, and how much ground the picture must show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replays.inspect.session import Session
from runtime.messages import Corridor, ObjectState, OccupancyGrid, PushGoal, RobotPose, RobotStatus, Truth

# The paper's robot (Sec. 6.1): used only where a session says nothing about its own.
ROBOT_DIAMETER = 0.46


@dataclass(frozen=True)
class Places:
    """Robot poses (N, 3) and object positions (M, 2), map frame; diameters in m.

    `robot_times` and `object_times` say when they were known (ns), `robot_stamps` when the robot was there.
    """

    robot_times: NDArray[np.int64]
    robot_stamps: NDArray[np.int64]
    robot: NDArray[np.float64]
    object_times: NDArray[np.int64]
    object: NDArray[np.float64]
    object_diameter: NDArray[np.float64]
    robot_diameter: float


@dataclass(frozen=True)
class Ground:
    """The rectangle that the map view shows, map frame, m."""

    west: float
    south: float
    east: float
    north: float


def places(session: Session) -> Places:
    """Collects them; arrays are empty where a topic is missing."""
    poses = session.track("robot/pose", RobotPose)
    objects = session.track("object/state", ObjectState)
    statuses = session.track("status", RobotStatus).messages
    corridors = session.track("corridor", Corridor).messages
    diameters = [status.diameter for status in statuses] + [each.robot_diameter for each in corridors]
    known = [diameter for diameter in diameters if diameter > 0.0]
    return Places(
        poses.times,
        np.array([m.stamp for m in poses.messages], np.int64),
        np.array([(m.pose.x, m.pose.y, m.pose.theta) for m in poses.messages], np.float64).reshape(-1, 3),
        objects.times,
        np.array([(m.position.x, m.position.y) for m in objects.messages], np.float64).reshape(-1, 2),
        np.array([m.diameter for m in objects.messages], np.float64),
        known[0] if known else ROBOT_DIAMETER,
    )


def ground(session: Session, where: Places) -> Ground:
    """The whole map and everything that moved; a square metre around the origin for a session without places."""
    corners: list[tuple[float, float]] = []
    for grid in session.track("map", OccupancyGrid).messages:
        east = grid.origin.x + grid.width * grid.resolution
        north = grid.origin.y + grid.height * grid.resolution
        corners += [(grid.origin.x, grid.origin.y), (east, north)]
    truths = session.track("truth", Truth).messages
    for points in (
        where.robot[:, :2],
        where.object,
        np.array([(m.robot.x, m.robot.y) for m in truths], np.float64).reshape(-1, 2),
        np.array([(m.position.x, m.position.y) for m in session.track("push/goal", PushGoal).messages]).reshape(-1, 2),
    ):
        if len(points):
            low, high = points.min(axis=0) - 0.5, points.max(axis=0) + 0.5
            corners += [(float(low[0]), float(low[1])), (float(high[0]), float(high[1]))]
    if not corners:
        return Ground(-0.5, -0.5, 0.5, 0.5)
    xs, ys = zip(*corners, strict=True)
    return Ground(min(xs), min(ys), max(xs), max(ys))
