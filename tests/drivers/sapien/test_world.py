"""The world against closed forms, and to the bit against itself."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys

import msgspec
import numpy as np
import pytest

from drivers.sapien import objects, scene
from drivers.sapien.base import BaseModel, CommandNotFinite
from drivers.sapien.friction import GRAVITY
from drivers.sapien.objects import ObjectBody
from drivers.sapien.scene import Bounds, BoxObstacle, DiscObstacle, Goal, Place, Scene
from drivers.sapien.world import CONTACT_MEMORY, SUBSTEP, World, WorldState
from runtime import state as snapshots

BASE = BaseModel()
SECOND = round(1 / SUBSTEP)
CRAMPED = Scene(
    name="cramped", title="A room where everything soon touches everything",
    bounds=Bounds(min_x=0.0, min_y=0.0, max_x=2.0, max_y=0.9), discs=(DiscObstacle(x=1.5, y=0.2, radius=0.1),),
    robot=Place(x=0.35, y=0.45), object=Place(x=0.95, y=0.45), goal=Goal(x=1.5, y=0.45), default_object="can",
)  # fmt: skip


def drawn(name: str, seed: int = 0) -> ObjectBody:
    return objects.draw(objects.get(name), np.random.default_rng(seed))


def open_world(name: str = "can", **changes: object) -> World:
    return World(msgspec.structs.replace(scene.get("open"), **changes), drawn(name), BASE)


def with_velocity(world: World, velocity: tuple[float, float], spin: float) -> None:
    state = world.state()
    moving = (*state.object[:7], *velocity, 0.0, 0.0, 0.0, spin)
    world.restore(msgspec.structs.replace(state, object=moving))


def digest(world: World) -> str:
    return hashlib.sha256(snapshots.encode(world.state())).hexdigest()


def busy(name: str, seed: int, seconds: int = 4) -> World:
    """A world with pushing, walls and changing commands behind it."""
    body = drawn(name, seed)
    world = World(CRAMPED, body, BASE)
    generator = np.random.default_rng(seed)
    for _ in range(4 * seconds):
        world.command(0.3, *(float(one) for one in generator.normal(0.0, 0.2, 2)))
        world.step(SECOND // 4)
    return world


def test_starts_where_the_scene_says() -> None:
    one = scene.get("open")
    for name in objects.names():
        world = World(one, drawn(name), BASE)
        assert world.robot_pose == pytest.approx([one.robot.x, one.robot.y, one.robot.yaw], abs=1e-6)
        assert world.object_pose == pytest.approx([one.object.x, one.object.y, one.object.yaw], abs=1e-6)
        assert not (world.touching or world.robot_hit or world.object_hit)


def test_nothing_moves_by_itself() -> None:
    world = World(scene.get("living-room"), drawn("dino"), BASE)
    robot, thing = world.robot_pose, world.object_pose
    world.step(2 * SECOND)
    assert (world.robot_pose == robot).all()
    assert (world.object_pose == thing).all()


def test_base_ramps_and_lags_behind_its_command() -> None:
    """A ramp a t through a first-order lag T: v = a (t - T + T exp(-t / T))."""
    world = open_world(robot=Place(x=0.0, y=0.0, yaw=0.6), object=Place(x=0.0, y=4.0))
    world.command(0.3, 0.0, 0.0)
    world.step(round(0.5 / SUBSTEP))
    speed = 0.4 * (0.5 - 0.1 + 0.1 * math.exp(-5))
    assert world.robot_twist == pytest.approx([speed * math.cos(0.6), speed * math.sin(0.6), 0.0], abs=2e-3)
    world.step(2 * SECOND)
    assert np.hypot(*world.robot_twist[:2]) == pytest.approx(0.3, abs=1e-5)


def test_base_drives_a_circle() -> None:
    """vx = 0.3 and omega = 0.6 is a circle of radius 0.5."""
    world = open_world(robot=Place(x=0.0, y=0.0), object=Place(x=0.0, y=4.0))
    world.command(0.3, 0.0, 0.6)
    world.step(3 * SECOND)
    x, y, theta = world.robot_pose
    middle = np.array([x - 0.5 * math.sin(theta), y + 0.5 * math.cos(theta)])
    for _ in range(5):
        world.step(SECOND)
        assert np.hypot(*(world.robot_pose[:2] - middle)) == pytest.approx(0.5, abs=2e-3)
    assert world.robot_twist[2] == pytest.approx(0.6, abs=1e-4)


def test_command_beyond_the_base_is_scaled_and_said() -> None:
    world = open_world(object=Place(x=0.0, y=4.0))
    assert world.command(0.0, 0.3, 0.5) is False
    assert world.command(3.0, -4.0, 9.0) is True
    world.step(4 * SECOND)
    assert world.robot_twist[2] == pytest.approx(BASE.angular_speed, abs=1e-4)
    assert np.hypot(*world.robot_twist[:2]) == pytest.approx(BASE.speed, abs=2e-3)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_command_that_is_not_finite_is_refused(bad: float) -> None:
    world = open_world()
    with pytest.raises(CommandNotFinite, match="finite"):
        world.command(0.1, bad, 0.0)
    assert world.state().wish == (0.0, 0.0, 0.0)


def test_sliding_object_stops_as_coulomb_says() -> None:
    body = drawn("can")
    world = open_world()
    with_velocity(world, (0.6, 0.8), 0.0)
    start = world.object_pose
    world.step(SECOND)
    slid = world.object_pose - start
    assert slid[:2] == pytest.approx(np.array([0.6, 0.8]) / (2 * body.friction * GRAVITY), rel=0.03)
    assert world.object_twist == pytest.approx([0.0, 0.0, 0.0])


def test_spinning_object_stops_as_coulomb_says() -> None:
    body = drawn("can")
    world = open_world()
    with_velocity(world, (0.0, 0.0), 10.0)
    world.step(2 * SECOND)
    slowing = 4 / 3 * body.friction * GRAVITY / (body.diameter / 2)
    turned = 10.0**2 / (2 * slowing)
    assert world.object_pose[2] == pytest.approx(math.remainder(turned, 2 * math.pi), abs=0.03 * turned)


def test_ball_rolls_far_and_loses_what_rolling_resistance_takes() -> None:
    """A rolling ball slows by 5/7 of its rolling resistance times g."""
    body = drawn("white-ball")
    world = open_world("white-ball")
    with_velocity(world, (0.3, 0.0), 0.0)
    start = world.object_pose
    world.step(8 * SECOND)
    assert world.object_pose[0] - start[0] == pytest.approx(0.3**2 / (2 * 5 / 7 * body.friction * GRAVITY), rel=0.03)


def test_centred_push_of_a_can_goes_straight_at_the_robots_speed() -> None:
    world = open_world()
    world.command(0.3, 0.0, 0.0)
    world.step(5 * SECOND)
    assert world.touching
    assert not (world.robot_hit or world.object_hit)
    assert world.object_twist[0] == pytest.approx(0.3, abs=5e-3)
    gap = world.object_pose[0] - world.robot_pose[0] - BASE.diameter / 2 - drawn("can").diameter / 2
    assert gap == pytest.approx(0.0, abs=1e-3)
    assert abs(world.object_pose[1]) < 5e-3


def test_object_twist_is_that_of_the_bounding_circles_centre() -> None:
    world = World(scene.get("open"), drawn("dino", 3), BASE)
    with_velocity(world, (0.5, -0.3), 4.0)
    before, twist = world.object_pose, world.object_twist
    world.step(1)
    after = (world.object_pose - before) / SUBSTEP
    assert after == pytest.approx(twist, abs=0.08)
    # The centre of mass itself moves otherwise.
    assert np.abs(twist[:2] - [0.5, -0.3]).max() > 0.02


def test_a_wall_stops_the_robot_and_is_told_apart() -> None:
    wall = BoxObstacle(x=-1.0, y=0.0, length=0.2, width=4.0)
    world = open_world(boxes=(wall,), object=Place(x=3.0, y=3.0))
    world.command(0.5, 0.0, 0.0)
    world.step(6 * SECOND)
    assert (world.touching, world.robot_hit, world.object_hit) == (False, True, False)
    assert world.robot_pose[0] == pytest.approx(-1.1 - 0.23, abs=2e-3)
    world.command(-0.3, 0.0, 0.0)
    world.step(4 * SECOND)
    assert not world.robot_hit


def test_an_object_between_robot_and_wall_is_held_not_crushed() -> None:
    wall = BoxObstacle(x=-1.0, y=0.0, length=0.2, width=4.0)
    world = open_world(boxes=(wall,))
    world.command(0.5, 0.0, 0.0)
    world.step(6 * SECOND)
    assert (world.touching, world.robot_hit, world.object_hit) == (True, False, True)
    assert world.object_pose[0] == pytest.approx(-1.1 - 0.12, abs=5e-3)
    assert world.robot_pose[0] == pytest.approx(-1.1 - 0.24 - 0.23, abs=1e-2)


def test_contacts_are_remembered_for_a_while_and_reading_changes_nothing() -> None:
    world = open_world()
    world.command(0.3, 0.0, 0.0)
    while not world.touching:
        world.step(1)
    world.command(-0.5, 0.0, 0.0)
    assert world.touching
    world.step(2 * SECOND)
    assert not world.touching


def test_contact_memory_covers_a_drivers_period() -> None:
    assert pytest.approx(0.05) == CONTACT_MEMORY * SUBSTEP


def test_a_heavy_object_slows_the_base_down() -> None:
    """The wheels' traction is 60 N; an object that needs more does not move."""
    heavy = msgspec.structs.replace(drawn("box"), mass=40.0, inertial_mass=40.0, friction=0.5)
    world = World(scene.get("open"), heavy, BASE)
    start = world.object_pose
    world.command(0.4, 0.0, 0.0)
    world.step(5 * SECOND)
    assert world.touching
    assert np.hypot(*(world.object_pose - start)[:2]) < 0.03
    assert np.hypot(*world.robot_twist[:2]) < 0.02


