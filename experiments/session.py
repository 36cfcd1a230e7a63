"""One simulated push: from names and a seed to services, and through them to a result and a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import msgspec
import numpy as np

from drivers.sapien import objects, scene, variants
from drivers.sapien.base import BaseModel
from drivers.sapien.config import SapienConfig
from drivers.sapien.occupancy import rasterise
from experiments.dynamic import changing
from experiments.settings import SimConfig, SystemConfig
from experiments.systems import BASES, EVERY, REAL, SENSES, SYSTEMS
from runtime import registry
from runtime.bus.config import BusConfig
from runtime.config.layers import ConfigError, Effective, Layer, effective
from runtime.live.config import LiveConfig
from runtime.live.plan import Plan
from runtime.local import PushResult, push, push_nodes
from runtime.messages import PushGoal, PushStatus, Vector2
from runtime.recorder import header
from runtime.recorder.writer import Recorder
from runtime.scheduler import Sink
from runtime.service import Service
from runtime.time import Time
from runtime.timing import TimingConfig
from services.mapping.config import KnownMap
from services.names import CONTROLLERS, STRATEGIES, method
from services.task.config import TaskConfig

if TYPE_CHECKING:
    from runtime.lockstep.run import Spread

_SENSED = {
    "corridor": {"unknown": "free", "apart": True, "spare": 0.1, "steady": True, "threshold": 0.1, "object_speed": 0.4},
    "task": {"shared": True},
    "strategy": {"predictive": {"margin": 0.04}},
    "controller": {"barrier_margin": 0.04},
}
"""Settings where all is seen from the robot: maps grow, are off by centimetres, and leave out object and robot."""

S = TypeVar("S", bound=msgspec.Struct)


@dataclass(frozen=True)
class Session:
    """Everything a push is made of, resolved.

    Attributes:
        nodes: names of the services, in scheduling order.
    """

    sim: SimConfig
    effective: Effective
    goal: PushGoal
    nodes: tuple[str, ...]

    @property
    def world(self) -> SapienConfig:
        """Return the section of the node that holds the simulated world."""
        found = self.effective.sections[self.nodes[0]]
        assert isinstance(found, SapienConfig)
        return found

    @property
    def method(self) -> tuple[str, str]:
        """Return strategy and controller of the push."""
        task = self.effective.sections["task"]
        assert isinstance(task, TaskConfig)
        return method(self.sim.strategy, self.sim.controller, (task.strategy, task.controller))

    def services(self) -> list[Service]:
        """Return the services, freshly built, in scheduling order."""
        return [registry.service_class(name)(self.effective.sections[name]) for name in self.nodes]

    def plan(self) -> Plan:
        """Return what the processes of a live system need to know."""
        sections = {name: msgspec.to_builtins(section) for name, section in self.effective.sections.items()}
        return Plan(robot=sections["bus"]["robot"], seed=self.sim.seed, nodes=list(self.nodes), sections=sections)

    def json(self) -> bytes:
        """Return the effective configuration as the recording holds it."""
        return self.plan().config()


def kinds() -> dict[str, type[msgspec.Struct]]:
    """Return the structure of every section of the configuration, whichever services run."""
    return {
        "system": SystemConfig,
        "sim": SimConfig,
        "timing": TimingConfig,
        "bus": BusConfig,
        "live": LiveConfig,
        **{name: registry.service_class(name).Config for name in EVERY},
    }


def prepare(layers: Sequence[Layer]) -> Session:
    """Resolve configuration layers into a session.

    Raises:
        ConfigError, UnknownScene, UnknownObject, ObjectError: the configuration names something wrong.
        BadUrl: a real base is to be reached at what is no address.
    """
    found = _section("sim", SimConfig, layers)
    for key, known in (("strategy", STRATEGIES), ("controller", CONTROLLERS)):
        name = getattr(found.value, key)
        if name and name not in known:
            origin = found.origin(key)
            raise ConfigError(f"{origin}: sim.{key}: no {key} is called '{name}'; expected one of {', '.join(known)}")
    system = _section("system", SystemConfig, layers).value
    if system.base != "simulated":
        return _real(system, found.value, layers)
    sim = found.value
    drawn, place = _draw(sim)
    nodes = SYSTEMS[sim.perception, sim.link]
    whole = _whole(nodes, [drawn, *layers])
    _of_one_world(whole, nodes[0], SENSES[sim.perception][0], drawn.origin)
    return Session(sim, whole, _goal(sim, sim.goal or (place.x, place.y)), nodes)


def _real(system: SystemConfig, sim: SimConfig, layers: Sequence[Layer]) -> Session:
    """Return the session of a real base: goals are asked for, and nothing is drawn but the filter's seed."""
    mapping: dict[str, Any] = {"seed": sim.seed}
    if system.map:
        mapping |= {"known": _known(system.map, None), "search": True}
    drawn = Layer(f"a real base, {system.base}", {"mapping": mapping, **_SENSED})
    nodes = REAL[system.base]
    if not any("opencv-camera" in layer.values for layer in layers):
        raise ConfigError(
            "opencv-camera: a real camera is like no other, so its calibration and mount have no default: expected "
            "sections [opencv-camera.calibration] and [opencv-camera.mount], see docs/camera.md"
        )
    whole = _whole(nodes, [drawn, *layers])
    for name in nodes:
        registry.wire(name, nodes, whole.sections[name])  # what it cannot be joined to shows before anything starts
    return Session(sim, whole, _goal(sim, sim.goal or (0.0, 0.0)), nodes)


