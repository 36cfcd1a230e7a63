"""Pictures of the experiments past the paper's, from their trials."""

from __future__ import annotations

import math
from collections.abc import Sequence

import matplotlib.ticker
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from drivers.sapien import objects, scene
from drivers.sapien.base import BaseModel
from drivers.sapien.shapes import bounding_circle
from experiments.beyond import tables
from experiments.beyond.cases import (
    FRICTIONS,
    GOAL_DISTANCE,
    NO_YAW,
    OPEN_OBJECTS,
    PARAMETERS,
    YAW,
    goal_of,
    has_wheels,
    value_name,
)
from experiments.paper.cells import HOUSEHOLD, SHAPES
from experiments.paper.plots import COLOURS
from experiments.paper.trial import Outcome
from experiments.scoring import wilson

_SERIES = ("#5c4b9b", "#d55e00", "#009e73", "#56b4e9", "#cc79a7", "#777777")
_ASKED = "#2c9a4b"


def best(outcomes: Sequence[Outcome]) -> Figure:
    """Return success by case, path ratio by case, and success by object, a series for each method and yaw."""
    ours = [one for one in outcomes if one.experiment == "best"]
    series = [
        (method, seen)
        for method in tables.methods(ours)
        for seen in (YAW, NO_YAW)
        if any(one.method == method and one.case.endswith(seen) for one in ours)
    ]
    names = list(dict.fromkeys(case.rsplit(", ", 1)[0] for case in tables.cases_of(ours, "best")))
    things = [name for name in (*HOUSEHOLD, *SHAPES) if any(one.object == name for one in ours)]
    figure = Figure(figsize=(10.5, 8.0), layout="constrained")
    panels = figure.subplot_mosaic([["case", "ratio"], ["object", "object"]])
    by_case, ratios, lower = panels["case"], panels["ratio"], panels["object"]
    for k, (method, seen) in enumerate(series):
        colour = _SERIES[k % len(_SERIES)]
        aside = 0.7 * ((k + 0.5) / len(series) - 0.5)
        mine = [one for one in ours if one.method == method and one.case.endswith(seen)]
        for x, name in enumerate(names):
            case = f"{name}, {seen}"
            some = [one for one in mine if one.case == case]
            _rate(by_case, x + aside, some, colour)
            if some:
                asked = tables.bar(case)
                by_case.plot([x + aside - 0.12, x + aside + 0.12], [asked, asked], color=_ASKED, linewidth=1.6)
            for wheels, mark in ((False, "o"), (True, "s")):
                found = tables.ratio(one for one in some if has_wheels(one.object) == wheels)
                if found is not None:
                    ratios.plot([x + aside], [found], mark, color=colour, fillstyle="none" if wheels else "full")
        for x, name in enumerate(things):
            _rate(lower, x + aside, [one for one in mine if one.object == name], colour)
    for axes, title in ((by_case, "success (%), Wilson 95 %; green: the bar"), (lower, "success by object (%)")):
        axes.set_title(title, fontsize=10)
        # Rates near 100 are told apart only where the axis begins near them.
        least = min((float(np.min(line.get_ydata())) for line in axes.lines), default=0.0)
        bottom = 10.0 * math.floor(least / 10.0)
        axes.set_ylim(bottom - 0.02 * (100.0 - bottom), 100.0 + 0.03 * (100.0 - bottom))
    for wheels, style in ((False, "-"), (True, "--")):
        ratios.axhline(tables.BAR_RATIO[wheels], color=_ASKED, linestyle=style, linewidth=1.2)
    ratios.set_title("median L_Qr / L_Qo: dots and line without wheels,\nsquares and dashes with wheels", fontsize=10)
    labels = [name.replace("rooms, ", "rooms,\n").replace("of Experiment", "of Exp.") for name in names]
    for axes in (by_case, ratios):
        axes.set_xticks(range(len(names)), labels, fontsize=8, rotation=20)
        axes.set_xlim(-0.5, len(names) - 0.5)
    lower.set_xticks(range(len(things)), things, fontsize=8, rotation=20)
    lower.set_xlim(-0.5, len(things) - 0.5)
    for axes in (by_case, ratios, lower):
        axes.grid(axis="y", color="#e4e4e4", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.tick_params(axis="y", labelsize=8)
    handles = [
        matplotlib.lines.Line2D([], [], color=_SERIES[k % len(_SERIES)], marker="o", linestyle="", label=", ".join(one))
        for k, one in enumerate(series)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(series), 4), fontsize=9, frameon=False)
    return figure


