"""What PhysX needs to be told: bodies that move in the plane, a room that stands, a system without gravity."""

from __future__ import annotations

from math import atan2, cos, sin
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.angles import wrap
from drivers.sapien.engine import physx, sapien
from drivers.sapien.shapes import Box, Shape

Body: TypeAlias = physx.PhysxRigidDynamicComponent
Contact: TypeAlias = physx.PhysxContact
Material: TypeAlias = physx.PhysxMaterial
System: TypeAlias = physx.PhysxCpuSystem

BodyState = tuple[float, ...]
"""Position (3), quaternion w x y z (4), velocity (3) and angular velocity (3), as PhysX has them: float32."""

_HEIGHT = 0.2
_DEPENETRATION = 0.3
_POSITION_ITERATIONS, _VELOCITY_ITERATIONS = 10, 1
_UPRIGHT = [0.5**0.5, 0.0, -(0.5**0.5), 0.0]
_LOCKED = [False, False, True, True, True, False]


def scene(substep: float) -> tuple[sapien.Scene, System]:
    """Return a new, empty scene without gravity, and its system, which steps `substep` s at a time.

    The scene keeps its bodies alive: hold it as long as them.
    """
    physx.set_scene_config(
        gravity=[0.0, 0.0, 0.0], enable_enhanced_determinism=True, enable_friction_every_iteration=True
    )
    physx.set_body_config(
        solver_position_iterations=_POSITION_ITERATIONS,
        solver_velocity_iterations=_VELOCITY_ITERATIONS,
        sleep_threshold=0.0,
    )
    system = physx.PhysxCpuSystem()
    made = sapien.Scene([system])
    made.set_timestep(substep)
    return made, system


def material(friction: float) -> Material:
    """Return a material without bounce. A pair's friction is the mean of both, so give all bodies one."""
    return physx.PhysxMaterial(friction, friction, 0.0)


def add_fixed(scene: sapien.Scene, shapes: tuple[Shape, ...], of: Material) -> sapien.Entity:
    """Add one body that stands still, made of `shapes`, map frame, and return it."""
    component = physx.PhysxRigidStaticComponent()
    for shape in shapes:
        component.attach(_collision(shape, (0.0, 0.0), of))
    entity = sapien.Entity()
    entity.add_component(component)
    scene.add_entity(entity)
    return entity


def add_movable(
    scene: sapien.Scene,
    parts: tuple[Shape, ...],
    centre: tuple[float, float],
    mass: float,
    inertia: float,
    state: BodyState,
    of: Material,
) -> Body:
    """Add a body that moves in the plane, and return it.

    parts: in the body's own frame. centre: m, centre of mass in that frame. mass: kg. inertia: kg m^2 about
    the vertical through the centre of mass. state: of the centre of mass.
    """
    component = physx.PhysxRigidDynamicComponent()
    for part in parts:
        component.attach(_collision(part, centre, of))
    component.mass = mass
    component.inertia = [inertia, inertia, inertia]
    # The entity's frame is the centre of mass: so a pose survives being read and set without rounding.
    component.cmass_local_pose = sapien.Pose()
    component.set_locked_motion_axes(_LOCKED)
    # PhysX damps turning by default; what slows a body here is friction only.
    component.set_linear_damping(0.0)
    component.set_angular_damping(0.0)
    component.set_max_depenetration_velocity(_DEPENETRATION)
    entity = sapien.Entity()
    entity.add_component(component)
    entity.pose = sapien.Pose(state[0:3], state[3:7])
    scene.add_entity(entity)
    component.set_linear_velocity(state[7:10])
    component.set_angular_velocity(state[10:13])
    return component


def at_rest(x: float, y: float, yaw: float) -> BodyState:
    """Return the state of a body that stands still at (x, y) m, turned by `yaw` rad."""
    return (x, y, 0.0, cos(yaw / 2), 0.0, 0.0, sin(yaw / 2), *[0.0] * 6)


def state_of(body: Body) -> BodyState:
    """Return the state of the centre of mass of `body`, exact."""
    pose = body.entity.pose
    parts = (pose.p, pose.q, body.linear_velocity, body.angular_velocity)
    return tuple(float(number) for part in parts for number in part)


def planar(body: Body) -> NDArray[np.float64]:
    """Return x, y, theta of the centre of mass of `body`, (3,), map frame, m and rad, theta in (-pi, pi]."""
    pose = body.entity.pose
    position, quaternion = pose.p, pose.q
    theta = wrap(2.0 * atan2(float(quaternion[3]), float(quaternion[0])))
    return np.array([position[0], position[1], theta], dtype=np.float64)


def _collision(shape: Shape, centre: tuple[float, float], of: Material) -> physx.PhysxCollisionShape:
    """Return PhysX's form of `shape`; an upright capsule is an exact disc in the plane."""
    position = [shape.x - centre[0], shape.y - centre[1], 0.0]
    if isinstance(shape, Box):
        form = physx.PhysxCollisionShapeBox([shape.length / 2, shape.width / 2, _HEIGHT], of)
        turn = [cos(shape.yaw / 2), 0.0, 0.0, sin(shape.yaw / 2)]
    else:
        form = physx.PhysxCollisionShapeCapsule(shape.radius, _HEIGHT, of)
        turn = _UPRIGHT
    form.set_local_pose(sapien.Pose(position, turn))
    return form
