"""Which pushes make up the paper's experiments: cells, and the trials in them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import msgspec

from runtime.errors import PushlaneError
from services.names import CONTROLLERS, STRATEGIES

ROOMS = ("1A", "1B", "2A", "2B")
SHAPES = ("orange-cylinder", "green-cylinder", "blue-box", "red-box", "white-ball")
HOUSEHOLD = ("dino", "plane", "can", "cart", "cloud", "cheezit", "box")
STARTS = ("behind", "beside", "front")

TITLES = {
    "strategies": "Experiment 1: pushing strategies",
    "free-area": "Experiment 2: exploitation of free area",
    "controllers": "Experiment 3: controllers",
}
EXPERIMENTS = tuple(TITLES)

_BOTH = "predictive"
"""A method that is a strategy and a controller of its own; not in the paper."""

DEFAULT_METHODS = {
    "strategies": ("strict", "relaxed", "fixed-lookahead", _BOTH),
    "free-area": ("fixed-lookahead", "strict", "relaxed", _BOTH),
    "controllers": ("adaptive", "non-adaptive", "dipole", "centroid", _BOTH),
}

WHAT_A_CELL_IS = (
    "A cell is one scene and one method in Experiments 1 and 2, its trials spread evenly over the objects (trial i "
    "pushes object i modulo their number); one object and one method in Experiment 3, as in Table 4; and one "
    "experiment, one method and one start (behind, beside, front) where starts are told apart, its trials spread "
    "evenly over the scenes and objects of the experiment."
)


class UnknownMethod(PushlaneError):
    """No experiment has a method of this name; the message lists those there are."""


class Cell(msgspec.Struct, frozen=True, kw_only=True):
    """A kind of push.

    Attributes:
        experiment: of EXPERIMENTS.
        method: what the tables call it: a strategy in Experiments 1 and 2, a controller in 3.
        start: "scene", or one of STARTS.
        pushes: scene and object of trial i modulo their number.
    """

    experiment: str
    method: str
    start: str
    pushes: tuple[tuple[str, str], ...]

    @property
    def name(self) -> str:
        """Return a name for people and folders."""
        scenes, things = ({push[k] for push in self.pushes} for k in (0, 1))
        parts = [self.experiment, *(scenes if len(scenes) == 1 else ()), self.method]
        parts += [*(things if len(things) == 1 else ()), *((self.start,) if self.start != "scene" else ())]
        return "-".join(parts)


class Task(msgspec.Struct, frozen=True, kw_only=True):
    """One trial to be run.

    Attributes:
        precision: m.
        case: what tells the trial from others of the same scene and object, in words; empty in the paper's experiments.
        settings: configuration that the case adds to the user's, as JSON; empty: none.
    """

    experiment: str
    method: str
    start: str
    scene: str
    object: str
    strategy: str
    controller: str
    precision: float
    seed: int
    case: str = ""
    settings: str = ""

    @property
    def key(self) -> tuple[str, str, str, str, str, str, str, int]:
        """Return what tells this trial from every other."""
        kind = self.experiment, self.method, self.start, self.scene, self.object
        return *kind, self.case, self.settings, self.seed


def methods_of(experiment: str, wanted: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the methods of `experiment` among `wanted`, in the order of the paper's table; all if none is wanted.

    Raises:
        UnknownMethod: a wanted one is neither a strategy nor a controller.
    """
    for name in wanted:
        if name not in (*STRATEGIES, *CONTROLLERS):
            known = ", ".join(dict.fromkeys((*STRATEGIES, *CONTROLLERS)))
            raise UnknownMethod(f"no method is called '{name}'; expected some of {known}")
    default = DEFAULT_METHODS[experiment]
    if not wanted:
        return default
    possible = (*default, *(CONTROLLERS if experiment == "controllers" else STRATEGIES))
    return tuple(name for name in dict.fromkeys(possible) if name in wanted)


def cells(experiments: Iterable[str], methods: Sequence[str] = (), starts: Sequence[str] = STARTS) -> list[Cell]:
    """Return the cells of `experiments`; see WHAT_A_CELL_IS.

    Raises:
        UnknownMethod: see `methods_of`.
    """
    found = [
        Cell(experiment=experiment, method=method, start="scene", pushes=pushes)
        for experiment in experiments
        for method in methods_of(experiment, methods)
        for pushes in _groups(experiment)
    ]
    return found + [
        Cell(experiment=experiment, method=method, start=start, pushes=_every(experiment))
        for experiment in experiments
        for method in methods_of(experiment, methods)
        for start in starts
    ]


def tasks(wanted: Iterable[Cell], trials: int, first_seed: int) -> Iterator[Task]:
    """Yield `trials` of every cell, one of each in turn: whenever a run ends, its cells are equally full.

    Trial i has seed `first_seed` + i in every cell, so methods are compared on the same objects, starts and noise.
    """
    wanted = tuple(wanted)
    for i in range(trials):
        for cell in wanted:
            yield task(cell, i, first_seed)


def task(cell: Cell, i: int, first_seed: int) -> Task:
    """Return trial `i` of `cell`."""
    scene, thing = cell.pushes[i % len(cell.pushes)]
    if cell.method == _BOTH:
        strategy, controller = _BOTH, _BOTH
    elif cell.experiment == "controllers":
        strategy, controller = "relaxed", cell.method
    else:
        strategy, controller = cell.method, "adaptive"
    return Task(
        experiment=cell.experiment,
        method=cell.method,
        start=cell.start,
        scene=scene,
        object=thing,
        strategy=strategy,
        controller=controller,
        precision=0.1 if cell.experiment == "controllers" else 0.05,
        seed=first_seed + i,
    )


def cell_of(one: Task) -> Cell:
    """Return the cell that `one` is a trial of."""
    starts = () if one.start == "scene" else (one.start,)
    wanted = cells([one.experiment], [one.method], starts)
    return next(cell for cell in wanted if cell.start == one.start and (one.scene, one.object) in cell.pushes)


def _every(experiment: str) -> tuple[tuple[str, str], ...]:
    """Return all scenes with all objects; a few in a row already mix both. Their numbers have no common divisor."""
    pushes = [push for group in _groups(experiment) for push in group]
    scenes, things = (tuple(dict.fromkeys(push[k] for push in pushes)) for k in (0, 1))
    return tuple((scenes[i % len(scenes)], things[i % len(things)]) for i in range(len(pushes)))


def _groups(experiment: str) -> list[tuple[tuple[str, str], ...]]:
    if experiment == "strategies":
        return [tuple((scene, thing) for thing in SHAPES) for scene in ROOMS]
    if experiment == "free-area":
        return [tuple((scene, thing) for thing in HOUSEHOLD) for scene in ("corridor-1", "corridor-2")]
    return [(("corridor-3", thing),) for thing in HOUSEHOLD]