def test_wheels_prefer_their_own_way() -> None:
    """Pushed from behind at a slant, a cart rolls on along its wheels; a box goes with the push."""
    along: dict[str, float] = {}
    for name in ("cart", "box"):
        one = msgspec.structs.replace(scene.get("open"), object=Place(x=-2.0, y=0.0, yaw=0.5))
        world = World(one, drawn(name, 2), BASE)
        world.command(0.3, 0.0, 0.0)
        world.step(round(3.2 * SECOND))
        theta = world.object_pose[2]
        vx, vy, _ = world.object_twist
        along[name] = abs(-math.sin(theta) * vx + math.cos(theta) * vy)
    assert along["cart"] < along["box"]


@pytest.mark.parametrize("name", objects.names())
def test_run_that_goes_on_and_run_restored_are_the_same_to_the_bit(name: str) -> None:
    first = busy(name, 1, 3)
    kept = snapshots.decode(WorldState, snapshots.encode(first.state()))
    second = World(CRAMPED, drawn(name, 1), BASE)
    second.restore(kept)
    for k in range(6):
        for world in (first, second):
            world.command(0.4, 0.1 * (-1) ** k, 0.2)
            world.step(100)
            assert world.substeps == kept.substeps + 100 * (k + 1)
        assert (first.robot_pose == second.robot_pose).all()
        assert (first.object_pose == second.object_pose).all()
        flags = [(w.touching, w.robot_hit, w.object_hit) for w in (first, second)]
        assert flags[0] == flags[1]
    assert first.state() == second.state()


