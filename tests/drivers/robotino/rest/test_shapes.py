"""What is believed of answers: the reference's examples, and nothing of another shape."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.robotino.rest import shapes
from drivers.robotino.rest.shapes import BadShape

READERS = (shapes.odometry, shapes.distances, shapes.bumper, shapes.power, shapes.scan, shapes.versions)
SCAN = {
    "angle_increment": 0.00872665, "angle_max": 1.92859, "angle_min": -1.91986, "range_max": 20, "range_min": 0,
    "ranges": [0.0] * 440 + [1.25], "seq": 7,
}  # fmt: skip


def test_the_live_examples_of_the_reference() -> None:
    found = shapes.odometry(b"[0,0,0,0,0,0,27501]\n")
    assert (found.pose, found.twist, found.sequence) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 27501)
    assert shapes.distances(json.dumps([0.4099999964237213] * 9).encode()) == (0.4099999964237213,) * 9
    assert shapes.bumper(b'{"value": true}') is True
    scan = shapes.scan(json.dumps(SCAN).encode())
    assert len(scan.ranges) == 441 and scan.ranges[-1] == 1.25 and scan.farthest == 20.0
    assert scan.last == pytest.approx(-1.91986 + 440 * 0.00872665), "the angle of the last beam, not of the next"
    nested = b'{"TYPE": "CONTROLLERINFO", "payload": {"hardware": "3.0.0", "software": "1.2.3"}}'
    assert (
        shapes.versions(nested) == shapes.versions(b'{"hardware": "3.0.0", "software": "1.2.3"}') == ("3.0.0", "1.2.3")
    )


@pytest.mark.parametrize(
    ("reader", "body"),
    [
        (shapes.odometry, b"[0,0,0,0,0,0]"),
        (shapes.odometry, b"[0,0,0,0,0,0,1,2]"),
        (shapes.odometry, b"[0,0,NaN,0,0,0,1]"),
        (shapes.odometry, b"[0,0,1e999,0,0,0,1]"),
        (shapes.odometry, b"[0,0,0,0,0,0,1.5]"),
        (shapes.odometry, b"[0,0,7,0,0,0,1]"),
        (shapes.odometry, b"[true,0,0,0,0,0,1]"),
        (shapes.odometry, b'["0",0,0,0,0,0,1]'),
        (shapes.odometry, b"[0,0,0,0,0,0"),
        (shapes.distances, b"[1,2,3]"),
        (shapes.distances, json.dumps([410.0] * 9).encode()),
        (shapes.bumper, b"[true]"),
        (shapes.bumper, b'{"value": 1}'),
        (shapes.power, b'{"voltage": "24"}'),
        (shapes.power, b'{"voltage": 24000}'),
        (shapes.scan, json.dumps(SCAN | {"ranges": [0.0] * 300}).encode()),
        (shapes.scan, json.dumps(SCAN | {"ranges": [-1.0] * 441}).encode()),
        (shapes.versions, b"{}"),
    ],
)
def test_other_shapes_are_refused_by_name(reader: object, body: bytes) -> None:
    with pytest.raises(BadShape):
        reader(body)  # type: ignore[operator]


_JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=9) | st.dictionaries(st.sampled_from([*SCAN, "value", "voltage"]), inner),
    max_leaves=20,
)


@given(st.binary(max_size=60) | _JSON.map(lambda one: json.dumps(one).encode()))
def test_whatever_comes_is_read_or_refused(body: bytes) -> None:
    for reader in READERS:
        try:
            reader(body)
        except BadShape:
            continue


@pytest.mark.parametrize("body", [b"NaN", b"[Infinity]", b'{"a": -Infinity}'])
def test_constants_that_json_does_not_know_are_refused(body: bytes) -> None:
    with pytest.raises(BadShape, match="no JSON"):
        shapes.read(body)


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(BadShape):
        shapes.odometry(b"[" * 100_000)


def test_what_is_not_finite_is_never_told() -> None:
    with pytest.raises(BadShape, match="expected finite"):
        shapes.omnidrive(float("nan"), 0.0, 0.0)
