"""The experiments past the paper's: which pushes they are, what they set, and what their tables say."""

from __future__ import annotations

import json
import math
from collections import Counter
from itertools import product
from typing import Any

import msgspec
import numpy as np
import pytest

from drivers.sapien import objects, scene, variants
from drivers.sapien.friction import GRAVITY
from drivers.sapien.shapes import bounding_circle
from experiments.beyond import cases, plots, tables
from experiments.beyond.cases import HOUSEHOLD, PARAMETERS, ROOMS, SHAPES, Case
from experiments.beyond.whole import DEFAULTS, TITLES, WANTED
from experiments.paper.cells import Task, UnknownMethod
from experiments.paper.report import assignments
from experiments.paper.trial import Outcome, session_of
from experiments.session import prepare
from runtime.config.layers import ConfigError, Layer, read_assignments
from tests.experiments.trials import outcome


def session_settings(task: Task, layers: list[Layer] | None = None) -> dict[str, Any]:
    """Return every setting of the push of `task` by its dotted key; tuples whole."""
    found: dict[str, Any] = {}

    def walk(key: str, value: object) -> None:
        if isinstance(value, dict):
            for name, inner in value.items():
                walk(f"{key}.{name}" if key else name, inner)
        else:
            found[key] = value

    walk("", msgspec.json.decode(msgspec.json.encode(session_of(task, layers or []).effective.sections)))
    return found


def first_of(case: Case, trial: int = 0) -> Task:
    return list(cases.tasks([case], "predictive", trial + 1, 5))[-1]


def made(experiment: str, case: str, **changes: object) -> Outcome:
    facts: dict[str, object] = {"experiment": experiment, "case": case, "method": "predictive", "scene": "corridor-1"}
    return outcome(**(facts | changes))


def test_the_bar_has_its_cases() -> None:
    found = cases.best()
    corridors = Counter(
        (place, case.settings["sim"]["width"], thing)
        for case in found
        if "sim" in case.settings
        for place, thing in case.pushes
    )
    assert set(corridors) == set(
        product(("corridor-1", "corridor-2", "corridor-3"), (0.85, 1.0, 1.3, 1.8), objects_called(HOUSEHOLD))
    )
    rooms = Counter(push for case in found if "sim" not in case.settings for push in case.pushes)
    assert set(rooms) == set(product(("1A", "1B", "2A", "2B"), (*SHAPES, *HOUSEHOLD)))
    assert set(corridors.values()) == set(rooms.values()) == {1}
    assert len(SHAPES) == 5 and len(HOUSEHOLD) == 7


def objects_called(names: tuple[str, ...]) -> tuple[str, ...]:
    assert set(names) <= set(objects.names())
    return names


def test_trials_are_as_the_case_says_and_the_same_in_every_case() -> None:
    wanted = list(cases.tasks(cases.best(), "predictive", 3, 40))
    assert len({one.key for one in wanted}) == len(wanted) == 3 * 20
    assert [one.seed for one in wanted] == [40] * 20 + [41] * 20 + [42] * 20
    assert {one.precision for one in wanted} == {0.05}
    assert {(one.strategy, one.controller) for one in wanted} == {("predictive", "predictive")}
    wide = next(one for one in wanted if one.case.startswith("width 1.8") and one.scene == "corridor-2")
    assert session_settings(wide)["driver.scene.bounds.max_y"] > scene.get("corridor-2").bounds.max_y
    # Recordings of different trials go to different files.
    files = Counter((cases.folder_of(one), one.seed) for one in wanted)
    assert set(files.values()) == {1}


def test_without_yaw_nothing_else_differs() -> None:
    for seen, blind in zip(cases.best(), cases.best(yaw=False), strict=True):
        assert seen.pushes == blind.pushes and seen.name != blind.name
    with_yaw, without = session_settings(first_of(cases.best()[0])), session_settings(first_of(cases.best(False)[0]))
    assert {key for key in with_yaw if with_yaw[key] != without[key]} == {"perception.yaw"}
    assert with_yaw["perception.yaw"] and not without["perception.yaw"]


