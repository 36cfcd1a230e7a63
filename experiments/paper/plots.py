"""The paper's Fig. 7c, 9 and 10, drawn from our trials, as PNG and SVG."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from drivers.sapien.base import BaseModel
from drivers.sapien.scene import Scene
from drivers.sapien.shapes import Box, corners
from experiments.paper.cells import ROOMS
from experiments.paper.figures import select
from experiments.paper.samples import Push
from experiments.paper.tables import methods
from experiments.paper.trial import Outcome
from services.controller.activation import activations

matplotlib.use("Agg")
# Text stays text and ids stay the same, so that the same trials give the same file.
matplotlib.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": "pushlane"}

_DPI = 80
COLOURS = {
    "strict": "#0072b2",
    "relaxed": "#d55e00",
    "fixed-lookahead": "#009e73",
    "switching": "#56b4e9",
    "adaptive": "#0072b2",
    "non-adaptive": "#009e73",
    "dipole": "#cc79a7",
    "centroid": "#d55e00",
    "predictive": "#5c4b9b",
}
_TIMES = 5
"""Time steps k_1 to k_5 of Fig. 10."""


def efforts(outcomes: Sequence[Outcome]) -> Figure:
    """Return Fig. 7c: for each scene and strategy the robot path, the object path and the time of the successes."""
    ours = select(outcomes, experiment="strategies")
    shown = methods(ours, "strategies")
    figure = Figure(figsize=(11.5, 4.0), layout="constrained")
    panels = (("robot path L_Qr (m)", "robot_length"), ("object path L_Qo (m)", "object_length"), ("time (s)", "time"))
    width = 0.8 / max(len(shown), 1)
    for axes, (title, name) in zip(figure.subplots(1, 3), panels, strict=True):
        for k, method in enumerate(shown):
            for x, scene in enumerate(ROOMS):
                cell = select(ours, scene=scene, method=method)
                values = [getattr(one, name) for one in cell if one.success]
                at = x + (k - (len(shown) - 1) / 2) * width
                _box(axes, at, values, width, COLOURS.get(method, "#777777"))
        for edge in range(1, len(ROOMS)):
            axes.axvline(edge - 0.5, color="#dddddd", linewidth=0.8, zorder=0)
        axes.set_xticks(range(len(ROOMS)), ROOMS)
        axes.set_xlim(-0.5, len(ROOMS) - 0.5)
        most = max((getattr(one, name) for one in ours if one.success), default=1.0)
        axes.set_ylim(0.0, 1.05 * most)
        axes.set_title(title, fontsize=10)
        axes.tick_params(labelsize=8)
    handles = [matplotlib.patches.Patch(color=COLOURS.get(method, "#777777"), label=method) for method in shown]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(shown), fontsize=9, frameon=False)
    return figure


def trajectories(pushes: Sequence[Push], title: str) -> Figure:
    """Return a part of Fig. 9: the same push with every method, side by side."""
    bounds = pushes[0].scene.bounds
    tall = (bounds.max_y - bounds.min_y) / (bounds.max_x - bounds.min_x)
    figure = Figure(figsize=(2.8 * len(pushes), 2.6 * tall + 0.95), layout="constrained")
    for axes, push in zip(figure.subplots(1, len(pushes), squeeze=False).flat, pushes, strict=True):
        _trajectory(axes, push)
    figure.suptitle(title, fontsize=10)
    return figure


def activation_changes(pushes: Sequence[Push]) -> Figure:
    """Return Fig. 10: psi_push over alpha at five times of a push, a panel an object."""
    columns = min(4, len(pushes))
    rows = -(-len(pushes) // columns)
    figure = Figure(figsize=(2.9 * columns, 2.3 * rows + 0.5), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).flat
    alphas = np.linspace(-np.pi, np.pi, 361)
    for axes, push in zip(grid, pushes, strict=False):
        if len(push.learned):
            begun = push.learned[0, 0]
            for step, index in enumerate(np.linspace(0, len(push.learned) - 1, _TIMES).round().astype(int)):
                when, mu, kappa = push.learned[index]
                psi = [activations(float(angle), mu, kappa)[0] for angle in alphas]
                colour = matplotlib.colormaps["viridis"](step / _TIMES)
                axes.plot(alphas, psi, color=colour, linewidth=1.2, label=f"{when - begun:.1f} s")
            axes.legend(fontsize=6.5, loc="upper right", frameon=False, handlelength=1.0, borderaxespad=0.2)
        axes.set_title(f"{push.task.object}: {push.score.cause or 'delivered'}", fontsize=8.5)
        axes.set_xlim(-np.pi, np.pi)
        axes.set_ylim(0.0, 1.05)
        axes.set_xticks([-np.pi, 0.0, np.pi], ["-π", "0", "π"])
        axes.tick_params(labelsize=7, labelbottom=True)
    for axes in figure.axes[len(pushes) :]:
        axes.set_axis_off()
    figure.supxlabel(r"$\alpha$ (rad)", fontsize=8.5)
    figure.supylabel(r"$\psi_{push}$", fontsize=8.5)
    return figure


def save(figure: Figure, folder: Path, name: str) -> str:
    """Write `figure` as PNG and SVG into `folder`; returns the name of the PNG."""
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name}.png", dpi=_DPI)
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
    return f"{name}.png"


def _box(axes: Axes, at: float, values: Sequence[float], width: float, colour: str) -> None:
    """Draw median, quartiles, the whole range, and the mean as a dot. A cross on the axis: no success."""
    if not values:
        axes.plot([at], [0.0], marker="x", color=colour, markersize=6, clip_on=False, zorder=5)
        return
    low, q1, middle, q3, high = np.percentile(values, [0, 25, 50, 75, 100])
    axes.plot([at, at], [low, high], color=colour, linewidth=0.9, zorder=1)
    axes.bar(at, q3 - q1, 0.8 * width, bottom=q1, color=colour, alpha=0.55, zorder=2)
    axes.plot([at - 0.4 * width, at + 0.4 * width], [middle, middle], color="black", linewidth=1.1, zorder=3)
    axes.plot([at], [np.mean(values)], marker="o", color="black", markersize=2.5, zorder=4)


def _trajectory(axes: Axes, push: Push) -> None:
    walls(axes, push.scene)
    for edge in push.edges:
        axes.plot(edge[:, 0], edge[:, 1], color="#b89b00", linewidth=0.9, zorder=2)
    axes.plot(push.path[:, 0], push.path[:, 1], color="#999999", linewidth=0.8, linestyle="--", zorder=2)
    colour = COLOURS.get(push.task.method, "#777777")
    axes.plot(push.robot[:, 0], push.robot[:, 1], color="#222222", linewidth=0.8, zorder=3)
    axes.plot(push.object[:, 0], push.object[:, 1], color=colour, linewidth=2.0, zorder=4)
    axes.add_patch(Circle(tuple(push.robot[0]), BaseModel().diameter / 2, fill=False, color="#222222", linewidth=0.7))
    axes.plot(*push.object[0], marker="o", color=colour, markersize=4, zorder=5)
    goal = push.scene.goal
    axes.plot([goal.x], [goal.y], marker="*", color="#2c9a4b", markeredgecolor="black", markersize=9, zorder=6)
    bounds = push.scene.bounds
    axes.set_xlim(bounds.min_x, bounds.max_x)
    axes.set_ylim(bounds.min_y, bounds.max_y)
    axes.set_aspect("equal")
    axes.tick_params(labelsize=7)
    score = push.score
    axes.set_title(
        f"{push.task.method}: {score.cause or 'delivered'}\n"
        f"robot {score.robot_length:.1f} m, object {score.object_length:.1f} m, {score.time:.0f} s",
        fontsize=8.5,
    )


def walls(axes: Axes, scene: Scene) -> None:
    """Draw walls and furniture."""
    for shape in scene.obstacles():
        if isinstance(shape, Box):
            axes.add_patch(matplotlib.patches.Polygon(corners(shape), closed=True, color="#cfcfcf", zorder=1))
        else:
            axes.add_patch(Circle((shape.x, shape.y), shape.radius, color="#cfcfcf", zorder=1))
