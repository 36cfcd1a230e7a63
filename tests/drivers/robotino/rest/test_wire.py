"""The wire against servers that are not ours: what each fault becomes, and that none of them stays."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from drivers.robotino.rest.check import read_all
from drivers.robotino.rest.connecting import BadUrl
from drivers.robotino.rest.exchange import Connection
from drivers.robotino.rest.wire import HttpWire
from runtime.errors import PushlaneError
from runtime.messages import HttpFault, HttpRequest, SerialData
from tests.drivers.robotino.rest.strangers import LONG, STAMP, WHOLE, Host, Stranger, heard

SHORT = 0.3
FAR = 5.0
"""s, that nothing here may take which is bounded by less than one"""


def well(line: socket.socket, _: int = 0) -> None:
    while heard(line):
        line.sendall(WHOLE)


def first(wrong: Callable[[socket.socket], None]) -> Callable[[socket.socket, int], None]:
    """Return a server that is wrong on its first connection only."""

    def serve(line: socket.socket, number: int) -> None:
        if number:
            return well(line)
        heard(line)
        return wrong(line)

    return serve


def reset(line: socket.socket) -> None:
    line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    line.close()


def dripping(data: bytes) -> Callable[[socket.socket], None]:
    def drip(line: socket.socket) -> None:
        for byte in data:
            line.sendall(bytes([byte]))
            time.sleep(0.05)

    return drip


def hang(line: socket.socket) -> None:
    line.recv(1)


def endless(start: bytes, more: bytes) -> Callable[[socket.socket], None]:
    def send(line: socket.socket) -> None:
        line.sendall(start)
        while True:
            line.sendall(more)

    return send


def test_answers_are_those_of_the_standard_library_over_one_connection_per_lane() -> None:
    seen: list[tuple[str, str, str | None, bytes]] = []
    lines = set()

    class Plain(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            lines.add(self.client_address)
            body = self.rfile.read(int(self.headers.get("Content-Length", "0")))
            seen.append((self.command, self.path, self.headers.get("Content-Type"), body))
            self.send_response(418 if self.command == "PUT" else 200)
            self.send_header("Content-Type", "text/odd; charset=x")
            self.send_header("Content-Length", "4")
            self.end_headers()
            self.wfile.write(b"\x00\xff{}")

        do_PUT = do_GET

        def log_message(self, format: str, *args: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Plain) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with Host(f"http://127.0.0.1:{server.server_address[1]}") as host:
            for _ in range(5):
                told = host.answer(host.tell(b"[0.1, 0, 0]"))
                read = host.answer(host.ask("odometry"))
                host.answer(host.ask("bumper"))
        server.shutdown()
    assert (told.fault, told.status, told.path, told.stamp) == (HttpFault.HTTP_OK, 418, "/data/drive", STAMP)
    assert (read.status, read.content_type, read.body) == (200, "text/odd; charset=x", b"\x00\xff{}")
    assert len(lines) == 3, "one connection of each lane"
    assert len(seen) == 15
    assert seen[0] == ("PUT", "/data/drive", "application/json", b"[0.1, 0, 0]")
    assert seen[1] == ("GET", "/data/odometry", None, b"")


@pytest.mark.parametrize(
    ("wrong", "fault"),
    [
        (hang, HttpFault.HTTP_TIMEOUT),
        (dripping(WHOLE * 9), HttpFault.HTTP_TIMEOUT),
        (dripping(b"HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n" + bytes(900)), HttpFault.HTTP_TIMEOUT),
        (lambda line: line.sendall(WHOLE[:-1]), HttpFault.HTTP_CUT),
        (lambda line: line.sendall(WHOLE[:9]), HttpFault.HTTP_CUT),
        (lambda line: line.sendall(b"HT"), HttpFault.HTTP_CUT),
        (lambda line: None, HttpFault.HTTP_CUT),
        (reset, HttpFault.HTTP_CUT),
        (lambda line: line.sendall(b"\x00\xff garbage"), HttpFault.HTTP_MALFORMED),
        (lambda line: (line.sendall(b"SSH-2.0"), hang(line)), HttpFault.HTTP_MALFORMED),
        (lambda line: line.sendall(b"HTTP/9 what\r\n\r\n"), HttpFault.HTTP_MALFORMED),
        (lambda line: line.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: -3\r\n\r\n"), HttpFault.HTTP_MALFORMED),
        (endless(b"HTTP/1.1 200 OK\r\nX: ", b"x" * 4096), HttpFault.HTTP_MALFORMED),
        (endless(b"HTTP/1.1 200 OK\r\n\r\n", b"x" * 65536), HttpFault.HTTP_MALFORMED),
        (endless(b"HTTP/1.1 200 OK\r\nContent-Length: 9999999\r\n\r\n", b"x" * 65536), HttpFault.HTTP_MALFORMED),
    ],
)
def test_a_fault_is_named_ends_in_time_and_does_not_stay(
    wrong: Callable[[socket.socket], None], fault: HttpFault
) -> None:
    with Stranger(first(wrong)) as server, Host(server.url) as host:
        begun = time.monotonic()
        answer = host.answer(host.ask(timeout=SHORT if fault == HttpFault.HTTP_TIMEOUT else LONG))
        took = time.monotonic() - begun
        assert HttpFault.Name(answer.fault) == HttpFault.Name(fault), answer.reason
        assert answer.reason and (answer.status, answer.body, answer.stamp) == (0, b"", STAMP)
        assert took < FAR
        for _ in range(2):
            assert host.answer(host.ask()).body == b"[]"
        assert len(server.lines) == 2, "dropped, and one other opened"


def test_odd_but_whole_answers() -> None:
    """No length, no body, in chunks, after a 100, elsewhere: all of these are answers, and nothing is followed."""
    said = [
        (b"HTTP/1.0 200 OK\r\n\r\nto the end", 200, b"to the end"),
        (b"HTTP/1.1 204 No\r\n\r\n", 204, b""),
        (b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2\r\n[1\r\n1\r\n]\r\n0\r\n\r\n", 200, b"[1]"),
        (b"HTTP/1.1 100 Continue\r\n\r\n" + WHOLE, 200, b"[]"),
        (b"HTTP/1.1 302 Found\r\nLocation: /elsewhere\r\nContent-Length: 0\r\n\r\n", 302, b""),
        (WHOLE + WHOLE.replace(b"[]", b"no"), 200, b"[]"),
        (WHOLE, 200, b"[]"),
    ]
    left = list(said)

    def serve(line: socket.socket, _: int) -> None:
        while heard(line):
            data = left.pop(0)[0]
            line.sendall(data)
            if data.startswith(b"HTTP/1.0"):
                return

    with Stranger(serve) as server, Host(server.url) as host:
        for _, status, body in said:
            answer = host.answer(host.ask())
            assert (answer.fault, answer.status, answer.body) == (HttpFault.HTTP_OK, status, body), answer.reason
    assert not left


def test_nobody_listens_and_then_somebody_does() -> None:
    with Stranger(well) as server:
        port = server.port
    with Host(f"http://127.0.0.1:{port}") as host:
        assert host.answer(host.ask()).fault == HttpFault.HTTP_REFUSED
        for _ in range(2):
            with Stranger(well, port) as server:
                assert host.answer(host.ask()).body == b"[]"
                assert host.answer(host.ask()).body == b"[]"
                assert len(server.lines) == 1
            assert host.answer(host.ask()).fault == HttpFault.HTTP_REFUSED, "gone, with the connection"


def test_a_connection_that_nobody_takes_is_given_up_in_time() -> None:
    """A full backlog, to whose SYN nobody answers: as a base that is switched off."""
    with socket.socket() as full:
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        fillers = [socket.socket() for _ in range(3)]
        for one in fillers:
            one.setblocking(False)
            one.connect_ex(full.getsockname())
        with Host(f"http://127.0.0.1:{full.getsockname()[1]}") as host:
            begun = time.monotonic()
            answer = host.answer(host.ask(timeout=SHORT))
            assert (answer.fault, answer.reason) == (HttpFault.HTTP_TIMEOUT, "no connection in time")
            assert time.monotonic() - begun < FAR
            begun = time.monotonic()
            rows = read_all(f"http://127.0.0.1:{full.getsockname()[1]}", SHORT)
            assert {one.state for one in rows} == {"missing"} and time.monotonic() - begun < FAR
        for one in fillers:
            one.close()


def test_a_connection_that_the_server_closed_while_idle_is_no_fault() -> None:
    def serve(line: socket.socket, _: int) -> None:
        heard(line)
        line.sendall(WHOLE)

    with Stranger(serve) as server, Host(server.url) as host:
        for _k in range(3):
            assert host.answer(host.ask()).fault == HttpFault.HTTP_OK
            assert host.answer(host.tell(b"[]")).fault == HttpFault.HTTP_OK
            assert host.answer(host.ask("x", "POST")).fault == HttpFault.HTTP_OK
            while any(one.fileno() >= 0 for one in server.lines):
                time.sleep(0.01)
        assert len(server.lines) == 9


def test_what_comes_unasked_is_no_answer_to_the_next_request() -> None:
    sent = threading.Event()

    def serve(line: socket.socket, number: int) -> None:
        while heard(line):
            line.sendall(WHOLE)
            if number == 0:
                time.sleep(0.05)
                line.sendall(WHOLE.replace(b"[]", b"no"))
                sent.set()

    with Stranger(serve) as server, Host(server.url) as host:
        host.answer(host.ask())
        assert sent.wait(LONG)
        assert host.answer(host.ask()).body == b"[]"


@pytest.mark.parametrize("method", ["GET", "PUT"])
def test_one_closed_just_when_it_is_used_is_tried_once_more(method: str) -> None:
    asked = []

    def serve(line: socket.socket, number: int) -> None:
        while found := heard(line):
            asked.append((number, found[0].split()[0]))
            if asked.count(asked[0]) == 2 and number == 0:
                return
            line.sendall(WHOLE)

    with Stranger(serve) as server, Host(server.url) as host:
        assert [host.answer(host.ask("x", method)).fault for _ in range(2)] == [HttpFault.HTTP_OK] * 2
        assert asked == [(0, method), (0, method), (1, method)]


def test_it_is_tried_once_only_and_not_when_it_changes_more_than_once() -> None:
    asked = []

    def serve(line: socket.socket, number: int) -> None:
        heard(line)
        asked.append(number)
        if number == 0 or number == 2:
            line.sendall(WHOLE)
            heard(line)
            asked.append(number)

    with Stranger(serve) as server, Host(server.url) as host:
        assert host.answer(host.ask("x")).fault == HttpFault.HTTP_OK
        assert host.answer(host.ask("x")).fault == HttpFault.HTTP_CUT
        assert asked == [0, 0, 1]
        assert host.answer(host.ask("x", "POST")).fault == HttpFault.HTTP_OK
        assert host.answer(host.ask("x", "POST")).fault == HttpFault.HTTP_CUT
        assert asked == [0, 0, 1, 2, 2]


def test_the_newest_that_waits_wins_and_the_others_are_answered_at_once() -> None:
    bodies, come, go = [], threading.Event(), threading.Event()

    def serve(line: socket.socket, _: int) -> None:
        while found := heard(line):
            bodies.append(found[1])
            come.set()
            go.wait(LONG)
            line.sendall(WHOLE)

    with Stranger(serve) as server, Host(server.url) as host:
        one = host.tell(b"1")
        assert come.wait(LONG)
        others = [host.tell(b"%d" % k) for k in range(2, 6)]
        for k in others[:-1]:
            answer = host.answer(k)
            assert (answer.fault, answer.path) == (HttpFault.HTTP_REPLACED, "/data/drive")
        assert host.more() == 0 and bodies == [b"1"], "one request under way"
        go.set()
        assert host.answer(one).fault == host.answer(others[-1]).fault == HttpFault.HTTP_OK
        assert bodies == [b"1", b"5"] and len(server.lines) == 1


def test_a_sensor_that_hangs_does_not_hold_up_the_drive() -> None:
    def serve(line: socket.socket, _: int) -> None:
        while found := heard(line):
            if found[0].startswith("GET"):
                hang(line)
            line.sendall(WHOLE)

    with Stranger(serve) as server, Host(server.url) as host:
        for lane in ("odometry", "scan", "bumper"):
            host.ask(lane)
        for _k in range(20):
            assert host.answer(host.tell(b"[]")).fault == HttpFault.HTTP_OK
        assert len(host.found) == 20, "no sensor was given up meanwhile"


def test_the_last_word_goes_out_on_close() -> None:
    bodies: list[bytes] = []

    def serve(line: socket.socket, _: int) -> None:
        while found := heard(line):
            bodies.append(found[1])
            line.sendall(WHOLE)

    for _ in range(5):
        with Stranger(serve) as server:
            bodies.clear()
            host = Host(server.url)
            host.tell(b"[0.1, 0, 0]")
            host.tell(b"[0, 0, 0]")
            host.wire.close()
            assert bodies[-1] == b"[0, 0, 0]"


@pytest.mark.parametrize("before", [0, 1])
def test_the_last_word_goes_out_though_the_one_before_it_hangs_and_so_do_the_sensors(before: int) -> None:
    bodies: list[bytes] = []
    come, end = threading.Event(), threading.Event()

    def serve(line: socket.socket, _: int) -> None:
        while found := heard(line):
            bodies.append(found[1])
            if found[1] in (b"", b"hang"):
                if found[1]:
                    come.set()
                hang(line)
                return
            if found[1] == b"[0, 0, 0]":
                end.set()
            line.sendall(WHOLE)

    with Stranger(serve) as server:
        host = Host(server.url)
        host.ask("odometry")
        for _k in range(before):
            host.answer(host.tell(b"well"))
        host.tell(b"hang")
        assert come.wait(LONG)
        host.tell(b"[0, 0, 0]")
        begun = time.monotonic()
        host.wire.close()
        count = host.more()
        assert time.monotonic() - begun < FAR
        assert end.wait(LONG), bodies
        assert bodies.count(b"hang") == 1, "what hung is not said again"
        time.sleep(0.3)
        assert host.more() == count, "nothing is brought after the end"
    limit = time.monotonic() + FAR
    while any(one.name.startswith("http ") for one in threading.enumerate()):
        assert time.monotonic() < limit, "threads are left"
        time.sleep(0.01)


def test_nothing_is_brought_once_it_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A look-up of a name cannot be cut short, so its lane outlives the wire."""
    begun, go = threading.Event(), threading.Event()

    def slow(*_: object, **__: object) -> list[object]:
        begun.set()
        go.wait(LONG)
        return []

    monkeypatch.setattr(socket, "getaddrinfo", slow)
    host = Host("http://robotino.invalid")
    host.ask(timeout=0.6)
    assert begun.wait(LONG)
    host.wire.close()
    count = host.more()
    limit = time.monotonic() + LONG
    while any(one.name == "http odometry" for one in threading.enumerate()):
        assert time.monotonic() < limit
        time.sleep(0.01)
    go.set()
    assert host.more() == count


