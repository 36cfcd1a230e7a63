"""Keeps a map of the room and knows where the robot is on it, from laser scans and odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime import topics
from runtime.messages import (
    LaserScan,
    ObjectState,
    OccupancyGrid,
    Odometry,
    Pose2,
    RobotPose,
    SeenFloor,
    Vector2,
    Visibility,
)
from runtime.service import Effects, Input, Output, Publication, Service, on
from runtime.time import SECOND, Time, nanoseconds
from services.geometry.angles import wrap
from services.geometry.pose import History, between, compose
from services.mapping.config import MappingConfig
from services.mapping.filter import Noise, Particles
from services.mapping.floor import BadFloor, Seen
from services.mapping.globally import explained, locate
from services.mapping.grid import RESOLUTION, Maps, off_cells
from services.mapping.scan import Scan

Array = NDArray[np.float64]

_REMEMBERED = 2.0
"""s of odometry"""
_LEAST = np.diag([0.004**2, 0.004**2, 0.002**2])
"""m^2 and rad^2: that of a map that is made while it is used. Particles that agree know nothing of the errors that all
of them share; with this the squared normalised error is about what it should be (`pushlane experiment tracking`)."""
_LEAST_KNOWN = np.diag([RESOLUTION**2 / 12.0, RESOLUTION**2 / 12.0, 0.002**2])
"""The same of a map that was made before: its surfaces are anywhere within their cells, and so is what is drawn over
them by a robot that was located in it."""
_CARRIED = 0.3
"""m from where the object was seen last at which it was carried, not pushed"""
_AHEAD = 0.1
"""s that a picture may be newer than the odometry: nobody knows where it was taken"""
_EXPLAINED = 2
"""cells from what stands on the map within which what the camera meets is taken for that"""
_DOUBTED = 0.75
"""share of a scan's beams that end where the known map has something, below which it is doubted"""
_RIM = 0.04
"""m around the object within which what was drawn is taken for it"""


@dataclass
class MappingState:
    """What mapping goes on from.

    Attributes:
        particles: the filter.
        shown: the map as it is published: it forgets faster than those of the filter, whose memory keeps it in place.
        odometry: of the last while, odom frame.
        scan: the newest one, until the odometry of its time has come.
        located: whether it is known where the base is on the map.
        began: when the first scan came, ns; None before.
        matched: ns, of the last scan that was matched; None before.
        at_match: (3,), odom frame, there; before, of the first odometry.
        object: the pushed one, as it was seen last.
        version: of the map, as published last at `published`, ns.
        cells: as published last.
    """

    particles: Particles
    shown: Maps = field(default_factory=Maps)
    odometry: History = field(default_factory=History)
    scan: LaserScan | None = None
    located: bool = True
    began: Time | None = None
    matched: Time | None = None
    at_match: Array = field(default_factory=lambda: np.zeros(3))
    object: ObjectState | None = None
    version: int = 0
    published: Time = 0
    cells: bytes = b""


