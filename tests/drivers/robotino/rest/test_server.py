"""The double on a real socket, spoken to by clients that are not ours, in the manner of the manufacturer's examples."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from errno import ECONNRESET
from http.client import BadStatusLine, HTTPConnection, HTTPException, HTTPResponse, IncompleteRead
from urllib.error import HTTPError
from urllib.request import ProxyHandler, Request, build_opener

import cv2
import numpy as np
import pytest

from drivers.robotino.rest.restapid import Response, Restapid
from drivers.robotino.rest.server import Fault, RestServer
from runtime.messages import HttpFault
from tests.drivers.robotino.rest.base import Base
from tests.drivers.robotino.rest.strangers import LONG, Host

DRIVE = "/data/omnidrive"


@pytest.fixture
def base() -> Base:
    return Base()


@pytest.fixture
def server(base: Base) -> Iterator[RestServer]:
    with RestServer(base.handle) as server:
        yield server


_CLIENTS: list[HTTPConnection] = []


@pytest.fixture(autouse=True)
def no_client_is_left() -> Iterator[None]:
    yield
    while _CLIENTS:
        _CLIENTS.pop().close()


def client(server: RestServer, timeout: float = LONG) -> HTTPConnection:
    _CLIENTS.append(HTTPConnection(server.address, server.port, timeout=timeout))
    return _CLIENTS[-1]


def said(one: HTTPConnection, method: str, target: str, body: str | None = None, **headers: str) -> HTTPResponse:
    one.request(method, target, body, headers)
    answer = one.getresponse()
    answer.body = answer.read()  # type: ignore[attr-defined]
    return answer


def test_a_post_of_a_text_without_content_type_drives(base: Base, server: RestServer) -> None:
    """`requests.post(url, params={"sid": ...}, data=json.dumps(...))`, as the manufacturer's examples do."""
    answer = said(client(server), "POST", f"{DRIVE}?sid=example_circle", "[0.1, 0.0, 0.2]")
    assert (answer.status, answer.getheader("Content-Length")) == (200, "0")
    assert base.server.wish == (0.1, 0.0, 0.2)
    assert base.asked == [("POST", f"{DRIVE}?sid=example_circle", b"[0.1, 0.0, 0.2]")]


def test_urllib_puts_and_reads(base: Base, server: RestServer) -> None:
    opener = build_opener(ProxyHandler({}))
    put = Request(server.url + DRIVE, b"[0.1,0,0]", {"Content-Type": "application/json"}, method="PUT")
    with opener.open(put, timeout=LONG) as answer:
        assert (answer.status, answer.read()) == (200, b"")
    with opener.open(f"{server.url}/data/odometry?sid=1", timeout=LONG) as answer:
        assert answer.headers["Content-Type"] == "application/json"
        assert len(json.loads(answer.read())) == 7
    with opener.open(f"{server.url}/data/scan0", timeout=LONG) as answer:
        assert (answer.status, answer.read()) == (200, b""), "no laser"
    with opener.open(f"{server.url}/sensorimage", timeout=LONG) as answer:
        assert answer.headers["Content-Type"] == "image/png"
        free = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_COLOR)
    base.plant.bumper = True
    with opener.open(f"{server.url}/sensorimage", timeout=LONG) as answer:
        pressed = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_COLOR)
    red = [int(((one[:, :, 2] > 200) & (one[:, :, 1] < 50)).sum()) for one in (free, pressed)]
    assert red[0] == 0 < red[1]


def test_too_fast_is_400_and_zero(base: Base, server: RestServer) -> None:
    one = client(server)
    assert said(one, "PUT", DRIVE, "[0.1,0,0]").status == 200
    assert base.server.wish[0] == 0.1
    assert said(one, "PUT", DRIVE, "[2.5,0,0]").status == 400
    assert base.server.wish == (0.0, 0.0, 0.0)
    with pytest.raises(HTTPError) as error:
        build_opener(ProxyHandler({})).open(Request(server.url + DRIVE, b"no json", method="PUT"), timeout=LONG)
    error.value.close()
    assert error.value.code == 400


