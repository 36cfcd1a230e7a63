"""The simulated world: base, object and room in the plane, stepped by PhysX with our own floor friction.

PhysX keeps contact caches that cannot be read or restored, so a run that goes on and one restored from its
state would part. Therefore `World.state` rebuilds the PhysX scene from the very state it returns: both go on
alike, to the bit. Taking a state changes the last bits of what follows, so take it when a replay will too.
"""

from __future__ import annotations

from math import ceil, cos, inf, sin

import msgspec
import numpy as np
from numpy.typing import NDArray

from drivers.sapien import physics
from drivers.sapien.base import BaseModel, drive
from drivers.sapien.engine import sapien
from drivers.sapien.friction import resist
from drivers.sapien.objects import ObjectBody, floor
from drivers.sapien.physics import BodyState
from drivers.sapien.scene import Scene
from drivers.sapien.shapes import Disc, Shape

SUBSTEP = 0.0025
"""Length of a substep, s. At 0.005 s a push of 6 s already ends 1-4 cm and 0.2 rad elsewhere."""

CONTACT_MEMORY = 20
"""For how many substeps a contact is reported, 0.05 s: a driver that reads so often misses none."""

# PhysX keeps bodies in contact about 0.00001 m from each other.
_TOUCH = 1e-4

Vector = tuple[float, float, float]


