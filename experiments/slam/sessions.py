"""A recorded session as a laser log: what the scanner saw of the room, odometry, and the truth if it is there."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.slam.logs import BadLog, Log
from replays.inspect.errors import Unreadable
from replays.inspect.session import Track, read_session
from replays.inspect.shapes import pose_at
from runtime.messages import LaserScan, ObjectState, Odometry, Pose2, RobotPose, Truth, Visibility
from runtime.time import SECOND
from services.geometry.pose import between

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

_NOTHING = 9.99
"""m; the scanner of the simulation, like those on Robotinos, says 10 m where it sees nothing"""
_AT_MOST = 0.5
"""s between a scan and where the object was seen"""
_AROUND = 0.06
"""m around the pushed object's circle in which nothing is taken for a part of the room"""


def of_session(file: Path) -> Log:
    """Return the scans of a session, without the object that is pushed.

    Raises:
        BadLog: it cannot be read, or has no scans or no odometry.
    """
    try:
        session = read_session(file)
        scans, odometry = session.track("scan", LaserScan), session.track("odometry", Odometry)
        truth = session.track("truth", Truth)
        objects, robots = session.track("object/state", ObjectState), session.track("robot/pose", RobotPose)
    except Unreadable as error:
        raise BadLog(str(error)) from error
    if not len(scans) or not len(odometry):
        raise BadLog(f"{file}: {len(scans)} messages of scan and {len(odometry)} of odometry; expected both")
    stamps = np.array([one.timestamp.seconds * SECOND + one.timestamp.nanos for one in scans.messages], np.int64)
    ranges, angles = [], []
    for scan, stamp in zip(scans.messages, stamps, strict=True):
        seen = np.array(scan.ranges)
        bearings = np.linspace(scan.start_angle, scan.end_angle, len(seen))
        turn = 2.0 * math.atan2(scan.pose.orientation.z, scan.pose.orientation.w)
        place = np.array([scan.pose.position.x, scan.pose.position.y])
        ends = place + seen[:, None] * np.column_stack([np.cos(bearings + turn), np.sin(bearings + turn)])
        circle = _object(objects, robots, stamp)
        if circle is not None:
            seen = np.where(np.hypot(*(ends - circle[0]).T) < circle[1], np.nan, seen)
        ranges.append(seen)
        angles.append(bearings)
    first = scans.messages[0].pose.position
    raw = _poses([(one.stamp, one.pose) for one in odometry.messages], stamps)
    reference = _poses([(one.stamp, one.robot) for one in truth.messages], stamps) if len(truth) else None
    steps = np.array([np.zeros(3), *(between(raw[k], raw[k + 1]) for k in range(len(raw) - 1))])
    start = raw[0] if reference is None else reference[0]
    turned = scans.messages[0].pose.orientation
    mount = np.array([first.x, first.y, 2.0 * math.atan2(turned.z, turned.w)])
    return Log(ranges, angles, mount, steps, start, reference, _NOTHING, reference is not None)


def _poses(stamped: list[tuple[int, Pose2]], stamps: Stamps) -> Array:
    """Return the poses at `stamps`, (K, 3), between those that are known."""
    times = np.array([one[0] for one in stamped], np.int64)
    return pose_at(stamps, times, np.array([(pose.x, pose.y, pose.theta) for _, pose in stamped]))


def _object(objects: Track[ObjectState], robots: Track[RobotPose], stamp: int) -> tuple[Array, float] | None:
    """Return centre, (2,), base frame, and radius of the circle that the object is in, m; None if nobody saw it."""
    if not len(objects) or not len(robots):
        return None
    thing = min(objects.messages, key=lambda one: abs(one.stamp - stamp))
    if thing.visibility == Visibility.LOST or abs(thing.stamp - stamp) > _AT_MOST * SECOND:
        return None
    robot = min(robots.messages, key=lambda one: abs(one.stamp - stamp)).pose
    dx, dy = thing.position.x - robot.x, thing.position.y - robot.y
    c, s = math.cos(robot.theta), math.sin(robot.theta)
    return np.array([c * dx + s * dy, -s * dx + c * dy]), 0.5 * thing.diameter + _AROUND
