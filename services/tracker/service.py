"""Says where the pushed object is, from pictures of the robot's camera."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from runtime import topics
from runtime.messages import (
    CompressedImage,
    ObjectState,
    Odometry,
    RobotPose,
    Vector2,
)
from runtime.service import Effects, Input, Output, Publication, Timer, on
from runtime.time import SECOND, Time, nanoseconds
from services.geometry.angles import wrap
from services.geometry.pose import History, between, compose, rotation
from services.tracker.config import TrackerConfig
from services.tracker.filter import Reading, Track
from services.tracker.finders import Hint, Memory, Sighting, View, finder_of
from services.tracker.outline import lines
from services.vision.beams import passed
from services.vision.seeing import BadPicture, SeeingService, decoded, taken

Array = NDArray[np.float64]

_REMEMBERED = 2.5
"""s of the robot's poses: cameras are late by up to 2 s"""
_EARLIER = 0.1
"""s that a picture may be older than the first pose: as good as of the same time"""
_PERIOD = 0.1
_SILENT = 0.3
"""s without a picture after which the track goes on without"""


@dataclass
class TrackerState:
    """What the tracker goes on from.

    Attributes:
        robots: where the robot was lately, odometry's frame.
        origin: (3,), x, y, theta, of that frame in the map's, as mapping says now.
        track: of the object, odometry's frame; None before it was seen.
        doubt: (2, 2), m^2, odometry's frame, what it may be off in picture after picture, which the filter cannot tell
            from its place; yaw_doubt: rad^2.
        looked: ns, when a picture came last; stamp: of which time it was; 0 before.
        said: ns, of which time the last published state is.
        memory: what is learned for finding it.
        unreadable: pictures that were none.
    """

    robots: History = field(default_factory=History)
    origin: Array | None = None
    track: Track | None = None
    doubt: Array = field(default_factory=lambda: np.zeros((2, 2)))
    yaw_doubt: float = 0.0
    looked: Time = 0
    stamp: Time = 0
    said: Time = 0
    memory: Memory = field(default_factory=Memory)
    unreadable: int = 0


