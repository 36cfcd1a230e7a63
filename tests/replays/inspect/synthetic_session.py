"""A made-up session: a robot pushes a disc around two bends. Same topics and types as a recorded one.

Nothing here is simulated; every motion is a formula of time, so that tests can say what a picture must hold.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import Message
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from runtime.messages import base_pb2, geometry_pb2, push_pb2, session_pb2, world_pb2

Floats = NDArray[np.float64]
Row = tuple[int, str, Message]

CELL = 0.05  # m
SIDE = 160  # cells: 8 m
ROBOT, OBJECT = 0.46, 0.30  # m, diameters
KAPPA_0, KAPPA_1 = 1.5, 9.0
LATE = 60_000_000  # ns between a pose and its message


def ns(seconds: float) -> int:
    return round(seconds * 1e9)


def wrapped(angle: float) -> float:
    return float(np.arctan2(np.sin(angle), np.cos(angle)))


def grid() -> NDArray[np.uint8]:
    """(SIDE, SIDE) cells, row y first: walls, four round obstacles, unknown outside."""
    cells = np.full((SIDE, SIDE), 255, np.uint8)
    cells[6:-6, 6:-6] = 0
    cells[6:9, 6:-6] = cells[-9:-6, 6:-6] = cells[6:-6, 6:9] = cells[6:-6, -9:-6] = 100
    y, x = np.mgrid[0:SIDE, 0:SIDE] * CELL
    for cx, cy, radius in ((4.4, 4.7, 0.55), (2.9, 2.6, 0.5), (6.3, 6.2, 0.5), (1.4, 2.0, 0.35)):
        cells[np.hypot(x - cx, y - cy) < radius] = 100
    return cells


def path(count: int = 120) -> Floats:
    """(count, 2) Q, map frame, m: two bends, points at equal arc length."""
    u = np.linspace(0.0, 1.0, 2000)
    q = np.column_stack([1.2 + 5.6 * u, 3.9 + 1.9 * np.sin(2.0 * np.pi * (u * 1.05 + 0.02))])
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(q, axis=0).T))])
    even = np.linspace(0.0, s[-1], count)
    return np.column_stack([np.interp(even, s, q[:, 0]), np.interp(even, s, q[:, 1])])


def clearance(points: Floats) -> Floats:
    """(N) m to the closest occupied cell."""
    far = distance_transform_edt(grid() != 100) * CELL
    return np.asarray(np.minimum(far[(points[:, 1] / CELL).astype(int), (points[:, 0] / CELL).astype(int)], 0.75))


def _polyline(points: Floats) -> geometry_pb2.Polyline:
    return geometry_pb2.Polyline(x=points[:, 0].tolist(), y=points[:, 1].tolist())


def _offset(points: Floats, by: Floats) -> Floats:
    along = np.gradient(points, axis=0)
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    return np.asarray(points + normal * by[:, None])


def corridor(version: int, scale: float, time: int) -> push_pb2.Corridor:
    """A corridor whose widths are `scale` times those of the map."""
    q = path()
    c = clearance(q) * scale
    width_push = c - ROBOT / 2.0
    width_object = width_push - (ROBOT + OBJECT) / 4.0
    edges = [_polyline(_offset(q, width_push)), _polyline(_offset(q, -width_push))]
    inner = [_polyline(_offset(q, width_object)), _polyline(_offset(q, -width_object))]
    return push_pb2.Corridor(
        stamp=time, version=version, goal_id=1, map_version=1, path=_polyline(q), clearance=c.tolist(),
        width_push=width_push.tolist(), width_object=width_object.tolist(), edge_push=edges, edge_object=inner,
        robot_diameter=ROBOT, object_diameter=OBJECT, found=True,
    )  # fmt: skip


class Push:
    """Where everything is at a time (s) of a push that takes `seconds`."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.q = path(1200)
        self.length = float(np.hypot(*np.diff(self.q, axis=0).T).sum())

    def along(self, time: float) -> float:
        """Index of Q where the object is: still for a tenth of the time, then at constant speed."""
        share = min(max((time / self.seconds - 0.1) / 0.86, 0.0), 1.0)
        return share * (len(self.q) - 25) + 10

    def object(self, time: float) -> Floats:
        index = self.along(time)
        low = int(index)
        o = self.q[low] + (index - low) * (self.q[min(low + 1, len(self.q) - 1)] - self.q[low])
        return np.asarray(o + 0.06 * np.sin(0.9 * time) * np.array([0.3, 1.0]))

    def target(self, time: float) -> Floats:
        return np.asarray(self.q[min(int(self.along(time)) + 130, len(self.q) - 1)])

    def alpha(self, time: float) -> float:
        return 0.35 * float(np.sin(1.1 * time)) * float(np.exp(-time / 40.0)) + 0.05

    def robot(self, time: float) -> Floats:
        """x, y, theta: behind the object, seen under alpha; coming from afar at first."""
        o, t = self.object(time), self.target(time)
        theta_ro = float(np.arctan2(t[1] - o[1], t[0] - o[0])) - self.alpha(time)
        away = (ROBOT + OBJECT) / 2.0 + 0.5 * max(0.0, 1.0 - time / (0.1 * self.seconds))
        return np.array([o[0] - away * np.cos(theta_ro), o[1] - away * np.sin(theta_ro), wrapped(theta_ro)])

    def velocity(self, time: float) -> Floats:
        """vx, vy, omega, base frame."""
        a, b = self.robot(time), self.robot(time + 0.02)
        d = (b - a) / 0.02
        cos, sin = np.cos(a[2]), np.sin(a[2])
        return np.array([cos * d[0] + sin * d[1], -sin * d[0] + cos * d[1], wrapped(b[2] - a[2]) / 0.02])