def around(outcomes: Sequence[Outcome], method: str) -> Figure:
    """Return where the goals are and which were reached with `method`, a panel for each object and friction."""
    ours = [one for one in outcomes if one.experiment == "open" and one.method == method]
    place, base = scene.get("open"), BaseModel().diameter / 2
    ahead = math.atan2(place.object.y - place.robot.y, place.object.x - place.robot.x)
    behind = math.hypot(place.object.y - place.robot.y, place.object.x - place.robot.x)
    figure = Figure(figsize=(3.0 * len(OPEN_OBJECTS), 3.15 * len(FRICTIONS) + 0.5), layout="constrained")
    grid = figure.subplots(len(FRICTIONS), len(OPEN_OBJECTS), squeeze=False)
    for row, friction in enumerate(FRICTIONS):
        for column, thing in enumerate(OPEN_OBJECTS):
            axes = grid[row, column]
            mine = [one for one in ours if one.object == thing and goal_of(one.case)[0] == friction]
            radius = bounding_circle(objects.get(thing).parts)[2]
            axes.add_patch(Circle((0.0, 0.0), radius, color="#e0a060"))
            axes.add_patch(
                Circle((-behind * math.cos(ahead), -behind * math.sin(ahead)), base, fill=False, color="#222222")
            )
            for degrees in sorted({goal_of(one.case)[1] for one in mine}):
                some = [one for one in mine if goal_of(one.case)[1] == degrees]
                share = sum(one.success for one in some) / len(some)
                angle = math.radians(degrees)
                x, y = GOAL_DISTANCE * math.cos(angle), GOAL_DISTANCE * math.sin(angle)
                axes.plot([x], [y], "o", markersize=8, color=matplotlib.colormaps["RdYlGn"](share), mec="#444444")
                if share < 1.0:
                    axes.annotate(f"{100 * share:.0f}", (1.17 * x, 1.17 * y), fontsize=7, ha="center", va="center")
            good = sum(one.success for one in mine)
            axes.set_title(f"{thing}, friction {friction:g}: {good}/{len(mine)}", fontsize=9)
            axes.set_xlim(-2.6, 2.6)
            axes.set_ylim(-2.6, 2.6)
            axes.set_aspect("equal")
            axes.tick_params(labelsize=7)
    figure.supxlabel("m from where the object starts; black: the base", fontsize=8.5)
    figure.suptitle(f"{method}: share of pushes delivered at each goal, in per cent where not all", fontsize=10)
    return figure


def robustness(outcomes: Sequence[Outcome]) -> Figure:
    """Return success over each parameter that there are trials of, with Wilson bands, a panel a parameter."""
    ours = [one for one in outcomes if one.experiment == "robustness"]
    there = {one.case for one in ours}
    shown = [one for one in PARAMETERS.values() if any(value_name(one, value) in there for value in one.values)]
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(3.6 * columns + 0.4, 2.9 * rows + 0.6), layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    names = tables.methods(ours)
    for axes, one in zip(panels, shown, strict=False):
        if one.usual:
            low, high = one.usual
            axes.axvspan(low, high, color="#dddddd", linewidth=1.5, zorder=0)
        for k, method in enumerate(names):
            colour = COLOURS.get(method, _SERIES[(k + 1) % len(_SERIES)])
            found = []
            for value in one.values:
                mine = [each for each in ours if (each.method, each.case) == (method, value_name(one, value))]
                if mine:
                    good = sum(each.success for each in mine)
                    found.append((value, 100 * good / len(mine), *(100 * edge for edge in wilson(good, len(mine)))))
            if found:
                x, rate, bottom, top = zip(*found, strict=True)
                axes.fill_between(x, bottom, top, color=colour, alpha=0.2, linewidth=0)
                axes.plot(x, rate, color=colour, marker="o", markersize=4, linewidth=1.4, label=method)
        if one.log:
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter(matplotlib.ticker.StrMethodFormatter("{x:g}"))
        axes.set_ylim(-2, 103)
        axes.set_xlabel(f"{one.name} ({one.unit})" if one.unit else one.name, fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(color="#eeeeee", linewidth=0.7)
        axes.set_axisbelow(True)
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    figure.supylabel("success (%), Wilson 95 %", fontsize=9)
    if names:
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(names), fontsize=9, frameon=False)
    return figure


def _rate(axes: Axes, at: float, outcomes: Sequence[Outcome], colour: str) -> None:
    """Draw a rate in per cent with its interval; nothing without trials."""
    if not outcomes:
        return
    good = sum(one.success for one in outcomes)
    low, high = (100 * edge for edge in wilson(good, len(outcomes)))
    axes.plot([at, at], [low, high], color=colour, linewidth=1.3)
    axes.plot([at], [100 * good / len(outcomes)], "o", color=colour, markersize=4.5)
