"""Messages of the simulated world, for whichever node publishes them."""

from __future__ import annotations

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from drivers.sapien.rays import Outlines
from drivers.sapien.sensors import Laser, laser_scan
from drivers.sapien.world import World
from runtime.messages import LaserScan, Pose2, Truth, Twist2
from runtime.time import SECOND, Time


def truth(world: World, sequence: int, now: Time) -> Truth:
    """Return what is so; `sequence`: of the odometry that is of now."""
    robot, thing = world.robot_pose, world.object_pose
    robot_twist, thing_twist = world.robot_twist, world.object_twist
    return Truth(
        stamp=now,
        robot=Pose2(x=robot[0], y=robot[1], theta=robot[2]),
        robot_twist=Twist2(vx=robot_twist[0], vy=robot_twist[1], omega=robot_twist[2]),
        object=Pose2(x=thing[0], y=thing[1], theta=thing[2]),
        object_twist=Twist2(vx=thing_twist[0], vy=thing_twist[1], omega=thing_twist[2]),
        touching=world.touching,
        robot_hit=world.robot_hit,
        object_hit=world.object_hit,
        driver_sequence=sequence,
    )


def scan(
    laser: Laser, pose: NDArray[np.float64], seen: Outlines, noise: float, generator: np.random.Generator, now: Time
) -> LaserScan:
    """Return what the laser sees at `pose`, (3,), of the base."""
    ranges = laser_scan(laser, pose, seen, noise, generator)
    message = LaserScan(
        timestamp=Timestamp(seconds=now // SECOND, nanos=now % SECOND),
        frame_id="base",
        start_angle=laser.yaw - laser.field / 2,
        end_angle=laser.yaw + laser.field / 2,
        ranges=ranges.tolist(),
    )
    message.pose.position.x, message.pose.position.y = laser.x, laser.y
    message.pose.orientation.w = 1.0
    return message
