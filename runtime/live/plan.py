"""What a live system is made of, as its processes read it: one JSON file written by the launcher."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from runtime.bus.config import BusConfig
from runtime.errors import PushlaneError


class BadPlan(PushlaneError):
    """The file is no plan."""


class Plan(msgspec.Struct, frozen=True, kw_only=True):
    """A live system.

    Attributes:
        robot: its name on the bus.
        seed: of the simulation.
        nodes: the services, in the order in which they are started.
        sections: the effective configuration, plain. Its [bus] is that of the machine whose launcher wrote it.
    """

    robot: str
    seed: int
    nodes: list[str]
    sections: dict[str, Any]

    @classmethod
    def read(cls, path: Path) -> Plan:
        """Return the plan in the file `path`.

        Raises:
            BadPlan: there is none.
        """
        try:
            return msgspec.json.decode(path.read_bytes(), type=cls)
        except (OSError, msgspec.MsgspecError) as error:
            raise BadPlan(f"{path} is no plan of a live system: {error}") from error

    def differences(self, other: Plan) -> list[str]:
        """Return the settings in which another machine's plan differs; each has a [bus] of its own."""
        mine, theirs = _flat(self), _flat(other)
        return sorted(key for key in mine.keys() | theirs.keys() if mine.get(key) != theirs.get(key))

    def encoded(self) -> bytes:
        """Return the plan as JSON."""
        return msgspec.json.encode(self)

    def bus(self) -> BusConfig:
        """Return where the processes of this machine meet the others."""
        return msgspec.convert(self.sections["bus"], BusConfig)

    def config(self) -> bytes:
        """Return the configuration as a recording holds it."""
        return msgspec.json.encode({"sections": self.sections})


def _flat(plan: Plan) -> dict[str, Any]:
    found: dict[str, Any] = {"robot": plan.robot, "seed": plan.seed, "nodes": plan.nodes}
    # As it comes over the bus: JSON has no tuples.
    sections = msgspec.json.decode(msgspec.json.encode(plan.sections), type=dict[str, dict[str, Any]])
    for section, values in sections.items():
        if section != "bus":
            found |= {f"{section}.{key}": value for key, value in values.items()}
    return found
