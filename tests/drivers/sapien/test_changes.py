"""Things that come and go in a scene: in the world, before the sensors, on the map of truth, and in experiments."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from drivers.sapien import objects, scene
from drivers.sapien.base import BaseModel
from drivers.sapien.occupancy import rasterise
from drivers.sapien.rays import Rooms
from drivers.sapien.scene import DiscObstacle, Scene
from drivers.sapien.world import SUBSTEP, World
from experiments.dynamic import changing
from experiments.session import prepare, run
from runtime import state as snapshots
from runtime.config.layers import Layer
from runtime.messages import OccupancyGrid
from runtime.sample import Sample

BASE = BaseModel()
POST = DiscObstacle(x=1.0, y=0.0, radius=0.1, since=2.0, until=4.0)


def room(post: DiscObstacle = POST) -> Scene:
    """Return the open floor with the base at the middle, and something before it for a while."""
    empty = scene.get("open")
    robot, thing = scene.Place(x=0.0, y=0.0), scene.Place(x=0.0, y=3.0)
    return msgspec.structs.replace(empty, robot=robot, object=thing, discs=(post,))


def world(post: DiscObstacle = POST) -> World:
    return World(room(post), objects.draw(objects.get("can"), np.random.default_rng(1)), BASE)


def test_a_scene_says_what_stands_when() -> None:
    empty = len(room().obstacles(0.0))
    assert [len(room().obstacles(time)) - empty for time in (1.99, 2.0, 3.99, 4.0)] == [0, 1, 1, 0]
    assert room().changes() == (2.0, 4.0)
    assert scene.get("living-room").changes() == ()


def test_the_base_runs_into_what_has_come_and_not_into_what_is_gone() -> None:
    there = world()
    there.command(0.4, 0.0, 0.0)
    there.step(round(3.9 / SUBSTEP))
    # It stops at the post: centre to centre the radii.
    assert there.robot_hit
    assert there.robot_pose[0] == pytest.approx(1.0 - 0.1 - BASE.diameter / 2, abs=0.02)
    there.step(round(4.0 / SUBSTEP) - there.substeps)
    there.command(0.4, 0.0, 0.0)
    there.step(round(2.0 / SUBSTEP))
    assert there.robot_pose[0] > 1.2
    never = world(msgspec.structs.replace(POST, since=5.0, until=6.0))
    never.command(0.4, 0.0, 0.0)
    never.step(round(4.9 / SUBSTEP))
    assert never.robot_pose[0] > 1.2


def test_a_world_restored_before_a_change_sees_it_alike() -> None:
    one = world()
    one.command(0.4, 0.0, 0.0)
    one.step(round(1.5 / SUBSTEP))
    state = one.state()
    other = world()
    other.restore(state)
    for each in (one, other):
        each.step(round(3.5 / SUBSTEP))
    assert snapshots.encode(one.state()) == snapshots.encode(other.state())


@pytest.mark.parametrize("parts", [1, 7, 400])
def test_a_change_comes_at_its_time_however_the_steps_are_cut(parts: int) -> None:
    whole, cut = world(), world()
    for each in (whole, cut):
        each.command(0.4, 0.0, 0.0)
    total = round(4.4 / SUBSTEP)
    whole.step(total)
    done = 0
    while done < total:
        count = min(math.ceil(total / parts), total - done)
        cut.step(count)
        done += count
    assert snapshots.encode(whole.state()) == snapshots.encode(cut.state())


def test_sensors_and_maps_have_it_from_then_to_then() -> None:
    rooms = Rooms(room())
    assert [len(rooms.at(time).discs) for time in (0.0, 1.9, 2.0, 3.9, 4.0, 99.0)] == [0, 0, 1, 1, 0, 0]
    occupied = [int((rasterise(room(), time=time).cells == 100).sum()) for time in (0.0, 3.0, 5.0)]
    assert occupied[0] == occupied[2]
    # At least as many cells as the disc has area, at most as its square with a cell more on each side.
    assert math.pi * 0.1**2 / 0.05**2 <= occupied[1] - occupied[0] <= (0.3 / 0.05) ** 2


def test_truth_publishes_a_map_for_each_change() -> None:
    maps: list[OccupancyGrid] = []

    def take(sample: Sample) -> None:
        if sample.topic == "map":
            maps.append(OccupancyGrid.FromString(sample.payload))

    values = {"scene": "childrens-room", "seed": 3, "changing": True, "time_limit": 12.0}
    session = prepare([Layer("test", {"sim": values})])
    run(session, sinks=[take])
    moments = session.effective.sections["driver"].scene.changes()  # type: ignore[attr-defined]
    assert len(moments) == 3
    assert [one.version for one in maps] == list(range(1, 1 + sum(moment < 12.0 for moment in moments) + 1))
    began = maps[0].stamp
    for one, moment in zip(maps[1:], moments, strict=False):
        assert (one.stamp - began) * 1e-9 == pytest.approx(moment, abs=0.06)


@pytest.mark.parametrize("seed", range(1, 6))
def test_drawn_changes_are_in_the_corridor_ahead_and_leave_a_way(seed: int) -> None:
    home = scene.get("childrens-room")
    body = objects.draw(objects.get("cart"), np.random.default_rng(seed))
    drawn = changing(home, body, BASE.diameter, seed)
    assert drawn == changing(home, body, BASE.diameter, seed)
    come = [one for one in drawn.discs if one.since > 0.0]
    assert len(come) == 2 and len(drawn.discs) == len(home.discs) + 2
    gone = [one.label for one in (*drawn.boxes, *drawn.discs) if one.until < scene.FOR_EVER]
    assert len(gone) == 1
    for one in come:
        away = math.hypot(one.x - home.object.x, one.y - home.object.y)
        assert away > 0.5, "put down on the object"
    assert [one.label for one in home.boxes] == [one.label for one in drawn.boxes]
