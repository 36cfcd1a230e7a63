"""The serial device itself: carries what the driver sends to it, and brings what comes from it.

One thread owns the device. It never waits to write: a frame is a poll with the speeds of now, so of those that the line
does not take the newest alone is kept, and that not for long.
"""

from __future__ import annotations

import os
import socket
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from select import POLLIN, poll
from threading import Event, Lock, Thread
from time import monotonic, sleep

from google.protobuf.message import Message
from serial import Serial

from drivers.robotino.serial.config import SerialConfig
from drivers.robotino.serial.port import FAILURES, NoLine, gone, opened, shut
from runtime.live.wire import Bring
from runtime.messages import SerialData
from runtime.time import Time

_AGAIN = 0.25
"""s between two tries to open the device"""
_PATIENCE = 0.25
"""s that a frame may wait for the line, and that `close` may take"""
_LOOK = 0.005
"""s after which a line that took no bytes is tried again"""
_MOST = 4096
"""bytes that are read at once"""


class SerialWire:
    """Joins the driver to a serial device."""

    sends = "serial/sent"
    brings = "serial/received"

    def __init__(self, device: str) -> None:
        """Take the device's path; empty or "auto": the one that says it is a Robotino."""
        self._device = device
        self._given: deque[tuple[float, bytes]] = deque(maxlen=1)
        self._held: tuple[float, bytes] | None = None
        self._wrote = 0.0
        self._said: str | None = None
        self._closing = Event()
        self._ended = False
        self._lock = Lock()
        self._thread: Thread | None = None

    @classmethod
    def of(cls, config: SerialConfig) -> SerialWire:
        """Return the wire to the device that settings name."""
        return cls(config.device)

    def open(self, bring: Bring, now: Callable[[], Time]) -> None:
        """Begin. A device that is not there is waited for."""
        self._bring, self._now = bring, now
        self._bell, self._ring = socket.socketpair()
        self._bell.setblocking(False)
        self._ring.setblocking(False)
        self._thread = Thread(target=self._work, name="serial-wire", daemon=True)
        self._thread.start()

    def carry(self, message: Message) -> None:
        """Send bytes on their way, in place of those that still wait."""
        if isinstance(message, SerialData) and message.data and not self._closing.is_set():
            self._given.append((monotonic(), message.data))
            self._wake()

    def close(self) -> None:
        """See off the last bytes given, for 0.25 s at most, and end."""
        self._closing.set()
        if self._thread is not None:
            self._wake()
            self._thread.join(_PATIENCE + _AGAIN)
        with self._lock:
            self._ended = True

    def _wake(self) -> None:
        # A bell that is full rings already; one that is gone has nobody left to wake.
        with suppress(OSError, AttributeError):
            self._ring.send(b"\0")

    def _work(self) -> None:
        with self._bell, self._ring:
            while not self._closing.is_set():
                self._try()
                self._closing.wait(_AGAIN)

    def _try(self) -> None:
        """Open the device, and carry and bring until it fails or the end."""
        try:
            port = opened(self._device)
        except NoLine as error:
            self._say(str(error))
            return
        try:
            self._serve(port)
        except FAILURES as error:
            self._say(gone(error, str(port.port)))
        finally:
            shut(port)

    def _serve(self, port: Serial) -> None:
        """Carry and bring until the end. What was given while there was no line is too old to be written.

        Raises:
            OSError, termios.error: the line failed.
        """
        self._given.clear()
        self._held = None
        self._say("")
        while not self._closing.is_set():
            waits = self._held is not None or port.out_waiting > 0
            wait = poll()  # select would fail from the 1024th file on
            wait.register(port.fileno(), POLLIN)
            wait.register(self._bell, POLLIN)
            wait.poll(1000.0 * _LOOK if waits else None)
            self._silence()
            self._read(port)
            self._write(port)
        until = monotonic() + _PATIENCE
        self._write(port)
        while (self._held is not None or port.out_waiting) and monotonic() < until:
            sleep(_LOOK)
            self._write(port)

    def _silence(self) -> None:
        """Stop the bell."""
        with suppress(BlockingIOError):
            while self._bell.recv(_MOST):
                pass

    def _read(self, port: Serial) -> None:
        data = port.read(_MOST)
        if data:
            self._hand_over(SerialData(stamp=self._now(), data=data, open=True))

    def _write(self, port: Serial) -> None:
        """Offer the newest frame to the line: whole, and never behind another one that it has not taken."""
        with suppress(IndexError):
            self._held = self._given.pop()
            if port.out_waiting:
                port.reset_output_buffer()
        if self._held is None:
            if port.out_waiting and monotonic() - self._wrote > _PATIENCE:
                port.reset_output_buffer()
            return
        given, data = self._held
        if monotonic() - given > _PATIENCE or (not port.out_waiting and _written(port, data)):
            self._held, self._wrote = None, monotonic()

    def _say(self, fault: str) -> None:
        """Bring that the line is there, or what is wrong with it, when that has changed."""
        if fault != self._said:
            self._said = fault
            self._hand_over(SerialData(stamp=self._now(), open=not fault, fault=fault))

    def _hand_over(self, message: SerialData) -> None:
        with self._lock:
            if not self._ended:
                self._bring(message)


def _written(port: Serial, data: bytes) -> bool:
    """Return whether the line took all of the data. A part is taken back: the board begins anew at the next head."""
    try:
        # Not port.write: with nowhere to put the bytes that turns in a circle.
        if os.write(port.fileno(), data) == len(data):
            return True
    except BlockingIOError:
        pass
    port.reset_output_buffer()
    return False
