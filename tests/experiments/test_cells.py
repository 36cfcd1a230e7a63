"""Which pushes the experiments are made of, by the paper's Sec. 6.3."""

from __future__ import annotations

from collections import Counter
from itertools import product

import pytest

from drivers.sapien import objects, scene
from experiments.paper.cells import (
    EXPERIMENTS,
    HOUSEHOLD,
    ROOMS,
    SHAPES,
    STARTS,
    UnknownMethod,
    cell_of,
    cells,
    methods_of,
    tasks,
)
from services.names import CONTROLLERS, STRATEGIES


def test_the_paper_has_its_cells() -> None:
    main = cells(EXPERIMENTS, starts=())
    assert Counter(cell.experiment for cell in main) == {"strategies": 4 * 4, "free-area": 2 * 4, "controllers": 5 * 7}
    assert len({cell.name for cell in cells(EXPERIMENTS)}) == len(cells(EXPERIMENTS)) == 59 + (4 + 4 + 5) * 3
    for cell in main:
        for place, thing in cell.pushes:
            assert place in scene.names() and thing in objects.names()


def test_strategies_and_controllers_go_together_as_in_the_paper() -> None:
    for one in tasks(cells(EXPERIMENTS), 7, 1):
        assert one.strategy in STRATEGIES and one.controller in CONTROLLERS
        if one.method == "predictive":
            assert (one.strategy, one.controller) == ("predictive", "predictive")
        elif one.experiment == "controllers":
            assert (one.strategy, one.controller) == ("relaxed", one.method)
        else:
            assert (one.strategy, one.controller) == (one.method, "adaptive")
        assert one.precision == (0.1 if one.experiment == "controllers" else 0.05)


def test_trials_are_spread_evenly_over_objects() -> None:
    wanted = list(tasks(cells(["strategies", "free-area"], starts=()), 200, 1))
    counts = Counter((one.scene, one.method, one.object) for one in wanted)
    assert {count for (place, _, _), count in counts.items() if place in ROOMS} == {200 // 5}
    assert {count for (place, _, _), count in counts.items() if place not in ROOMS} == {200 // 7, 200 // 7 + 1}
    third = Counter((one.method, one.object) for one in tasks(cells(["controllers"], starts=()), 200, 1))
    assert set(third.values()) == {200}


@pytest.mark.parametrize(
    ("experiment", "places", "things"),
    [("strategies", ROOMS, SHAPES), ("free-area", ("corridor-1", "corridor-2"), HOUSEHOLD)],
)
def test_every_start_meets_every_scene_with_every_object(
    experiment: str, places: tuple[str, ...], things: tuple[str, ...]
) -> None:
    for cell in cells([experiment]):
        if cell.start in STARTS:
            assert sorted(cell.pushes) == sorted(product(places, things))


def test_methods_meet_the_same_pushes_and_cells_fill_evenly() -> None:
    wanted = list(tasks(cells(EXPERIMENTS), 3, 50))
    assert len({one.key for one in wanted}) == len(wanted)
    by_method: dict[tuple[str, str], set[tuple[str, str, str, int]]] = {}
    for one in wanted:
        by_method.setdefault((one.experiment, one.method), set()).add((one.start, one.scene, one.object, one.seed))
    for experiment in EXPERIMENTS:
        pushes = [value for (name, _), value in by_method.items() if name == experiment]
        assert all(value == pushes[0] for value in pushes)
    number = len(cells(EXPERIMENTS))
    for cut in (1, number // 2, number, number + 3):
        counts = Counter(cell_of(one) for one in wanted[:cut])
        assert max(counts.values()) - (min(counts.values()) if len(counts) == number else 0) <= 1


def test_methods_can_be_chosen_and_added() -> None:
    assert methods_of("free-area", ["relaxed", "switching"]) == ("relaxed", "switching")
    assert methods_of("controllers", ["switching", "dipole"]) == ("dipole",)
    with pytest.raises(UnknownMethod, match="no method is called 'bang'; expected some of strict, relaxed"):
        methods_of("free-area", ["bang"])
