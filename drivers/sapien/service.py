"""The simulated driver: the base, its sensors and the object, as a service like any other."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drivers.sapien import publish
from drivers.sapien.config import SapienConfig
from drivers.sapien.odometry import DriftingOdometry, OdometryState
from drivers.sapien.rays import Outlines, Rooms
from drivers.sapien.sensors import ring_ranges
from drivers.sapien.world import SUBSTEP, World, WorldState
from runtime import topics
from runtime.messages import (
    Alive,
    MotionLimits,
    Odometry,
    Pose2,
    RangeArray,
    RobotStatus,
    Twist2,
    VelocityCommand,
)
from runtime.service import Effects, Input, Output, Publication, Service, Timer, on
from runtime.time import SECOND, Time, nanoseconds

_PERIOD = 0.05
_SUBSTEP: Time = nanoseconds(SUBSTEP)
_SCAN_EVERY = 2
_STATUS_EVERY = 4
_REMEMBERED = 100
_CONTROLLER = "controller"


@dataclass
class DriverState:
    """What the driver goes on from.

    Attributes:
        origin: when the first event came, ns; the world's time counts from there.
        sequence: of the last odometry; stamps: when the newest of them were published, ns, the last one last.
        command_stamp: stamp of the odometry that the command in force is based on; None while the base is held.
        command_deadline: ns that command may be old.
        orphaned: the controller was there and is gone.
    """

    generator: np.random.Generator
    origin: Time | None = None
    world: WorldState | None = None
    odometry: OdometryState | None = None
    sequence: int = 0
    stamps: list[Time] = field(default_factory=list)
    command_stamp: Time | None = None
    command_deadline: Time = 0
    accepted: int = 0
    clamped: int = 0
    stale: int = 0
    bumper: bool = False
    orphaned: bool = False


class SapienDriver(Service):
    """Steps the world up to each event's time and publishes what the base would.

    The last line of safety is here as on a real base: a command too old by the driver's own clock is not obeyed,
    and the base stops when no fresh one comes.
    """

    name = "driver"
    Config = SapienConfig

    command = Input(topics.COMMAND)
    alive = Input(topics.ALIVE)
    odometry = Output(topics.ODOMETRY)
    scan = Output(topics.SCAN)
    ranges = Output(topics.RANGES)
    status = Output(topics.STATUS)
    truth = Output(topics.TRUTH)
    tick = Timer(_PERIOD)

    config: SapienConfig
    state: DriverState

    def __init__(self, config: SapienConfig) -> None:
        super().__init__(config)
        self.state = DriverState(np.random.Generator(np.random.PCG64(config.seed)))
        self._world = World(config.scene, config.body, config.base)
        self._odometry = DriftingOdometry.of(self.config.scene.noise, self._world.robot_pose)
        self._rooms = Rooms(config.scene)

    def freeze(self) -> None:
        """Take the world's state. This rebuilds the world, so that it goes on as a restored one would."""
        self.state.world = self._world.state()
        self.state.odometry = self._odometry.state

    def thaw(self) -> None:
        """Build the world again from the state."""
        assert self.state.world is not None and self.state.odometry is not None
        self._world = World(self.config.scene, self.config.body, self.config.base)
        self._world.restore(self.state.world)
        self._odometry = DriftingOdometry.of(self.config.scene.noise, self._world.robot_pose)
        self._odometry.state = self.state.odometry

    @on(alive)
    def call(self, alive: Alive, now: Time) -> Effects:
        """Hold the base when the controller is gone: sooner than its last command runs out."""
        self._advance(now)
        gone = _CONTROLLER not in alive.nodes
        if gone and self.state.command_stamp is not None:
            self._hold()
            yield self.say("the controller is gone: base held", now, "WARNING")
        self.state.orphaned = gone

    @on(command)
    def obey(self, command: VelocityCommand, now: Time) -> Effects:
        """Follow a command, unless it is too old."""
        self._advance(now)
        stamp = self._stamp(command.driver_sequence)
        deadline = min(command.deadline, nanoseconds(self.config.deadline))
        if self.state.orphaned:
            self.state.stale += 1
            yield self.say("command refused: its controller is gone", now)
            return
        if stamp is None or now - stamp > deadline:
            self.state.stale += 1
            age = "unknown" if stamp is None else f"{(now - stamp) / SECOND:.3f} s"
            yield self.say(f"stale command refused: based on odometry {command.driver_sequence}, age {age}", now)
            return
        self.state.command_stamp, self.state.command_deadline = stamp, deadline
        self.state.accepted += 1
        twist = command.twist
        self.state.clamped += self._world.command(twist.vx, twist.vy, twist.omega)

    @on(tick)
    def sense(self, now: Time) -> Effects:
        """Publish what the sensors say."""
        self._advance(now)
        state, world = self.state, self._world
        state.sequence += 1
        state.stamps = [*state.stamps[-_REMEMBERED + 1 :], now]
        pose = world.robot_pose
        bumped = world.robot_hit
        yield self.truth(publish.truth(world, state.sequence, now))
        yield self._odometry_message(pose, now)
        seen = self._outlines()
        yield self._ranges(pose, seen, now)
        if state.sequence % _SCAN_EVERY == 1:
            noise = self.config.scene.noise.scan
            yield self.scan(publish.scan(self.config.laser, pose, seen, noise, state.generator, now))
        if state.sequence % _STATUS_EVERY == 1 or bumped != state.bumper:
            state.bumper = bumped
            yield self._status(now)

    def _stamp(self, sequence: int) -> Time | None:
        """Return when odometry `sequence` was published; None if that is long ago or never was."""
        back = self.state.sequence - sequence
        return self.state.stamps[-1 - back] if 0 <= back < len(self.state.stamps) else None

    def _advance(self, now: Time) -> None:
        """Step the world up to `now`, and hold the base from the moment its command is too old."""
        stop = None
        if self.state.command_stamp is not None:
            stop = self.state.command_stamp + self.state.command_deadline
        if stop is not None and stop < now:
            self._step_to(stop)
            self._hold()
            self.state.stale += 1
        self._step_to(now)

    def _hold(self) -> None:
        self._world.hold()
        self.state.command_stamp = None

    def _step_to(self, time: Time) -> None:
        if self.state.origin is None:
            self.state.origin = time
        count = (time - self.state.origin) // _SUBSTEP - self._world.substeps
        if count > 0:
            self._world.step(count)

    def _outlines(self) -> Outlines:
        return self._rooms.around(self._world.seconds, self.config.body.parts, self._world.object_pose)

    def _odometry_message(self, pose: NDArray[np.float64], now: Time) -> Publication:
        reading = self._odometry.read(pose, self.state.generator)
        vx, vy, omega = self._world.robot_twist_base
        noise, drift = self.config.scene.noise, self._odometry.state
        position = noise.odometry_distance**2 * drift.travelled
        heading = noise.odometry_turn**2 * drift.turned + noise.odometry_heading**2 * drift.travelled
        return self.odometry(
            Odometry(
                stamp=now,
                pose=Pose2(x=reading[0], y=reading[1], theta=reading[2]),
                twist=Twist2(vx=vx, vy=vy, omega=omega),
                driver_sequence=self.state.sequence,
                covariance=[position, 0, 0, 0, position, 0, 0, 0, heading],
            )
        )

    def _ranges(self, pose: NDArray[np.float64], seen: Outlines, now: Time) -> Publication:
        ring = self.config.ring
        distance = ring_ranges(ring, pose, seen, self.config.scene.noise.ranges, self.state.generator)
        return self.ranges(
            RangeArray(
                stamp=now,
                bearing=ring.bearings().tolist(),
                distance=distance.tolist(),
                ring_radius=ring.radius,
                minimum=ring.minimum,
                maximum=ring.maximum,
            )
        )

    def _status(self, now: Time) -> Publication:
        base, state = self.config.base, self.state
        return self.status(
            RobotStatus(
                stamp=now,
                bumper=state.bumper,
                motors_enabled=True,
                battery_voltage=self.config.battery_voltage,
                limits=MotionLimits(
                    speed=base.speed,
                    angular_speed=base.angular_speed,
                    acceleration=base.acceleration,
                    angular_acceleration=base.angular_acceleration,
                    lag=base.lag,
                ),
                diameter=base.diameter,
                commands_accepted=state.accepted,
                commands_clamped=state.clamped,
                commands_stale=state.stale,
            )
        )