def test_the_usual_noise_latency_and_speed_are_those_asked_for() -> None:
    found = session_settings(first_of(cases.best()[0]))
    assert 0.005 <= found["perception.object_noise"] <= 0.010
    assert 0.005 <= found["perception.robot_noise"] <= 0.010
    assert math.degrees(found["perception.object_yaw_noise"]) == pytest.approx(2.0, abs=0.01)
    assert (found["perception.latency_low"], found["perception.latency_high"]) == (0.05, 0.1)
    assert found["strategy.predictive.speed"] == found["controller.speed"] == 0.3


def test_goals_are_all_around_at_equal_angles() -> None:
    found = cases.around()
    assert len(found) == len({(case.name, case.pushes) for case in found}) == 24 * 3 * 2 == 144
    start = scene.get("open").object
    kinds: dict[tuple[str, float], list[float]] = {}
    for case in found:
        ((place, thing),) = case.pushes
        assert place == "open"
        x, y = case.settings["sim"]["goal"]
        assert math.hypot(x - start.x, y - start.y) == pytest.approx(2.0, abs=1e-5)
        angle = math.degrees(math.atan2(y - start.y, x - start.x)) % 360
        friction, named = cases.goal_of(case.name)
        assert (angle - named + 180) % 360 == pytest.approx(180, abs=1e-3)
        kinds.setdefault((thing, friction), []).append(angle)
    assert len(kinds) == 6
    for angles in kinds.values():
        assert np.diff(sorted(round(one) % 360 for one in angles)).tolist() == [15] * 23


def test_every_orientation_is_asked_of_every_object_in_every_scene() -> None:
    found = list(cases.tasks(cases.turned(), "predictive", 7, 1))
    asked = Counter((one.scene, one.object, json.loads(one.settings)["sim"]["yaw"]) for one in found)
    places = {one.scene for one in found}
    assert places == {"corridor-1", "corridor-2", "corridor-3", "open"}
    assert len(asked) == len(places) * 7 * 8 and set(asked.values()) == {1}
    yaws = sorted({yaw for _, _, yaw in asked})
    assert np.allclose(np.diff(yaws), math.pi / 4, atol=1e-5) and -math.pi <= yaws[0] and yaws[-1] <= math.pi + 1e-6
    within = {json.loads(one.settings)["sim"]["yaw_precision"] for one in found}
    assert within == {round(math.radians(15), 6)}
    for place in places:
        assert len({one.seed for one in found if one.scene == place}) == 56


def test_orientations_are_told_by_object_and_by_wheels() -> None:
    trials = [
        made("orientation", cases.yaw_name(45), object="dino", seed=1, turned=math.radians(4.0)),
        made("orientation", cases.yaw_name(90), object="cart", seed=2, success=False, cause="not turned", turned=1.0),
        made("orientation", cases.yaw_name(90), object="dino", seed=3, turned=math.radians(8.0)),
    ]
    things, _, yaws = tables.orientation(trials)
    rates = {row[1]: row[2] for row in things.rows}
    assert rates == {"dino": "2/2", "cart": "0/1", "no wheels": "2/2", "wheels": "0/1", "all": "2/3"}
    assert [row[1:3] for row in yaws.rows] == [("turned to 45 deg", "1/1"), ("turned to 90 deg", "1/2")]
    assert things.rows[1][-2] == "not turned 1"
    assert [row[-1] for row in things.rows] == ["6.0", "-", "6.0", "-", "6.0"], "of what succeeded"


def test_every_goal_has_seeds_of_its_own() -> None:
    wanted = list(cases.tasks(cases.around(), "predictive", 2, 1))
    assert sorted(one.seed for one in wanted) == list(range(1, 2 * 144 + 1))


