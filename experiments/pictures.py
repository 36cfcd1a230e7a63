"""Draws every scene and every object into docs/pictures: `python -m experiments.pictures`."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from scipy.ndimage import distance_transform_edt

from drivers.sapien import objects, scene
from drivers.sapien.base import BaseModel
from drivers.sapien.occupancy import rasterise
from drivers.sapien.scene import BoxObstacle, DiscObstacle, Scene, outer_walls
from drivers.sapien.shapes import Box, Disc, Shape, corners, moved

matplotlib.use("Agg")

FOLDER = Path("docs/pictures")
SEED = 1
_ROBOT, _OBJECT, _GOAL, _ROOM = "#2f6db3", "#e08a1e", "#2c9a4b", "#dff0e4"
_WALL = "#5c5c5c"
_DPI = 80
_OVERVIEW_DPI = 70


def draw_scene(axes: Axes, one: Scene, labels: bool = True) -> None:
    """Draw `one`: walls, furniture, where the base's centre fits, base, object and goal."""
    robot_radius = BaseModel().diameter / 2
    grid = rasterise(one, 0.025)
    fits = distance_transform_edt(grid.cells == 0) * grid.resolution > robot_radius
    high, wide = grid.cells.shape
    extent = (
        grid.origin[0], grid.origin[0] + wide * grid.resolution,
        grid.origin[1], grid.origin[1] + high * grid.resolution,
    )  # fmt: skip
    axes.imshow(
        np.where(fits, 1.0, np.nan), origin="lower", extent=extent, zorder=0, interpolation="nearest",
        cmap=matplotlib.colors.ListedColormap([_ROOM]),
    )  # fmt: skip
    pieces: tuple[BoxObstacle | DiscObstacle, ...] = (*one.boxes, *one.discs)
    for piece in pieces:
        _fill(axes, _plain(piece), piece.colour)
        if labels and piece.label:
            tall = isinstance(piece, BoxObstacle) and piece.width > piece.length
            axes.text(
                piece.x, piece.y, piece.label, ha="center", va="center", fontsize=6.5, zorder=4,
                rotation=90 if tall else 0,
            )  # fmt: skip
    for wall in outer_walls(one.bounds):
        _fill(axes, wall, _WALL, above=0.5)
    _arrow_disc(axes, one.robot.x, one.robot.y, one.robot.yaw, robot_radius)
    model = objects.get(one.default_object)
    body = objects.draw(model, np.random.default_rng(SEED))
    for part in body.parts:
        _fill(axes, moved(part, one.object.x, one.object.y, one.object.yaw), _OBJECT)
    axes.plot([one.goal.x], [one.goal.y], marker="*", markersize=11, color=_GOAL, markeredgecolor="black", zorder=5)
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], extent[3])
    axes.set_aspect("equal")
    axes.set_title(one.title if labels else one.name, fontsize=9)
    axes.tick_params(labelsize=7)


def draw_object(axes: Axes, name: str, labels: bool = True) -> None:
    """Draw one draw of object `name`: parts, support or wheels, bounding circle, centre of mass."""
    model = objects.get(name)
    body = objects.draw(model, np.random.default_rng(SEED))
    for part in body.parts:
        _fill(axes, part, _OBJECT, 0.55)
    axes.add_patch(Circle((0, 0), body.diameter / 2, fill=False, linestyle="--", linewidth=1, edgecolor=_ROBOT))
    on = objects.floor(body)
    at = on.position + np.array([body.centre_x, body.centre_y])
    if body.wheels:
        for wheel in body.wheels:
            _fill(axes, Box(x=wheel.x, y=wheel.y, yaw=wheel.yaw, length=0.05, width=0.015), "#202020")
    else:
        size = (25 if labels else 6) * on.limit[:, 0] / on.limit[:, 0].max()
        axes.scatter(at[:, 0], at[:, 1], s=size, color="#303030", zorder=4)
    axes.plot([0], [0], marker="+", markersize=9, color=_ROBOT, zorder=6)
    axes.plot([body.centre_x], [body.centre_y], marker="o", markersize=6, color="#c02020", zorder=6)
    reach = 0.27
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_aspect("equal")
    axes.tick_params(labelsize=7)
    if not labels:
        axes.set_xticks([-0.2, 0.0, 0.2])
        axes.set_yticks([-0.2, 0.0, 0.2])
    axes.set_title(model.title if labels else name, fontsize=9)
    if labels:
        grip = f"wheels {model.along} along, {model.across} across" if body.wheels else f"friction {model.friction}"
        axes.set_xlabel(
            f"d_o = {body.diameter:.3f} m   mass {model.mass} kg\n{grip}\n"
            "dashed: bounding circle, +: o, red: a drawn centre of mass,\n"
            + ("black: wheels" if body.wheels else "black: support points, size = load"),
            fontsize=7.5,
        )


