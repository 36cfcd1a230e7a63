"""One run of an experiment past the paper's, from beginning to end, and its report."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.beyond import plots
from experiments.beyond.cases import (
    FRICTIONS,
    GOAL_DISTANCE,
    GOALS,
    OPEN_LIMIT,
    OPEN_OBJECTS,
    PRECISION,
    YAW_PRECISION,
    YAWS,
    Case,
    folder_of,
    tasks,
)
from experiments.beyond.tables import methods, tables
from experiments.paper.plots import save
from experiments.paper.report import PLOTS, every_failure, failures, provenance
from experiments.paper.store import Facts
from experiments.paper.tables import Table
from experiments.paper.trial import Outcome
from experiments.paper.whole import Run, pushed
from runtime.config.layers import Layer
from runtime.outputs import writing

TITLES = {
    "best": "The bar: corridors of four widths, and rooms",
    "open": "Goals all around, without obstacles",
    "orientation": "Goals with an orientation",
    "robustness": "One parameter at a time",
    "dynamic": "Experiment 4: a cluttered room that changes",
    "sensors": "From sensors beside truth",
}

WANTED = {"best": 200, "open": 1, "orientation": 7, "robustness": 21, "dynamic": 50, "sensors": 100}
"""Trials a case that a report is meant to have."""

DEFAULTS = {"open": [Layer("experiment open", {"sim": {"time_limit": OPEN_LIMIT}})]}
"""What an experiment sets unless the user does."""

NOTES = {
    "best": (
        "A case is one scene and one width, its trials spread evenly over its objects (trial i pushes object i modulo "
        "their number); the tables put the scenes of a case together. *Met*: the rate reaches the bar. *Not decided*: "
        "it does not, but its interval does. *Missed*: nor does its interval. A hit is a trial in which robot or "
        "object touched walls or furniture; it is no failure by itself."
    ),
    "open": (
        f"{GOALS} goals at equal angles, {GOAL_DISTANCE:g} m from where the object starts, by {len(OPEN_OBJECTS)} "
        f"objects ({', '.join(OPEN_OBJECTS)}), by floor frictions {' and '.join(f'{one:g}' for one in FRICTIONS)}: 144 "
        f"cases, {OPEN_LIMIT:g} s each, every one with a seed of its own. As many as in Pushing in the Dark "
        "(Özdamar et al. 2024), whose rates stand below ours. Its robot feels the object and does not see it, pushes "
        "at 0.05 m/s, and its objects, frictions, distances and physics are others: the two say how hard each found "
        "its own world, not who is better."
    ),
    "orientation": (
        f"{YAWS} orientations at equal angles by seven household objects, in Corridors 1 to 3 and on the open floor, "
        "each pair with a seed of its own. Success needs the true orientation to be within "
        f"{math.degrees(YAW_PRECISION):.0f} degrees as well. It is that of the object's own x axis: symmetries are not "
        "made use of."
    ),
    "robustness": (
        "One parameter at a time; all others as they are by default (noise of positions 7 mm for the object and 5 mm "
        "for the robot, latency 50 to 100 ms, V = 0.3 m/s; size, mass and friction the objects' own). Corridors 1 to 3 "
        "at width 1: trial i is in corridor i modulo 3, with household object i modulo their number. Noise is of both "
        "positions; latency is drawn evenly from 25 ms around the value; size is the diameter of the bounding circle, "
        "the object scaled at its mass; friction is the floor's, with objects that slide only."
    ),
    "dynamic": (
        "The children's room among scattered toys (Sec. 6.3.4), with every household object. While the robot pushes, "
        "two things are put into the corridor, at least 1 m before where the object can be by then, and one small "
        "thing is taken away; places, sizes, which one and when (1.5 to 8 s after the start) are drawn by the seed, so "
        "that a way is left from where the object started. A hit is a trial in which robot or object touched anything "
        "else."
    ),
    "sensors": (
        "The same pushes seen in different ways: in rooms 1A to 2B and the living-room, with every object, each with "
        "the same seed. *truth*: positions from the simulation with their usual noise and delay, and its map. Others: "
        "mapping from laser and odometry that begins with nothing, and the tracker's camera; *tags*: a cube of five "
        "tags on the object; *plan*: tags, and the room's floor plan known; *appearance*: none, it is found because it "
        "looks other than the floor; *depth*: none, before a camera that measures depth; *untagged plan*: none, found "
        "by its looks, in a room whose floor plan is known. These three see no yaw, as does *no yaw*: truth without it."
    ),
}


@dataclass(frozen=True, kw_only=True)
class Order(Run):
    """What is to be run: cases of one experiment, all with one method."""

    cases: tuple[Case, ...]
    method: str


def carry_out(order: Order) -> bool:
    """Carry out `order`, print the tables and write the report. Returns False if it was interrupted.

    Raises:
        ConfigError, UnknownMethod, BadRun, CannotScale, CannotAlter, NoRoomToStart, WorkerDied: see there.
    """
    wanted = list(tasks(order.cases, order.method, order.trials, order.first_seed))
    store, whole, kept = pushed(order, wanted, folder_of)
    with writing(order.folder):
        found = write(order, store.facts, store.outcomes, kept)
    for table in found:
        print(table.markdown(), end="\n\n")
    print(f"{order.folder / 'report.md'}: {len(store.outcomes)} trials", flush=True)
    return whole


def write(
    order: Order, run: Facts, outcomes: Sequence[Outcome], kept: Sequence[tuple[Outcome, Path]] = ()
) -> list[Table]:
    """Write report.md, failures.md and the plots of `outcomes`; returns the tables."""
    found = tables(outcomes)
    pictures = draw(order.folder / PLOTS, outcomes) if order.drawn else []
    shown = [name for name in TITLES if any(one.experiment == name for one in outcomes)]
    text = [
        f"# {' / '.join(TITLES[name] for name in shown) or 'No trials'}",
        "",
        *(line for name in shown for line in (_told(outcomes, name), "")),
        *provenance(run, order.command, order.jobs),
        f"- {len(outcomes)} trials, precision {_precisions(outcomes)} m. A trial has the same seed with every method.",
        "- Success is judged by the simulation's truth: the object's centre within the precision, neither centre ever "
        "outside the pushing corridor, in time. Intervals are Wilson's at 95 %. Paths, their ratios and times are "
        "medians over successes.",
        *(f"- {NOTES[name]}" for name in shown),
        "",
        "## Tables",
        "",
        *(line for table in found for line in (table.markdown(), "")),
    ]
    if pictures:
        text += ["## Plots", ""]
        for file, caption in pictures:
            text += [f"![{caption}]({PLOTS}/{file})", "", caption, ""]
    text += failures(outcomes, kept, order.folder)
    (order.folder / "report.md").write_text("\n".join(text), encoding="utf-8")
    (order.folder / "failures.md").write_text(every_failure(outcomes, run), encoding="utf-8")
    return found


def draw(folder: Path, outcomes: Sequence[Outcome]) -> list[tuple[str, str]]:
    """Draw what there are trials for; returns file names with captions."""
    made = []
    there = {one.experiment for one in outcomes}
    if "best" in there:
        caption = "Success with Wilson 95 % intervals beside the bar, and how much longer the robot's path is"
        made.append((save(plots.best(outcomes), folder, "best"), caption))
    if "open" in there:
        for name in methods(one for one in outcomes if one.experiment == "open"):
            file = save(plots.around(outcomes, name), folder, f"open-{name.replace('/', '-')}")
            made.append((file, f"Goals all around, {name}"))
    if "robustness" in there:
        caption = "Success over one parameter, with Wilson 95 % bands; grey: where the parameter lies otherwise"
        made.append((save(plots.robustness(outcomes), folder, "robustness"), caption))
    return made


def _precisions(outcomes: Sequence[Outcome]) -> str:
    return " and ".join(f"{one:g}" for one in sorted({one.precision for one in outcomes} or {PRECISION}))


def _told(outcomes: Sequence[Outcome], experiment: str) -> str:
    """Return how many trials a case has, and whether that is as many as meant."""
    ours = [one for one in outcomes if one.experiment == experiment]
    counts = Counter(folder_of(one) for one in ours).values()
    low, high = min(counts), max(counts)
    each = f"{low}" if low == high else f"{low} to {high}"
    if low >= WANTED[experiment]:
        return f"Trials a case: {each}."
    return f"**Fewer than {WANTED[experiment]} trials a case: there are {each}.**"
