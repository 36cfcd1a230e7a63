"""What the predictive method knows and expects is drawn as it is: against closed forms, and against the truth."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from replays.inspect import to_rrd
from replays.inspect.expected import after
from replays.inspect.response import DURATION, SPEED, answers
from replays.inspect.session import read_session
from runtime.messages import (
    ObjectState,
    PushGoal,
    PushResponse,
    PushTarget,
    RobotStatus,
    Truth,
    Vector2,
    VelocityCommand,
)
from services.predictive import model as m
from tests.figures import Figures
from tests.replays.inspect.rrd import column
from tests.replays.inspect.synthetic_session import ROBOT, Row, ns, write_rows

Floats = NDArray[np.float64]

RADIUS, OFF = 0.15, 0.02
"""m: a disc, whose centre is off the one that the tracker follows"""
LEAD = ns(0.05)


def series_of(function: Floats, bearings: Floats) -> list[float]:
    """Return the spline's coefficients for a function of the bearing, by least squares."""
    return [float(one) for one in np.linalg.lstsq(m.basis(bearings)[0], function, rcond=None)[0]]


def contour_of_disc() -> list[float]:
    """Return the distance of the centres in touch around a disc that is off centre: the law of cosines."""
    b = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    return series_of(OFF * np.cos(b) + np.sqrt((ROBOT / 2.0 + RADIUS) ** 2 - (OFF * np.sin(b)) ** 2), b)


def yaw(time: float) -> float:
    return 0.7 * time - 1.0


def session(out: Path, seen: bool) -> None:
    """An object that turns, its yaw seen or reckoned, known as an even disc at first and then as one on wheels."""
    even, wheels = m.prior_response(0.3).tolist(), m.prior_response(0.3).tolist()
    wheels[m.ANISOTROPY], wheels[m.AXIS], wheels[m.CENTRE_X], wheels[m.CENTRE_Y] = -1.5, 0.3, 0.03, -0.02
    rows: list[Row] = [(0, "status", RobotStatus(stamp=0, diameter=ROBOT))]
    for tick in range(60):
        time = tick / 20.0
        angle = yaw(time)
        thing = ObjectState(stamp=ns(time), position=Vector2(x=1.0 + 0.1 * time, y=2.0), diameter=0.3)
        known = PushResponse(
            stamp=ns(time), contour=contour_of_disc(), response=even if tick < 30 else wheels, windows=tick,
            error=0.001 * tick, prior_error=0.002 * tick,
        )  # fmt: skip
        if seen:
            thing.yaw = angle
        else:
            known.yaw = angle
        rows += [(ns(time), "object/state", thing), (ns(time), "push/response", known)]
    write_rows(out, rows)


def at(rrd: Path, entity: str, component: str, time: float) -> Floats:
    """Return what is drawn at a time: the newest row not after it."""
    times, rows = column(rrd, entity, component)
    row = rows[int(np.searchsorted(times, ns(time), side="right")) - 1]
    return np.array(row, np.float64)


