"""The last line of safety: which commands the base is told, and when it is to stop.

A command names the newest odometry it is based on, so its age is known by the driver's own clock alone: what a network
held back and then delivers in a burst is old, and does not move the base.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot, isfinite

from drivers.robotino.kinematics import Geometry, Twist
from runtime.messages import Alive, MotionLimits, VelocityCommand
from runtime.time import SECOND, Time, nanoseconds

CONTROLLER = "controller"
STILL: Twist = (0.0, 0.0, 0.0)

_REMEMBERED = 100


@dataclass
class Gate:
    """What is known of commands.

    Attributes:
        sequence: of the last odometry; stamps: when the newest of them were published, ns, the last one last.
        wish: the command in force, m/s and rad/s, base frame. until: ns, when it is too old; None: none is in force.
        orphaned: the controller was there and is gone.
        accepted, clamped, stale, refused: commands so far, as in RobotStatus.
    """

    sequence: int = 0
    stamps: list[Time] = field(default_factory=list)
    wish: Twist = STILL
    until: Time | None = None
    orphaned: bool = False
    accepted: int = 0
    clamped: int = 0
    stale: int = 0
    refused: int = 0

    def sensed(self, now: Time) -> int:
        """Take note of an odometry that is published now; return its sequence."""
        self.sequence += 1
        self.stamps = [*self.stamps[-_REMEMBERED + 1 :], now]
        return self.sequence

    def call(self, alive: Alive) -> bool:
        """Take note of who is there; return whether the base is held because its controller has gone."""
        gone = CONTROLLER not in alive.nodes
        held = gone and self.until is not None
        if held:
            self.hold()
        self.orphaned = gone
        return held

    def offer(
        self, command: VelocityCommand, now: Time, longest: float, limits: MotionLimits, geometry: Geometry
    ) -> str:
        """Take a command, or return why not.

        Args:
            longest: s, that a command may be old, whatever it says itself.
        """
        twist = (command.twist.vx, command.twist.vy, command.twist.omega)
        if not all(map(isfinite, twist)):
            self.refused += 1
            self.hold()
            return f"command refused, base held: {twist}, expected finite numbers"
        if self.orphaned:
            self.stale += 1
            return "command refused: its controller is gone"
        back = self.sequence - command.driver_sequence
        stamp = self.stamps[-1 - back] if 0 <= back < len(self.stamps) else None
        deadline = min(max(command.deadline, 0), nanoseconds(longest))
        if stamp is None or now - stamp > deadline:
            self.stale += 1
            age = "unknown" if stamp is None else f"{(now - stamp) / SECOND:.3f} s"
            return f"stale command refused: based on odometry {command.driver_sequence}, age {age}"
        self.wish, clamped = within(twist, limits, geometry)
        self.until = stamp + deadline
        self.accepted += 1
        self.clamped += clamped
        return ""

    def now(self, now: Time) -> Twist:
        """Return how the base is to move, m/s and rad/s, base frame: not at all once the command is too old."""
        if self.until is not None and now > self.until:
            self.stale += 1
            self.hold()
        return self.wish

    def hold(self) -> None:
        """Stop, until there is a new command."""
        self.wish, self.until = STILL, None


def within(twist: Twist, limits: MotionLimits, geometry: Geometry) -> tuple[Twist, bool]:
    """Return the motion within limits and motors, its course kept, and whether it differs."""
    vx, vy, omega = twist
    share = min(1.0, limits.speed / max(hypot(vx, vy), 1e-300))
    spin = min(max(omega, -limits.angular_speed), limits.angular_speed)
    scaled, more = geometry.within((share * vx, share * vy, spin))
    return scaled, more or share < 1.0 or spin != omega
