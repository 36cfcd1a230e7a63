"""Keeps the pushing corridor: plans it for a goal, and anew when what is sensed no longer fits it (Sec. 3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime import topics
from runtime.messages import (
    Corridor,
    LaserScan,
    ObjectState,
    OccupancyGrid,
    PushGoal,
    RobotPose,
    RobotStatus,
    Visibility,
)
from runtime.service import Effects, Input, Output, Publication, Service, on
from runtime.time import SECOND, Time
from services.corridor import hits
from services.corridor.chart import Chart, apart
from services.corridor.clearance import measure
from services.corridor.config import CorridorConfig
from services.corridor.corridor import build
from services.corridor.shortest_path import PlanningError
from services.corridor.update import disagrees, external
from services.geometry.corridor import CorridorGeometry
from services.geometry.wire import geometry, polyline, vector

Array = NDArray[np.float64]

_ANOTHER_WAY = 0.4
"""m between two paths from which on they are not the same with noise"""


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


_JOIN = 0.2
"""m ahead of the object at which a new path joins one that is kept"""


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

    @on(map)
    def chart(self, map: OccupancyGrid, now: Time) -> Effects:
        """Plan anew if the map has changed where the corridor is."""
        corridor = self.state.corridor
        if not (self.state.goal_id and self.state.planned) or map.version == corridor.map_version:
            return
        if self._geometry is None:
            yield from self._plan(now)
            return
        change = self._change(map)
        if change < -self.config.map_threshold or change > self.config.map_gain:
            yield self.say(f"the map has changed by {change:+.2f} m along the path: planning anew", now)
            yield from self._plan(now)
        else:
            yield from self._think_again(map, now)

    @on(scan)
    def sense(self, scan: LaserScan, now: Time) -> None:
        """Keep a scan until the pose at its time is known."""
        self.state.scan = scan

    @on(robot)
    def check(self, robot: RobotPose, now: Time) -> Effects:
        """Algorithm 1: compare what was sensed with the corridor, and plan anew if they disagree.

        The corridor is a function of the map; while that has not changed since the plan, planning again could
        only repeat it, so nothing is done. Where no more than noise of it has changed, an obstacle that is farther
        away than the edge, which is usual, is no reason either.
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
        if self.object.visibility == Visibility.LOST:
            o = np.full(2, np.inf)  # nobody knows where it is: what stands there is an obstacle
        # It may have been pushed on since it was seen.
        late = max(robot.stamp - self.object.stamp, 0) / SECOND * self.config.object_speed
        sensed = external(sensed, r, o, d_r, d_o, self.config.object_margin + late)
        found = disagrees(self._geometry.field, d_r, r, sensed, self.config.threshold)
        if found.nearer or (found.farther and self._change(self.map) > self.config.map_gain):
            where = "before" if found.nearer else "beyond"
            yield self.say(
                f"an obstacle is {abs(found.difference):.2f} m {where} the corridor's edge: planning anew", now
            )
            yield from self._plan(now)

    def _hits(self, scan: LaserScan, robot: RobotPose) -> Array:
        pose = (robot.pose.x, robot.pose.y, robot.pose.theta)
        found = [hits.of_scan(scan, pose, self.config.scan_maximum)]
        if self.ranges is not None:
            found.append(hits.of_ranges(self.ranges, pose))
        return np.concatenate(found)

    def _think_again(self, grid: OccupancyGrid, now: Time) -> Effects:
        """While the path leads through what nobody has seen: take another if what is seen by now makes it better."""
        known, goal, robot, object, status = self._geometry, self.goal, self.robot, self.object, self.status
        if known is None or goal is None or robot is None or object is None or status is None:
            return
        ahead = known.path[known.arc >= min(known.closest(vector(object.position)).arc, float(known.arc[-1]))]
        if not self._chart(grid, ahead).doubts(ahead):
            return
        try:
            found = self._built(goal, grid, robot, object, status)
        except PlanningError:
            return  # the way through the unknown is still one
        if apart(found.path[found.start :], known.path) > _ANOTHER_WAY:
            yield self.say("a better way has come into sight: planning anew", now)
            yield self._adopt(found, "", now)

    def _change(self, grid: OccupancyGrid) -> float:
        """Return how much the clearance along the rest of Q has changed, m: the worst loss if it counts, else the gain.

        It is compared with that on which the corridor was built, so a cell or two of noise do not count.
        """
        found, robot, object = self._geometry, self.robot, self.object
        if found is None or robot is None or object is None:
            return 0.0
        ahead = found.arc >= min(found.closest(vector(object.position)).arc, float(found.arc[-1]))
        discs = _bodies(robot, object, found, 0.5 * self.config.object_margin)
        chart = self._chart(grid, found.path)
        discs = discs[:0] if self.config.apart else discs
        now = measure(chart.cells, chart.resolution, chart.origin, discs)
        change = np.minimum(now.along(found.path[ahead]), self.config.clearance_cap) - found.clearance[ahead]
        worst, best = float(change.min()), float(change.max())
        return worst if worst < -self.config.map_threshold else best

    def _plan(self, now: Time) -> Effects:
        goal, grid, robot, object, status = self.goal, self.map, self.robot, self.object, self.status
        if goal is None or grid is None or robot is None or object is None or status is None:
            return
        self.state.planned = True
        try:
            found, reason = self._built(goal, grid, robot, object, status), ""
        except PlanningError as error:
            found, reason = None, str(error)
            yield self.say(f"no corridor: {error}", now, "WARNING")
        yield self._adopt(found, reason, now)

    def _adopt(self, found: CorridorGeometry | None, reason: str, now: Time) -> Publication:
        """Put a corridor in force."""
        goal, grid, object, status = self.goal, self.map, self.object, self.status
        assert goal is not None and grid is not None and object is not None and status is not None
        corridor = Corridor(
            stamp=now,
            version=self.state.corridor.version + 1,
            goal_id=goal.id,
            map_version=grid.version,
            robot_diameter=status.diameter,
            object_diameter=object.diameter,
            reason=reason,
        )
        if found is not None:
            _fill(corridor, found)
        self._geometry, self.state.corridor = found, corridor
        return self.corridor(corridor)

    def _built(
        self, goal: PushGoal, grid: OccupancyGrid, robot: RobotPose, object: ObjectState, status: RobotStatus
    ) -> CorridorGeometry:
        r, o, g = np.array((robot.pose.x, robot.pose.y)), vector(object.position), vector(goal.position)
        chart, config = self._chart(grid, np.stack([r, o, g])), self.config
        known = None
        if config.steady and self._geometry is not None and self.state.corridor.goal_id == goal.id:
            rest = self._geometry.arc > self._geometry.closest(o).arc + _JOIN
            known = self._geometry.path[rest] if rest.any() else None
        return build(
            chart.cells,
            chart.resolution,
            chart.origin,
            r,
            o,
            g,
            status.diameter,
            object.diameter,
            weight=config.path_weight,
            cap=config.clearance_cap,
            object_margin=0.5 * config.object_margin,
            spare=config.spare,
            apart=config.apart,
            doubtful=chart.doubtful,
            known=known,
        )

    def _chart(self, grid: OccupancyGrid, within: Array) -> Chart:
        return Chart.of(grid, within, self.config.unknown == "free")


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


def _bodies(robot: RobotPose, object: ObjectState, found: CorridorGeometry, margin: float) -> Array:
    """Return the discs, (2, 3), x, y, radius, m, in which what is occupied is object or robot."""
    o = object.position
    return np.array(
        [(o.x, o.y, 0.5 * found.object_diameter + margin), (robot.pose.x, robot.pose.y, 0.5 * found.robot_diameter)]
    )
