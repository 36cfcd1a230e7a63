"""Corridors of another width and other starts: distances from the drawings, worked out by hand."""

from __future__ import annotations

import math
from itertools import product

import msgspec
import numpy as np
import pytest
from scipy.ndimage import label

from drivers.sapien import objects, scene, variants
from drivers.sapien.occupancy import rasterise
from drivers.sapien.scene import Scene
from experiments.paper.cells import HOUSEHOLD, ROOMS, SHAPES
from experiments.session import prepare
from replays.goldens import GOLDENS, paths
from replays.recording import load
from runtime.config.layers import ConfigError, Layer
from services.corridor.corridor import build

D_R = 0.46

# Half the passage (m), and points of its middle line far from ends and bends; as drawn in the scene files.
# Not the piece between corridor 3's turns: as it widens its corners draw apart, and it opens by a little more.
MIDDLES = {
    "corridor-1": (0.90, [(1.5, 0.9), (3.8, 2.8)]),
    "corridor-2": (0.94, [(1.1, 1.14), (3.0749, 1.9443), (5.2, 2.7487)]),
    "corridor-3": (0.90, [(1.2, 0.9), (4.9, 2.8)]),
}
FACTORS = (0.85, 1.0, 1.3, 1.8)


def nearest_wall(one: Scene, x: float, y: float) -> float:
    """Return the distance of a point to the nearest obstacle by sampling the edges of all of them, m."""
    found = math.inf
    along = np.linspace(-0.5, 0.5, 4001)
    for box in one.obstacles():
        c, s = math.cos(box.yaw), math.sin(box.yaw)  # type: ignore[union-attr]
        length, width = box.length, box.width  # type: ignore[union-attr]
        for u, v in (
            (along * length, np.full(4001, 0.5 * width)),
            (along * length, np.full(4001, -0.5 * width)),
            (np.full(4001, 0.5 * length), along * width),
            (np.full(4001, -0.5 * length), along * width),
        ):
            px, py = box.x + c * u - s * v, box.y + s * u + c * v
            found = min(found, float(np.hypot(px - x, py - y).min()))
    return found


@pytest.mark.parametrize(("name", "factor"), list(product(MIDDLES, FACTORS)))
def test_the_half_width_of_the_pushing_corridor_is_scaled_and_its_middle_stays(name: str, factor: float) -> None:
    half, points = MIDDLES[name]
    one = variants.widened(scene.get(name), factor, D_R)
    for x, y in points:
        # In the middle a wall on either side is as far; a bend's corner may be nearer than the other side.
        assert nearest_wall(one, x, y) - D_R / 2 == pytest.approx(factor * (half - D_R / 2), abs=2e-3)


@pytest.mark.parametrize("factor", FACTORS)
def test_a_scaled_corridor_has_no_gaps_and_no_bumps(factor: float) -> None:
    # Corridor 1 is an L: its free area is that of two rectangles.
    one = variants.widened(scene.get("corridor-1"), factor, D_R)
    shift = (factor - 1.0) * (0.9 - 0.23)
    half = 0.9 + shift
    area = (4.7 + 2 * shift) * 2 * half + 2 * half * (4.2 + 2 * shift - 2 * half)
    assert reached(one) == pytest.approx(area, rel=0.02)
    # Corridor 3 is a Z of three rectangles.
    one = variants.widened(scene.get("corridor-3"), factor, D_R)
    area = (3.8 + 2 * shift) * 2 * half + (4.2 + 2 * shift) * 2 * half + 2 * half * (3.7 + 2 * shift - 4 * half)
    assert reached(one) == pytest.approx(area, rel=0.02)
    # Corridor 2 is a strip of constant width along a line with two bends of 50 degrees. Offsetting a bent line adds
    # to one side of a bend what it takes from the other. The strip ends half a width beyond the line.
    one = variants.widened(scene.get("corridor-2"), factor, D_R)
    shift = (factor - 1.0) * (0.94 - 0.23)
    half = 0.94 + shift
    slant = (2.7487 - 1.14) / math.sin(math.radians(50.0))
    flat = 6.35 + 2 * shift - slant * math.cos(math.radians(50.0))
    assert reached(one) == pytest.approx(2 * half * (flat + slant), rel=0.02)


def reached(one: Scene) -> float:
    """Return the free area that hangs together with the robot's start, m^2."""
    grid = rasterise(one, 0.01)
    free, _ = label(grid.cells == 0)
    row = int((one.robot.y - grid.origin[1]) / grid.resolution)
    column = int((one.robot.x - grid.origin[0]) / grid.resolution)
    return float((free == free[row, column]).sum()) * grid.resolution**2


