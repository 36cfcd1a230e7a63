"""The laser alone over REST, beside a base on the serial link: against the double, and through a real socket."""

from __future__ import annotations

import json
from math import isclose

import pytest

from drivers.robotino.plant import IdealPlant, LaserReading
from drivers.robotino.rest.config import LaserConfig
from drivers.robotino.rest.laser import RobotinoLaser
from drivers.robotino.rest.restapid import Restapid
from drivers.robotino.rest.server import RestServer
from drivers.robotino.rest.wire import HttpWire
from runtime import topics
from runtime.live.alone import Alone
from runtime.messages import HttpAnswer, HttpFault, HttpRequest, LaserScan, Log
from runtime.time import SECOND
from tests.drivers.robotino.rest.base import Base

READING = LaserReading(-1.0, 1.0, (1.0, 0.0, 2.5))


def given(found: object, kind: type) -> list:  # type: ignore[type-arg]
    return [one.message for one in found or () if isinstance(one.message, kind)]  # type: ignore[attr-defined]


def asked(service: RobotinoLaser, now: int) -> HttpRequest | None:
    found = given(service.ask(now), HttpRequest)
    return found[0] if found else None


def answer(server: Restapid, plant: IdealPlant, request: HttpRequest) -> HttpAnswer:
    found = server.handle(request.method, request.path, request.body, plant)
    return HttpAnswer(id=request.id, path=request.path, status=found.status, body=found.body)


def test_a_scan_is_passed_on_as_it_was_when_it_was_asked_for() -> None:
    plant, server, service = IdealPlant.at_rest(), Restapid(), RobotinoLaser(LaserConfig(laser_x=0.2, laser_yaw=0.3))
    plant.scan = READING
    request = asked(service, SECOND)
    assert request is not None and request.path == "/data/scan0" and request.method == "GET"
    assert asked(service, SECOND + 1000) is None, "one at a time"
    told = answer(server, plant, request)
    said = json.loads(told.body)
    (scan,) = given(service.hear(told, SECOND + SECOND // 10), LaserScan)
    assert scan.timestamp.seconds == 1 and scan.timestamp.nanos == 0
    assert isclose(scan.start_angle, said["angle_min"] + 0.3, abs_tol=1e-6)
    assert list(scan.ranges) == pytest.approx([1.0, said["range_max"], 2.5]), "nothing seen is as far as it sees"
    assert scan.pose.position.x == 0.2
    again = asked(service, 2 * SECOND)
    assert again is not None
    assert (
        given(service.hear(HttpAnswer(id=again.id, path=again.path, status=200, body=told.body), 2 * SECOND), LaserScan)
        == []
    )


def test_what_is_no_scan_is_counted_by_kind_and_the_next_is_asked_for() -> None:
    service = RobotinoLaser(LaserConfig())
    wrong = [
        {"status": 200},
        {"status": 500, "body": b"x"},
        {"status": 200, "body": b"[1]"},
        {"fault": HttpFault.HTTP_TIMEOUT, "reason": "late"},
    ]
    for k, values in enumerate(wrong):
        request = asked(service, (k + 1) * SECOND)
        assert request is not None
        found = list(service.hear(HttpAnswer(id=request.id, path=request.path, **values), (k + 1) * SECOND))  # type: ignore[arg-type]
        assert given(found, LaserScan) == [] and len(given(found, Log)) == 1
    assert set(service.state.faults.counts) == {"no scan", "status 500", "scan shape", "timeout"}
    request = asked(service, 9 * SECOND)
    assert request is not None
    assert list(service.hear(HttpAnswer(id=request.id - 1, path=request.path, status=200), 9 * SECOND)) == []
    assert asked(service, 10 * SECOND) is not None, "given up"


def test_through_a_real_socket() -> None:
    base = Base()
    base.plant.scan = READING
    with RestServer(base.handle) as far:
        laser = Alone(RobotinoLaser(LaserConfig(url=far.url)), HttpWire.of(LaserConfig(url=far.url)))
        with laser.running():
            assert laser.run(10.0, lambda: laser.last(topics.SCAN) is not None)
    assert {(method, path) for method, path, _ in base.asked} == {("GET", "/data/scan0")}


def test_a_snapshot_of_it_goes_on_alike() -> None:
    first = RobotinoLaser(LaserConfig())
    asked(first, SECOND)
    second = RobotinoLaser(LaserConfig())
    second.restore(first.snapshot(), {})
    late = HttpAnswer(id=1, path="/data/scan0", status=200)
    assert [one.message.SerializeToString() for one in first.hear(late, SECOND)] == [  # type: ignore[union-attr]
        one.message.SerializeToString()  # type: ignore[union-attr]
        for one in second.hear(late, SECOND)
    ]
    assert first.snapshot() == second.snapshot()
