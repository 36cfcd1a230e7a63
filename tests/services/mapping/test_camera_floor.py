"""What the mapping service draws of the floor that the camera sees."""

from __future__ import annotations

import math

import numpy as np

from runtime.messages import (
    SeenFloor,
    Vector2,
)
from runtime.time import SECOND
from tests.services.mapping.driving import (
    OBJECT,
    START,
    Drive,
    drive,
    occupied_near,
)


def look_down(found: Drive, *stretches: tuple[float, float, float, bool]) -> None:
    """Give the service what the camera, 0.12 m ahead of the base's middle, sees of the floor now."""
    bearing, first, last, met = zip(*stretches, strict=True)
    place = Vector2(x=0.12)
    found.give("floor", SeenFloor(stamp=found.now, position=place, bearing=bearing, first=first, last=last, met=met))


def test_what_the_camera_sees_behind_the_object_is_on_the_map_and_goes_from_it() -> None:
    """The base stands at (0.8, 0.8), heading along x; the object stands ahead, and something where no beam comes."""
    object, thing = np.array([1.3, 0.8]), np.array([2.42, 0.8])
    bearings = np.arange(-0.1, 0.11, 0.02)
    # Of the object its foot is met, and its top, 1.4 times as far; then the floor is seen as far as the thing.
    own = [(b, 0.2, 0.3, True) for b in bearings] + [(b, 0.7, 0.75, True) for b in bearings]
    found = drive()
    found.object = object
    for _ in range(40):
        found.to(START)
        if not found.sequence % 4:
            look_down(found, *own, *[(b, 0.95, 1.42, True) for b in bearings])
    assert occupied_near(found.maps[-1], thing, 0.1)
    assert not occupied_near(found.maps[-1], object, 0.2)
    assert not any(occupied_near(found.maps[-1], np.array([x, 0.8]), 0.1) for x in np.arange(1.4, 2.15, 0.1))
    for _ in range(40):
        found.to(START)
    assert occupied_near(found.maps[-1], thing, 0.1)  # no beam has passed there since
    for _ in range(40):
        found.to(START)
        if not found.sequence % 4:
            look_down(found, *own, *[(b, 0.95, 2.0, False) for b in bearings])
    assert not occupied_near(found.maps[-1], thing, 0.1)


def test_where_a_wall_is_known_the_camera_adds_none_before_it() -> None:
    found = drive()
    found.object = OBJECT
    for _ in range(40):
        found.to(START)
    for off in (0.0, 0.04, 0.08):
        for _ in range(20):
            found.to(START)
            # The wall below the robot, seen a little too near.
            look_down(found, *[(b, 0.3, (0.8 - off) / -math.sin(b), True) for b in np.arange(-1.9, -1.2, 0.02)])
    before = [np.array([x, y]) for x in np.arange(0.5, 1.4, 0.05) for y in (0.1, 0.15)]
    assert not any(occupied_near(found.maps[-1], place, 0.04) for place in before)


def test_floor_that_makes_no_sense_or_is_of_another_time_harms_nothing() -> None:
    found = drive()
    found.object = OBJECT
    look_down(found, (0.0, 0.2, 1.0, True))
    for _ in range(40):
        found.to(START)
    before, now = found.service.snapshot(), found.now
    found.now = SECOND // 100
    look_down(found, (0.0, 0.2, 1.0, True))
    found.now = now + SECOND  # the odometry has stopped: nobody knows from where this was seen
    look_down(found, (0.0, 0.2, 1.0, True))
    found.now = now
    assert found.service.snapshot() == before
    columns = SeenFloor(stamp=found.now, bearing=[0.0], first=[0.1, 0.2], last=[1.0], met=[True])
    (said,) = found.service.looked_down(columns, found.now)  # type: ignore[misc]
    assert "[1, 2, 1, 1]" in said.message.message
    assert found.service.snapshot() == before
