"""Reads each sensor of a Robotino once, and says in words what it found. Nothing is written, so nothing moves."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from math import degrees
from typing import Literal

import cv2
import numpy as np

from drivers.robotino.health import Row
from drivers.robotino.infrared import FARTHEST
from drivers.robotino.rest import shapes
from drivers.robotino.rest.connecting import Failed, parsed
from drivers.robotino.rest.exchange import Answer, Connection
from drivers.robotino.rest.shapes import BadShape

ODOMETRY = "/data/odometry"
CAMERA = "/cam0"
_PAUSE = 0.2
"""s between the two reads of the odometry, and between tries of the camera"""
_TRIES = 3
_CLEAR = FARTHEST - 0.005


def read_all(url: str, timeout: float = 1.0) -> list[Row]:
    """Return a row of each sensor of the base at `url`. A base that is broken or away is told in the rows, not raised.

    When there is no connection from the first, the rest is not asked, so this takes about one `timeout` then.

    Args:
        timeout: s, for each answer.

    Raises:
        BadUrl: `url` is not one of a base.
    """
    reader = _Reader(url, timeout)
    try:
        rows = [reader.row("odometry", reader.odometry)]
        rows += [reader.row(name, partial(reader.sensor, path, word)) for name, path, word in SENSORS]
        return [*rows, reader.row("camera", reader.camera)]
    finally:
        reader.connection.drop()


class _Bad(Exception):
    """A sensor that is there and wrong."""


class _Missing(Exception):
    """A sensor that is not there."""


class _Reader:
    def __init__(self, url: str, timeout: float) -> None:
        self.connection = Connection(*parsed(url))
        self._timeout = timeout
        self._away = ""
        self._met = False
        self._took = 0.0

    def row(self, name: str, read: Callable[[], str]) -> Row:
        """Return what comes of reading a sensor."""
        self._took = 0.0
        state: Literal["ok", "missing", "bad"] = "ok"
        try:
            said = read()
        except _Missing as error:
            state, said = "missing", str(error)
        except (_Bad, BadShape) as error:
            state, said = "bad", str(error)
        return Row(name, state, said, self._took)

    def sensor(self, path: str, word: Callable[[bytes], str]) -> str:
        """Return what a sensor says, in words."""
        return word(self._body(path))

    def odometry(self) -> str:
        """Return where the base says it is, and whether that is news from one read to the next."""
        first = shapes.odometry(self._body(ODOMETRY))
        took, begun = self._took, time.monotonic()
        time.sleep(_PAUSE)
        second = shapes.odometry(self._body(ODOMETRY))
        seconds, self._took = time.monotonic() - begun, took
        (x, y, rot), (vx, vy, omega) = second.pose, second.twist
        news = second.sequence - first.sequence
        if news <= 0:
            raise _Bad(f"its counter went from {first.sequence} to {second.sequence} in {seconds:.2f} s: no news")
        return (
            f"x {x:.3f} m, y {y:.3f} m, {degrees(rot):.1f} degrees; {vx:.2f} and {vy:.2f} m/s, "
            f"{degrees(omega):.1f} degrees/s; {news} news in {seconds:.2f} s, about {news / seconds:.0f} Hz"
        )

    def camera(self) -> str:
        """Return what the camera gives. Its first answer after a pause is an error, so it is asked again."""
        for left in reversed(range(_TRIES)):
            answer = self._ask(CAMERA)
            if answer.status != 500 or not left:
                break
            time.sleep(_PAUSE)
        if answer.status == 500:
            raise _Missing(f"status 500 {_TRIES} times: {_text(answer)}")
        try:
            image = cv2.imdecode(np.frombuffer(self._whole(answer), np.uint8), cv2.IMREAD_COLOR)
        except cv2.error as error:  # of absurd size
            raise _Bad(f"no picture: {str(error).strip()[:100]}") from error
        if image is None:
            raise _Bad(f"no picture, {len(answer.body)} bytes of {answer.media!r}: {_text(answer)}")
        return f"{image.shape[1]} x {image.shape[0]} pixels, {len(answer.body) / 1000:.1f} kB of {answer.media}"

    def _body(self, path: str) -> bytes:
        return self._whole(self._ask(path))

    def _whole(self, answer: Answer) -> bytes:
        if answer.status == 404:
            raise _Missing("status 404: this image has no such path")
        if answer.status != 200:
            raise _Bad(f"status {answer.status}: {_text(answer)}")
        if not answer.body.strip():
            raise _Missing("empty answer: there is none, or its service does not run")
        return answer.body

    def _ask(self, path: str) -> Answer:
        if self._away:
            raise _Missing(f"not asked: {self._away}")
        begun = time.monotonic()
        try:
            answer = self.connection.ask("GET", path, b"", self._timeout)
            self._met = True
            return answer
        except Failed as failed:
            self._met = self._met or failed.connected
            if not failed.connected:
                self._away = "" if self._met else str(failed)
                raise _Missing(f"unreachable: {failed}") from failed
            raise _Bad(str(failed)) from failed
        finally:
            self._took = 1000.0 * (time.monotonic() - begun)


def _text(answer: Answer) -> str:
    return repr(answer.body[:60].decode("latin-1"))


def _bumper(body: bytes) -> str:
    return "pressed" if shapes.bumper(body) else "free"


def _distances(body: bytes) -> str:
    found = shapes.distances(body)
    words = ["-" if one > _CLEAR else f"{one:.2f}" for one in found]
    return f"m, from the front counter-clockwise, - nothing seen: {' '.join(words)}"


def _power(body: bytes) -> str:
    found = shapes.power(body)
    words = [f"{found.voltage:.1f} V, {found.kind}"]
    words += ["external power"] * found.external
    words += [f"low, off in {found.shutdown / 1000:.0f} s"] * found.low
    return ", ".join(words)


def _versions(body: bytes) -> str:
    hardware, software = shapes.versions(body)
    return f"hardware {hardware}, firmware {software}"


def _analog(body: bytes) -> str:
    return f"V: {' '.join(f'{one:.2f}' for one in shapes.analog(body))}"


def _digital(body: bytes) -> str:
    return " ".join("on" if one else "off" for one in shapes.digital(body))


def _scan(body: bytes) -> str:
    found = shapes.scan(body)
    seen = [one for one in found.ranges if one > 0.0]
    near = f"{len(seen)} see something, the nearest at {min(seen):.2f} m" if seen else "none sees anything"
    angles = f"{degrees(found.first):.0f} to {degrees(found.last):.0f} degrees"
    return f"{len(found.ranges)} beams from {angles}; {near}"


SENSORS: tuple[tuple[str, str, Callable[[bytes], str]], ...] = (
    ("bumper", "/data/bumper", _bumper),
    ("distances", "/data/distancesensorarray", _distances),
    ("power", "/data/powermanagement", _power),
    ("controller", "/data/controllerinfo", _versions),
    ("analog inputs", "/data/analoginputarray", _analog),
    ("digital inputs", "/data/digitalinputarray", _digital),
    ("laser", "/data/scan0", _scan),
)
"""Name, path, and what says it in words; odometry and camera are read otherwise."""