def _plain(piece: BoxObstacle | DiscObstacle) -> Shape:
    if isinstance(piece, BoxObstacle):
        return Box(x=piece.x, y=piece.y, yaw=piece.yaw, length=piece.length, width=piece.width)
    return Disc(x=piece.x, y=piece.y, radius=piece.radius)


def _fill(axes: Axes, shape: Shape, colour: str, alpha: float = 1.0, above: float = 0.0) -> None:
    if isinstance(shape, Disc):
        patch: Circle | Polygon = Circle((shape.x, shape.y), shape.radius)
    else:
        patch = Polygon(corners(shape), closed=True)
    patch.set(facecolor=colour, edgecolor="black", linewidth=0.4, alpha=alpha, zorder=3 + above)
    axes.add_patch(patch)


def _arrow_disc(axes: Axes, x: float, y: float, yaw: float, radius: float) -> None:
    _fill(axes, Disc(x=x, y=y, radius=radius), _ROBOT)
    tip = (x + radius * cos(yaw), y + radius * sin(yaw))
    axes.annotate("", tip, (x, y), arrowprops={"arrowstyle": "->", "color": "white"}, zorder=6)


def _overview(
    name: str, shown: tuple[str, ...], columns_rows: tuple[int, int], draw: Callable[[Axes, str], None]
) -> None:
    columns, rows = columns_rows
    figure = Figure(figsize=(1.8 * columns, 1.75 * rows), layout="constrained")
    for axes, one in zip(figure.subplots(rows, columns).flat, shown, strict=False):
        draw(axes, one)
    for axes in figure.axes[len(shown) :]:
        axes.set_axis_off()
    figure.savefig(FOLDER / f"{name}.png", dpi=_OVERVIEW_DPI)


def main() -> None:
    """Write scene-NAME.png, object-NAME.png, scenes.png, recovery.png and objects.png."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in scene.names():
        figure = Figure(figsize=(5.6, 4.8), layout="constrained")
        axes = figure.add_subplot()
        draw_scene(axes, scene.get(name))
        axes.set_xlabel("x / m    green: the base's centre fits, blue: base, orange: object, star: goal", fontsize=7.5)
        axes.set_ylabel("y / m", fontsize=7.5)
        figure.savefig(FOLDER / f"scene-{name}.png", dpi=_DPI)
    for name in objects.names():
        figure = Figure(figsize=(4.2, 4.8), layout="constrained")
        draw_object(figure.add_subplot(), name)
        figure.savefig(FOLDER / f"object-{name}.png", dpi=_DPI)
    recovery = tuple(name for name in scene.names() if name.startswith("recovery-"))
    others = tuple(name for name in scene.names() if name not in recovery)
    for overview, shown, shape in (("scenes", others, (4, 3)), ("recovery", recovery, (3, 2))):
        _overview(overview, shown, shape, lambda axes, name: draw_scene(axes, scene.get(name), False))
    _overview("objects", objects.names(), (5, 3), lambda axes, name: draw_object(axes, name, False))


if __name__ == "__main__":
    main()