def test_a_goal_of_the_open_floor_is_taken_with_its_friction_and_time() -> None:
    case = cases.around()[-1]
    task = first_of(case)
    session = session_of(task, DEFAULTS["open"])
    goal = session.goal
    assert [goal.position.x, goal.position.y] == case.settings["sim"]["goal"] and goal.time_limit == 300.0
    assert session_settings(task)["driver.body.friction"] == 0.6
    assert not any(cases.has_wheels(thing) for thing in cases.OPEN_OBJECTS)


_TOUCHED = {
    "noise": {"perception.object_noise", "perception.robot_noise"},
    "latency": {"perception.latency_low", "perception.latency_high"},
    "speed": {"strategy.predictive.speed", "controller.speed"},
    "size": {
        "sim.object_diameter", "driver.body.parts", "driver.body.diameter", "driver.body.inertia",
        "driver.body.centre_x", "driver.body.centre_y", "perception.object_diameter",
    },
    "mass": {"sim.object_mass", "driver.body.mass", "driver.body.inertial_mass", "driver.body.inertia"},
    "friction": {"sim.object_friction", "driver.body.friction"},
}  # fmt: skip


@pytest.mark.parametrize("name", list(PARAMETERS))
def test_a_parameter_changes_itself_and_nothing_else(name: str) -> None:
    parameter = PARAMETERS[name]
    plain = session_settings(first_of(Case("robustness", "plain", (("corridor-1", "dino"),), {})))
    for case, value in zip(cases.sweep([name]), parameter.values, strict=True):
        assert case.name.startswith(f"{name} {value:g}")
        found = session_settings(first_of(case))
        assert found["sim.object"] == "dino"
        differing = {key for key in found if found[key] != plain[key]}
        assert differing <= _TOUCHED[name]
        # Some values are the usual ones; the others change all that they should.
        assert differing == _TOUCHED[name] or name in ("noise", "latency", "speed")
        read = {
            "noise": [1000 * found["perception.object_noise"], 1000 * found["perception.robot_noise"]],
            "latency": [500 * (found["perception.latency_low"] + found["perception.latency_high"])],
            "speed": [found["strategy.predictive.speed"], found["controller.speed"]],
            "size": [found["driver.body.diameter"], found["perception.object_diameter"]],
            "mass": [found["driver.body.mass"]],
            "friction": [found["driver.body.friction"]],
        }[name]
        assert read == pytest.approx([value] * len(read))
        assert 0.0 <= found["perception.latency_low"] <= found["perception.latency_high"]


def test_the_sweep_reaches_as_far_as_asked() -> None:
    reach = {name: (min(one.values), max(one.values)) for name, one in PARAMETERS.items()}
    assert reach == {
        "noise": (0, 30),
        "latency": (0, 300),
        "speed": (0.1, 0.5),
        "size": (0.06, 0.6),
        "mass": (0.05, 10.0),
        "friction": (0.1, 0.9),
    }
    with pytest.raises(ConfigError, match="no parameter is called 'bang'; expected some of noise, latency"):
        cases.sweep(["noise", "bang"])
    for case in cases.sweep():
        things = {thing for _, thing in case.pushes}
        wheels = {thing for thing in things if objects.get(thing).wheels}
        assert wheels == (set() if case.name.startswith("friction") else {"plane", "cart"})
        assert set(case.pushes) == set(product(("corridor-1", "corridor-2", "corridor-3"), things))


