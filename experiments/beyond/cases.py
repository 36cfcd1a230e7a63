"""Which pushes make up the experiments past the paper's: cases, and the trials in them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec

from drivers.sapien import objects, scene
from experiments.paper.cells import HOUSEHOLD, ROOMS, SHAPES, Task, UnknownMethod
from runtime.config.layers import ConfigError
from services.names import CONTROLLERS, STRATEGIES

PRECISION = 0.05
"""m, unless a case says otherwise."""
USUAL_PRECISION = 0.1
"""m, the paper's: what sensors find is off by a third of the other"""

CORRIDORS = ("corridor-1", "corridor-2", "corridor-3")
WIDTHS = (0.85, 1.0, 1.3, 1.8)

YAW, NO_YAW = "yaw seen", "no yaw"

GOALS = 24
GOAL_DISTANCE = 2.0
"""m from where the object starts; all goals are clear of the far walls then."""
FRICTIONS = (0.2, 0.6)
OPEN_OBJECTS = ("cheezit", "box", "cloud")
"""Those that differ most among the objects that slide: a light box whose contents lie to one side (0.26 m), a large
and heavy carton, evenly filled (0.43 m, up to 2 kg), and a light cushion of lobes with hollows between them. Objects
with wheels are left out, because the friction of the floor is what is varied."""
OPEN_LIMIT = 300.0
"""s, as in Pushing in the Dark."""
_AROUND = GOALS * len(FRICTIONS) * len(OPEN_OBJECTS)

SENSES: dict[str, dict[str, dict[str, Any]]] = {
    "truth": {},
    "tags": {"sim": {"perception": "sensors"}},
    "plan": {"sim": {"perception": "sensors", "map": "plan"}},
    "appearance": {"sim": {"perception": "sensors", "tagged": False}},
    "depth": {"sim": {"perception": "sensors", "tagged": False, "depth": True}},
    "untagged plan": {"sim": {"perception": "sensors", "tagged": False, "map": "plan"}},
    "no yaw": {"perception": {"yaw": False}},
}
"""How the pushes of `sensing` are seen: by truth with noise and delay, or by sensors, with an object that bears tags,
the same with the room's floor plan known, one without tags that looks other than the floor, one without before a
camera that measures depth, and one that looks other in a room whose floor plan is known."""
BLIND = ("appearance", "depth", "untagged plan")
"""those of them that see no yaw: truth without it stands beside them"""

YAWS = 8
"""orientations at the goal, at equal angles"""
YAW_PRECISION = math.radians(15.0)
"""rad"""


@dataclass(frozen=True)
class Case:
    """A kind of push.

    Attributes:
        experiment: best, open, orientation, robustness, dynamic or sensors.
        name: in words; cases of one name are one group of the tables.
        pushes: scene and object of trial i modulo their number.
        settings: configuration that makes the case, section by section.
        first, step: trial i has the seed of the run plus first + step * i.
        precision: m.
    """

    experiment: str
    name: str
    pushes: tuple[tuple[str, str], ...]
    settings: dict[str, dict[str, Any]]
    first: int = 0
    step: int = 1
    precision: float = PRECISION


