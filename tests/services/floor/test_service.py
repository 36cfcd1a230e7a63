"""The floor service: what it says of pictures whose truth is known, of bad ones, and how it goes on."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import pytest
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from runtime.messages import CompressedImage, LaserScan, Log, RobotStatus, SeenFloor
from runtime.service import Publication
from runtime.time import SECOND, Time
from services.floor.config import FloorConfig
from services.floor.service import FloorService
from tests.services.tracker.scenes import Thing, calibration_of, camera, cast, measured, mount, picture, transform_of

EYE, ON = camera(), mount()
THING = Thing(1.0, 0.2, 0.3, 0.2, 0.5, height=0.3)
BEHIND = Thing(1.9, 0.2, 0.25, height=0.3, colour=(40, 90, 160))


@dataclass
class Fed:
    """A floor service and what it has said."""

    service: FloorService
    now: Time = SECOND
    seen: list[SeenFloor] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def give(self, topic: str, message: Message) -> None:
        """Give the service a message, and keep what it publishes."""
        self.service.latest[topic] = message
        handler = self.service.contract.handlers.get(topic)
        for one in (getattr(self.service, handler)(message, self.now) if handler else None) or ():
            assert isinstance(one, Publication)
            if isinstance(one.message, SeenFloor):
                self.seen.append(one.message)
            elif isinstance(one.message, Log):
                self.said.append(one.message.message)

    def look(self, image: NDArray[np.uint8] | NDArray[np.uint16], later: Time = SECOND // 5) -> None:
        """Let `later` ns pass, then comes a picture."""
        self.now += later
        depth = image.dtype == np.uint16
        ok, data = cv2.imencode(".png" if depth else ".jpg", image if depth else image[..., ::-1])
        assert ok
        self.give("depth" if depth else "image", taken(self.now, data.tobytes()))


def taken(now: Time, data: bytes) -> CompressedImage:
    return CompressedImage(timestamp=Timestamp(seconds=now // SECOND, nanos=now % SECOND), data=data)


def clear() -> LaserScan:
    """Return a scan that meets nothing within 30 degrees to both sides but the things, which stand left of ahead."""
    bearing = np.radians(np.arange(-60, 61))
    ranges = np.where(bearing < -0.1, 4.0, 0.8)
    found = LaserScan(start_angle=bearing[0], end_angle=bearing[-1], ranges=ranges.tolist())
    found.pose.orientation.w = 1.0
    return found


def floor(**values: object) -> Fed:
    found = Fed(FloorService(FloorConfig(**values)))  # type: ignore[arg-type]
    found.give("status", RobotStatus(diameter=0.45))
    found.give("calibration", calibration_of(EYE))
    found.give("camera/mount", transform_of(ON))
    found.give("scan", clear())
    return found


def ends(message: SeenFloor) -> NDArray[np.float64]:
    """Return where something is met, (N, 2), m, base frame."""
    last, bearing, met = (np.array(one) for one in (message.last, message.bearing, message.met))
    below = (message.position.x, message.position.y)
    return np.asarray((below + last[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)]))[met])


def colours(things: list[Thing], seed: int = 0) -> NDArray[np.uint8]:
    return picture(EYE, ON, things, seed)


def depths(things: list[Thing], seed: int = 0) -> NDArray[np.uint16]:
    return np.asarray(np.rint(1000.0 * measured(cast(EYE, ON, things)[0], seed)), np.uint16)


@pytest.mark.parametrize(("sees", "shot"), [("appearance", colours), ("depth", depths)])
def test_a_thing_and_what_stands_behind_it_are_met_where_they_are(sees: str, shot: object) -> None:
    found = floor(sees=sees)
    for seed in range(8):
        found.look(shot([THING, BEHIND], seed))  # type: ignore[operator]
    met = ends(found.seen[-1])
    off = [np.abs(np.hypot(*(met - [one.x, one.y]).T) - one.diameter / 2) for one in (THING, BEHIND)]
    # The box is within its bounding circle, the other is a cylinder.
    near = np.hypot(*(met - [THING.x, THING.y]).T) < THING.diameter / 2 + 0.02
    assert near.sum() > 8
    # Depths that are 2 m away tell what is 3 cm high from the floor, which is 6 cm of it. An edge is seen on the floor
    # behind, see test_stretches.
    behind = off[1] < (0.07 if sees == "depth" else 0.02)
    assert behind.sum() >= 4
    assert (near | behind).sum() >= len(met) - 3


def test_an_empty_floor_meets_nothing() -> None:
    found = floor()
    for seed in range(8):
        found.look(colours([], seed))
    assert len(found.seen) >= 7
    assert sum(sum(one.met) for one in found.seen) == 0


def test_pictures_that_come_too_soon_and_from_unknown_cameras_are_left_alone() -> None:
    found = floor(period=0.5, sees="depth")
    for _ in range(11):
        found.look(depths([THING]), SECOND // 10)
    assert [one.stamp for one in found.seen] == [SECOND + k * SECOND // 10 for k in (1, 6, 11)]
    blind = Fed(FloorService(FloorConfig(sees="depth")))
    blind.look(depths([THING]))
    assert not blind.seen


@pytest.mark.parametrize("sees", ["appearance", "depth"])
def test_what_is_no_picture_is_said_and_left_out(sees: str) -> None:
    found = floor(sees=sees)
    topic = "depth" if sees == "depth" else "image"
    for data in (b"", b"nothing of the kind", cv2.imencode(".png", np.zeros((10, 20), np.uint8))[1].tobytes()):
        found.now += SECOND
        found.give(topic, taken(found.now, data))
    assert not found.seen
    assert found.service.state.unreadable == 3
    assert "unreadable" in found.said[0]
    assert "20 x 10" in found.said[2]
    assert "640 x 480" in found.said[2]


def test_a_restored_service_goes_on_alike_to_the_byte() -> None:
    found = floor()
    for seed in range(3):
        found.look(colours([THING], seed))
    again = floor()
    again.service.restore(found.service.snapshot(), dict(found.service.latest))
    again.now = found.now
    for one in (found, again):
        one.seen.clear()
        for seed in (5, 6):
            one.look(colours([THING, BEHIND], seed))
    assert [one.SerializeToString() for one in found.seen] == [one.SerializeToString() for one in again.seen]
    assert found.service.snapshot() == again.service.snapshot()
