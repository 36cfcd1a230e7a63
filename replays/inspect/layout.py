"""Arranges the views: the map from above on the left, the learning and the numbers on the right."""

from __future__ import annotations

import math

import rerun.blueprint as rrb
from rerun import TimeRange

from replays.inspect.bodies import NEAR
from replays.inspect.canvas import TIMELINE, Canvas
from replays.inspect.learning import HISTORY
from replays.inspect.places import Ground
from replays.inspect.response import BODY

HALF_VIEW = math.radians(55.0) / 2.0  # half the vertical opening of Rerun's eye
ASPECT = 1.12  # width over height of the map view, at its narrowest
# A plot's legend covers its right end: so much empty time, as a share of the session, keeps the lines clear of it.
WIDE, NARROW, LANES = 0.26, 0.38, 0.10
LIVE = 60.0  # s of a live session that plots show
NORTH = (0.0, 1.0, 0.0)


class Layout:
    """Makes a blueprint with a view for everything that was drawn, and none for what was not.

    Args:
        live: the session goes on: plots show its last minute, and the cursor follows.
    """

    def __init__(self, canvas: Canvas, ground: Ground, span: tuple[int, int], live: bool = False) -> None:
        self._canvas = canvas
        self._ground = ground
        self._first, self._last = span
        self._live = live

    def blueprint(self) -> rrb.Blueprint:
        """The whole window."""
        # The session's facts need a tall place; behind the map is one.
        facts = rrb.TextDocumentView(origin="/session", name="Session")
        left = _stack((rrb.Tabs(self._map(), facts, active_tab=0), 4.2), (self._lanes(), 1.2))
        right = _stack(
            (self._close_up(), 1.9),
            (self._learning(), 1.35),
            (self._velocities(), 1.15),
            (self._corridor(), 1.15),
            (self._texts(), 1.05),
        )
        return rrb.Blueprint(
            rrb.Horizontal(left, right, column_shares=[1.0, 1.1]),
            rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following" if self._live else None),
            rrb.SelectionPanel(state="hidden"),
            rrb.BlueprintPanel(state="hidden"),
            rrb.TopPanel(state="hidden"),
            auto_views=False,
            auto_layout=False,
        )

    def _map(self) -> rrb.View:
        ground = self._ground
        x, y = (ground.west + ground.east) / 2.0, (ground.south + ground.north) / 2.0
        half = max((ground.north - ground.south) / 2.0, (ground.east - ground.west) / 2.0 / ASPECT)
        height = 1.04 * half / math.tan(HALF_VIEW)
        eye = rrb.EyeControls3D(position=(x, y, height), look_target=(x, y, 0.0), eye_up=NORTH)
        return _from_above("Map from above", eye)

    def _lanes(self) -> rrb.Tabs:
        views = [
            rrb.StateTimelineView(origin=origin, name=name, time_view=self._time(LANES))
            for origin, name in (("/states", "Push"), ("/machine", "Base and commands"))
            if self._canvas.has(origin)
        ]
        return _tabs(views)

    def _close_up(self) -> rrb.Container:
        """What happens now: the object from near, what is known of it, the camera, the activation."""
        views: list[rrb.View] = []
        if self._canvas.has("/map/object"):
            eye = rrb.EyeControls3D(position=(0.0, 0.0, 1.5), look_target=(0.0, 0.0, 0.0), eye_up=NORTH)
            views.append(_from_above("Near the object", eye, origin=NEAR))
        if self._canvas.has(f"{BODY}/outline"):
            views.append(_learned())
        if self._canvas.has("/camera"):
            views.append(rrb.Spatial2DView(origin="/camera", name="Camera"))
        if self._canvas.has("/activation"):
            views.append(rrb.BarChartView(origin="/activation", name="psi_push over alpha [rad], now"))
        return rrb.Horizontal(*views)

    def _learning(self) -> rrb.Container:
        """What was learned over the session."""
        plots = self._plots(
            WIDE,
            ("/prediction", "Prediction error over 0.4 s [m]"),
            ("/angles", "Angles alpha, gamma, mu [rad]"),
            ("/learned", "kappa"),
            ("/samples", "Samples"),
            ("/blend", "psi_push, psi_relocate"),
        )
        if not self._canvas.has("/history"):
            return _beside(plots, self._plots(WIDE, ("/expectation", "Object off its plan [m]")))
        # The picture and a little more: the view fills its width, and must not cut the labels off.
        width, height = HISTORY
        bounds = rrb.VisualBounds2D(x_range=(0.0, width), y_range=(-0.08 * height, 1.08 * height))
        title = "psi_push over the session (up: alpha, right: time)"
        return rrb.Horizontal(
            plots,
            rrb.Spatial2DView(origin="/history", name=title, visual_bounds=bounds),
            column_shares=[1.35, 1.0],
        )

    def _velocities(self) -> rrb.Container:
        return _beside(
            self._plots(NARROW, ("/velocity/speed", "Speed [m/s]"), ("/velocity/vx", "vx"), ("/velocity/vy", "vy")),
            self._plots(NARROW, ("/velocity/omega", "Turning omega [rad/s]"), ("/base", "Base")),
        )

    def _corridor(self) -> rrb.Container:
        return _beside(
            self._plots(NARROW, ("/depth", "Depth in the corridor [m]")),
            self._plots(NARROW, ("/distance", "Distance left [m]"), ("/lengths", "Ways made L_Qr, L_Qo [m]")),
        )

    def _texts(self) -> rrb.Tabs:
        # The viewer makes its column of times too narrow to read: each line says its time instead.
        hidden = rrb.encodings.TimelineColumn(timeline=TIMELINE, visible=False)
        columns = rrb.TextLogColumns(timeline_columns=[hidden], text_log_columns=["loglevel", "body"])
        health = self._plots(WIDE, ("/health/busy", "Slowest handlers [ms]"), ("/health/queue", "Queues"))
        return rrb.Tabs(
            rrb.TextLogView(origin="/log", name="Log", columns=columns),
            *health.contents,
            active_tab=0,
        )

    def _plots(self, room: float, *plots: tuple[str, str]) -> rrb.Tabs:
        """A tab for each of the plots that has data."""
        views = [
            rrb.TimeSeriesView(origin=origin, name=name, plot_legend=rrb.Corner2D.RightTop, axis_x=self._time(room))
            for origin, name in plots
            if self._canvas.has(origin)
        ]
        return _tabs(views)

    def _time(self, room: float) -> rrb.TimeAxis:
        """The whole session, and `room` of its length more; of a live one the last minute."""
        if self._live:
            ends = [rrb.TimeRangeBoundary.cursor_relative(seconds=end) for end in (-LIVE, room * LIVE)]
            return rrb.TimeAxis(view_range=TimeRange(*ends))
        last = self._last + round(room * max(self._last - self._first, 1))
        ends = [rrb.TimeRangeBoundary.absolute(nanos=end) for end in (self._first, last)]
        return rrb.TimeAxis(view_range=TimeRange(*ends))