@dataclass(frozen=True)
class Parameter:
    """What is varied alone.

    Attributes:
        name, unit: for people. usual: where it lies otherwise, low and high, in `unit`; None: as the objects are.
        scale: of the values to those of the configuration.
        log: whether the axis is to be logarithmic.
        slides: whether it says anything of objects that slide only.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    usual: tuple[float, float] | None
    scale: float = 1.0
    log: bool = False
    slides: bool = False
    keys: tuple[str, ...] = field(default=())

    def settings(self, value: float) -> dict[str, dict[str, Any]]:
        """Return the configuration in which the parameter is `value`, in `unit`."""
        amount = round(value * self.scale, 6)
        if self.name == "latency":
            # As far around the mean as usual, where there is room for it.
            spread = min(amount, _SPREAD)
            return {"perception": {"latency_low": round(amount - spread, 6), "latency_high": round(amount + spread, 6)}}
        return _nested((key, amount) for key in self.keys)


_SPREAD = 0.025
_NOISE = ("perception.object_noise", "perception.robot_noise")
_SPEED = ("strategy.predictive.speed", "controller.speed")

PARAMETERS = {
    one.name: one
    for one in (
        Parameter("noise", "mm", (0, 5, 10, 15, 20, 30), (5, 7), 0.001, keys=_NOISE),
        Parameter("latency", "ms", (0, 50, 100, 150, 200, 300), (50, 100), 0.001),
        Parameter("speed", "m/s", (0.1, 0.2, 0.3, 0.4, 0.5), (0.3, 0.3), keys=_SPEED),
        Parameter("size", "m", (0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6), None, keys=("sim.object_diameter",)),
        Parameter("mass", "kg", (0.05, 0.1, 0.3, 1.0, 3.0, 10.0), None, log=True, keys=("sim.object_mass",)),
        Parameter("friction", "", (0.1, 0.2, 0.3, 0.5, 0.7, 0.9), None, slides=True, keys=("sim.object_friction",)),
    )
}  # fmt: skip


def method(name: str) -> tuple[str, str]:
    """Return strategy and controller of a method: STRATEGY/CONTROLLER, or `predictive`, which is both.

    Raises:
        UnknownMethod: it is neither.
    """
    strategy, slash, controller = name.partition("/")
    if not slash and strategy in STRATEGIES and strategy in CONTROLLERS:
        controller = strategy
    if strategy not in STRATEGIES or controller not in CONTROLLERS:
        raise UnknownMethod(
            f"--method {name}: expected predictive, or STRATEGY/CONTROLLER with a strategy of {', '.join(STRATEGIES)} "
            f"and a controller of {', '.join(CONTROLLERS)}"
        )
    return strategy, controller


def has_wheels(thing: str) -> bool:
    """Return whether the object called `thing` has wheels."""
    return bool(objects.get(thing).wheels)


def best(yaw: bool = True) -> list[Case]:
    """Return the cases of the bar: corridors of four widths, and rooms, with every object."""
    seen = YAW if yaw else NO_YAW
    blind = {} if yaw else {"perception": {"yaw": False}}
    corridors = [
        Case("best", f"width {width:g}, {seen}", _each((place,), HOUSEHOLD), {"sim": {"width": width}} | blind)
        for width in WIDTHS
        for place in CORRIDORS
    ]
    return corridors + [
        Case("best", f"rooms, {what}, {seen}", _each((place,), things), blind)
        for what, things in (("objects of Experiment 1", SHAPES), ("household objects", HOUSEHOLD))
        for place in ROOMS
    ]


def around() -> list[Case]:
    """Return the 144 cases of goals all around: objects by floor frictions by directions.

    Each has seeds of its own: with one trial a case, all would else push the same object from the same pose.
    """
    start = scene.get("open").object
    found: list[Case] = []
    for friction in FRICTIONS:
        for thing in OPEN_OBJECTS:
            for k in range(GOALS):
                angle = math.tau * k / GOALS
                goal = [
                    round(start.x + GOAL_DISTANCE * math.cos(angle), 6),
                    round(start.y + GOAL_DISTANCE * math.sin(angle), 6),
                ]
                settings = {"sim": {"goal": goal, "object_friction": friction}}
                name = goal_name(friction, 360 * k // GOALS)
                found.append(Case("open", name, (("open", thing),), settings, len(found), _AROUND))
    return found


def goal_name(friction: float, degrees: int) -> str:
    """Return the name of a case of `around`."""
    return f"friction {friction:g}, goal at {degrees} deg"


def goal_of(name: str) -> tuple[float, int]:
    """Return friction and direction, in degrees, of a case of `around`: 0 is straight ahead, counter-clockwise."""
    found = re.fullmatch(r"friction (\S+), goal at (\d+) deg", name)
    assert found is not None, name
    return float(found[1]), int(found[2])


def turned() -> list[Case]:
    """Return the cases of goals with an orientation: corridors, and the open floor, with every household object.

    Seven objects and eight orientations share no divisor: 56 trials a scene have every pair once.
    """
    return [
        Case("orientation", yaw_name(degrees), _each((place,), HOUSEHOLD), _wanted(degrees), k, YAWS)
        for place in (*CORRIDORS, "open")
        for k, degrees in enumerate(range(0, 360, 360 // YAWS))
    ]


def yaw_name(degrees: int) -> str:
    """Return the name of a case of `turned`."""
    return f"turned to {degrees} deg"


def sweep(wanted: Sequence[str] = ()) -> list[Case]:
    """Return the cases of the parameters called `wanted`, or of all, in the order of PARAMETERS.

    Raises:
        ConfigError: no parameter is called so.
    """
    wrong = [name for name in wanted if name not in PARAMETERS]
    if wrong:
        raise ConfigError(
            f"--parameters: no parameter is called '{wrong[0]}'; expected some of {', '.join(PARAMETERS)}"
        )
    return [
        Case("robustness", value_name(one, value), _mixed(one.slides), one.settings(value))
        for one in PARAMETERS.values()
        if not wanted or one.name in wanted
        for value in one.values
    ]


def value_name(parameter: Parameter, value: float) -> str:
    """Return the name of a case of `sweep`."""
    return f"{parameter.name} {value:g} {parameter.unit}".strip()


def changing(perception: str) -> list[Case]:
    """Return the case of a cluttered room that changes while the robot pushes (Sec. 6.3.4), with every object."""
    settings = {"sim": {"changing": True, "perception": perception}}
    name = f"children's room, changing, {perception}"
    return [Case("dynamic", name, _each(("childrens-room",), HOUSEHOLD), settings, precision=USUAL_PRECISION)]


def sensing(kinds: Sequence[str] = ()) -> list[Case]:
    """Return the cases of one set of pushes in furnished rooms, seen in the ways called `kinds`, or in all.

    Raises:
        ConfigError: no way is called so.
    """
    wrong = [name for name in kinds if name not in SENSES]
    if wrong:
        raise ConfigError(f"--senses: nothing is called '{wrong[0]}'; expected some of {', '.join(SENSES)}")
    places, things = (*ROOMS, "living-room"), (*HOUSEHOLD, *SHAPES)
    assert math.gcd(len(places), len(things)) == 1
    pushes = tuple((places[i % len(places)], things[i % len(things)]) for i in range(len(places) * len(things)))
    return [
        Case("sensors", name, pushes, settings, precision=USUAL_PRECISION)
        for name, settings in SENSES.items()
        if not kinds or name in kinds
    ]


def tasks(cases: Sequence[Case], name: str, trials: int, first_seed: int) -> Iterator[Task]:
    """Yield `trials` of every case with the method called `name`, one of each in turn.

    Trial i has seed `first_seed` + i in every case but those of `around`, so that cases differ in nothing else, and
    the same seed with every method.

    Raises:
        UnknownMethod: see `method`.
    """
    strategy, controller = method(name)
    for i in range(trials):
        for case in cases:
            place, thing = case.pushes[i % len(case.pushes)]
            yield Task(
                experiment=case.experiment,
                method=name,
                start="scene",
                scene=place,
                object=thing,
                strategy=strategy,
                controller=controller,
                precision=case.precision,
                seed=first_seed + case.first + case.step * i,
                case=case.name,
                settings=msgspec.json.encode(case.settings, order="sorted").decode() if case.settings else "",
            )


def folder_of(one: Task) -> str:
    """Return the folder for recordings of the case that `one` is a trial of."""
    # In the sweep a case goes over the scenes; in the others each scene has its own.
    mixed = one.experiment in ("robustness", "sensors")
    words = [one.case, one.method] if mixed else [one.scene, one.object, one.case, one.method]
    if one.experiment in ("best", "orientation", "dynamic"):
        words.remove(one.object)
    return re.sub(r"[^a-z0-9.]+", "-", "-".join([one.experiment, *words]).lower())


def _wanted(degrees: int) -> dict[str, dict[str, Any]]:
    yaw = math.remainder(math.radians(degrees), math.tau)
    return {"sim": {"yaw": round(yaw, 6), "yaw_precision": round(YAW_PRECISION, 6)}}


def _each(places: Sequence[str], things: Sequence[str]) -> tuple[tuple[str, str], ...]:
    return tuple((place, thing) for place in places for thing in things)


def _mixed(slides: bool) -> tuple[tuple[str, str], ...]:
    """Return all corridors with all household objects; a few in a row mix both. Their numbers share no divisor."""
    things = [thing for thing in HOUSEHOLD if not (slides and has_wheels(thing))]
    assert math.gcd(len(CORRIDORS), len(things)) == 1
    count = len(CORRIDORS) * len(things)
    return tuple((CORRIDORS[i % len(CORRIDORS)], things[i % len(things)]) for i in range(count))


def _nested(items: Iterable[tuple[str, float]]) -> dict[str, Any]:
    """Return dotted keys as nested tables."""
    found: dict[str, Any] = {}
    for key, value in items:
        *above, last = key.split(".")
        inner = found
        for name in above:
            inner = inner.setdefault(name, {})
        inner[last] = value
    return found
