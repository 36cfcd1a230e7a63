from __future__ import annotations

from heapq import heappop, heappush
from math import cos, hypot, sin

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from drivers.sapien import objects, scene
from drivers.sapien.occupancy import Grid, rasterise
from drivers.sapien.scene import Bounds, BoxObstacle, DiscObstacle, Goal, Place, Scene

ROBOT_RADIUS = 0.23
EMPTY = Scene(
    name="e", title="E", bounds=Bounds(min_x=-1.0, min_y=-0.5, max_x=1.0, max_y=1.0),
    robot=Place(x=0.0, y=0.0), object=Place(x=0.5, y=0.0), goal=Goal(x=0.5, y=0.5), default_object="can",
)  # fmt: skip
WIDE = msgspec.structs.replace(EMPTY, bounds=Bounds(min_x=-1.5, min_y=-1.5, max_x=1.5, max_y=1.5))


def test_empty_room_is_free_inside_its_walls() -> None:
    grid = rasterise(EMPTY)
    assert grid.cells.dtype == np.uint8
    assert grid.origin == pytest.approx((-1.1, -0.6))
    assert grid.cells.shape == (34, 44)
    assert (grid.cells[2:-2, 2:-2] == 0).all()
    grid.cells[2:-2, 2:-2] = 100
    assert (grid.cells == 100).all()


def test_box_on_cell_borders_takes_exactly_its_cells() -> None:
    box = BoxObstacle(x=0.1, y=0.2, length=0.2, width=0.1)
    grid = rasterise(msgspec.structs.replace(EMPTY, boxes=(box,)))
    taken = np.argwhere(grid.cells[2:-2, 2:-2] == 100)
    assert len(taken) == 8
    assert taken.min(axis=0).tolist() == [13, 20]


place = st.floats(-0.6, 0.6)


def touched(grid: Grid, points: NDArray[np.float64]) -> NDArray[np.uint8]:
    index = np.floor((points - np.array(grid.origin)) / grid.resolution).astype(int)
    return np.asarray(grid.cells[index[:, 1], index[:, 0]])


@settings(max_examples=40)
@given(place, place, st.floats(-3, 3), st.floats(0.02, 0.5), st.floats(0.02, 0.5))
def test_every_point_of_a_box_is_in_an_occupied_cell_and_no_cell_is_far(
    x: float, y: float, yaw: float, length: float, width: float
) -> None:
    box = BoxObstacle(x=x, y=y, yaw=yaw, length=length, width=width)
    grid = rasterise(msgspec.structs.replace(WIDE, boxes=(box,)))
    inner = np.stack(np.meshgrid(np.linspace(-0.4999, 0.4999, 41), np.linspace(-0.4999, 0.4999, 41)), -1)
    own = inner.reshape(-1, 2) * [length, width]
    turn = np.array([[cos(yaw), -sin(yaw)], [sin(yaw), cos(yaw)]])
    assert (touched(grid, (own @ turn.T + [x, y])) == 100).all()
    rows, columns = np.nonzero(grid.cells[2:-2, 2:-2])
    centre = np.stack([columns + 2.5, rows + 2.5], axis=1) * grid.resolution + np.array(grid.origin)
    back = np.abs((centre - [x, y]) @ turn) - [length / 2, width / 2]
    outside = np.hypot(*np.maximum(back, 0).T)
    assert outside.max(initial=0.0) <= grid.resolution / 2**0.5 + 1e-6


@settings(max_examples=40)
@given(place, place, st.floats(0.01, 0.35))
def test_disc_takes_exactly_the_cells_it_overlaps(x: float, y: float, radius: float) -> None:
    grid = rasterise(msgspec.structs.replace(WIDE, discs=(DiscObstacle(x=x, y=y, radius=radius),)))
    angle = np.linspace(0, 2 * np.pi, 721)
    rim = np.array([x, y]) + 0.999 * radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert (touched(grid, rim) == 100).all()
    rows, columns = np.nonzero(grid.cells[2:-2, 2:-2])
    low = np.stack([columns + 2, rows + 2], axis=1) * grid.resolution + np.array(grid.origin)
    nearest = np.clip([x, y], low, low + grid.resolution)
    assert np.hypot(*(nearest - [x, y]).T).max() <= radius


