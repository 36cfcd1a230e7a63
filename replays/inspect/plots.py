"""Plots numbers over time: angles, velocities, depth in the corridor, distance left, the machinery's health."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replays.inspect import palette
from replays.inspect.canvas import Canvas
from replays.inspect.places import Places
from replays.inspect.session import Session
from replays.inspect.shapes import corridor_depth, rotated
from runtime.messages import (
    Corridor,
    Health,
    Odometry,
    PushBehaviour,
    PushPhase,
    PushStatus,
    PushTarget,
    RobotStatus,
    Truth,
    VelocityCommand,
)

Floats = NDArray[np.float64]


def draw_plots(canvas: Canvas, session: Session, where: Places) -> None:
    """Every plot whose topics are there."""
    _plot_behaviour(canvas, session)
    _plot_velocities(canvas, session)
    _plot_depth(canvas, session, where)
    _plot_distance(canvas, session)
    _plot_base(canvas, session)
    _plot_health(canvas, session)


def _plot_behaviour(canvas: Canvas, session: Session) -> None:
    track = session.track("push/behaviour", PushBehaviour)
    times, messages = track.times, track.messages
    fresh = np.array([m.moving for m in messages], bool)
    gamma = np.array([m.gamma for m in messages])
    # gamma only means something where the object moved.
    canvas.dots("/angles/gamma", times[fresh], gamma[fresh], palette.GAMMA, "gamma", 1.2)
    canvas.series("/angles/mean_gamma", times, [m.mean_gamma for m in messages], palette.MEAN_GAMMA, "mean gamma")
    canvas.series("/angles/alpha", times, [m.alpha for m in messages], palette.ALPHA, "alpha")
    canvas.series("/angles/mu", times, [m.mu for m in messages], palette.MU, "mu")
    canvas.series("/angles/alpha_p", times, [m.alpha_p for m in messages], palette.ALPHA_P, "alpha_p")
    canvas.series("/learned/kappa", times, [m.kappa for m in messages], palette.MU, "kappa", 2.0)
    canvas.series("/samples/alphas", times, [m.sample_count for m in messages], palette.ALPHA, "|A_k| alphas")
    canvas.series("/samples/gammas", times, [m.reading_count for m in messages], palette.GAMMA, "|Gamma_k| gammas")
    commands = session.track("command", VelocityCommand)
    for name, values, colour in (
        ("psi_push", [m.psi_push for m in commands.messages], palette.PSI),
        ("psi_relocate", [m.psi_relocate for m in commands.messages], palette.PUSH_POSITION),
    ):
        canvas.series(f"/blend/{name}", commands.times, values, colour, name)


def _plot_velocities(canvas: Canvas, session: Session) -> None:
    """The command against what the base measured, and against the truth; base frame."""
    commands = session.track("command", VelocityCommand)
    readings = session.track("odometry", Odometry)
    truths = session.track("truth", Truth)
    moved = np.array([(m.robot_twist.vx, m.robot_twist.vy) for m in truths.messages]).reshape(-1, 2)
    true = np.column_stack(
        [
            rotated(moved, -np.array([m.robot.theta for m in truths.messages])),
            np.array([m.robot_twist.omega for m in truths.messages]),
        ]
    )
    wanted = np.array([(m.twist.vx, m.twist.vy, m.twist.omega) for m in commands.messages]).reshape(-1, 3)
    measured = np.array([(m.twist.vx, m.twist.vy, m.twist.omega) for m in readings.messages]).reshape(-1, 3)
    for source, times, twist, colour, width in (
        ("truth", truths.times, true, palette.TRUTH_LINE, 1.0),
        ("base", readings.times, measured, palette.BASE, 1.6),
        ("command", commands.times, wanted, palette.COMMAND, 1.6),
    ):
        values: dict[str, Floats] = {
            "vx": twist[:, 0],
            "vy": twist[:, 1],
            "omega": twist[:, 2],
            "speed": np.hypot(twist[:, 0], twist[:, 1]),
        }
        for name, series in values.items():
            canvas.series(f"/velocity/{name}/{source}", times, series, colour, source, width)


def _plot_depth(canvas: Canvas, session: Session, where: Places) -> None:
    """max_i (W_i - |x - q_i|) for robot and object, by the corridor in force at the time."""
    corridors = session.track("corridor", Corridor)
    for name, times, points, inner, colour in (
        ("robot", where.robot_times, where.robot[:, :2], False, palette.ROBOT),
        ("object", where.object_times, where.object, False, palette.OBJECT),
        ("object_inner", where.object_times, where.object, True, palette.OBJECT_CORRIDOR),
    ):
        at = corridors.latest(times)
        depth = np.full(len(times), np.nan)
        for index in np.unique(at[at >= 0]):
            corridor = corridors.messages[index]
            path = np.column_stack([corridor.path.x, corridor.path.y])
            width = np.array(corridor.width_object if inner else corridor.width_push, np.float64)
            if len(path) == 0 or len(width) != len(path):
                continue
            rows = at == index
            depth[rows] = corridor_depth(points[rows], path, width)
        known = np.isfinite(depth)
        label = {"robot": "robot in E", "object": "object in E", "object_inner": "object in E_o"}[name]
        canvas.series(f"/depth/{name}", times[known], depth[known], colour, label)
    first, last = session.span
    if canvas.has("/depth"):
        canvas.series("/depth/edge", np.array([first, last]), [0.0, 0.0], palette.BAD, "edge", 1.2)


def _plot_distance(canvas: Canvas, session: Session) -> None:
    statuses = session.track("push/status", PushStatus)
    targets = session.track("push/target", PushTarget)
    under_way = np.array([m.phase > PushPhase.IDLE for m in statuses.messages], bool)
    left = np.array([m.distance_left for m in statuses.messages])[under_way]
    canvas.series("/distance/straight", statuses.times[under_way], left, palette.DISTANCE, "straight o-g", 2.0)
    canvas.series(
        "/distance/path", targets.times, [m.distance_to_go for m in targets.messages], palette.PATH, "along Q"
    )
    for name, values, colour in (
        ("L_Qr", [m.robot_path_length for m in statuses.messages], palette.ROBOT),
        ("L_Qo", [m.object_path_length for m in statuses.messages], palette.OBJECT),
    ):
        canvas.series(f"/lengths/{name}", statuses.times, values, colour, name)


def _plot_base(canvas: Canvas, session: Session) -> None:
    track = session.track("status", RobotStatus)
    for name, values, colour in (
        ("clamped", [m.commands_clamped for m in track.messages], palette.WARN),
        ("refused", [m.commands_refused for m in track.messages], palette.BAD),
        ("stale", [m.commands_stale for m in track.messages], palette.GAMMA),
    ):
        canvas.series(f"/base/commands/{name}", track.times, values, colour, f"commands {name}")
    voltages = [m.battery_voltage for m in track.messages]
    canvas.series("/base/battery", track.times, voltages, palette.GOAL, "battery, V")


def _plot_health(canvas: Canvas, session: Session) -> None:
    shades = (
        palette.ALPHA,
        palette.GAMMA,
        palette.ALPHA_P,
        palette.MU,
        palette.DISTANCE,
        palette.BASE,
        palette.COMMAND,
    )
    topics = [topic for topic in session.tracks if topic.startswith("health/")]
    for number, topic in enumerate(topics):
        track, node = session.track(topic, Health), topic.removeprefix("health/")
        colour = shades[number % len(shades)]
        busy = [1e3 * m.busy_max for m in track.messages]
        canvas.series(f"/health/busy/{node}", track.times, busy, colour, f"{node} slowest, ms")
        queue = [m.queue_length for m in track.messages]
        canvas.series(f"/health/queue/{node}", track.times, queue, colour, f"{node} queue")
