"""Goals with an orientation: the object is brought there turned as asked, judged by the simulation's truth."""

from __future__ import annotations

import math

import pytest

from experiments.scoring import Judge, Score
from experiments.session import prepare, run
from runtime import topics
from runtime.config.layers import Layer
from runtime.messages import Truth
from runtime.sample import Sample
from tests.figures import Figures


def _layer(thing: str, yaw: float | None) -> Layer:
    sim = {
        "scene": "corridor-1",
        "object": thing,
        "seed": 2,
        "strategy": "predictive",
        "controller": "predictive",
        "precision": 0.05,
        **({} if yaw is None else {"yaw": yaw}),
    }
    return Layer("test", {"sim": sim})


@pytest.mark.parametrize(
    ("thing", "degrees"),
    [
        ("box", 90.0),
        ("cheezit", -90.0),
        *(
            pytest.param(thing, degrees, marks=pytest.mark.slow)
            for thing in ("box", "cheezit", "dino", "cloud", "can")
            for degrees in (0.0, 180.0)
        ),
    ],
)
def test_the_object_is_brought_there_turned_as_asked(thing: str, degrees: float, figures: Figures) -> None:
    session, judge = prepare([_layer(thing, math.radians(degrees))]), Judge()
    score = judge.score(session, run(session, sinks=[judge]))
    assert score.success, score.cause
    assert score.turned is not None and math.degrees(score.turned) <= 15.0
    figures(f"{thing} turned to {degrees:g} degrees: {math.degrees(score.turned):.1f} degrees off")


def test_an_orientation_is_judged_to_the_degree() -> None:
    """One push, with no orientation asked, judged as if the orientation it ended with, and others, had been."""
    samples: list[Sample] = []
    session = prepare([_layer("box", None)])
    result = run(session, sinks=[samples.append])
    end = [Truth.FromString(one.payload) for one in samples if one.topic == topics.TRUTH.name][-1].object.theta

    def judged(yaw: float | None) -> Score:
        judge = Judge()
        for sample in samples:
            judge(sample)
        return judge.score(prepare([_layer("box", yaw)]), result)

    assert judged(None).success and judged(None).turned is None
    for off in (-14.0, 14.0):
        score = judged(math.remainder(end + math.radians(off), math.tau))
        assert score.success and score.turned == pytest.approx(math.radians(14.0))
    for off in (-16.0, 16.0, 180.0):
        score = judged(math.remainder(end + math.radians(off), math.tau))
        assert not score.success and score.cause == "not turned"