def clearance(grid: Grid) -> NDArray[np.float64]:
    """Distance of each cell's centre from the nearest occupied cell's edge, m, at worst a little short."""
    return np.asarray(distance_transform_edt(grid.cells == 0) * grid.resolution - grid.resolution / 2)


def widest(room: NDArray[np.float64], start: tuple[int, int], end: tuple[int, int]) -> float:
    """The largest clearance that a path from start to end can keep all the way."""
    best = np.full(room.shape, -1.0)
    best[start] = room[start]
    queue = [(-room[start], start)]
    while queue:
        found, cell = heappop(queue)
        if cell == end:
            return float(-found)
        for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            other = (cell[0] + step[0], cell[1] + step[1])
            if not (0 <= other[0] < room.shape[0] and 0 <= other[1] < room.shape[1]):
                continue
            reached = min(-found, room[other])
            if reached > best[other]:
                best[other] = reached
                heappush(queue, (-reached, other))
    return 0.0


def cell(grid: Grid, x: float, y: float) -> tuple[int, int]:
    return int((y - grid.origin[1]) / grid.resolution), int((x - grid.origin[0]) / grid.resolution)


def bottleneck(one: Scene) -> float:
    """The largest clearance, m, of the robot's centre that a path from object to goal can keep."""
    grid = rasterise(one, 0.025)
    return widest(clearance(grid), cell(grid, one.object.x, one.object.y), cell(grid, one.goal.x, one.goal.y))


def diameter(name: str) -> float:
    return objects.draw(objects.get(name), np.random.default_rng(0)).diameter


@pytest.mark.parametrize("name", scene.names())
def test_robot_fits_from_start_to_goal(name: str) -> None:
    one = scene.get(name)
    grid = rasterise(one)
    room = clearance(grid)
    start, end = cell(grid, one.robot.x, one.robot.y), cell(grid, one.goal.x, one.goal.y)
    assert widest(room, start, end) >= ROBOT_RADIUS + 0.02
    assert room[cell(grid, one.object.x, one.object.y)] >= 0.3


@pytest.mark.parametrize("name", scene.names())
def test_robot_starts_close_behind_the_object_facing_it(name: str) -> None:
    one = scene.get(name)
    ahead = np.array([one.object.x - one.robot.x, one.object.y - one.robot.y])
    distance = hypot(*ahead)
    for thing in objects.names():
        gap = distance - ROBOT_RADIUS - diameter(thing) / 2
        assert 0.05 + one.jitter.robot_position + one.jitter.object_position < gap <= 0.46
    facing = np.array([cos(one.robot.yaw), sin(one.robot.yaw)])
    assert ahead @ facing / distance == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("name", ["1A", "2A", "2B"])
def test_narrow_rooms_have_a_passage_where_the_object_corridor_vanishes(name: str) -> None:
    """c < d_r + d_o / 2, for the smallest object; the robot still fits."""
    smallest = min(diameter(thing) for thing in objects.names())
    assert ROBOT_RADIUS + 0.1 < bottleneck(scene.get(name)) < 2 * ROBOT_RADIUS + smallest / 2


def test_1b_keeps_an_object_corridor() -> None:
    assert bottleneck(scene.get("1B")) > 2 * ROBOT_RADIUS + 0.23


@pytest.mark.parametrize("name", ["corridor-1", "corridor-2", "corridor-3"])
def test_corridors_have_the_half_widths_they_claim(name: str) -> None:
    """Half width of the pushing corridor, W_p = c - d_r / 2."""
    assert 0.60 <= bottleneck(scene.get(name)) - ROBOT_RADIUS <= 0.75


def test_wide_bend_has_a_half_width_of_095_or_more() -> None:
    assert bottleneck(scene.get("wide-bend")) - ROBOT_RADIUS >= 0.95


def test_living_room_is_wide_and_bends() -> None:
    one = scene.get("living-room")
    assert bottleneck(one) - ROBOT_RADIUS >= 0.9
    start, end = np.array([one.object.x, one.object.y]), np.array([one.goal.x, one.goal.y])
    assert 4.0 <= hypot(*(end - start)) <= 5.0
    line = start + np.linspace(0, 1, 200)[:, None] * (end - start)
    assert (touched(rasterise(one), line) == 100).any(), "a straight push would reach the goal"