def test_two_clients_side_by_side_the_last_one_wins(base: Base, server: RestServer) -> None:
    a, b = client(server), client(server)
    for one, text in ((a, "[0.1,0,0]"), (b, "[0,0.1,0]"), (a, "[0.2,0,0]"), (b, "[0,0.2,0]")):
        assert said(one, "PUT", f"{DRIVE}?sid=x", text).status == 200
        assert list(base.server.wish) == json.loads(text)
    assert server.connections == 2 and server.requests == 4, "kept alive"


def test_the_base_moves_and_stops_by_itself(base: Base, server: RestServer) -> None:
    one = client(server)
    said(one, "PUT", DRIVE, "[0.2,0,0]")
    time.sleep(0.3)
    assert json.loads(said(one, "GET", "/data/odometry").body)[3] > 0.0  # type: ignore[attr-defined]
    limit = time.monotonic() + LONG
    while base.plant.twist[0] > 0.0 or base.server.wish[0] > 0.0:
        assert time.monotonic() < limit
        said(one, "GET", "/data/bumper")
        time.sleep(0.02)


@pytest.mark.skipif(shutil.which("curl") is None, reason="there is no curl")
def test_curl() -> None:
    base = Base(Restapid(picture=b"\xff\xd8\xff\xd9"))

    def curl(*words: str) -> str:
        found = subprocess.run(
            ["curl", "-s", "--noproxy", "*", "-m", "10", "-w", " %{http_code} %{content_type}", *words],
            capture_output=True, check=True,
        )  # fmt: skip
        return found.stdout.decode("latin-1")

    with RestServer(base.handle) as server:
        assert curl("-X", "PUT", "-H", "Content-Type: application/json", "-d", "[0.1,0,0]", server.url + DRIVE) == (
            " 200 application/json"
        )
        assert base.server.wish == (0.1, 0.0, 0.0)
        assert (
            curl("-H", "Content-Type:", "-d", "[0,0.1,0]", f"{server.url}{DRIVE}?sid=curl") == " 200 application/json"
        )
        assert base.server.wish == (0.0, 0.1, 0.0)
        assert curl(server.url + "/data/bumper") == '{\n    "value": false\n}\n 200 application/json'
        assert curl("-X", "OPTIONS", server.url + "/data/bumper").startswith("Allow: DELETE, GET, POST, PUT 200")
        assert curl("-X", "DELETE", server.url + "/x?y").startswith("/x?y 200")
        assert curl(server.url + "/cam0", server.url + "/cam0").endswith("\xff\xd8\xff\xd9 200 image/jpeg")
        assert curl("-H", "Expect: 100-continue", "-X", "PUT", "-d", "[0.2,0,0]", server.url + DRIVE).startswith(" 200")


def test_odometry_is_counted_20_times_a_second_whether_it_is_read_or_not() -> None:
    server, plant = Restapid(), Base().plant
    for now in (0.01, 0.06, 1.01, 1.02):
        server.advance(now, plant)
    assert json.loads(server.handle("GET", "/data/odometry", b"", plant).body)[6] == 20


def test_guests_may_not_drive(base: Base, server: RestServer) -> None:
    one = client(server)
    assert json.loads(said(one, "PUT", "/data/login", '{"role": "guest", "password": ""}').body)["success"]  # type: ignore[attr-defined]
    assert json.loads(said(one, "GET", "/data/userrole").body) == {"role": "guest"}  # type: ignore[attr-defined]
    assert said(one, "PUT", DRIVE, "[0.1,0,0]").status == 400 and base.server.wish == (0.0, 0.0, 0.0)
    assert not json.loads(said(one, "PUT", "/data/login", '{"role": "king"}').body)["success"]  # type: ignore[attr-defined]
    said(one, "PUT", "/data/login", '{"role": "operator", "password": ""}')
    assert said(one, "PUT", DRIVE, "[0.1,0,0]").status == 200
    for value, status in ((-100, 200), (101, 400), ("x", 400)):
        assert said(one, "PUT", "/data/poweroutput", json.dumps({"value": value})).status == status
    assert base.server.power == -100