@pytest.mark.parametrize("thing", objects.names())
@pytest.mark.parametrize("diameter", [0.06, 0.6])
def test_an_object_of_another_size_keeps_its_form_and_mass(thing: str, diameter: float) -> None:
    body = objects.draw(objects.get(thing), np.random.default_rng(3))
    found = variants.altered(body, diameter=diameter)
    scale = diameter / body.diameter
    x, y, radius = bounding_circle(found.parts)
    assert 2 * radius == pytest.approx(diameter) == found.diameter and math.hypot(x, y) < 1e-9
    assert found.mass == body.mass and found.inertia == pytest.approx(body.inertia * scale**2)
    # What the floor can do: as hard to slide, and a spin is resisted in proportion to the lever arms.
    old, new = objects.floor(body), objects.floor(found)
    assert new.limit.sum(axis=0) == pytest.approx(old.limit.sum(axis=0))
    if not body.rolls:
        # Objects of several parts get their points by the size of the parts.
        spins = [float((one.limit[:, 1] * np.hypot(*one.position.T)).sum()) for one in (old, new)]
        assert spins[1] == pytest.approx(scale * spins[0], rel=0.02)


def test_a_disc_of_another_size_and_mass_is_that_disc() -> None:
    body = objects.draw(objects.get("can"), np.random.default_rng(3))
    found = variants.altered(body, diameter=0.5, mass=3.0, friction=0.7)
    assert found.inertia == pytest.approx(3.0 * 0.25**2 / 2)
    floor = objects.floor(found)
    # A spinning disc under even pressure: two thirds of mu m g R.
    torque = float((floor.limit[:, 0] * np.hypot(*floor.position.T)).sum())
    assert torque == pytest.approx(2 / 3 * 0.7 * 3.0 * GRAVITY * 0.25, rel=0.01)


def test_a_ball_stays_a_ball() -> None:
    body = objects.draw(objects.get("white-ball"), np.random.default_rng(3))
    found = variants.altered(body, diameter=0.4, mass=2.0)
    assert found.inertial_mass == pytest.approx(2.0 * 7 / 5) and found.inertia == pytest.approx(2 / 5 * 2.0 * 0.2**2)


@pytest.mark.parametrize(("thing", "why"), [("cart", "has wheels"), ("plane", "has wheels"), ("white-ball", "rolls")])
def test_friction_is_refused_where_it_means_nothing(thing: str, why: str) -> None:
    layer = Layer("test", {"sim": {"object": thing, "object_friction": 0.4}})
    with pytest.raises(variants.CannotAlter, match=f"sim.object_friction is 0.4, but object '{thing}' {why}"):
        prepare([layer])


def test_what_failures_md_tells_is_the_same_push() -> None:
    for case in (cases.best(False)[0], cases.around()[17], cases.sweep(["latency"])[3], cases.sweep(["size"])[0]):
        task = first_of(case)
        names = ("scene", "object", "strategy", "controller", "precision", "seed")
        typed = Layer("options", {"sim": {name: getattr(task, name) for name in names}})
        retyped = prepare([read_assignments(assignments(task.settings)), typed])
        assert retyped.json() == session_of(task, []).json()


@pytest.mark.parametrize(
    ("name", "pair"), [("predictive", ("predictive", "predictive")), ("strict/dipole", ("strict", "dipole"))]
)
def test_a_method_is_a_pair(name: str, pair: tuple[str, str]) -> None:
    assert cases.method(name) == pair


@pytest.mark.parametrize("name", ["strict", "adaptive", "strict/bang", "bang/adaptive", "", "predictive/"])
def test_an_unknown_method_is_refused(name: str) -> None:
    with pytest.raises(UnknownMethod, match="expected predictive, or STRATEGY/CONTROLLER"):
        cases.method(name)


def test_every_case_has_its_bar() -> None:
    bars = {case.name: tables.bar(case.name) for yaw in (True, False) for case in cases.best(yaw)}
    assert Counter(bars.values()) == {99.5: 3, 99.0: 4, 98.5: 1, 98.0: 1, 97.5: 1, 95.0: 1, 94.5: 1}
    assert bars["width 0.85, yaw seen"] == 99.0 and bars["width 0.85, no yaw"] == 98.5
    assert bars["width 1, yaw seen"] == 99.5 and bars["width 1.8, no yaw"] == 99.0
    assert bars["rooms, objects of Experiment 1, yaw seen"] == 98.0 and bars["rooms, household objects, no yaw"] == 94.5