class WorldState(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything that a world goes on from. The shapes and masses are those of its scene, body and base.

    substeps: since the start. wish, ramp, reference: base frame, see `base.drive`. touched, robot_struck,
    object_struck: number of the substep that last had such a contact, see `World`.
    """

    substeps: int
    robot: BodyState
    object: BodyState
    wish: Vector
    ramp: Vector
    reference: Vector
    touched: int
    robot_struck: int
    object_struck: int


class World:
    """A base, one object and a room.

    Poses are (x, y, theta) and twists (vx, vy, omega), float64 (3,), map frame, m and rad; the object's are
    those of the centre o of its bounding circle.
    `touching`, `robot_hit`, `object_hit`: in one of the last CONTACT_MEMORY substeps the base touched the
    object; the base, or the object, touched a wall or furniture. Reading changes nothing.
    `seconds`: since the start.
    """

    def __init__(self, scene: Scene, body: ObjectBody, base: BaseModel) -> None:
        self._body, self._base = body, base
        self._room = scene
        self._changes = [ceil(moment / SUBSTEP) for moment in scene.changes()]
        self._floor = floor(body)
        self._centre = (body.centre_x, body.centre_y)
        self._parameters = base.parameters(SUBSTEP)
        robot, thing = scene.robot, scene.object
        c, s = cos(thing.yaw), sin(thing.yaw)
        centre_x = thing.x + c * body.centre_x - s * body.centre_y
        centre_y = thing.y + s * body.centre_x + c * body.centre_y
        self._fixed: sapien.Entity = None
        self._build(
            WorldState(
                substeps=0,
                robot=physics.at_rest(robot.x, robot.y, robot.yaw),
                object=physics.at_rest(centre_x, centre_y, thing.yaw),
                wish=(0.0, 0.0, 0.0),
                ramp=(0.0, 0.0, 0.0),
                reference=(0.0, 0.0, 0.0),
                touched=-CONTACT_MEMORY,
                robot_struck=-CONTACT_MEMORY,
                object_struck=-CONTACT_MEMORY,
            )
        )

    def command(self, vx: float, vy: float, omega: float) -> bool:
        """Tell the base how to move from now on: m/s and rad/s, base frame.

        Returns whether the base's own limits scaled the command down.

        Raises:
            CommandNotFinite: a number is NaN or infinite.
        """
        followed, limited = self._base.within(vx, vy, omega)
        self._wish[:] = followed
        return limited

    def hold(self) -> None:
        """Stop the motors at once, without the ramp, as a Robotino does when its commands run out.

        The wheels' traction then brakes the base: 3 m/s^2 with the default one.
        """
        self._wish[:] = self._ramp[:] = self._reference[:] = 0.0

    def step(self, count: int) -> None:
        """Let `count` substeps of SUBSTEP s pass."""
        end = self.substeps + count
        for change in self._changes:
            if self.substeps < change <= end:
                self._step(change - self.substeps)
                self._scene.remove_entity(self._fixed)
                self._fixed = physics.add_fixed(self._scene, self._obstacles(), physics.material(self._body.rim))
        self._step(end - self.substeps)

    def _obstacles(self) -> tuple[Shape, ...]:
        # Half a substep more: a moment that is a whole number of substeps is not to be missed by rounding.
        return self._room.obstacles((self.substeps + 0.5) * SUBSTEP)

    def _step(self, count: int) -> None:
        robot, thing, system = self._robot, self._object, self._system
        robot_entity, thing_entity = robot.entity, thing.entity
        wish, ramp, reference, parameters = self._wish, self._ramp, self._reference, self._parameters
        mass, inertia, on = self._body.inertial_mass, self._body.inertia, self._floor
        position, limit, axis, isotropic = on.position, on.limit, on.axis, on.isotropic
        for _ in range(count):
            velocity, spin = robot.linear_velocity, robot.angular_velocity
            drive(robot_entity.pose.q, velocity, spin, wish, ramp, reference, parameters)
            robot.set_linear_velocity(velocity)
            robot.set_angular_velocity(spin)
            velocity, spin = thing.linear_velocity, thing.angular_velocity
            quaternion = thing_entity.pose.q
            if resist(quaternion, velocity, spin, mass, inertia, SUBSTEP, position, limit, axis, isotropic):
                thing.set_linear_velocity(velocity)
                thing.set_angular_velocity(spin)
            system.step()
            self.substeps += 1
            for contact in system.get_contacts():
                self._note(contact)

    @property
    def seconds(self) -> float:
        """How long the world has been going, s."""
        return self.substeps * SUBSTEP

    @property
    def touching(self) -> bool:
        """Whether the base touches the object."""
        return self.substeps - self._touched < CONTACT_MEMORY

    @property
    def robot_hit(self) -> bool:
        """Whether the base touches a wall or furniture."""
        return self.substeps - self._robot_struck < CONTACT_MEMORY

    @property
    def object_hit(self) -> bool:
        """Whether the object touches a wall or furniture."""
        return self.substeps - self._object_struck < CONTACT_MEMORY

    @property
    def robot_pose(self) -> NDArray[np.float64]:
        """Where the base is."""
        return physics.planar(self._robot)

    @property
    def robot_twist(self) -> NDArray[np.float64]:
        """How the base moves."""
        velocity, spin = self._robot.linear_velocity, self._robot.angular_velocity
        return np.array([velocity[0], velocity[1], spin[2]], dtype=np.float64)

    @property
    def robot_twist_base(self) -> tuple[float, float, float]:
        """How the base moves, m/s and rad/s, base frame."""
        vx, vy, omega = (float(one) for one in self.robot_twist)
        theta = float(self.robot_pose[2])
        c, s = np.cos(theta), np.sin(theta)
        return float(c * vx + s * vy), float(-s * vx + c * vy), omega

    @property
    def object_pose(self) -> NDArray[np.float64]:
        """Where o is."""
        planar = physics.planar(self._object)
        x, y = self._from_centre_to_o(planar[2])
        return planar + np.array([x, y, 0.0])

    @property
    def object_twist(self) -> NDArray[np.float64]:
        """How o moves."""
        velocity, spin = self._object.linear_velocity, float(self._object.angular_velocity[2])
        x, y = self._from_centre_to_o(physics.planar(self._object)[2])
        return np.array([velocity[0] - spin * y, velocity[1] + spin * x, spin], dtype=np.float64)

    def state(self) -> WorldState:
        """Return everything this world goes on from, and rebuild it from that."""
        state = WorldState(
            substeps=self.substeps,
            robot=physics.state_of(self._robot),
            object=physics.state_of(self._object),
            wish=_vector(self._wish),
            ramp=_vector(self._ramp),
            reference=_vector(self._reference),
            touched=self._touched,
            robot_struck=self._robot_struck,
            object_struck=self._object_struck,
        )
        self._build(state)
        return state

    def restore(self, state: WorldState) -> None:
        """Go on from `state`, which a world of the same scene, body and base gave."""
        self._build(state)

    def _build(self, state: WorldState) -> None:
        base, body = self._base, self._body
        self._scene, self._system = physics.scene(SUBSTEP)
        rim = physics.material(body.rim)
        self.substeps = state.substeps
        self._fixed = physics.add_fixed(self._scene, self._obstacles(), rim)
        self._robot = physics.add_movable(
            self._scene, (Disc(radius=base.diameter / 2),), (0.0, 0.0), base.mass, base.inertia, state.robot, rim
        )
        self._object = physics.add_movable(
            self._scene, body.parts, self._centre, body.inertial_mass, body.inertia, state.object, rim
        )
        self._wish, self._ramp = np.array(state.wish), np.array(state.ramp)
        self._reference = np.array(state.reference)
        self._touched = state.touched
        self._robot_struck, self._object_struck = state.robot_struck, state.object_struck

    def _note(self, contact: physics.Contact) -> None:
        if min((point.separation for point in contact.points), default=inf) > _TOUCH:
            return
        first, second = contact.bodies
        robot, thing = self._robot, self._object
        if first is robot or second is robot:
            if first is thing or second is thing:
                self._touched = self.substeps
            else:
                self._robot_struck = self.substeps
        else:
            self._object_struck = self.substeps

    def _from_centre_to_o(self, theta: float) -> tuple[float, float]:
        c, s = cos(theta), sin(theta)
        x, y = self._centre
        return -(c * x - s * y), -(s * x + c * y)


def _vector(array: NDArray[np.float64]) -> Vector:
    return float(array[0]), float(array[1]), float(array[2])
