from __future__ import annotations

import msgspec
import numpy as np
import pytest

from drivers.sapien import objects
from drivers.sapien.friction import GRAVITY
from drivers.sapien.objects import ObjectBody, ObjectError, UnknownObject
from drivers.sapien.shapes import bounding_circle

EXPERIMENT_1 = {  # Fig. 7b
    "orange-cylinder": 0.14,
    "green-cylinder": 0.18,
    "blue-box": 0.224,
    "red-box": 0.142,
    "white-ball": 0.2,
}
HOUSEHOLD = ("dino", "plane", "can", "cart", "cloud", "cheezit", "box")  # Fig. 8


def drawn(name: str, seed: int = 0) -> ObjectBody:
    return objects.draw(objects.get(name), np.random.default_rng(seed))


def test_all_objects_of_the_paper_are_there() -> None:
    assert set(objects.names()) == {*EXPERIMENT_1, *HOUSEHOLD, "cylinder"}


@pytest.mark.parametrize(("name", "diameter"), EXPERIMENT_1.items())
def test_diameters_are_the_papers(name: str, diameter: float) -> None:
    assert drawn(name).diameter == pytest.approx(diameter, abs=0.001)


def test_cylinder_is_thirty_centimetres_wide() -> None:
    assert drawn("cylinder").diameter == pytest.approx(0.3)


def test_unknown_object_is_told_what_exists() -> None:
    with pytest.raises(UnknownObject, match=r"'teapot'.*known are orange-cylinder, .*cylinder"):
        objects.get("teapot")


@pytest.mark.parametrize("name", objects.names())
def test_every_draw_lies_in_its_ranges_and_stands(name: str) -> None:
    model = objects.get(name)
    generator = np.random.default_rng(3)
    for _ in range(100):
        body = objects.draw(model, generator)
        for key in ("mass", "friction", "along", "across", "rim"):
            low, high = getattr(model, key)
            assert low <= getattr(body, key) <= high
        on = objects.floor(body)
        mu = body.across if body.wheels else body.friction
        assert on.limit[:, 1].sum() == pytest.approx(mu * body.mass * GRAVITY)
        # The load's centroid is the centre of mass, which is the floor's origin.
        assert on.limit[:, 1] @ on.position == pytest.approx([0.0, 0.0], abs=1e-6)


def test_wheels_have_the_frictions_asked_for() -> None:
    for name in ("plane", "cart"):
        model = objects.get(name)
        assert model.along == (0.02, 0.06)
        assert model.across == (0.35, 0.6)
        on = objects.floor(drawn(name))
        assert not on.isotropic
        assert on.limit[:, 0].sum() < on.limit[:, 1].sum() / 5


def test_uniform_cylinder_has_the_inertia_of_a_disc() -> None:
    body = drawn("can")
    assert body.inertia == pytest.approx(body.mass * 0.12**2 / 2)
    assert body.inertial_mass == body.mass


def test_ball_rolls() -> None:
    body = drawn("white-ball")
    assert body.inertial_mass == pytest.approx(7 / 5 * body.mass)
    assert body.inertia == pytest.approx(2 / 5 * body.mass * 0.1**2)


@pytest.mark.parametrize("name", objects.names())
def test_the_bounding_circle_is_about_the_origin(name: str) -> None:
    body = drawn(name)
    assert bounding_circle(body.parts) == pytest.approx((0.0, 0.0, body.diameter / 2), abs=1e-9)


def test_same_seed_draws_the_same_and_survives_encoding() -> None:
    one, two = drawn("dino", 5), drawn("dino", 5)
    assert one == two
    assert one != drawn("dino", 6)
    assert msgspec.json.decode(msgspec.json.encode(one), type=ObjectBody) == one


GOOD = """
[[object]]
name = "a"
title = "A"
parts = [{ shape = "disc", radius = 0.1 }]
mass = [1.0, 2.0]
friction = [0.3, 0.5]
"""


def load_and_draw(text: str) -> ObjectBody:
    return objects.draw(objects.load(text, "x.toml")["a"], np.random.default_rng(0))


def test_good_file_loads() -> None:
    assert objects.load(GOOD, "x.toml")["a"].mass == (1.0, 2.0)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("[1.0, 2.0]", "[2.0, 1.0]", r"a: mass is \[2.0, 1.0\], expected \[low, high\]"),
        ("mass", "weight", r"x\.toml: .*weight"),
        ("0.3", "nan", r"x\.toml: .*float.*friction"),
        ("radius = 0.1", "radius = -0.1", r"x\.toml: .*> 0\.0.*radius"),
        ('"disc"', '"star"', r"x\.toml: .*star"),
        ("[[object]]", "[[object", r"x\.toml: "),
        ("mass", 'rolls = true\nparts2 = 1\nmass', r"x\.toml: .*parts2"),
        ("friction", "offset_x = [0.2, 0.3]\nfriction", "a: centre of mass .* outside the hull"),
    ],
)  # fmt: skip
def test_bad_file_is_refused_with_file_and_key(before: str, after: str, message: str) -> None:
    text = GOOD.replace(before, after)
    with pytest.raises(ObjectError, match=message):
        load_and_draw(text)


def test_ball_of_two_discs_is_refused() -> None:
    text = GOOD.replace("parts = [", 'rolls = true\nparts = [{ shape = "disc", radius = 0.2 }, ')
    with pytest.raises(ObjectError, match="expects one disc"):
        objects.load(text, "x.toml")
