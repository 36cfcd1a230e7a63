"""What is read of a base that is well, of one with faults, of one that is away, and of servers that are none."""

from __future__ import annotations

import json
import socket
import time

import cv2
import numpy as np
import pytest

from drivers.robotino.health import Row
from drivers.robotino.plant import LaserReading
from drivers.robotino.rest.check import read_all
from drivers.robotino.rest.connecting import BadUrl
from drivers.robotino.rest.restapid import Response, Restapid
from drivers.robotino.rest.server import Fault, RestServer
from tests.drivers.robotino.rest.base import Base
from tests.drivers.robotino.rest.strangers import Stranger, heard

NAMES = [
    "odometry", "bumper", "distances", "power", "controller", "analog inputs", "digital inputs", "laser", "camera",
]  # fmt: skip
JPEG = bytes(cv2.imencode(".jpg", np.zeros((48, 64, 3), np.uint8))[1])


def rows(url: str, timeout: float = 5.0) -> dict[str, Row]:
    found = read_all(url, timeout)
    assert [one.name for one in found] == NAMES and all(one.words for one in found)
    return {one.name: one for one in found}


def states(found: dict[str, Row]) -> set[str]:
    return {one.state for one in found.values()}


def test_a_base_that_is_well_is_read_in_words_and_not_touched() -> None:
    base = Base(Restapid(picture=JPEG, volts=23.4))
    base.plant.distances = (0.1, *[0.41] * 8)
    base.plant.scan = LaserReading(-1.9, 1.9, (1.0, 0.0, 2.0))
    with RestServer(base.handle) as server:
        found = rows(server.url)
        assert server.connections == 1
    assert states(found) == {"ok"}, found
    assert found["odometry"].words.startswith("x 0.000 m, y 0.000 m") and "Hz" in found["odometry"].words
    assert found["bumper"].words == "free"
    assert found["distances"].words.endswith(": 0.10 - - - - - - - -")
    assert found["power"].words == "23.4 V, Li-Ion"
    assert found["controller"].words == "hardware 3.0.0, firmware 1.2.3"
    assert found["analog inputs"].words == "V: 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00"
    assert found["digital inputs"].words == "off off off off off off off off"
    assert "3 beams from -109 to 109 degrees; 2 see something, the nearest at 1.00 m" in found["laser"].words
    assert found["camera"].words.startswith("64 x 48 pixels") and "image/jpeg" in found["camera"].words
    assert all(one.milliseconds > 0.0 for one in found.values())
    assert {method for method, _, _ in base.asked} == {"GET"}
    assert [target for _, target, _ in base.asked].count("/cam0") == 2, "the first one fails"


def test_what_is_not_there_is_missing() -> None:
    with RestServer(Base().handle) as server:
        found = rows(server.url)
    assert {one.name for one in found.values() if one.state == "missing"} == {"laser", "camera"}
    assert "empty" in found["laser"].words and "No camera connected" in found["camera"].words
    with RestServer(lambda method, target, body: Response(404)) as server:
        found = rows(server.url)
    assert states(found) == {"missing"} and "404" in found["bumper"].words


@pytest.mark.parametrize("step", [0, -5])
def test_odometry_that_is_no_news_is_bad(step: int) -> None:
    count = [100]

    def handle(method: str, target: str, body: bytes) -> Response:
        count[0] += step
        return Response(200, body=json.dumps([0, 0, 0, 0, 0, 0, count[0]]).encode())

    with RestServer(handle) as server:
        found = rows(server.url)
    assert found["odometry"].state == "bad" and str(count[0] if not step else 95) in found["odometry"].words
    assert found["bumper"].state == found["distances"].state == "bad", "of another shape"


def test_the_rate_of_the_odometry_is_counted() -> None:
    begun = time.monotonic()

    def handle(method: str, target: str, body: bytes) -> Response:
        return Response(200, body=json.dumps([1, -2, 0, 0, 0, 0, int((time.monotonic() - begun) * 1000)]).encode())

    with RestServer(handle) as server:
        said = rows(server.url)["odometry"].words
    rate = float(said.rpartition("about ")[2].removesuffix(" Hz"))
    assert 500 < rate < 2000 and said.startswith("x 1.000 m, y -2.000 m")


@pytest.mark.parametrize(
    ("fault", "word"),
    [(Fault.HANG, "time"), (Fault.RESET, "reset"), (Fault.GARBAGE, "no HTTP"), (Fault.HALF, "within"),
     (Fault.DRIP, "time"), (Fault.ERROR, "500")],
)  # fmt: skip
def test_a_base_with_a_fault_is_bad_in_words(fault: Fault, word: str) -> None:
    with RestServer(Base().handle) as server:
        server.fail(fault)
        found = rows(server.url, timeout=0.4)
    assert all(found[one].state == "bad" and word in found[one].words for one in NAMES[:-1]), found
    assert found["camera"].state != "ok"


def test_a_base_that_is_away_says_so_in_every_row_and_soon() -> None:
    with socket.create_server(("127.0.0.1", 0)) as line:
        port = line.getsockname()[1]
    found = rows(f"http://127.0.0.1:{port}")
    assert states(found) == {"missing"}
    assert "unreachable" in found["odometry"].words and "not asked" in found["camera"].words
    found = rows("http://robotino.invalid", timeout=0.5)
    assert states(found) == {"missing"}


@pytest.mark.parametrize("body", [b"garbage", b"[" * 9999, b"{}", b"[]", b"null", b"\xff\xd8\xff\xe0garbage", b" "])
def test_nothing_that_a_server_says_raises(body: bytes) -> None:
    with RestServer(lambda method, target, _: Response(200, body=body)) as server:
        assert "ok" not in states(rows(server.url))


@pytest.mark.parametrize("word", [b"HTTP/1.1 200 OK\r\nContent-Length: 1\r\n\r\n", b"", b"SSH-2.0-dropbear\r\n"])
def test_servers_that_are_no_robotino(word: bytes) -> None:
    def serve(line: socket.socket, _: int) -> None:
        heard(line)
        line.sendall(word)

    with Stranger(serve) as server:
        assert states(rows(server.url)) == {"bad"}


def test_a_url_that_is_none_is_the_users_error() -> None:
    with pytest.raises(BadUrl):
        read_all("172.26.1.1")
