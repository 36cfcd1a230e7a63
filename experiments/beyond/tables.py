"""The tables of the experiments past the paper's."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from statistics import median

from experiments.beyond.cases import (
    BLIND,
    CORRIDORS,
    FRICTIONS,
    NO_YAW,
    OPEN_OBJECTS,
    PARAMETERS,
    SENSES,
    WIDTHS,
    YAW,
    goal_of,
    has_wheels,
    value_name,
)
from experiments.paper.cells import HOUSEHOLD, ROOMS, SHAPES
from experiments.paper.figures import paired, rate
from experiments.paper.tables import Table
from experiments.paper.trial import Outcome
from experiments.scoring import wilson

BAR_RATIO = {False: 1.25, True: 1.6}
"""Most that the median L_Qr / L_Qo may be, without and with wheels."""

BAR_BESIDE = 1.1
"""Most times another method's L_Qr that the predictive method's may be, on pushes that both deliver."""

ROOM_SETS = {"objects of Experiment 1": SHAPES, "household objects": HOUSEHOLD}

_SECTORS = (("ahead (to 45 deg)", 0, 45), ("beside (60 to 120 deg)", 60, 120), ("back (135 deg on)", 135, 180))

_BARS = {"household": 95.0, "rooms": 98.0, "narrow": 99.0, "width": 99.5}
_WITHOUT_YAW = 0.5

# Counts of 144 of the rates that its authors print: reactive, not reactive, and adaptive by vision.
_IN_THE_DARK = (("RPS", 127), ("NPS", 23), ("APS", 8))


def bar(case: str) -> float:
    """Return the least success in per cent that is asked of a case of `cases.best`."""
    kind = "narrow" if case.startswith(f"width {min(WIDTHS):g},") else "width"
    if case.startswith("rooms"):
        kind = "household" if "household" in case else "rooms"
    return _BARS[kind] - (_WITHOUT_YAW if case.endswith(NO_YAW) else 0.0)


def verdict(successes: int, trials: int, wanted: float) -> str:
    """Return whether a rate in per cent is that wanted: met, missed, or missed with an interval that reaches it."""
    if trials == 0:
        return "-"
    if 100 * successes / trials >= wanted:
        return "met"
    return "not decided" if 100 * wilson(successes, trials)[1] >= wanted else "missed"


def ratio(outcomes: Iterable[Outcome]) -> float | None:
    """Return the median L_Qr / L_Qo of the successes; None without any whose object moved."""
    found = [one.robot_length / one.object_length for one in outcomes if one.success and one.object_length > 0.0]
    return median(found) if found else None


def cases_of(outcomes: Sequence[Outcome], experiment: str) -> list[str]:
    """Return the names of the cases of best that there are trials of, in the order of the tables."""
    there = {one.case for one in outcomes if one.experiment == experiment}
    names = [f"width {width:g}" for width in WIDTHS] + [f"rooms, {what}" for what in ROOM_SETS]
    return [f"{name}, {seen}" for seen in (YAW, NO_YAW) for name in names if f"{name}, {seen}" in there]


def methods(outcomes: Iterable[Outcome]) -> list[str]:
    """Return the methods there are trials of, the predictive one first."""
    return sorted({one.method for one in outcomes}, key=lambda name: (name != "predictive", name))


def best(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return the tables of `pushlane experiment best`."""
    ours = [one for one in outcomes if one.experiment == "best"]
    cases = cases_of(ours, "best")
    bars, places, things, efforts = [], [], [], []
    for method in methods(ours):
        for case in cases:
            mine = [one for one in ours if (one.method, one.case) == (method, case)]
            if not mine:
                continue
            good = sum(one.success for one in mine)
            wheels = {kind: [one for one in mine if has_wheels(one.object) == kind] for kind in (False, True)}
            bars.append(
                (
                    method, case, f"{good}/{len(mine)}", rate(good, len(mine)), f"{bar(case):g} %",
                    verdict(good, len(mine), bar(case)),
                    *(_ratio_told(wheels[kind], kind) for kind in (False, True)),
                    str(sum(one.hits > 0 for one in mine)), failed(mine),
                )
            )  # fmt: skip
            places.append((method, case, *(_success(mine, "scene", name) for name in (*CORRIDORS, *ROOMS))))
            things.append((method, case, *(_success(mine, "object", name) for name in (*HOUSEHOLD, *SHAPES))))
            efforts.append(
                (method, case, *_medians(mine), *(_told(ratio(_of(mine, name))) for name in (*HOUSEHOLD, *SHAPES)))
            )
    return [
        Table(
            "The bar: success, precision 0.05 m; path ratios are medians of L_Qr / L_Qo over successes",
            (
                "method", "case", "success", "Wilson 95 %", "bar", "result",
                f"ratio, no wheels (at most {BAR_RATIO[False]:g})", f"ratio, wheels (at most {BAR_RATIO[True]:g})",
                "trials that hit furniture or walls", "failures",
            ),
            tuple(bars),
        ),
        Table("Success by scene", ("method", "case", *CORRIDORS, *ROOMS), tuple(places)),
        Table("Success by object", ("method", "case", *HOUSEHOLD, *SHAPES), tuple(things)),
        Table(
            "Effort of successes: medians, and the median L_Qr / L_Qo of each object",
            ("method", "case", *_MEDIANS, *HOUSEHOLD, *SHAPES),
            tuple(efforts),
        ),
    ]  # fmt: skip


