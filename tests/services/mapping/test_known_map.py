"""The mapping service on a map that was made before."""

from __future__ import annotations

import base64
import math
import zlib

import cv2
import msgspec
import numpy as np
import pytest

from services.geometry.pose import between
from services.mapping.config import BadKnownMap, KnownMap, MappingConfig
from services.mapping.grid import hollow
from services.mapping.service import MappingService
from tests.services.mapping.driving import START, Drive, cell, drive, occupied_near, path, square
from tests.services.mapping.rooms import WALLS, Array

CORNER = np.array([-0.53, -0.48])
"""m, not on whole cells, as the corners of maps are that were made elsewhere"""


def plan(walls: Array = WALLS) -> KnownMap:
    """Return a floor plan: cells that a wall passes through, and all others free."""
    cells = np.zeros((120, 160), np.uint8)
    for a, b in walls:
        for share in np.linspace(0.0, 1.0, 2000):
            i, j = np.floor((a + share * (b - a) - CORNER) / 0.05).astype(int)
            cells[j, i] = 100
    return KnownMap.of(cells, CORNER)


def driven(found: Drive, count: int = 0) -> tuple[list[float], list[float]]:
    """Drive the round; return how far off the poses were, m, and by how much turned, rad."""
    there = path()[: count or None]
    for pose in there:
        found.to(pose)
    off = [(math.hypot(*between(p, np.array((one.pose.x, one.pose.y, 0.0)))[:2]),
            abs(math.remainder(one.pose.theta - p[2], math.tau)))
           for one, p in zip(found.poses, there[-len(found.poses):], strict=True)]  # fmt: skip
    return [one for one, _ in off], [one for _, one in off]


def test_the_base_is_located_in_a_known_map_and_the_map_stays() -> None:
    """The plan's surfaces are the middles of cells, so up to half a cell off the walls."""
    found = drive(known=plan(), wait=0.0)
    off, turned = driven(found)
    assert not found.logs
    assert np.mean(off) < 0.03 and max(off) < 0.06
    assert np.mean(turned) < 0.01
    last = found.maps[-1]
    assert (last.width, last.height) == (160, 120)
    assert (last.origin.x, last.origin.y) == pytest.approx(CORNER)
    for wall in WALLS:
        for share in np.linspace(0.1, 0.9, 9):
            assert occupied_near(last, wall[0] + share * (wall[1] - wall[0]), 0.08)


def thick(walls: Array = WALLS) -> KnownMap:
    """Return the plan with walls 0.3 m thick, away from the room, and a pillar that is full: as floor plans have it."""
    grid = plan(walls).grid().copy()
    free = np.zeros_like(grid)
    flood = grid.copy()
    start = np.floor((START[:2] - CORNER) / 0.05).astype(int)
    cv2.floodFill(flood, None, (int(start[0]), int(start[1])), 50)
    free[flood == 50] = 1
    near = cv2.dilate(free, np.ones((13, 13), np.uint8)) > 0
    return KnownMap.of(np.where(free > 0, np.uint8(0), np.where(near, np.uint8(100), np.uint8(255))), CORNER)


def test_on_thick_walls_the_base_is_located_as_well_and_does_not_jump() -> None:
    """Without surfaces scans lie anywhere within the wall: the pose jumps by most of a cell from scan to scan."""
    found = drive(known=thick(), wait=0.0)
    off, _ = driven(found)
    assert np.mean(off) < 0.03 and max(off) < 0.06
    there = path()[-len(found.poses) :]
    error = np.array([(one.pose.x - p[0], one.pose.y - p[1]) for one, p in zip(found.poses, there, strict=True)])
    jumps = np.hypot(*np.diff(error, axis=0).T)
    assert np.percentile(jumps, 99) < 0.02 and jumps.max() < 0.03, (np.percentile(jumps, 99), jumps.max())


def test_only_what_a_beam_can_meet_stays_of_what_is_thick() -> None:
    shown = np.full((7, 7), 100, np.uint8)
    shown[0] = 0
    shown[6] = 255
    left = hollow(shown)
    assert (left[1] == 100).all() and (left[2:6] == 255).all()
    assert (left[0] == 0).all() and (left[6] == 255).all()