def _scan(push: Push, time: float, far: Floats) -> LaserScan:
    x, y, theta = push.robot(time)
    bearing = np.linspace(-2.09, 2.09, 240)
    reach = np.full(len(bearing), np.inf)
    for distance in np.arange(0.25, 5.6, 0.03):
        column = ((x + distance * np.cos(theta + bearing)) / CELL).astype(int).clip(0, SIDE - 1)
        row = ((y + distance * np.sin(theta + bearing)) / CELL).astype(int).clip(0, SIDE - 1)
        reach[np.isinf(reach) & (far[row, column] == 0.0)] = distance
    message = LaserScan(frame_id="base", start_angle=-2.09, end_angle=2.09, ranges=reach.tolist())
    message.timestamp.FromNanoseconds(ns(time))
    message.pose.orientation.w = 1.0
    return message


def _image(time: float) -> CompressedImage:
    picture = np.full((120, 160, 3), 90, np.uint8)
    cv2.circle(picture, (80 + int(20 * np.sin(time)), 80), 25, (40, 140, 255), -1)
    data = cv2.imencode(".jpg", picture)[1].tobytes()
    message = CompressedImage(frame_id="camera", format="jpeg", data=data)
    message.timestamp.FromNanoseconds(ns(time))
    return message


def rows(seconds: float, images: bool = False) -> Iterator[Row]:
    """Every message of a session, in no order."""
    push, rng = Push(seconds), np.random.default_rng(7)
    noise = rng.normal(size=4096)
    cells = grid()
    far = distance_transform_edt(cells != 100)
    goal = path()[-1]
    yield (
        0,
        "map",
        world_pb2.OccupancyGrid(
            stamp=0,
            version=1,
            resolution=CELL,
            width=SIDE,
            height=SIDE,
            origin=geometry_pb2.Vector2(),
            cells=cells.tobytes(),
        ),
    )
    for time, active in ((0.02 * seconds, True), (0.97 * seconds, False)):
        yield ns(time), "push/goal", push_pb2.PushGoal(
            stamp=ns(time), id=1, position=geometry_pb2.Vector2(x=goal[0], y=goal[1]), precision=0.2,
            strategy="relaxed", controller="adaptive", time_limit=120.0, active=active,
        )  # fmt: skip
    for version, (share, scale) in enumerate(((0.03, 1.0), (0.5, 0.93), (0.7, 1.0)), start=1):
        yield ns(share * seconds), "corridor", corridor(version, scale, ns(share * seconds))
    yield (
        ns(0.02 * seconds),
        "request/task",
        session_pb2.Request(id=1, name="push/goal", type="pushlane.PushGoal"),
    )
    yield ns(0.02 * seconds), "reply/task", session_pb2.Reply(id=1, name="push/goal", accepted=True)
    for tick in range(int(seconds * 50)):
        time = tick / 50.0
        x, y, theta = push.robot(time)
        vx, vy, omega = push.velocity(time)
        n = noise[tick % 4000 : tick % 4000 + 3]
        yield ns(time), "odometry", base_pb2.Odometry(
            stamp=ns(time), pose=geometry_pb2.Pose2(x=x - 1.0, y=y - 2.0, theta=theta), driver_sequence=tick,
            twist=geometry_pb2.Twist2(vx=vx + 0.01 * n[0], vy=vy + 0.01 * n[1], omega=omega + 0.02 * n[2]),
        )  # fmt: skip
        yield (
            ns(time) + LATE,
            "robot/pose",
            world_pb2.RobotPose(
                stamp=ns(time),
                pose=geometry_pb2.Pose2(x=x + 0.004 * n[0], y=y + 0.004 * n[1], theta=theta),
                driver_sequence=tick,
            ),
        )
        if tick % 2 == 0:
            yield from _at_25_hz(push, time, n)
        if tick % 5 == 0:
            yield from _at_10_hz(push, time, far, cells)
            if images:
                yield ns(time), "image", _image(time)
        if tick % 10 == 0:
            yield ns(time), "status", base_pb2.RobotStatus(
                stamp=ns(time), motors_enabled=True, battery_voltage=24.3 - 0.002 * time, diameter=ROBOT,
                commands_clamped=int(time // 20),
            )  # fmt: skip
            yield ns(time), "push/status", _status(push, time)
        if tick % 50 == 0:
            for number, node in enumerate(("controller", "strategy", "learner", "mapping")):
                yield (
                    ns(time),
                    f"health/{node}",
                    session_pb2.Health(
                        stamp=ns(time),
                        node=node,
                        handled=50,
                        queue_length=number % 2,
                        busy_mean=2e-4,
                        busy_max=1e-3 * (1 + number),
                    ),
                )
            yield ns(time), "journal/controller", session_pb2.Journal(node="controller", first=tick)
    for time, level, name, text in (
        (0.0, Log.INFO, "launcher", "eight services started"),
        (0.03 * seconds, Log.INFO, "corridor", "path of 8.4 m found, narrowest half width 0.31 m"),
        (0.42 * seconds, Log.WARNING, "tracker", "object predicted: no detection for 0.2 s"),
        (0.50 * seconds, Log.INFO, "corridor", "map changed: corridor version 2"),
        (0.62 * seconds, Log.ERROR, "mapping", "scan matching failed once"),
        (0.70 * seconds, Log.INFO, "corridor", "map changed: corridor version 3"),
    ):
        line = Log(level=level, name=name, message=text)
        line.timestamp.FromNanoseconds(ns(time))
        yield ns(time), f"log/{name}", line


def _at_25_hz(push: Push, time: float, n: Floats) -> Iterator[Row]:
    o, t = push.object(time), push.target(time)
    x, y, theta = push.robot(time)
    vx, vy, omega = push.velocity(time)
    alpha, learned = push.alpha(time), time / push.seconds
    yield ns(time), "truth", world_pb2.Truth(
        stamp=ns(time), robot=geometry_pb2.Pose2(x=x, y=y, theta=theta), object=geometry_pb2.Pose2(x=o[0], y=o[1]),
        robot_twist=geometry_pb2.Twist2(
            vx=np.cos(theta) * vx - np.sin(theta) * vy, vy=np.sin(theta) * vx + np.cos(theta) * vy, omega=omega
        ),
        touching=learned > 0.1 and np.sin(1.7 * time) > -0.9,
    )  # fmt: skip
    seen = world_pb2.PREDICTED if 0.42 < learned < 0.45 else world_pb2.VISIBLE
    if learned > 0.01:
        yield ns(time) + 2_000_000, "object/state", world_pb2.ObjectState(
            stamp=ns(time), position=geometry_pb2.Vector2(x=o[0] + 0.006 * n[0], y=o[1] + 0.006 * n[1]),
            diameter=OBJECT, visibility=seen,
        )  # fmt: skip
    if not 0.04 < learned < 0.97:
        return
    direction = (o - t) / np.hypot(*(o - t))
    p = o + direction * (ROBOT + OBJECT) / 2.0
    yield ns(time) + 3_000_000, "push/target", push_pb2.PushTarget(
        stamp=ns(time), corridor_version=1, target=geometry_pb2.Vector2(x=t[0], y=t[1]),
        object=geometry_pb2.Vector2(x=o[0], y=o[1]), push_position=geometry_pb2.Vector2(x=p[0], y=p[1]),
        strategy="relaxed", fallback=0.55 < learned < 0.58,
        distance_to_go=push.length * (1.0 - push.along(time) / len(push.q)),
    )  # fmt: skip
    mu = 0.25 * float(np.sin(4.0 * learned))
    yield ns(time) + 4_000_000, "push/behaviour", push_pb2.PushBehaviour(
        stamp=ns(time), alpha=alpha, gamma=-0.4 * alpha + 0.06 * n[1], mean_gamma=0.05 * float(np.sin(0.2 * time)),
        mu=mu, kappa=KAPPA_0 + (KAPPA_1 - KAPPA_0) * learned, alpha_p=mu,
        sample_count=int(10 * time), reading_count=int(20 * time),
        moving=learned > 0.1 and n[0] > -0.5,
    )  # fmt: skip
    psi = float(np.exp((KAPPA_0 + (KAPPA_1 - KAPPA_0) * learned) * (np.cos(alpha - mu) - 1.0)))
    yield ns(time) + 5_000_000, "command", base_pb2.VelocityCommand(
        stamp=ns(time), twist=geometry_pb2.Twist2(vx=vx * 1.02, vy=vy, omega=omega), deadline=200_000_000,
        controller="adaptive", psi_push=psi, psi_relocate=float(np.sqrt(1.0 - psi**2)), limited=0.3 < learned < 0.34,
    )  # fmt: skip


def _at_10_hz(push: Push, time: float, far: Floats, cells: NDArray[np.uint8]) -> Iterator[Row]:
    yield ns(time), "scan", _scan(push, time, far)
    below = geometry_pb2.Vector2(x=0.12)
    yield (
        ns(time),
        "floor",
        world_pb2.SeenFloor(
            stamp=ns(time), position=below, bearing=[0.3, 0.0], first=[0.3, 0.3], last=[0.9, 1.5], met=[True, False]
        ),
    )
    x, y, theta = push.robot(time)
    bearing = np.linspace(0.0, 2.0 * np.pi, 9, endpoint=False)
    distance = np.full(9, 0.4)
    for index, angle in enumerate(bearing):
        for reach in np.arange(0.02, 0.4, 0.02):
            px = x + (ROBOT / 2.0 + reach) * np.cos(theta + angle)
            py = y + (ROBOT / 2.0 + reach) * np.sin(theta + angle)
            if cells[int(py / CELL), int(px / CELL)] == 100 or np.hypot(*(push.object(time) - (px, py))) < OBJECT / 2.0:
                distance[index] = reach
                break
    yield (
        ns(time),
        "ranges",
        base_pb2.RangeArray(
            stamp=ns(time),
            bearing=bearing.tolist(),
            distance=distance.tolist(),
            ring_radius=ROBOT / 2.0,
            minimum=0.04,
            maximum=0.4,
        ),
    )


def _status(push: Push, time: float) -> push_pb2.PushStatus:
    share = time / push.seconds
    left = float(np.hypot(*(path()[-1] - push.object(time))))
    message = push_pb2.PushStatus(
        stamp=ns(time), goal_id=1, distance_left=left, elapsed=max(0.0, time - 0.02 * push.seconds)
    )
    message.robot_path_length, message.object_path_length = 1.15 * push.length * share, push.length * share
    if share < 0.02:
        message.phase = push_pb2.IDLE
    elif share < 0.04:
        message.phase = push_pb2.PLANNING
    elif share < 0.97:
        message.phase = push_pb2.WAITING if 0.42 < share < 0.45 else push_pb2.PUSHING
    else:
        message.phase, message.outcome, message.reason = (
            push_pb2.ENDED,
            push_pb2.DELIVERED,
            "object within precision",
        )
    return message


def write_session(
    out: Path, seconds: float = 8.0, without: frozenset[str] = frozenset(), images: bool = False
) -> dict[str, int]:
    """Writes the session, less the topics in `without`; gives the number of messages per topic."""
    return write_rows(out, [row for row in rows(seconds, images) if row[1] not in without])


def write_rows(out: Path, found: list[Row]) -> dict[str, int]:
    """Writes a session of these messages; gives the number of messages per topic."""
    counts: dict[str, int] = {}
    channels: dict[str, int] = {}
    with out.open("wb") as file:
        writer = Writer(file, chunk_size=64 * 1024)
        writer.start()
        writer.add_metadata("header", {"run": "synthetic", "seed": "7", "commit": "0123abc", "robot": "robotino"})
        writer.add_metadata("versions", {"numpy": np.__version__, "python": "3.11"})
        writer.add_attachment(0, 0, "config.toml", "text/plain", b"[controller]\nspeed = 0.2\n")
        for time, topic, message in sorted(found, key=lambda row: row[0]):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "protobuf", register_schema(writer, type(message)))
            counts[topic] = counts.get(topic, 0) + 1
            writer.add_message(channels[topic], time, message.SerializeToString(), time, counts[topic])
        writer.finish()
    return counts