def _whole(nodes: Sequence[str], layers: Sequence[Layer]) -> Effective:
    """Return the configuration of a system. What is said of services that it has not is looked at and left out."""
    said = {section for layer in layers for section in layer.values}
    every = kinds()
    wanted = {name: kind for name, kind in every.items() if name not in EVERY or name in nodes or name in said}
    whole = effective(wanted, layers, every)
    left = {name: one for name, one in whole.sections.items() if name not in EVERY or name in nodes}
    return Effective(left, whole.origins)


def _goal(sim: SimConfig, place: tuple[float, float]) -> PushGoal:
    return PushGoal(
        position=Vector2(x=place[0], y=place[1]),
        precision=sim.precision,
        yaw=sim.yaw,
        yaw_precision=sim.yaw_precision,
        strategy=sim.strategy,
        controller=sim.controller,
        time_limit=sim.time_limit,
    )


@dataclass(frozen=True)
class _Section(Generic[S]):
    """One section of the configuration, looked at before the others."""

    name: str
    value: S
    origins: dict[str, str]

    def origin(self, key: str) -> str:
        return self.origins.get(f"{self.name}.{key}", "default")


def _section(name: str, kind: type[S], layers: Sequence[Layer]) -> _Section[S]:
    given = [Layer(one.origin, {name: one.values[name]}) for one in layers if name in one.values]
    found = effective({name: kind}, given)
    value = found.sections[name]
    assert isinstance(value, kind)
    return _Section(name, value, found.origins)


def _known(name: str, room: scene.Scene | None) -> object:
    """Return the known map called `name`, as configuration holds it; None for no name.

    Raises:
        services.mapping.config.BadKnownMap, experiments.slam.maps.BadMap: it is none.
    """
    if not name:
        return None
    if name == "plan" and room is not None:
        plan = rasterise(room)
        return msgspec.to_builtins(KnownMap.of(plan.cells, np.array(plan.origin)))
    from experiments.slam import maps  # OpenCV

    if not Path(name).is_file():
        raise maps.BadMap(f"sim.map is '{name}', expected plan, or a map's YAML file: there is no such file")
    return msgspec.to_builtins(KnownMap.of(*maps.read(Path(name))))


def _of_one_world(whole: Effective, world: str, other: str, drawn: str) -> None:
    """Refuse a configuration in which the driver and what stands in for eyes have another scene."""
    scenes = [msgspec.to_builtins(whole.sections[name])["scene"] for name in (world, other)]
    if scenes[0] != scenes[1]:
        origin = next((origin for key, origin in whole.origins.items() if ".scene." in key and origin != drawn), "")
        raise ConfigError(f"{origin}: {world}.scene and {other}.scene differ: the map would not be of this world")