def raw(server: RestServer, data: bytes) -> bytes:
    with socket.create_connection((server.address, server.port), timeout=LONG) as line:
        found = b""
        try:
            line.sendall(data)
            line.shutdown(socket.SHUT_WR)
            while more := line.recv(65536):
                found += more
        except OSError:
            pass  # it hung up on us
        return found


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (b"PUT /data/omnidrive HTTP/1.1\r\nContent-Length: -5\r\n\r\n[0,0]", b"400"),
        (b"PUT /data/omnidrive HTTP/1.1\r\nContent-Length: many\r\n\r\n", b"400"),
        (b"PUT /data/omnidrive HTTP/1.1\r\nContent-Length: 1_0\r\n\r\n[0.1,0,0]0", b"400"),
        (b"PUT /data/omnidrive HTTP/1.1\r\nContent-Length: 9999999\r\n\r\n", b"413"),
        (b"PUT /data/omnidrive HTTP/1.1\r\nContent-Length: " + b"9" * 5000 + b"\r\n\r\n", b"413"),
        (b"PUT /data/omnidrive HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", b"411"),
        (b"PUT /data/omnidrive HTTP/1.1\r\nContent-Length: 50\r\n\r\n[0.1,0,0]", b""),
        (b"GET /" + b"x" * 70000 + b" HTTP/1.1\r\n\r\n", b""),
        (b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 500 + b"\r\n", b""),
        (b"GET / HTTP/x\r\n\r\n", b""),
        (b"BREW /pot HTTP/1.1\r\n\r\n", b"501"),
        (b"\x00\xff" * 3000 + b"\r\n\r\n", b""),
        (b"\x16\x03\x01\x02\x00\x01", b""),
        (b"", b""),
        (b"\r\n" * 100, b""),
    ],
)
def test_garbage_does_no_harm(base: Base, server: RestServer, data: bytes, status: bytes) -> None:
    found = raw(server, data)
    if status:
        assert found.split()[1] == status, found[:100]
    assert not base.asked, "nothing of it is a request"
    assert said(client(server), "GET", "/data/bumper").status == 200
    assert threading.active_count() < 50


def test_what_breaks_inside_is_a_500_and_requests_come_one_at_a_time() -> None:
    inside = []

    def handle(method: str, target: str, body: bytes) -> Response:
        inside.append(1)
        assert len(inside) == 1, "two at a time"
        time.sleep(0.005)
        inside.pop()
        if target == "/broken":
            raise KeyError(target)
        return Response(200)

    with RestServer(handle) as server:
        assert said(client(server), "GET", "/broken").status == 500
        states = []
        threads = [
            threading.Thread(target=lambda: states.append(said(client(server), "GET", "/").status)) for _ in range(20)
        ]
        for one in threads:
            one.start()
        for one in threads:
            one.join(LONG)
        assert states == [200] * 20 and server.requests == 21


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        (Fault.HANG, TimeoutError),
        (Fault.RESET, ConnectionResetError),
        (Fault.GARBAGE, BadStatusLine),
        (Fault.HALF, IncompleteRead),
    ],
)
def test_faults_are_switched_on_and_off(server: RestServer, fault: Fault, error: type[Exception]) -> None:
    kept = client(server)
    assert said(kept, "GET", "/data/bumper").status == 200
    server.fail(fault)
    for one in (kept, client(server)):
        one.sock and one.sock.settimeout(0.3)
        one.timeout = 0.3
        with pytest.raises((error, HTTPException) if error is not TimeoutError else error) as found:
            said(one, "GET", "/data/bumper")
        assert isinstance(found.value, error)
        # http.client calls a mere end a reset too, but of its own making.
        assert fault != Fault.RESET or found.value.errno == ECONNRESET  # type: ignore[attr-defined]
        one.close()
    server.heal()
    assert said(client(server), "GET", "/data/bumper").status == 200