class TrackerService(SeeingService):
    """Publishes the object's state with every picture, and while none comes what it must be by now.

    The object is followed in the frame of the odometry, which never jumps. On the map it would seem to move whenever
    mapping finds that the robot is elsewhere.
    """

    name = "tracker"
    Config = TrackerConfig

    image = Input(topics.IMAGE)
    depth = Input(topics.DEPTH)
    odometry = Input(topics.ODOMETRY)
    robot = Input(topics.ROBOT_POSE)
    status = Input(topics.STATUS)
    scan = Input(topics.SCAN)
    object = Output(topics.OBJECT_STATE)
    annotations = Output(topics.IMAGE_ANNOTATIONS)
    tick = Timer(_PERIOD)

    config: TrackerConfig
    state: TrackerState

    def __init__(self, config: TrackerConfig) -> None:
        super().__init__(config)
        self.state = TrackerState()
        self._finder = finder_of(config)

    @on(odometry)
    def moved(self, odometry: Odometry, now: Time) -> Effects:
        """Note where the robot is: what is seen is seen from there."""
        state = self.state
        pose = np.array((odometry.pose.x, odometry.pose.y, odometry.pose.theta))
        if state.robots.leaps(odometry.stamp, pose):
            if state.track is not None:
                state.track.carry(state.robots.poses[-1], pose)
            state.robots, state.origin = History(), None
            yield self.say("the odometry has begun anew: the object is taken to be where it was", now, "WARNING")
        state.robots.add(odometry.stamp, pose, _REMEMBERED)

    @on(robot)
    def localised(self, robot: RobotPose, now: Time) -> None:
        """Note where the odometry's frame is on the map."""
        if self.state.robots.stamps:
            there = self.state.robots.at(robot.stamp)
            back = between(there, np.zeros(3))
            self.state.origin = compose(np.array((robot.pose.x, robot.pose.y, robot.pose.theta)), back)

    @on(image)
    def see(self, image: CompressedImage, now: Time) -> Effects:
        """Look for the object in a picture."""
        if self.config.finds != "depth":
            yield from self._look(image, now)

    @on(depth)
    def feel(self, depth: CompressedImage, now: Time) -> Effects:
        """Look for the object in depths."""
        if self.config.finds == "depth":
            yield from self._look(depth, now)

    @on(tick)
    def go_on(self, now: Time) -> Effects:
        """Say where the object must be while no picture comes."""
        state = self.state
        if state.track is None or now - state.looked <= nanoseconds(_SILENT) or not state.robots.stamps:
            return
        if state.origin is None:
            return
        yield self._say(self._ahead(state.track, now), now)

    def _look(self, image: CompressedImage, now: Time) -> Effects:
        state, camera, mount = self.state, self._camera, self._mount
        stamp = taken(image)
        if camera is None or mount is None or not state.robots.stamps or stamp <= state.stamp:
            return
        try:
            picture = decoded(image, camera, self._finder.decoding, self._finder.kind)
        except BadPicture as error:
            state.unreadable += 1
            yield self.say(str(error), now, "WARNING")
            return
        if stamp < state.robots.stamps[0] - nanoseconds(_EARLIER):
            state.unreadable += 1
            yield self.say("picture too old to know where the robot was", now, "WARNING")
            return
        state.looked, state.stamp = now, stamp
        pose = state.robots.at(stamp)
        if state.track is not None:
            self._predict(state.track, stamp)
        diameter = 0.0 if self.status is None else self.status.diameter
        free = passed(self.scan if self.config.finds == "appearance" else None)
        seen = self._finder.find(picture, View(camera, mount, self._hint(pose), free, diameter), state.memory)
        if seen is not None:
            self._take(seen, pose, stamp)
        yield self.annotations(lines([] if seen is None else seen.outlines, image.timestamp))
        if state.track is not None and state.origin is not None:
            # Where it was predicted meanwhile, time does not go back for those who listen.
            said = max(stamp, state.said)
            yield self._say(self._ahead(state.track, said), said)

    def _take(self, seen: Sighting, pose: Array, stamp: Time) -> None:
        turned = rotation(float(pose[2]))
        reading = Reading(
            place=turned @ seen.place + pose[:2],
            covariance=turned @ seen.covariance @ turned.T,
            yaw=None if seen.yaw is None else wrap(seen.yaw + float(pose[2])),
            yaw_variance=seen.yaw_variance,
            diameter=self.config.diameter or seen.diameter,
        )
        self.state.doubt, self.state.yaw_doubt = turned @ seen.doubt @ turned.T, seen.yaw_doubt
        if self.state.track is None:
            self.state.track = Track.begin(reading, stamp, self.config)
        else:
            self.state.track.correct(reading, self.config)

    def _ahead(self, track: Track, stamp: Time) -> Track:
        """Return the track gone on to `stamp`. A copy: pictures that are on their way may be older."""
        ahead = replace(track)
        self._predict(ahead, stamp)
        return ahead

    def _predict(self, track: Track, stamp: Time) -> None:
        robot = self.state.robots.at(stamp)[:2]
        track.predict(stamp, robot, 0.0 if self.status is None else self.status.diameter, self.config)

    def _hint(self, pose: Array) -> Hint | None:
        """Return where the object should be, base frame, `pose` being the robot's; None before it was seen."""
        track = self.state.track
        if track is None:
            return None
        turned = rotation(-float(pose[2]))
        yaw = wrap(float(track.yaw[0] - pose[2])) if track.oriented else None
        age = (self.state.stamp - track.seen) / SECOND
        return Hint(
            turned @ (track.mean[:2] - pose[:2]),
            turned @ track.covariance[:2, :2] @ turned.T,
            yaw,
            float(track.yaw_covariance[0, 0]),
            track.diameter,
            age,
        )

    def _say(self, track: Track, stamp: Time) -> Publication:
        """Say where the object is on the map. Where the odometry's frame is there has to be known."""
        origin, self.state.said = self.state.origin, stamp
        assert origin is not None
        turned = rotation(float(origin[2]))
        place = origin[:2] + turned @ track.mean[:2]
        covariance = turned @ (track.covariance[:2, :2] + self.state.doubt) @ turned.T
        yaw_variance = float(track.yaw_covariance[0, 0]) + self.state.yaw_doubt
        if self.robot is not None and len(self.robot.covariance) == 9:
            # Seen from where the robot is taken to be: its error is the object's as well.
            off = turned @ (track.mean[:2] - self.state.robots.at(stamp)[:2])
            lever = np.array([[1.0, 0.0, -off[1]], [0.0, 1.0, off[0]]])
            pose = np.array(self.robot.covariance).reshape(3, 3)
            covariance, yaw_variance = covariance + lever @ pose @ lever.T, yaw_variance + float(pose[2, 2])
        said = ObjectState(
            stamp=stamp,
            position=Vector2(x=place[0], y=place[1]),
            diameter=track.diameter,
            covariance=covariance.ravel().tolist(),
            visibility=track.visibility(stamp, self.config),
        )
        if track.oriented:
            said.yaw, said.yaw_variance = wrap(float(track.yaw[0] + origin[2])), yaw_variance
        return self.object(said)