class MappingService(Service):
    """Publishes the robot's pose with every odometry, and the map when it has changed.

    The map's frame is the one in which `start` of the configuration says where the base starts. With a known map, the
    filter's maps and the one that is published begin as that, and scans are drawn over them: what a plan has to the
    cell is found more exactly where the robot comes by.
    """

    name = "mapping"
    Config = MappingConfig

    odometry = Input(topics.ODOMETRY)
    scan = Input(topics.SCAN)
    object = Input(topics.OBJECT_STATE)
    status = Input(topics.STATUS)
    floor = Input(topics.SEEN_FLOOR)
    pose = Output(topics.ROBOT_POSE)
    map = Output(topics.MAP)

    config: MappingConfig
    state: MappingState

    def __init__(self, config: MappingConfig) -> None:
        super().__init__(config)
        self._noise = Noise()
        corner = np.zeros(2) if config.known is None else np.array((config.known.x, config.known.y))
        # Inside, everything is moved by what a known map's cells are off ours.
        self._shift = np.array([*off_cells(corner), 0.0])
        self.state = MappingState(Particles.at(np.array(config.start) - self._shift, config.particles, config.seed))
        if config.known is not None:
            self.state.located = not config.search
            cells, corner = config.known.grid(), corner - self._shift[:2]
            self.state.particles.maps = Maps.known(cells, corner, config.particles, surfaces=True)
            self.state.shown = Maps.known(cells, corner, 1)

    def freeze(self) -> None:
        """Leave out of the maps what nobody uses."""
        self.state.particles.maps.compact()
        self.state.shown.compact()

    @on(object)
    def located(self, object: ObjectState, now: Time) -> None:
        """Note where the object is: it is no part of the room.

        Where it was not known to be, it may have been drawn; it is wiped out there, since no beam will pass while it
        stands. Elsewhere nothing is: a wall beside it is to stay.
        """
        before, self.state.object = self.state.object, object
        place = np.array((object.position.x, object.position.y))
        if object.visibility != Visibility.VISIBLE:
            return
        if (
            before is None
            or before.visibility == Visibility.LOST
            or math.dist(place, (before.position.x, before.position.y)) > _CARRIED
        ):
            self.state.shown.wipe(0, place - self._shift[:2], 0.5 * object.diameter + _RIM)

    @on(odometry)
    def moved(self, odometry: Odometry, now: Time) -> Effects:
        """Say where the robot is now."""
        state = self.state
        pose = np.array((odometry.pose.x, odometry.pose.y, odometry.pose.theta))
        if not state.odometry.stamps:
            state.at_match = pose
        if state.odometry.leaps(odometry.stamp, pose):
            self._go_on_from(pose)
            yield self.say("the odometry has begun anew: going on from where the robot was", now, "WARNING")
        if not state.odometry.add(odometry.stamp, pose, _REMEMBERED):
            return
        if state.scan is not None and _stamp(state.scan) <= odometry.stamp:
            yield from self._look(now)
        if state.located:
            yield self._where(pose, odometry)

    def _go_on_from(self, pose: Array) -> None:
        """Take it that the robot has stayed where it was, and that this is now `pose`, (3,), odom frame."""
        state = self.state
        step = between(state.at_match, state.odometry.poses[-1])
        state.particles.poses = np.array([compose(one, step) for one in state.particles.poses])
        state.at_match, state.odometry, state.scan = pose, History(), None

    @on(scan)
    def scanned(self, scan: LaserScan, now: Time) -> Effects:
        """Take a scan, now or as soon as the odometry of its time has come."""
        state = self.state
        state.scan = scan
        state.began = now if state.began is None else state.began
        if state.odometry.stamps and _stamp(scan) <= state.odometry.stamps[-1]:
            yield from self._look(now)

    def _look(self, now: Time) -> Effects:
        """Match the scan that waits, and draw it."""
        state, config = self.state, self.config
        message, state.scan = state.scan, None
        assert message is not None and state.began is not None
        stamp = _stamp(message)
        if stamp < state.odometry.stamps[0]:
            return  # too old for the odometry that is remembered
        if state.matched is not None and stamp <= state.matched:
            return
        there = state.odometry.at(stamp)
        particles = state.particles
        step = between(state.at_match, there)
        pose = compose(particles.pose, step)
        scan = self._scan(message, pose)
        if not state.located:
            # Before it waits for the object: who looks for that asks where the base is.
            yield from self._locate(scan, there, now)
            if not state.located:
                return
            step, pose = np.zeros(3), particles.pose
        if state.object is None and now - state.began < nanoseconds(config.wait):
            return
        soon = state.matched is not None and stamp - state.matched < nanoseconds(config.pause)
        if not soon or math.hypot(step[0], step[1]) >= config.step or abs(step[2]) >= config.turn:
            if state.matched is None:
                particles.poses[:] = pose
                yield from self._doubt(scan, pose, now)
            else:
                particles.move(step, self._noise, scan)
            particles.draw(scan, config.memory)
            particles.select()
            state.matched, state.at_match = stamp, there
            pose = particles.pose
        state.shown.draw(0, pose, scan.ends, scan.returned, scan.start, config.shown_memory)
        if not state.version or now - state.published >= nanoseconds(config.map_period):
            yield from self._show(now)

    @on(floor)
    def looked_down(self, floor: SeenFloor, now: Time) -> Effects:
        """Draw what the camera sees of the floor on the published map: what stands behind the object is met by no beam.

        Poses are not found with it. Where something stands on the map already, laser or plan have it more exactly.
        """
        state = self.state
        stamps = state.odometry.stamps
        if state.matched is None or not stamps[0] <= floor.stamp <= stamps[-1] + nanoseconds(_AHEAD):
            return
        try:
            seen = Seen.of(floor)
        except BadFloor as error:
            yield self.say(f"floor left out: {error}", now, "WARNING")
            return
        step = between(state.at_match, state.odometry.at(floor.stamp))
        pose = compose(state.particles.pose, step)
        thing = self._thing(floor.stamp, pose)
        told = state.shown.stands(0, seen.on_map(pose), _EXPLAINED)
        if thing is not None:
            told |= seen.of_thing(*thing)
        seen = seen.shortened(seen.met & told, (_EXPLAINED + 1) * RESOLUTION)
        state.shown.draw(0, pose, seen.lasts, seen.met, seen.firsts, self.config.shown_memory)

    def _locate(self, scan: Scan, there: Array, now: Time) -> Effects:
        """Look for the base all over the known map, by one scan, taken where the odometry said `there`, (3,)."""
        state = self.state
        poses, _ = locate(state.particles.maps, scan)
        if not len(poses):
            yield self.say("the scan fits nowhere on the known map: waiting for another", now, "WARNING")
            return
        state.particles.poses[:] = poses[0]
        state.at_match, state.located = there, True
        x, y, theta = poses[0] + self._shift
        share = explained(state.particles.maps, scan, poses[0])
        yield self.say(
            f"found on the known map: ({x:.2f}, {y:.2f}) m, {round(math.degrees(wrap(theta)))} degrees; {share:.0%} of "
            "the beams end where it has something",
            now,
        )

    def _doubt(self, scan: Scan, pose: Array, now: Time) -> Effects:
        """Say so if what the first scan meets is not on the known map: that may be another's, or the start wrong."""
        if self.config.known is None:
            return
        share = explained(self.state.particles.maps, scan, pose)
        if share < _DOUBTED:
            yield self.say(
                f"only {share:.0%} of the first scan's beams end where the known map has something: is it the map of "
                "this place, and does the base start there?",
                now,
                "WARNING",
            )

    def _scan(self, message: LaserScan, pose: Array) -> Scan:
        """Return the scan without beams that end at the object or at the robot itself; `pose`: (3,), of the robot."""
        ranges = np.array(message.ranges)
        angles = np.linspace(message.start_angle, message.end_angle, len(ranges))
        turned = message.pose.orientation
        mount = np.array((message.pose.position.x, message.pose.position.y, 2.0 * math.atan2(turned.z, turned.w)))
        ends = mount[:2] + ranges[:, None] * np.column_stack([np.cos(angles + mount[2]), np.sin(angles + mount[2])])
        foreign = np.ones(len(ranges), np.bool_)
        if self.status is not None:
            foreign &= np.hypot(*ends.T) > 0.5 * self.status.diameter
        thing = self._thing(_stamp(message), pose)
        if thing is not None:
            foreign &= np.hypot(*(ends - thing[0]).T) > thing[1]
        config = self.config
        return Scan.of(ranges[foreign], angles[foreign], mount, config.furthest, config.nothing)

    def _thing(self, stamp: Time, pose: Array) -> tuple[Array, float] | None:
        """Return where the pushed object may be at `stamp`: centre, (2,), base frame, `pose` being the robot's, radius.

        None where nobody knows.
        """
        thing = self.state.object
        if thing is None or thing.visibility == Visibility.LOST:
            return None
        place = np.array((thing.position.x, thing.position.y, 0.0)) - self._shift
        # It may have been pushed on since it was seen.
        late = max(stamp - thing.stamp, 0) / SECOND * self.config.object_speed
        return between(pose, place)[:2], 0.5 * thing.diameter + self.config.object_margin + late

    def _where(self, odometry_pose: Array, odometry: Odometry) -> Publication:
        state, particles = self.state, self.state.particles
        step = between(state.at_match, odometry_pose)
        here, covariance = particles.after(step, _LEAST if self.config.known is None else _LEAST_KNOWN)
        x, y, theta = here + self._shift
        return self.pose(
            RobotPose(
                stamp=odometry.stamp,
                pose=Pose2(x=x, y=y, theta=theta),
                covariance=covariance.ravel().tolist(),
                driver_sequence=odometry.driver_sequence,
            )
        )

    def _show(self, now: Time) -> Effects:
        """Publish the map if it has changed."""
        state = self.state
        cells, corner = state.shown.picture(0)
        known = cells != 255
        if not known.any():
            return
        rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        cells = np.ascontiguousarray(cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])
        corner = corner + RESOLUTION * np.array((columns[0], rows[0])) + self._shift[:2]
        height, width = cells.shape
        payload = cells.tobytes()
        if payload == state.cells:
            return
        state.version += 1
        state.published, state.cells = now, payload
        yield self.map(
            OccupancyGrid(
                stamp=now,
                version=state.version,
                resolution=RESOLUTION,
                width=width,
                height=height,
                origin=Vector2(x=corner[0], y=corner[1]),
                cells=payload,
            )
        )


def _stamp(scan: LaserScan) -> Time:
    return scan.timestamp.seconds * SECOND + scan.timestamp.nanos