def test_nothing_is_carried_while_it_is_closed() -> None:
    """Who hears that its request was cut may ask again, at once."""
    paths: list[str] = []

    def serve(line: socket.socket, _: int) -> None:
        if found := heard(line):
            paths.append(found[0].split()[1])
            hang(line)

    with Stranger(serve) as server:
        wire = HttpWire(server.url)
        again = HttpRequest(id=2, lane="again", method="GET", path="/again", timeout=10**9)
        wire.open(lambda _: wire.carry(again), int)
        for lane in ("drive", "x"):
            wire.carry(HttpRequest(id=1, lane=lane, method="GET", path=f"/{lane}", timeout=10**10))
        limit = time.monotonic() + LONG
        while len(paths) < 2:
            assert time.monotonic() < limit
            time.sleep(0.01)
        wire.close()
        assert sorted(paths) == ["/drive", "/x"]


def test_a_lane_outlives_what_nobody_thought_of(monkeypatch: pytest.MonkeyPatch) -> None:
    with Stranger(well) as server, Host(server.url) as host:
        with monkeypatch.context() as patch:
            patch.setattr(Connection, "_receive", lambda *_: {}["a defect"])
            answer = host.answer(host.tell(b"[]"))
        assert answer.fault == HttpFault.HTTP_MALFORMED and "a defect" in answer.reason
        assert host.answer(host.tell(b"[]")).fault == HttpFault.HTTP_OK