def on_map(rrd: Path, points: Floats, time: float) -> Floats:
    """Return points of the object's frame where the drawn frame puts them."""
    x, y = at(rrd, "/map/body", "Transform3D:translation", time)[0, :2]
    _, _, s, c = at(rrd, "/map/body", "Transform3D:quaternion", time)[0]
    theta = 2.0 * math.atan2(s, c)
    cos, sin = math.cos(theta), math.sin(theta)
    return points[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + (x, y)


@pytest.mark.parametrize("seen", [True, False])
def test_the_outline_is_that_of_the_disc_and_turns_with_it(seen: bool, tmp_path: Path) -> None:
    session(tmp_path / "a.mcap", seen)
    to_rrd(tmp_path / "a.mcap", tmp_path / "a.rrd")
    for time in (0.5, 2.5):
        centre = np.array([1.0 + 0.1 * time, 2.0]) + OFF * np.array([math.cos(yaw(time)), math.sin(yaw(time))])
        for name, radius in (("contour", ROBOT / 2.0 + RADIUS), ("outline", RADIUS)):
            drawn = on_map(
                tmp_path / "a.rrd", at(tmp_path / "a.rrd", f"/map/body/{name}", "LineStrips3D:strips", time)[0], time
            )
            # A series of the fourth order has it within 0.1 mm.
            assert np.hypot(*(drawn - centre).T) == pytest.approx(np.full(len(drawn), radius), abs=2e-4)
            assert len(drawn) > 90
            assert drawn[0] == pytest.approx(drawn[-1], abs=1e-5)


def test_the_drawn_contour_is_the_model_s_at_a_recorded_instant(predicted: Path, tmp_path: Path) -> None:
    to_rrd(predicted, tmp_path / "a.rrd")
    loaded = read_session(predicted)
    track, things = loaded.track("push/response", PushResponse), loaded.track("object/state", ObjectState)
    index = len(track) - 3
    time, contour = int(track.times[index]), np.array(track.messages[index].contour)
    assert np.ptp(contour) > 0.005  # something was learned
    thing = things.messages[things.latest(np.array([time]))[0]]
    drawn = on_map(
        tmp_path / "a.rrd",
        at(tmp_path / "a.rrd", "/map/body/contour", "LineStrips3D:strips", time / 1e9)[0],
        time / 1e9,
    )
    for bearing, point in zip(np.linspace(-np.pi, np.pi, len(drawn)), drawn, strict=True):
        rho = m.radius(contour, float(bearing))[0]
        expected = (
            thing.position.x + rho * math.cos(thing.yaw + bearing),
            thing.position.y + rho * math.sin(thing.yaw + bearing),
        )
        assert point == pytest.approx(expected, abs=1e-5)


def test_the_easy_axis_is_drawn_where_there_is_one(tmp_path: Path) -> None:
    session(tmp_path / "a.mcap", True)
    to_rrd(tmp_path / "a.mcap", tmp_path / "a.rrd")
    even = at(tmp_path / "a.rrd", "/map/body/easy_axis", "LineStrips3D:strips", 1.0)[0]
    assert even[0] == pytest.approx(even[1])
    ends = at(tmp_path / "a.rrd", "/map/body/easy_axis", "LineStrips3D:strips", 2.0)[0]
    # Below 0 the friction across the axis named, at 0.3 rad, is the less: the object moves easily across it.
    assert ends.mean(axis=0)[:2] == pytest.approx((0.03, -0.02), abs=1e-6)
    way = ends[1] - ends[0]
    assert abs(way[0] * math.cos(0.3) + way[1] * math.sin(0.3)) < 1e-6
    assert np.hypot(way[0], way[1]) > RADIUS


def test_answers_are_straight_for_an_even_disc_and_lean_to_the_easy_axis_on_wheels() -> None:
    contour, response = m.prior_contour(ROBOT, 0.3), m.prior_response(0.3)
    touch, ways, turns = answers(contour, response, ROBOT / 2.0)
    bearings = 2.0 * np.pi * np.arange(len(touch)) / len(touch)
    away = np.column_stack([np.cos(bearings), np.sin(bearings)])
    assert touch == pytest.approx((contour[0] - ROBOT / 2.0) * away)
    assert ways == pytest.approx(-SPEED * DURATION * away, abs=5e-3)
    assert turns == pytest.approx(np.zeros(len(turns)), abs=1e-6)
    response[m.ANISOTROPY] = 3.0  # moves easily along x
    _, ways, _ = answers(contour, response, ROBOT / 2.0)
    for row in (1, 2, 4, 5, 7, 8, 10, 11):
        leaning = abs(math.atan(ways[row, 1] / ways[row, 0]))
        assert leaning < abs(math.atan(math.tan(bearings[row]))) - 0.02


def test_errors_are_the_messages_own(predicted: Path, tmp_path: Path) -> None:
    to_rrd(predicted, tmp_path / "a.rrd")
    track = read_session(predicted).track("push/response", PushResponse)
    known = [(time, one) for time, one in zip(track.times, track.messages, strict=True) if one.windows]
    assert len(known) > 50
    for name, values in (
        ("learned", [one.error for _, one in known]),
        ("prior", [one.prior_error for _, one in known]),
    ):
        times, rows = column(tmp_path / "a.rrd", f"/prediction/{name}", "Scalars:scalars")
        assert times.tolist() == [time for time, _ in known]
        assert rows == [[value] for value in values]


def test_plans_are_drawn_beside_what_came_at_the_times_they_mean(
    predicted: Path, tmp_path: Path, figures: Figures
) -> None:
    to_rrd(predicted, tmp_path / "a.rrd")
    loaded = read_session(predicted)
    truths, targets = loaded.track("truth", Truth).messages, loaded.track("push/target", PushTarget)
    stamps = np.array([truth.stamp for truth in truths])
    robots = np.array([(truth.robot.x, truth.robot.y) for truth in truths])
    times, planned = column(tmp_path / "a.rrd", "/map/plan/robot", "LineStrips3D:strips")
    _, taken = column(tmp_path / "a.rrd", "/map/taken/robot", "LineStrips3D:strips")
    assert len(planned) == len(taken) > 100
    misses, speeds = [], []
    for time, plan, way, message in zip(times, planned, taken, targets.messages, strict=True):
        expected, came = np.array(plan[0])[:, :2], np.array(way[0])[:, :2] if way else np.empty((0, 2))
        assert expected[:, 0] == pytest.approx(np.array(message.plan.robot_path.x), abs=1e-5)
        moments = after(len(expected))
        for k in range(len(came)):
            place = [np.interp(time + LEAD + moments[k] - stamps[0], stamps - stamps[0], axis) for axis in robots.T]
            assert came[k] == pytest.approx(place, abs=1e-5)
        # While it drives freely to the object, and within a second, the robot does what was planned.
        if time < ns(1.2) and len(came) > 5:
            misses.append(np.hypot(*(expected[:6] - came[:6]).T).max())
        speeds.append((np.hypot(*np.diff(expected, axis=0).T) / (np.diff(moments) * 1e-9)).max())
    figures(f"a robot that drives freely is at most {1e3 * max(misses):.0f} mm off its plan within a second")
    assert len(misses) > 5
    assert max(misses) < 0.03
    assert max(speeds) < 0.32  # no plan means more than the full speed, if its times are read rightly


def test_the_arrow_of_a_wanted_orientation_ends_with_its_goal(tmp_path: Path) -> None:
    goals = [
        PushGoal(stamp=ns(1.0), id=1, position=Vector2(x=1.0, y=2.0), precision=0.1, active=True, yaw=math.pi / 2),
        PushGoal(stamp=ns(2.0), id=2, position=Vector2(x=3.0, y=2.0), precision=0.1, active=True),
        PushGoal(stamp=ns(3.0), id=3, position=Vector2(x=4.0, y=2.0), precision=0.1, active=True, yaw=math.pi),
    ]
    write_rows(tmp_path / "a.mcap", [(goal.stamp, "push/goal", goal) for goal in goals])
    to_rrd(tmp_path / "a.mcap", tmp_path / "a.rrd")
    times, origins = column(tmp_path / "a.rrd", "/map/goal/orientation", "Arrows3D:origins")
    _, vectors = column(tmp_path / "a.rrd", "/map/goal/orientation", "Arrows3D:vectors")
    assert times.tolist() == [ns(1.0), ns(2.0), ns(3.0)]
    assert [len(row) for row in origins] == [1, 0, 1]
    assert np.array(origins[2][0])[:2] == pytest.approx([4.0, 2.0])
    lengths = [np.array(vectors[k][0])[:2] / np.linalg.norm(vectors[k][0]) for k in (0, 2)]
    assert np.array(lengths) == pytest.approx(np.array([[0.0, 1.0], [-1.0, 0.0]]), abs=1e-6)


def test_the_activation_is_left_out_where_it_is_not_used(predicted: Path, push: Path, tmp_path: Path) -> None:
    assert "/map/activation" not in to_rrd(predicted, tmp_path / "a.rrd").rows
    assert "/map/activation" in to_rrd(push, tmp_path / "b.rrd").rows
    assert len(read_session(predicted).track("command", VelocityCommand)) > 0