def upper(successes: int, trials: int) -> float:
    """Return the upper Wilson 95 % limit, by its formula."""
    z, p = 1.959964, successes / trials
    return (p + z * z / 2 / trials + z * math.sqrt(p * (1 - p) / trials + (z / 2 / trials) ** 2)) / (1 + z * z / trials)


def test_a_verdict_takes_the_interval_into_account() -> None:
    assert tables.verdict(597, 600, 99.5) == "met"
    assert upper(594, 600) > 0.995 and tables.verdict(594, 600, 99.5) == "not decided"
    assert upper(590, 600) < 0.995 and tables.verdict(590, 600, 99.5) == "missed"
    assert tables.verdict(0, 0, 95.0) == "-"


def test_the_table_of_the_bar() -> None:
    case = "width 1.3, yaw seen"
    trials = [
        made("best", case, object="dino", seed=1, robot_length=4.8, object_length=4.0),
        made("best", case, object="can", seed=2, robot_length=5.2, object_length=4.0),
        made("best", case, object="box", seed=3, robot_length=4.0, object_length=4.0, hits=7),
        made("best", case, object="cart", seed=4, robot_length=7.0, object_length=4.0),
        made("best", case, object="plane", seed=5, robot_length=90.0, object_length=1.0, success=False, cause="stall"),
    ]
    bars, places, things, efforts = tables.best(trials)
    (row,) = bars.rows
    told = dict(zip(bars.headings, row, strict=True))
    assert told["success"] == "4/5" and told["Wilson 95 %"].startswith("80.0 %") and told["bar"] == "99.5 %"
    # Medians of successes only: 1.2 of 1, 1.2, 1.3 and 1.75 of the cart alone.
    assert told["ratio, no wheels (at most 1.25)"] == "1.200, met"
    assert told["ratio, wheels (at most 1.6)"] == "1.750, missed"
    assert told["trials that hit furniture or walls"] == "1" and told["failures"] == "stall 1"
    assert dict(zip(places.headings, places.rows[0], strict=True))["corridor-1"] == "4/5"
    assert dict(zip(things.headings, things.rows[0], strict=True))["plane"] == "0/1"
    assert dict(zip(efforts.headings, efforts.rows[0], strict=True))["cart"] == "1.75"


def test_tables_tell_methods_and_yaw_apart() -> None:
    trials = [
        made("best", "width 1, yaw seen"),
        made("best", "width 1, no yaw", success=False, cause="orbit"),
        made("best", "width 1, no yaw", method="strict/adaptive"),
    ]
    rows = [(row[0], row[1], row[2]) for row in tables.best(trials)[0].rows]
    assert rows == [
        ("predictive", "width 1, yaw seen", "1/1"),
        ("predictive", "width 1, no yaw", "0/1"),
        ("strict/adaptive", "width 1, no yaw", "1/1"),
    ]


def test_paths_are_compared_on_pushes_that_both_delivered() -> None:
    case = "width 1, yaw seen"
    paper = {"method": "relaxed/adaptive"}
    trials = [
        made("best", case, object="dino", seed=1, robot_length=5.0),
        made("best", case, object="dino", seed=1, robot_length=5.5, **paper),
        made("best", case, object="dino", seed=2, robot_length=7.0),
        made("best", case, object="dino", seed=2, robot_length=4.5, **paper),
        made("best", case, object="dino", seed=3, robot_length=99.0),
        made("best", case, object="dino", seed=3, robot_length=1.0, success=False, cause="stall", **paper),
        made("best", case, object="cart", seed=4, robot_length=9.0),
        made("best", case, object="cart", seed=4, robot_length=10.0, **paper),
        made("best", "width 1.8, yaw seen", object="cart", seed=4, robot_length=88.0),
    ]
    (table,) = tables.beside(trials)
    assert table.rows == (
        ("relaxed/adaptive", "no wheels", "2", "6.00", "5.00", "1.200, missed"),
        ("relaxed/adaptive", "wheels", "1", "9.00", "10.00", "0.900, met"),
    )
    assert tables.beside(trials[:1])[0].rows == ()