def test_the_start_is_searched_for_where_it_is_not_known() -> None:
    service = MappingService(
        MappingConfig(start=(0.0, 0.0, 0.0), known=plan(), search=True, particles=8, wait=0.0)
    )  # fmt: skip
    found = Drive(service)
    off, turned = driven(found, 120)
    assert len(found.poses) >= 118, "a pose with the first scan on"
    assert max(off) < 0.08 and max(turned) < 0.03


def test_the_start_is_found_before_the_object_is_which_asks_for_it() -> None:
    found = Drive(MappingService(MappingConfig(known=plan(), search=True, particles=8)))
    for _ in range(4):
        found.to(START)
    assert found.poses and not found.maps, "nothing is drawn yet: the object could be among it"
    assert math.hypot(found.poses[-1].pose.x - START[0], found.poses[-1].pose.y - START[1]) < 0.08
    found.object = np.array([1.6, 0.9])
    for _ in range(10):
        found.to(START)
    assert found.maps and not occupied_near(found.maps[-1], found.object, 0.12)
    (said,) = found.logs
    assert "found on the known map" in said and int(said.split("% of the beams")[0].split()[-1]) > 90


@pytest.mark.parametrize(("start", "walls"), [(START, WALLS * (0.8, 1.3)), (START + np.array([0.3, 0.3, 0.3]), WALLS)])
def test_another_map_or_another_start_is_doubted(start: Array, walls: Array) -> None:
    config = MappingConfig(start=tuple(start), known=plan(), particles=8, wait=0.0)
    found = Drive(MappingService(config), walls=walls)
    for _ in range(4):
        found.to(START)
    assert len(found.logs) == 1 and "is it the map of this place" in found.logs[0]


def test_what_is_new_is_drawn_over_the_known_map_and_what_is_gone_leaves_it() -> None:
    gone, new = np.array([2.6, 1.6]), np.array([2.2, 0.9])
    found = drive(known=plan(np.concatenate([WALLS, square(*gone, 0.3)])), wait=0.0)
    found.to(START)
    found.to(START)
    found.walls = np.concatenate([WALLS, square(*new, 0.3)])
    assert occupied_near(found.maps[-1], gone, 0.25)
    assert not occupied_near(found.maps[-1], new, 0.25)
    for _ in range(40):
        found.to(START)
    assert occupied_near(found.maps[-1], new, 0.25)
    assert not occupied_near(found.maps[-1], gone - np.array([0.15, 0.0]), 0.1), "its side that can be seen"
    assert cell(found.maps[-1], 6.9, 5.4) != 255, "what the plan said out of sight stays"


def test_a_known_map_survives_the_configuration() -> None:
    config = MappingConfig(known=plan())
    again = msgspec.convert(msgspec.to_builtins(config), MappingConfig)
    assert again.known is not None and config.known is not None
    assert np.array_equal(again.known.grid(), config.known.grid())
    assert set(np.unique(again.known.grid())) == {0, 100}


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ("not base64", "expected base64"),
        (base64.b64encode(b"no zlib").decode(), "expected base64"),
        (base64.b64encode(zlib.compress(b"\0" * 5)).decode(), "not 2 x 3"),
        (base64.b64encode(zlib.compress(b"\0" * 7)).decode(), "not 2 x 3"),
        (base64.b64encode(zlib.compress(b"\0\0\0\0\0\7")).decode(), "7 in a cell"),
    ],
)
def test_what_is_no_map_is_refused(cells: str, said: str) -> None:
    with pytest.raises(BadKnownMap, match=said):
        MappingService(MappingConfig(known=KnownMap(cells=cells, width=2, height=3, x=0.0, y=0.0)))


def test_a_service_with_a_known_map_goes_on_alike_to_the_byte() -> None:
    found, other = drive(known=plan(), wait=0.0), drive(known=plan(), wait=0.0)
    there = path()[:140]
    for pose in there[:80]:
        found.to(pose)
    other.service.restore(found.service.snapshot(), dict(found.service.latest))
    other.now, other.odometry, other.last, other.sequence = found.now, found.odometry.copy(), found.last, found.sequence
    found.generator = np.random.Generator(np.random.PCG64(9))
    other.generator = np.random.Generator(np.random.PCG64(9))
    first = len(found.poses)
    for pose in there[80:]:
        found.to(pose)
        other.to(pose)
    assert [one.SerializeToString() for one in found.poses[first:]] == [one.SerializeToString() for one in other.poses]
    assert found.service.snapshot() == other.service.snapshot()
