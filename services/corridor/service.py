"""Keeps the pushing corridor: plans it for a goal, and anew when what is sensed no longer fits it (Sec. 3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime import topics
from runtime.messages import Corridor, LaserScan, ObjectState, PushGoal, RobotPose
from runtime.service import Effects, Input, Output, Service, on
from runtime.time import SECOND, Time
from services.corridor import hits
from services.corridor.config import CorridorConfig
from services.corridor.corridor import build
from services.corridor.shortest_path import PlanningError
from services.corridor.update import disagrees, external
from services.geometry.corridor import CorridorGeometry
from services.geometry.wire import geometry, polyline, vector


@dataclass
class CorridorState:
    """What the service goes on from.

    Attributes:
        goal_id: the goal that a corridor is wanted for; 0 if none.
        planned: whether there is an answer for it.
        corridor: as published last.
        scan: the newest scan that no robot pose has been matched with yet.
    """

    goal_id: int = 0
    planned: bool = False
    corridor: Corridor = field(default_factory=Corridor)
    scan: LaserScan | None = None


class CorridorService(Service):
    """Publishes the corridor from the object to the goal."""

    name = "corridor"
    Config = CorridorConfig

    goal = Input(topics.PUSH_GOAL)
    map = Input(topics.MAP)
    robot = Input(topics.ROBOT_POSE)
    object = Input(topics.OBJECT_STATE)
    status = Input(topics.STATUS)
    scan = Input(topics.SCAN)
    ranges = Input(topics.RANGES)
    corridor = Output(topics.CORRIDOR)

    config: CorridorConfig
    state: CorridorState

    def __init__(self, config: CorridorConfig) -> None:
        super().__init__(config)
        self.state = CorridorState()
        self._geometry: CorridorGeometry | None = None

    def thaw(self) -> None:
        """Rebuild the geometry of the corridor in force."""
        self._geometry = geometry(self.state.corridor)

    @on(goal)
    def want(self, goal: PushGoal, now: Time) -> Effects:
        """Plan for a new goal; forget one that has ended."""
        if not goal.active:
            self.state.goal_id = 0
        elif goal.id != self.state.goal_id:
            self.state.goal_id, self.state.planned = goal.id, False
            yield from self._plan(now)

    @on(object)
    def locate(self, object: ObjectState, now: Time) -> Effects:
        """Plan once everything that a plan needs is known."""
        if self.state.goal_id and not self.state.planned:
            yield from self._plan(now)

    @on(scan)
    def sense(self, scan: LaserScan, now: Time) -> None:
        """Keep a scan until the pose at its time is known."""
        self.state.scan = scan

    @on(robot)
    def check(self, robot: RobotPose, now: Time) -> Effects:
        """Algorithm 1: compare what was sensed with the corridor, and plan anew if they disagree.

        The corridor is a function of the map; while that has not changed since the plan, planning again could
        only repeat it, so nothing is done.
        """
        scan, corridor = self.state.scan, self.state.corridor
        if scan is None or robot.stamp < _stamp(scan):
            return
        self.state.scan = None
        if not (self.state.goal_id and self.state.planned and self._geometry is not None):
            return
        if self.map is None or self.object is None or self.map.version == corridor.map_version:
            return
        sensed = self._hits(scan, robot)
        r, o = np.array((robot.pose.x, robot.pose.y)), vector(self.object.position)
        d_r, d_o = corridor.robot_diameter, corridor.object_diameter
        sensed = external(sensed, r, o, d_r, d_o, self.config.object_margin)
        found = disagrees(self._geometry.field, d_r, r, sensed, self.config.threshold)
        if found.nearer or found.farther:
            yield self.say(f"sensed and corridor disagree by {found.difference:+.2f} m: planning anew", now)
            yield from self._plan(now)

    def _hits(self, scan: LaserScan, robot: RobotPose) -> NDArray[np.float64]:
        pose = (robot.pose.x, robot.pose.y, robot.pose.theta)
        found = [hits.of_scan(scan, pose, self.config.scan_maximum)]
        if self.ranges is not None:
            found.append(hits.of_ranges(self.ranges, pose))
        return np.concatenate(found)

    def _plan(self, now: Time) -> Effects:
        goal, grid, robot, object, status = self.goal, self.map, self.robot, self.object, self.status
        if goal is None or grid is None or robot is None or object is None or status is None:
            return
        self.state.planned = True
        cells = np.frombuffer(grid.cells, np.uint8).reshape(grid.height, grid.width)
        corridor = Corridor(
            stamp=now,
            version=self.state.corridor.version + 1,
            goal_id=goal.id,
            map_version=grid.version,
            robot_diameter=status.diameter,
            object_diameter=object.diameter,
        )
        try:
            self._geometry = build(
                cells,
                grid.resolution,
                vector(grid.origin),
                np.array((robot.pose.x, robot.pose.y)),
                vector(object.position),
                vector(goal.position),
                status.diameter,
                object.diameter,
                weight=self.config.path_weight,
                cap=self.config.clearance_cap,
                object_margin=0.5 * self.config.object_margin,
            )
            _fill(corridor, self._geometry)
        except PlanningError as error:
            self._geometry = None
            corridor.reason = str(error)
            yield self.say(f"no corridor: {error}", now, "WARNING")
        self.state.corridor = corridor
        yield self.corridor(corridor)


def _fill(message: Corridor, found: CorridorGeometry) -> None:
    message.found = True
    message.start = found.start
    message.path.CopyFrom(polyline(found.path))
    message.clearance.extend(found.clearance.tolist())
    message.width_push.extend(found.width_push.tolist())
    message.width_object.extend(found.width_object.tolist())
    message.edge_push.extend(polyline(edge) for edge in found.edge_push())
    message.edge_object.extend(polyline(edge) for edge in found.edge_object())


def _stamp(scan: LaserScan) -> Time:
    return scan.timestamp.seconds * SECOND + scan.timestamp.nanos