def run(
    session: Session,
    record: Path | None = None,
    watch: Callable[[Time, PushStatus], None] | None = None,
    sinks: Sequence[Sink] = (),
    guarded: bool = True,
    lockstep: Spread | None = None,
    overwrite: bool = False,
) -> PushResult:
    """Run the push of `session`, recording it to `record` if given; in other processes if `lockstep` says where.

    Raises:
        CannotRecord, GoalRefused, BadSystem: see there.
    """
    timing = session.effective.sections["timing"]
    assert isinstance(timing, TimingConfig)
    with ExitStack() as stack:
        if record is not None:
            mode = "local" if lockstep is None else "lockstep"
            head = header.of_this_machine(mode, session.sim.seed, list(session.nodes))
            sinks = [stack.enter_context(Recorder(record, head, session.json(), overwrite)), *sinks]
        if lockstep is None:
            return push(session.services(), session.goal, sinks, timing.timing(), watch, guarded)
        from runtime.lockstep.run import workers

        nodes = stack.enter_context(workers(session.effective.sections, session.nodes, lockstep))
        return push_nodes(nodes, session.goal, sinks, timing.timing(), watch)


def _draw(sim: SimConfig) -> tuple[Layer, scene.Goal]:
    """Return what scene, object and seed decide, as the weakest layer, and the scene's own goal."""
    room = scene.get(sim.scene)
    name = sim.object or room.default_object
    words = [int(word) >> 1 for word in np.random.SeedSequence(sim.seed).generate_state(5, np.uint64)]
    generator = np.random.Generator(np.random.PCG64(words[0]))
    body = objects.draw(objects.get(name), generator)
    body = variants.altered(body, sim.object_diameter, sim.object_mass, sim.object_friction)
    room = variants.widened(room, sim.width, BaseModel().diameter)
    room = variants.started(room, sim.start, BaseModel().diameter, body.diameter, sim.seed)
    room = variants.distanced(room, sim.distance, BaseModel().diameter, sim.seed)
    room = scene.jittered(room, generator)
    if sim.changing:
        if sim.goal is not None:
            room = msgspec.structs.replace(room, goal=scene.Goal(x=sim.goal[0], y=sim.goal[1]))
        room = changing(room, body, BaseModel().diameter, sim.seed)
    if sim.depth:
        room = msgspec.structs.replace(room, camera=msgspec.structs.replace(room.camera, depth=True))
    world = {
        "seed": words[1],
        "scene": msgspec.to_builtins(room),
        "body": msgspec.to_builtins(body),
        "base": msgspec.to_builtins(BaseModel()),
    }
    values = {
        **{base[0]: world for base in BASES.values()},
        "perception": {
            "seed": words[2],
            "scene": msgspec.to_builtins(room),
            "object_diameter": body.diameter,
            "object_noise": room.noise.object_position,
            "object_yaw_noise": room.noise.object_yaw,
        },
        "camera": {
            "seed": words[3],
            "scene": msgspec.to_builtins(room),
            "body": msgspec.to_builtins(body),
            "base": msgspec.to_builtins(BaseModel()),
            "tagged": sim.tagged,
        },
        "floor": {"sees": "depth" if room.camera.depth else "appearance"},
        "mapping": {
            "seed": words[4] >> 10,
            "start": [room.robot.x, room.robot.y, room.robot.yaw],
            "known": _known(sim.map, room),
        },
        "tracker": {
            "finds": "tags" if sim.tagged else "depth" if room.camera.depth else "appearance",
            "height": body.height,
            "diameter": body.diameter if sim.tagged else 0.0,
        },
        **(_SENSED if sim.perception == "sensors" else {}),
    }
    return Layer(f"scene {sim.scene}, object {name}, seed {sim.seed}", values), room.goal