def _from_above(name: str, eye: rrb.EyeControls3D, origin: str = "/map") -> rrb.Spatial3DView:
    """A view of the map with whole trails."""
    so_far = rrb.VisibleTimeRange(
        TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    trails = [rrb.VisibleTimeRanges([so_far])]
    return rrb.Spatial3DView(
        origin=origin,
        contents=["/map/**"],
        name=name,
        eye_controls=eye,
        line_grid=rrb.LineGrid3D(visible=False),
        background=rrb.Background(color=(14, 15, 19, 255)),
        overrides={"/map/trail/robot": trails, "/map/trail/object": trails},
    )


def _learned() -> rrb.Spatial3DView:
    """What is known of the object, in its own frame: it stands still, and the robot goes around it."""
    eye = rrb.EyeControls3D(position=(0.0, 0.0, 0.92), look_target=(0.0, 0.0, 0.0), eye_up=NORTH)
    return rrb.Spatial3DView(
        origin=BODY,
        contents=[f"{BODY}/**", "/map/object/rim", "/map/robot/rim", "/map/robot/heading"],
        name="What was learned (the object's frame)",
        eye_controls=eye,
        line_grid=rrb.LineGrid3D(visible=False),
        background=rrb.Background(color=(14, 15, 19, 255)),
    )


def _tabs(views: list[rrb.View]) -> rrb.Tabs:
    return rrb.Tabs(*views, active_tab=0)


def _beside(*parts: rrb.Container) -> rrb.Horizontal:
    return rrb.Horizontal(*[part for part in parts if part.contents])


def _stack(*rows: tuple[rrb.Container, float]) -> rrb.Vertical:
    """Return rows one above the other with their shares of the height, less the empty ones."""
    shown = [(part, share) for part, share in rows if part.contents]
    return rrb.Vertical(*[part for part, _ in shown], row_shares=[share for _, share in shown])
