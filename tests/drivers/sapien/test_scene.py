from __future__ import annotations

import msgspec
import numpy as np
import pytest

from drivers.sapien import objects, scene
from drivers.sapien.scene import Scene, SceneError, UnknownScene

GOOD = """
name = "x"
title = "X"
bounds = { min_x = 0.0, min_y = 0.0, max_x = 4.0, max_y = 3.0 }
boxes = [{ x = 1.0, y = 1.0, length = 0.5, width = 0.2, label = "table" }]
discs = [{ x = 3.0, y = 2.0, radius = 0.1 }]
robot = { x = 0.5, y = 0.5 }
object = { x = 1.2, y = 0.5 }
goal = { x = 3.0, y = 1.0 }
default_object = "can"
"""


def test_all_scenes_load_and_name_an_object_that_exists() -> None:
    expected = {"living-room", "1A", "1B", "2A", "2B", "corridor-1", "corridor-2", "corridor-3", "wide-bend"}
    recovery = {f"recovery-{what}" for what in ("stuck", "wall", "corner", "front", "overshot", "lost")}
    assert expected | recovery | {"childrens-room", "open"} == set(scene.names())
    for name in scene.names():
        one = scene.get(name)
        assert one.name == name
        assert one.default_object in objects.names()


def test_unknown_scene_is_told_what_exists() -> None:
    with pytest.raises(UnknownScene, match=r"'kitchen'.*1A, 1B.*wide-bend"):
        scene.get("kitchen")


def test_name_is_no_way_out_of_the_folder() -> None:
    with pytest.raises(UnknownScene):
        scene.get("../objects")


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("goal", "gaol", r"room\.toml: .*gaol"),
        ("radius = 0.1", "radius = 0.0", r"room\.toml: .*> 0\.0.*discs\[0\]\.radius"),
        ("x = 3.0, y = 1.0", "x = nan, y = 1.0", r"room\.toml: .*goal\.x"),
        ("x = 3.0, y = 1.0", "x = inf, y = 1.0", r"room\.toml: .*goal\.x"),
        ("max_x = 4.0", "max_x = -4.0", r"room\.toml: .*expected less than max.*bounds"),
        ('name = "x"', "name = 3", r"room\.toml: .*str.*name"),
        ('label = "table"', 'colour = "red"', r"room\.toml: .*boxes\[0\]\.colour"),
        ("goal = { x = 3.0, y = 1.0 }", "", r"room\.toml: .*goal"),
        ("[{", "[", r"room\.toml: "),
    ],
)
def test_bad_scene_is_refused_with_file_and_key(before: str, after: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        scene.load(GOOD.replace(before, after), "room.toml")


def test_scene_survives_encoding() -> None:
    one = scene.load(GOOD, "room.toml")
    assert msgspec.json.decode(msgspec.json.encode(one), type=Scene) == one


def test_obstacles_are_walls_boxes_and_discs() -> None:
    one = scene.load(GOOD, "room.toml")
    walls = scene.outer_walls(one.bounds)
    assert len(one.obstacles()) == len(walls) + 2
    # The inside stays free: each wall's inner face is the room's bound.
    assert [wall.y + wall.width / 2 for wall in walls[:1]] == pytest.approx([0.0])
    assert walls[3].x - walls[3].length / 2 == pytest.approx(4.0)


def test_jitter_is_seeded_and_within_its_range() -> None:
    one = scene.load(GOOD, "room.toml")
    generator = np.random.default_rng(1)
    shifted = [scene.jittered(one, generator) for _ in range(200)]
    assert shifted[0] == scene.jittered(one, np.random.default_rng(1))
    aside = np.array([[s.object.x - one.object.x, s.object.y - one.object.y] for s in shifted])
    assert np.abs(aside).max() <= one.jitter.object_position
    assert np.abs(aside).max() > 0.9 * one.jitter.object_position
    turned = max(abs(s.robot.yaw - one.robot.yaw) for s in shifted)
    assert 0.9 * one.jitter.robot_yaw < turned <= one.jitter.robot_yaw
    still = msgspec.structs.replace(one, jitter=scene.Jitter(
        robot_position=0.0, robot_yaw=0.0, object_position=0.0, object_yaw=0.0
    ))  # fmt: skip
    assert scene.jittered(still, generator) == still
