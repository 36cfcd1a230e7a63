"""Stills over HTTP, against a server that misbehaves as the script of each test says."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Thread

import pytest

from drivers.camera.feed import feed
from drivers.camera.picture import NoPicture
from drivers.camera.stills import BadAddress, Stills
from runtime.messages import CompressedImage
from tests.drivers.camera.test_jpeg import encoded

PICTURE = encoded(32, 24)
Answer = Callable[[BaseHTTPRequestHandler], None]


class Server(ThreadingHTTPServer):
    """Gives the answers of `script` one after the other, the last one for ever."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.script: list[Answer] = []
        self.asked: list[str] = []
        self.connections = 0
        self.over = Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/cam0"

    def process_request(self, request: object, client_address: object) -> None:
        self.connections += 1
        super().process_request(request, client_address)  # type: ignore[arg-type]


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Server

    def do_GET(self) -> None:
        self.server.asked.append(self.path)
        (self.server.script.pop(0) if len(self.server.script) > 1 else self.server.script[0])(self)

    def log_message(self, *_: object) -> None:
        pass


def says(body: bytes = PICTURE, status: int = 200, length: int | None = None) -> Answer:
    def answer(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(status)
        handler.send_header("Content-Length", str(len(body) if length is None else length))
        handler.end_headers()
        handler.wfile.write(body)
        if length is not None:
            handler.close_connection = True

    return answer


def hangs(handler: BaseHTTPRequestHandler) -> None:
    server = handler.server
    assert isinstance(server, Server)
    server.over.wait(5.0)
    handler.close_connection = True


def drips(handler: BaseHTTPRequestHandler) -> None:
    """Keep every wait for a piece short, and the whole endless."""
    server = handler.server
    assert isinstance(server, Server)
    handler.send_response(200)
    handler.send_header("Content-Length", "100000")
    handler.end_headers()
    while not server.over.wait(0.05):
        try:
            handler.wfile.write(b"x")
        except OSError:
            break
    handler.close_connection = True


@pytest.fixture
def server() -> Iterator[Server]:
    found = Server()
    thread = Thread(target=found.serve_forever, args=(0.05,))
    thread.start()
    yield found
    found.over.set()
    found.shutdown()
    thread.join()
    found.server_close()


def test_pictures_come_over_one_connection_and_no_cache_can_answer(server: Server) -> None:
    server.script = [says()]
    stills = Stills(server.url, time.monotonic)
    assert [stills.take().data for _ in range(3)] == [PICTURE] * 3
    stills.close()
    assert server.asked == [f"/cam0?stamp={number}" for number in (1, 2, 3)]
    assert server.connections == 1


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (says(b"No jpeg image available\n", 500), "answered 500: No jpeg image available"),
        (says(b"", 404), "answered 404: Not Found"),
        (says(b""), "0 bytes"),
        (says(b"<html>"), "expected a JPEG"),
        (says(PICTURE[:-30]), "cut off"),
        (says(PICTURE[:100], length=len(PICTURE)), "broke off"),
        (hangs, "timed out"),
        (drips, "and no end"),
    ],
    ids=["asleep", "missing", "empty", "page", "cut", "short", "hangs", "drips"],
)
def test_what_is_no_picture_is_named_and_the_next_request_begins_anew(
    server: Server, answer: Answer, words: str
) -> None:
    server.script = [answer, says()]
    stills = Stills(server.url, time.monotonic, patience=0.3)
    with pytest.raises(NoPicture, match=words):
        stills.take()
    assert stills.take().data == PICTURE
    stills.close()
    assert server.connections == 2


def test_a_robot_that_is_not_there_is_no_picture(server: Server) -> None:
    stills = Stills(server.url.replace("cam0", "x").replace(str(server.server_port), "9"), time.monotonic)
    with pytest.raises(NoPicture, match="refused"):
        stills.take()


@pytest.mark.parametrize("text", ["rtsp://robot/1", "http://", "http://robot:port/cam0", "http:///cam0"])
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(BadAddress, match="expected http://HOST/cam0"):
        Stills(text, time.monotonic)


def test_a_camera_that_wakes_up_is_fed_without_a_word(server: Server) -> None:
    """The first answer after a pause is 500; at the end the robot is switched off, which is said."""
    server.script = [says(b"No camera connected", 500), says(), says(), says(), hangs]
    given: list[bytes] = []
    lines: list[str] = []
    stop = Event()

    def ask(picture: CompressedImage) -> str:
        given.append(picture.data)
        return ""

    def say(line: str) -> None:
        lines.append(line)
        stop.set()

    tally = feed(Stills(server.url, time.monotonic, patience=0.2), ask, 100.0, time.monotonic, stop.wait, say)
    assert given == [PICTURE] * 3
    assert (tally.taken, tally.refused) == (3, 0)
    assert tally.failed == 4  # one to wake it, and three before anything was said
    assert len(lines) == 1
    assert lines[0].endswith("timed out; trying again")
