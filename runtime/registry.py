"""The services that exist, by name. Classes are named as text and imported when a system needs them.

This is the one place where the runtime knows of services and drivers; it keeps `import runtime` light and the
import contracts one-way.
"""

from __future__ import annotations

from importlib import import_module

from runtime.errors import PushlaneError
from runtime.service import Service

SERVICES: dict[str, str] = {
    "driver": "drivers.sapien.service:SapienDriver",
    "emulated-serial": "drivers.sapien.emulated_serial:EmulatedSerial",
    "robotino-serial": "drivers.robotino.serial.service:RobotinoSerial",
    "emulated-rest": "drivers.sapien.emulated_rest:EmulatedRest",
    "robotino-rest": "drivers.robotino.rest.service:RobotinoRest",
    "perception": "drivers.sapien.perception:TruthPerception",
    "camera": "drivers.sapien.camera:SapienCamera",
    "mapping": "services.mapping.service:MappingService",
    "tracker": "services.tracker.service:TrackerService",
    "corridor": "services.corridor.service:CorridorService",
    "strategy": "services.strategy.service:StrategyService",
    "learner": "services.learner.service:LearnerService",
    "controller": "services.controller.service:ControllerService",
    "task": "services.task.service:TaskService",
}


class UnknownService(PushlaneError):
    """No service has this name."""


def service_class(name: str) -> type[Service]:
    """Return the class of the service `name`.

    Raises:
        UnknownService: naming those that exist.
    """
    if name not in SERVICES:
        raise UnknownService(f"no service is called '{name}'; expected one of {', '.join(SERVICES)}")
    module, _, attribute = SERVICES[name].partition(":")
    found = getattr(import_module(module), attribute)
    if not (isinstance(found, type) and issubclass(found, Service)):
        raise TypeError(f"{SERVICES[name]} is no Service")
    return found