def test_it_carries_nothing_before_open_after_close_and_of_other_kinds() -> None:
    with Stranger(well) as server:
        wire = HttpWire(server.url)
        wire.carry(HttpRequest(id=1, lane="drive", method="PUT", path="/"))
        host = Host(server.url)
        host.wire.carry(SerialData(data=b"x"))
        host.wire.close()
        host.wire.close()
        host.tell(b"late")
        time.sleep(0.1)
        assert not server.lines and host.more() == 0


@pytest.mark.parametrize("path", ["no slash and space", "/a b", "/\r\nX: y", "/ü"])
def test_a_path_that_is_none_is_an_answer_and_no_end(path: str) -> None:
    with Stranger(well) as server, Host(server.url) as host:
        host.wire.carry(HttpRequest(id=99, lane="x", method="GET", path=path, timeout=10**9))
        assert host.answer(99).fault == HttpFault.HTTP_MALFORMED
        assert host.answer(host.ask("x")).fault == HttpFault.HTTP_OK


def test_a_name_that_nobody_finds_is_given_up_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    go = threading.Event()
    true = socket.getaddrinfo

    looks = []

    def slow(*args: object, **more: object) -> object:
        go.wait(LONG)
        looks.append(1)
        if len(looks) == 1:
            raise socket.gaierror("not there")
        found = true("127.0.0.1", *args[1:], **more)  # type: ignore[arg-type]
        return [(socket.AF_INET6, socket.SOCK_STREAM, 6, "", ("::1", 1, 0, 0)), *found]

    with Stranger(well) as server, Host(f"http://robotino.invalid:{server.port}") as host:
        monkeypatch.setattr(socket, "getaddrinfo", slow)
        answer = host.answer(host.ask(timeout=SHORT))
        assert answer.fault == HttpFault.HTTP_TIMEOUT and "robotino.invalid" in answer.reason
        go.set()
        answer = host.answer(host.ask())
        assert answer.fault == HttpFault.HTTP_REFUSED and "not there" in answer.reason
        tried = []
        connect = socket.socket.connect
        monkeypatch.setattr(socket.socket, "connect", lambda self, to: (tried.append(self.family), connect(self, to)))
        assert host.answer(host.ask()).fault == HttpFault.HTTP_OK
        assert tried == [socket.AF_INET], "not the other kind first"


@pytest.mark.parametrize(
    "url",
    ["", "172.26.1.1", "https://172.26.1.1", "http://", "http://a:0", "http://a:99999", "http://a:x", "http://a/data",
     "http://me@a", "http://a?b", "http://[::1", "http://a b", "ftp://a", "http:///data", "http://ü"],
)  # fmt: skip
def test_a_url_that_is_none_is_named(url: str) -> None:
    with pytest.raises(BadUrl, match="expected http://HOST") as error:
        HttpWire(url)
    assert repr(url) in str(error.value) and isinstance(error.value, PushlaneError)


@pytest.mark.parametrize("url", ["http://172.26.1.1", "http://172.26.1.1/", "http://robotino:8080", "http://[::1]:80"])
def test_a_url_that_is_one_is_taken(url: str) -> None:
    HttpWire(url)
