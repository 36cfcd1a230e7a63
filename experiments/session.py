"""One simulated push: from names and a seed to services, and through them to a result and a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from drivers.sapien import objects, scene, variants
from drivers.sapien.base import BaseModel
from drivers.sapien.config import SapienConfig
from drivers.sapien.occupancy import rasterise
from experiments.dynamic import changing
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
from services.names import CONTROLLERS, STRATEGIES

if TYPE_CHECKING:
    from runtime.lockstep.run import Spread

_SKILL = ("corridor", "strategy", "learner", "controller", "task")
_SENSES = {"truth": ("perception",), "sensors": ("camera", "mapping", "tracker")}
BASES = {
    "direct": ("driver",),
    "serial": ("emulated-serial", "robotino-serial"),
    "rest": ("emulated-rest", "robotino-rest"),
}
"""The nodes of the base by what lies between it and its driver; the first of them holds the simulated world."""
SYSTEMS = {(sense, link): (*base, *_SENSES[sense], *_SKILL) for sense in _SENSES for link, base in BASES.items()}
"""The services of a session by perception and link, in scheduling order: it breaks ties between timers."""
NODES = SYSTEMS["truth", "direct"]

_ON_OWN_MAP = {"unknown": "free", "apart": True, "spare": 0.1, "steady": True, "threshold": 0.1}
"""Settings of corridor for maps of sensors: they grow, are off by centimetres, and leave out object and robot."""

DEFAULT_SCENE = "living-room"


class SimConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The [sim] section: what to push where. Empty texts and zeros leave it to the scene and to [task]."""

    scene: Annotated[str, Meta(description="a scene of `pushlane sim --list`")] = DEFAULT_SCENE
    object: Annotated[str, Meta(description="an object of `pushlane sim --list`; empty: the scene's own")] = ""
    goal: Annotated[
        tuple[float, float] | None, Meta(description="m, where the object is to go; absent: the scene's own")
    ] = None
    yaw: (
        Annotated[float, Meta(ge=-6.3, le=6.3, description="rad, the object's orientation at the goal; absent: any")]
        | None
    ) = None
    yaw_precision: Annotated[float, Meta(ge=0, le=3.15, description="rad, of yaw; 0: as [task] says")] = 0.0
    strategy: Annotated[str, Meta(description="empty: as [task] says")] = ""
    controller: Annotated[str, Meta(description="empty: as [task] says")] = ""
    precision: Annotated[float, Meta(ge=0, le=5, description="m; 0: as [task] says")] = 0.0
    time_limit: Annotated[float, Meta(ge=0, le=36000, description="s; 0: as [task] says")] = 0.0
    seed: Annotated[int, Meta(ge=0, lt=2**53, description="of everything drawn")] = 1
    start: Annotated[
        Literal["scene", "behind", "beside", "front"],
        Meta(description="where the base starts, seen along the first push; scene: where the scene puts it"),
    ] = "scene"
    distance: Annotated[
        float, Meta(ge=0, le=20, description="m from the base to the object at the start; 0: as `start` says")
    ] = 0.0
    width: Annotated[
        float,
        Meta(gt=0.3, le=4, description="times the pushing corridor's half width; 1 except in corridor-1 to corridor-3"),
    ] = 1.0
    object_diameter: Annotated[
        float, Meta(ge=0, le=2, description="d_o, m: the object scaled to this, its mass kept; 0: its own")
    ] = 0.0
    object_mass: Annotated[float, Meta(ge=0, le=100, description="kg; 0: drawn from the object's range")] = 0.0
    object_friction: Annotated[
        float, Meta(ge=0, le=2, description="between floor and an object that slides; 0: drawn from its range")
    ] = 0.0
    perception: Annotated[
        Literal["truth", "sensors"],
        Meta(
            description="sensors: from camera, laser, infra-red and odometry; truth: positions from the simulation, "
            "with noise and delay"
        ),
    ] = "truth"
    link: Annotated[
        Literal["direct", "serial", "rest"],
        Meta(description="what lies between the simulated base and its driver: nothing, or a Robotino's own interface"),
    ] = "direct"
    map: Annotated[
        str,
        Meta(
            description="a map made before, for perception from sensors: map_server's YAML file, or `plan` for the "
            "scene's floor plan; empty: the map is made while pushing"
        ),
    ] = ""
    changing: Annotated[
        bool, Meta(description="while pushing, two things are put into the corridor and one is taken away")
    ] = False
    tagged: Annotated[bool, Meta(description="whether the object bears tags for the camera")] = True
    depth: Annotated[
        bool, Meta(description="whether the camera measures depth, as well as where the scene says so")
    ] = False


@dataclass(frozen=True)
class Session:
    """Everything a push is made of, resolved."""

    sim: SimConfig
    effective: Effective
    goal: PushGoal

    @property
    def nodes(self) -> tuple[str, ...]:
        """Return the names of the services, in scheduling order."""
        return SYSTEMS[self.sim.perception, self.sim.link]

    @property
    def world(self) -> SapienConfig:
        """Return the section of the node that holds the simulated world."""
        found = self.effective.sections[self.nodes[0]]
        assert isinstance(found, SapienConfig)
        return found

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
        "sim": SimConfig,
        "timing": TimingConfig,
        "bus": BusConfig,
        "live": LiveConfig,
        **{
            name: registry.service_class(name).Config
            for name in dict.fromkeys(name for names in SYSTEMS.values() for name in names)
        },
    }


def prepare(layers: Sequence[Layer]) -> Session:
    """Resolve configuration layers into a session.

    Raises:
        ConfigError, UnknownScene, UnknownObject, ObjectError: the configuration names something wrong.
    """
    sim_layers = [Layer(one.origin, {"sim": one.values["sim"]}) for one in layers if "sim" in one.values]
    sim = effective({"sim": SimConfig}, sim_layers)
    found = sim.sections["sim"]
    assert isinstance(found, SimConfig)
    for key, known in (("strategy", STRATEGIES), ("controller", CONTROLLERS)):
        name = getattr(found, key)
        if name and name not in known:
            origin = sim.origins.get(f"sim.{key}", "default")
            raise ConfigError(f"{origin}: sim.{key}: no {key} is called '{name}'; expected one of {', '.join(known)}")
    drawn, place = _draw(found)
    whole = effective(kinds(), [drawn, *layers])
    nodes = SYSTEMS[found.perception, found.link]
    unused = {name for names in SYSTEMS.values() for name in names} - set(nodes)
    whole = Effective({name: one for name, one in whole.sections.items() if name not in unused}, whole.origins)
    _of_one_world(whole, nodes[0], _SENSES[found.perception][0], drawn.origin)
    x, y = found.goal or (place.x, place.y)
    goal = PushGoal(
        position=Vector2(x=x, y=y),
        precision=found.precision,
        yaw=found.yaw,
        yaw_precision=found.yaw_precision,
        strategy=found.strategy,
        controller=found.controller,
        time_limit=found.time_limit,
    )
    return Session(found, whole, goal)


def _known(name: str, room: scene.Scene) -> object:
    """Return the known map called `name`, as configuration holds it; None for no name.

    Raises:
        services.mapping.config.BadKnownMap, experiments.slam.maps.BadMap: it is none.
    """
    if not name:
        return None
    if name == "plan":
        plan = rasterise(room)
        return msgspec.to_builtins(KnownMap.of(plan.cells, np.array(plan.origin)))
    from experiments.slam import maps  # OpenCV

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
        "corridor": _ON_OWN_MAP if sim.perception == "sensors" else {},
    }
    return Layer(f"scene {sim.scene}, object {name}, seed {sim.seed}", values), room.goal