def test_a_fault_ends_by_itself(server: RestServer) -> None:
    server.fail(Fault.ERROR, seconds=0.2)
    assert said(client(server), "GET", "/data/bumper").status == 500
    limit = time.monotonic() + LONG
    while said(client(server), "GET", "/data/bumper").status != 200:
        assert time.monotonic() < limit
    assert server.fault == Fault.NONE


def test_drips_are_whole_in_the_end(server: RestServer) -> None:
    server.fail(Fault.DRIP)
    with socket.create_connection((server.address, server.port), timeout=LONG) as line:
        line.sendall(b"GET /data/bumper HTTP/1.1\r\n\r\n")
        pieces = []
        while not b"".join(pieces).endswith(b"}\n"):
            pieces.append(line.recv(4096))
    assert len(pieces) > 20 and b"".join(pieces).startswith(b"HTTP/1.1 200 ")


def test_status_500_for_all_or_for_reads(base: Base, server: RestServer) -> None:
    one = client(server)
    server.fail(Fault.ERROR_READS)
    assert said(one, "GET", "/data/odometry").status == 500
    assert said(one, "PUT", DRIVE, "[0.1,0,0]").status == 200
    server.fail(Fault.ERROR)
    assert said(one, "PUT", DRIVE, "[0.2,0,0]").status == 500
    assert base.server.wish == (0.1, 0.0, 0.0), "it did not reach the base"


def test_refused_and_back_on_the_same_port(server: RestServer) -> None:
    kept, port = client(server), server.port
    said(kept, "GET", "/data/bumper")
    for _ in range(2):
        server.refuse()
        server.refuse()
        with pytest.raises((HTTPException, ConnectionError)):
            said(kept, "GET", "/data/bumper")
        with pytest.raises(ConnectionRefusedError):
            said(client(server), "GET", "/data/bumper")
        server.listen()
        server.listen()
        kept = client(server)
        assert server.port == port and said(kept, "GET", "/data/bumper").status == 200


def test_no_thread_is_left() -> None:
    before = set(threading.enumerate())
    with RestServer(Base().handle) as server:
        said(client(server), "GET", "/data/bumper")
        server.fail(Fault.HANG)
        with pytest.raises(TimeoutError):
            said(client(server, 0.1), "GET", "/data/bumper")
    limit = time.monotonic() + LONG
    while set(threading.enumerate()) - before:
        assert time.monotonic() < limit
        time.sleep(0.01)


FAULTS = {
    Fault.HANG: HttpFault.HTTP_TIMEOUT,
    Fault.RESET: HttpFault.HTTP_CUT,
    Fault.GARBAGE: HttpFault.HTTP_MALFORMED,
    Fault.HALF: HttpFault.HTTP_CUT,
    Fault.DRIP: HttpFault.HTTP_TIMEOUT,
    Fault.ERROR: HttpFault.HTTP_OK,
}


def test_the_wire_names_each_fault_of_the_double_and_comes_back(base: Base, server: RestServer) -> None:
    with Host(server.url) as host:
        for fault, name in FAULTS.items():
            server.fail(fault)
            timeout = 0.3 if name == HttpFault.HTTP_TIMEOUT else LONG
            asked = [host.ask("odometry", timeout=timeout), host.ask("omnidrive", "PUT", b"[0.1,0,0]", timeout)]
            assert [host.answer(one).fault for one in asked] == [name] * 2, fault
            server.heal()
            for one in (host.ask("odometry"), host.ask("omnidrive", "PUT", b"[0,0,0]")):
                assert host.answer(one).status == 200, fault
        server.refuse()
        assert host.answer(host.ask()).fault == HttpFault.HTTP_REFUSED
        server.listen()
        assert host.answer(host.ask()).status == 200