def test_goals_are_told_apart_by_direction_and_beside_the_published_rates() -> None:
    trials = [
        made("open", cases.goal_name(0.2, degrees), object="box", scene="open", success=degrees != 180, cause="")
        for degrees in (0, 45, 330, 90, 270, 180)
    ]
    whole, things, sectors = tables.around(trials)
    assert whole.rows[0][1] == "5/6"
    # The rates in the abstract's table: 88.19, 15.97 and 5.56 %.
    for row, printed in zip(whole.rows[1:], (88.19, 15.97, 5.56), strict=True):
        count, of = (int(part) for part in row[1].split("/"))
        assert of == 144 and 100 * count / of == pytest.approx(printed, abs=0.005)
    assert [(row[1], row[2], row[3]) for row in things.rows] == [("box", "0.2", "5/6")]
    assert [row[2] for row in sectors.rows] == ["3/3", "2/2", "0/1"]
    assert not any(table.rows for table in tables.around([]))


def test_curves_are_the_rates_with_their_bands() -> None:
    one = PARAMETERS["latency"]
    trials = [
        made("robustness", cases.value_name(one, value), seed=k, success=k < good, cause="" if k < good else "stall")
        for value, good in ((0, 4), (100, 3), (300, 1))
        for k in range(4)
    ]
    figure = plots.robustness(trials)
    (axes,) = [axes for axes in figure.axes if axes.axison]
    assert axes.get_xlabel() == "latency (ms)"
    (line,) = [line for line in axes.lines if len(line.get_xdata()) == 3]
    assert np.array(line.get_xdata()).tolist() == [0, 100, 300]
    assert np.array(line.get_ydata()).tolist() == [100.0, 75.0, 25.0]
    band = axes.collections[0].get_paths()[0].vertices
    for value, good in ((0, 4), (100, 3), (300, 1)):
        edges = [float(y) for x, y in np.asarray(band) if x == value]
        assert max(edges) == pytest.approx(100 * upper(good, 4), abs=0.01)
        assert min(edges) == pytest.approx(100 * (1 - upper(4 - good, 4)), abs=0.01)
    rows = [row for table in tables.robustness(trials) for row in table.rows]
    assert [row[:3] for row in rows] == [
        ("predictive", "0", "4/4"),
        ("predictive", "100", "3/4"),
        ("predictive", "300", "1/4"),
    ]


def test_pictures_show_every_kind() -> None:
    best = [made("best", case.name, scene=case.pushes[0][0]) for yaw in (True, False) for case in cases.best(yaw)]
    figure = plots.best(best)
    assert [label.get_text().replace("\n", " ") for label in figure.axes[0].get_xticklabels()][:4] == [
        "width 0.85", "width 1", "width 1.3", "width 1.8",
    ]  # fmt: skip
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["predictive, yaw seen", "predictive, no yaw"]
    around = [made("open", case.name, object=case.pushes[0][1], scene="open") for case in cases.around()]
    figure = plots.around(around, "predictive")
    assert len(figure.axes) == 6 and all(axes.get_title().endswith("24/24") for axes in figure.axes)


def test_every_experiment_is_told_of() -> None:
    every = (
        *cases.best(),
        *cases.around(),
        *cases.turned(),
        *cases.sweep(),
        *cases.changing("truth"),
        *cases.sensing(),
    )
    kinds = {case.experiment for case in every}
    assert kinds == set(TITLES) == set(WANTED)
    assert set(ROOMS) == {"1A", "1B", "2A", "2B"}
