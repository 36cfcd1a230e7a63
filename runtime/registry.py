"""The services that exist, by name. Classes are named as text and imported when a system needs them.

This is the one place where the runtime knows of services and drivers; it keeps `import runtime` light and the
import contracts one-way.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from operator import attrgetter
from typing import Any

from runtime.errors import PushlaneError
from runtime.live.wire import Wire
from runtime.service import Service

SERVICES: dict[str, str] = {
    "driver": "drivers.sapien.service:SapienDriver",
    "emulated-serial": "drivers.sapien.emulated_serial:EmulatedSerial",
    "robotino-serial": "drivers.robotino.serial.service:RobotinoSerial",
    "emulated-rest": "drivers.sapien.emulated_rest:EmulatedRest",
    "robotino-rest": "drivers.robotino.rest.service:RobotinoRest",
    "robotino-laser": "drivers.robotino.rest.laser:RobotinoLaser",
    "perception": "drivers.sapien.perception:TruthPerception",
    "opencv-camera": "drivers.camera.service:CameraService",
    "camera": "drivers.sapien.camera:SapienCamera",
    "floor": "services.floor.service:FloorService",
    "mapping": "services.mapping.service:MappingService",
    "tracker": "services.tracker.service:TrackerService",
    "corridor": "services.corridor.service:CorridorService",
    "strategy": "services.strategy.service:StrategyService",
    "learner": "services.learner.service:LearnerService",
    "controller": "services.controller.service:ControllerService",
    "task": "services.task.service:TaskService",
}

WIRES: dict[str, str] = {
    "robotino-serial": "drivers.robotino.serial.wire:SerialWire.of",
    "robotino-rest": "drivers.robotino.rest.wire:HttpWire.of",
    "robotino-laser": "drivers.robotino.rest.wire:HttpWire.of",
}
"""What makes the wire of a service from its settings, where no double of its other end is in the system."""


class UnknownService(PushlaneError):
    """No service has this name."""


def service_class(name: str) -> type[Service]:
    """Return the class of the service `name`.

    Raises:
        UnknownService: naming those that exist.
    """
    if name not in SERVICES:
        raise UnknownService(f"no service is called '{name}'; expected one of {', '.join(SERVICES)}")
    found = _named(SERVICES[name])
    if not (isinstance(found, type) and issubclass(found, Service)):
        raise TypeError(f"{SERVICES[name]} is no Service")
    return found


def wire(name: str, nodes: Iterable[str], config: object) -> Wire | None:
    """Return the wire of the service `name` in a system of `nodes`; None if another service is its other end.

    Raises:
        PushlaneError: its settings say nothing that it could be joined to.
    """
    wired = set(service_class(name).contract.wired)
    others = (service_class(one).contract.outputs for one in nodes if one != name)
    if not wired or any(wired & set(outputs) for outputs in others):
        return None
    made: Wire = _named(WIRES[name])(config)
    return made


def _named(text: str) -> Any:
    """Return what "module:attribute" names."""
    module, _, attributes = text.partition(":")
    return attrgetter(attributes)(import_module(module))