def test_the_restored_runs_really_had_contact_and_walls() -> None:
    seen = set()
    for name in objects.names():
        world = busy(name, 1, 3)
        for k in range(6):
            world.command(0.4, 0.1 * (-1) ** k, 0.2)
            world.step(100)
            seen |= {flag for flag in ("touching", "robot_hit", "object_hit") if getattr(world, flag)}
    assert seen == {"touching", "robot_hit", "object_hit"}


def test_state_taken_twice_is_the_same() -> None:
    world = busy("cloud", 2, 2)
    assert world.state() == world.state()


def test_same_seed_same_bytes_after_rebuilding() -> None:
    assert digest(busy("dino", 4)) == digest(busy("dino", 4))
    assert digest(busy("dino", 4)) != digest(busy("dino", 5))


def test_same_seed_same_bytes_in_another_process() -> None:
    script = "from tests.drivers.sapien.test_world import busy, digest\n"
    script += "print(*(digest(busy(name, 4)) for name in ('dino', 'cart')))"
    other = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=120)
    assert other.stdout.split() == [digest(busy("dino", 4)), digest(busy("cart", 4))]


def test_state_holds_float32_numbers_exactly() -> None:
    state = busy("plane", 3, 2).state()
    for number in (*state.robot, *state.object):
        assert float(np.float32(number)) == number


@pytest.mark.parametrize("name", scene.names())
def test_every_scene_can_be_simulated(name: str) -> None:
    one: Scene = scene.get(name)
    world = World(one, drawn(one.default_object), BASE)
    world.command(0.3, 0.0, 0.0)
    world.step(4 * SECOND)
    assert world.touching
    assert np.isfinite([*world.robot_pose, *world.object_pose]).all()


def test_hold_brakes_by_traction_alone() -> None:
    base = BaseModel(lag=0.1)
    world = World(scene.get("open"), objects.draw(objects.get("can"), np.random.default_rng(1)), base)
    world.command(-0.3, 0.0, 0.0)
    world.step(800)
    speed = -world.robot_twist[0]
    world.hold()
    # v = v0 - (traction / mass) t: half the speed is left half way.
    stop = speed * base.mass / base.traction
    world.step(round(stop / 2 / SUBSTEP))
    assert -world.robot_twist[0] == pytest.approx(speed / 2, rel=0.05)
    world.step(round(stop / 2 / SUBSTEP) + 1)
    assert abs(world.robot_twist[0]) < 1e-3