def test_the_planned_path_stays_and_its_corridor_has_the_asked_width() -> None:
    widths = {}
    for factor in (1.0, 1.8):
        one = variants.widened(scene.get("corridor-3"), factor, D_R)
        grid = rasterise(one)
        r, o, g = ((place.x, place.y) for place in (one.robot, one.object, one.goal))
        found = build(
            grid.cells, grid.resolution, np.array(grid.origin), np.array(r), np.array(o), np.array(g), D_R, 0.3, cap=3.0
        )
        k = int(np.argmin(np.hypot(found.path[:, 0] - 4.9, found.path[:, 1] - 2.8)))
        # The planner holds to the middle only as far as it wants room beside the path.
        assert math.dist(found.path[k], (4.9, 2.8)) < 0.2
        widths[factor] = found.width_push[k]
    assert widths[1.8] / widths[1.0] == pytest.approx(1.8, rel=0.12)


@pytest.mark.parametrize("name", ["living-room", "1A", "open", "wide-bend"])
def test_a_room_cannot_be_scaled(name: str) -> None:
    with pytest.raises(variants.CannotScale, match=rf"sim.width is 1.3, but scene '{name}'.*corridor-1, corridor-2"):
        variants.widened(scene.get(name), 1.3, D_R)
    with pytest.raises(variants.CannotScale):
        prepare([Layer("test", {"sim": {"scene": name, "width": 1.3}})])
    assert prepare([Layer("test", {"sim": {"scene": name, "width": 1.0}})])


@pytest.mark.parametrize(
    ("place", "start"),
    list(
        product(
            [*product(ROOMS, SHAPES), *product(("corridor-1", "corridor-2", "corridor-3"), HOUSEHOLD)],
            ("behind", "beside", "front"),
        )
    ),
)
def test_the_base_starts_where_asked_and_touches_nothing(place: tuple[str, str], start: str) -> None:
    name, thing = place
    one = scene.get(name)
    body = objects.draw(objects.get(thing), np.random.default_rng(0))
    sides = set()
    grid = rasterise(one, 0.02)
    ys, xs = np.nonzero(grid.cells)
    x, y = grid.origin[0] + (xs + 0.5) * 0.02, grid.origin[1] + (ys + 0.5) * 0.02
    for seed in range(8):
        found = variants.started(one, start, D_R, body.diameter, seed)
        # The scenes' first pushes go along x, or along y in 2A.
        push = (0.0, 1.0) if name == "2A" else (1.0, 0.0)
        dx, dy = found.robot.x - one.object.x, found.robot.y - one.object.y
        along, across = dx * push[0] + dy * push[1], dx * push[1] - dy * push[0]
        apart = D_R / 2 + body.diameter / 2 + variants.START_GAP
        expected = {"behind": (-apart, 0.0), "beside": (0.0, apart), "front": (apart, 0.0)}[start]
        assert (along, abs(across)) == pytest.approx(expected, abs=1e-9)
        # It faces the object.
        facing = (math.cos(found.robot.yaw), math.sin(found.robot.yaw))
        assert facing == pytest.approx((-dx / apart, -dy / apart), abs=1e-4)
        assert found.object == one.object
        sides.add(np.sign(round(across, 6)))
        assert np.hypot(x - found.robot.x, y - found.robot.y).min() > D_R / 2 + 0.03
    if start == "beside" and name.startswith("corridor"):
        assert sides == {-1.0, 1.0}


def test_no_room_to_start_is_said() -> None:
    one = scene.get("corridor-1")
    tight = msgspec.structs.replace(one, bounds=msgspec.structs.replace(one.bounds, max_x=1.9))
    with pytest.raises(variants.NoRoomToStart, match="sim.start is 'front'.*'corridor-1'"):
        variants.started(tight, "front", D_R, 0.3, 1)


def test_an_unknown_start_is_refused() -> None:
    with pytest.raises(ConfigError, match="start"):
        prepare([Layer("test", {"sim": {"start": "above"}})])


def test_the_default_leaves_every_draw_as_recorded() -> None:
    # The recordings were made before starts and widths could be asked for.
    recorded = {path.stem: load(path).config for path in paths()}
    assert set(recorded) == set(GOLDENS)
    for name, config in recorded.items():
        sections = prepare([Layer("test", GOLDENS[name])]).effective.sections
        for node in ("driver", "perception"):
            then = config["sections"][node]
            now = msgspec.json.decode(msgspec.json.encode(sections[node]))
            # The camera is no draw, and nobody looked through it then.
            drawn, before = (
                {key: one for key, one in each["scene"].items() if key != "camera"} for each in (now, then)
            )
            assert drawn == before, (name, node)
            assert now["seed"] == then["seed"]
        now = msgspec.json.decode(msgspec.json.encode(sections["driver"]))
        then = config["sections"]["driver"]["body"]
        # Sums over shapes end in other digits on other processors, where they come to nothing.
        numbers = {key: one for key, one in then.items() if isinstance(one, float)}
        assert {key: now["body"][key] for key in numbers} == pytest.approx(numbers, rel=1e-12, abs=1e-15)
        assert {key: one for key, one in now["body"].items() if key not in numbers} == {
            key: one for key, one in then.items() if key not in numbers
        }