def beside(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return the robot's paths of the predictive method beside those of others, on pushes that both delivered."""
    ours = [one for one in outcomes if one.experiment == "best"]
    rows = []
    for other in methods(ours)[1:]:
        for name, wheels in (("no wheels", False), ("wheels", True)):
            first, second = (
                [one for one in ours if one.method == method and has_wheels(one.object) == wheels]
                for method in ("predictive", other)
            )
            lengths = paired(first, second, lambda one: one.robot_length)
            if not lengths:
                continue
            mine, theirs = (sum(pair[k] for pair in lengths) / len(lengths) for k in (0, 1))
            result = "met" if mine <= BAR_BESIDE * theirs else "missed"
            rows.append(
                (other, name, str(len(lengths)), f"{mine:.2f}", f"{theirs:.2f}", f"{mine / theirs:.3f}, {result}")
            )
    headings = ("method", "objects", "both delivered", "L_Qr, predictive (m)", "L_Qr, method (m)")
    caption = "The robot's path beside other methods', means over the pushes that both delivered"
    return [Table(caption, (*headings, f"ratio (at most {BAR_BESIDE:g})"), tuple(rows))]


def around(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return the tables of `pushlane experiment open`."""
    ours = [one for one in outcomes if one.experiment == "open"]
    whole, things, sectors = [], [], []
    for method in methods(ours):
        mine = [one for one in ours if one.method == method]
        whole.append((f"{method}, here", *_row(mine)))
        for thing in OPEN_OBJECTS:
            for friction in FRICTIONS:
                some = [one for one in _of(mine, thing) if goal_of(one.case)[0] == friction]
                if some:
                    things.append((method, thing, f"{friction:g}", *_row(some)))
        for name, low, high in _SECTORS:
            some = [one for one in mine if low <= _aside(one) <= high]
            if some:
                sectors.append((method, name, *_row(some)))
    theirs = [(f"{name}, Pushing in the Dark", f"{n}/144", rate(n, 144), *["-"] * 6) for name, n in _IN_THE_DARK]
    return [
        Table("Goals all around: success, precision 0.05 m", ("method", *_ROW), (*whole, *theirs) if whole else ()),
        Table("By object and floor friction", ("method", "object", "friction", *_ROW), tuple(things)),
        Table("By where the goal lies, seen along the first push", ("method", "goal", *_ROW), tuple(sectors)),
    ]


def orientation(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return the tables of `pushlane experiment orientation`."""
    ours = [one for one in outcomes if one.experiment == "orientation"]
    things, places, yaws = [], [], []
    for method in methods(ours):
        mine = [one for one in ours if one.method == method]
        for name, some in (
            *((thing, _of(mine, thing)) for thing in HOUSEHOLD),
            ("no wheels", [one for one in mine if not has_wheels(one.object)]),
            ("wheels", [one for one in mine if has_wheels(one.object)]),
            ("all", mine),
        ):
            if some:
                things.append((method, name, *_row(some), _turned(some)))
        scenes = sorted({one.scene for one in mine})
        places += [(method, place, *_row([one for one in mine if one.scene == place])) for place in scenes]
        goals = sorted({one.case for one in mine}, key=lambda name: int(name.split()[2]))
        yaws += [(method, case, *_row([one for one in mine if one.case == case])) for case in goals]
    return [
        Table(
            "Goals with an orientation: success within 0.05 m and 15 degrees",
            ("method", "object", *_ROW, "off at the end (degrees)"),
            tuple(things),
        ),
        Table("By scene", ("method", "scene", *_ROW), tuple(places)),
        Table("By orientation, on the map", ("method", "goal", *_ROW), tuple(yaws)),
    ]


def robustness(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return the tables of `pushlane experiment robustness`."""
    ours = [one for one in outcomes if one.experiment == "robustness"]
    found = []
    for one in PARAMETERS.values():
        rows = []
        for method in methods(ours):
            for value in one.values:
                mine = [each for each in ours if (each.method, each.case) == (method, value_name(one, value))]
                if mine:
                    rows.append((method, f"{value:g}", *_row(mine)))
        unit = f", {one.unit}" if one.unit else ""
        found.append(Table(f"Robustness: {one.name}", ("method", f"{one.name}{unit}", *_ROW), tuple(rows)))
    return found


def dynamic(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return the tables of `pushlane experiment dynamic`."""
    ours = [one for one in outcomes if one.experiment == "dynamic"]
    rows = []
    for method in methods(ours):
        for case in sorted({one.case for one in ours if one.method == method}):
            mine = [one for one in ours if (one.method, one.case) == (method, case)]
            rows.append((method, case, "all", *_row(mine)))
            rows += [(method, case, thing, *_row(_of(mine, thing))) for thing in HOUSEHOLD if _of(mine, thing)]
    return [Table("Experiment 4: success", ("method", "case", "object", *_ROW), tuple(rows))]


def sensors(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return the tables of `pushlane experiment sensors`.

    Rates stand beside those of truth on the same seeds; of ways that see no yaw, beside truth without it.
    """
    ours = [one for one in outcomes if one.experiment == "sensors"]
    rows, places = [], []
    for method in methods(ours):
        mine = {name: [one for one in ours if (one.method, one.case) == (method, name)] for name in SENSES}
        for name, some in mine.items():
            if not some:
                continue
            other = "no yaw" if name in BLIND and mine["no yaw"] else "truth"
            known = {one.seed: one for one in mine[other]}
            both = [one for one in some if one.seed in known]
            gain = sum(one.success - known[one.seed].success for one in both)
            beside = f"{100 * gain / len(both):+.1f} of {len(both)}, {other}" if both and name != other else "-"
            rows.append((method, name, *_row(some), beside))
            scenes = sorted({one.scene for one in ours})
            places.append((method, name, *(_success(some, "scene", place) for place in scenes)))
    scenes = sorted({one.scene for one in ours})
    return [
        Table("From sensors: success", ("method", "seen by", *_ROW, "points beside"), tuple(rows)),
        Table("By scene", ("method", "seen by", *scenes), tuple(places)),
    ]


def tables(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return every table that there are trials for."""
    return [
        one
        for one in (
            *best(outcomes),
            *beside(outcomes),
            *around(outcomes),
            *orientation(outcomes),
            *robustness(outcomes),
            *dynamic(outcomes),
            *sensors(outcomes),
        )
        if one.rows
    ]


def failed(outcomes: Iterable[Outcome]) -> str:
    """Return the causes of failure with their numbers, the most frequent first."""
    counts = Counter(one.cause for one in outcomes if not one.success)
    return ", ".join(f"{cause} {n}" for cause, n in sorted(counts.items(), key=lambda item: (-item[1], item[0]))) or "-"


_MEDIANS = ("L_Qr (m)", "L_Qo (m)", "time (s)")
_ROW = ("success", "Wilson 95 %", *_MEDIANS, "L_Qr / L_Qo", "hits", "failures")


def _row(outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    good = sum(one.success for one in outcomes)
    return (
        f"{good}/{len(outcomes)}", rate(good, len(outcomes)), *_medians(outcomes), _told(ratio(outcomes)),
        str(sum(one.hits > 0 for one in outcomes)), failed(outcomes),
    )  # fmt: skip


def _medians(outcomes: Iterable[Outcome]) -> tuple[str, str, str]:
    good = [one for one in outcomes if one.success]
    if not good:
        return "-", "-", "-"
    return (
        f"{median(one.robot_length for one in good):.2f}",
        f"{median(one.object_length for one in good):.2f}",
        f"{median(one.time for one in good):.1f}",
    )


def _ratio_told(outcomes: Sequence[Outcome], wheels: bool) -> str:
    found = ratio(outcomes)
    if found is None:
        return "-"
    return f"{found:.3f}, {'met' if found <= BAR_RATIO[wheels] else 'missed'}"


def _success(outcomes: Sequence[Outcome], key: str, name: str) -> str:
    mine = [one for one in outcomes if getattr(one, key) == name]
    return f"{sum(one.success for one in mine)}/{len(mine)}" if mine else "-"


def _of(outcomes: Iterable[Outcome], thing: str) -> list[Outcome]:
    return [one for one in outcomes if one.object == thing]


def _turned(outcomes: Iterable[Outcome]) -> str:
    found = [math.degrees(one.turned) for one in outcomes if one.success and one.turned is not None]
    return f"{median(found):.1f}" if found else "-"


def _aside(one: Outcome) -> int:
    """Return how far to either side the goal lies, in degrees, 0 to 180."""
    degrees = goal_of(one.case)[1]
    return min(degrees, 360 - degrees)


def _told(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
