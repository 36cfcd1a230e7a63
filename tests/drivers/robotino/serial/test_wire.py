"""The wire on a bare pseudo-terminal: bytes both ways, which frames it drops, and how it ends."""

from __future__ import annotations

import os
import termios
from pathlib import Path
from threading import Event, Timer

import pytest
from serial import Serial

from drivers.robotino.serial import wire as serial_wire
from drivers.robotino.serial.port import NoLine
from drivers.robotino.serial.wire import SerialWire
from runtime.messages import SerialData
from tests.drivers.robotino.serial.bare import LONG, Heard, plugged, until, wired

EVERY = bytes(range(256))


def sent(data: bytes) -> SerialData:
    return SerialData(data=data, open=True)


def test_every_byte_goes_both_ways_as_it_is(tmp_path: Path) -> None:
    with plugged(tmp_path) as line, wired(str(line.link)) as (wire, heard):
        assert until(lambda: heard.states == [True])
        wire.carry(sent(EVERY))
        assert line.read_to(EVERY[-1:]) == EVERY
        line.write(EVERY)
        assert until(lambda: len(heard.data) >= 256)
        line.write(b"more")
        assert until(lambda: heard.data == EVERY + b"more")
        assert all(one.stamp == 7 and one.open and not one.fault for one in heard.said)
        assert heard.states == [True]


def numbers(data: bytes) -> list[int]:
    """Return the numbers of the whole frames: a thousand bytes, of which the last is a line end."""
    return [int(one) for one in data.split(b"\n") if len(one) == 999]


def test_of_frames_that_the_line_does_not_take_the_newest_goes_first(tmp_path: Path) -> None:
    with plugged(tmp_path) as line, wired(str(line.link)) as (wire, heard):
        assert until(lambda: heard.states)
        for number in range(300):
            wire.carry(sent(b"%0999d\n" % number))
            until(lambda: False, 0.001)
        found = numbers(line.read())
        # What the terminal itself holds for its reader, 4 kB, nobody can take back; the 16 kB before it can be.
        assert found == sorted(set(found)) and found[-1] == 299
        assert len(found) < 4 + 18
        wire.carry(sent(b"%0999d\n" % 300))
        assert numbers(line.read()) == [300]


def test_a_frame_that_waited_too_long_is_never_written(tmp_path: Path) -> None:
    with plugged(tmp_path) as line, wired(str(line.link)) as (wire, heard):
        assert until(lambda: heard.states)
        held = os.open(line.link, os.O_RDWR | os.O_NOCTTY)
        termios.tcflow(held, termios.TCOOFF)
        wire.carry(sent(b"old"))
        assert line.read(0.6) == b""
        termios.tcflow(held, termios.TCOON)
        os.close(held)
        assert line.read() == b""
        wire.carry(sent(b"new"))
        assert line.read() == b"new"


class Usb(Serial):
    """A line whose system says how many bytes it still holds, as a USB device's does and a terminal's does not."""

    full = fills = left = False
    thrown = 0

    @property
    def out_waiting(self) -> int:
        held, self.full = self.full, self.fills
        return 30 * held

    def close(self) -> None:
        self.left = self.full
        super().close()

    def reset_output_buffer(self) -> None:
        self.thrown += 1
        self.full = False


def test_a_frame_goes_behind_no_other_and_waits_nowhere_for_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with plugged(tmp_path) as line:
        usb = Usb(str(line.link), timeout=0)
        monkeypatch.setattr(serial_wire, "opened", lambda device: usb)
        with wired("usb") as (wire, heard):
            assert until(lambda: heard.states)
            # Full but right after it was emptied: the frame goes, and then is held by the system.
            usb.full = usb.fills = True
            wire.carry(sent(b"new"))
            assert line.read_to(b"new") == b"new"
            assert usb.thrown == 1, "what was held before is thrown away"
            assert until(lambda: usb.thrown > 1), "and so is this one after a while"
        assert not usb.is_open and not usb.left, "at the end too: to close it would wait for what it holds"


def test_unplugged_and_plugged_in_again_behind_the_same_name(tmp_path: Path) -> None:
    with plugged(tmp_path) as line, wired(str(line.link)) as (wire, heard):
        assert until(lambda: heard.states == [True])
        line.unplug()
        assert until(lambda: any("is not there" in one for one in heard.faults))
        for _ in range(5):
            wire.carry(sent(b"too late"))
            until(lambda: False, 0.1)
        assert heard.states[0] and not any(heard.states[1:])
        assert "expected a Robotino that stays switched on and plugged in" in heard.faults[0]
        assert len(heard.faults) == len(set(heard.faults)) <= 2, "said once, not at each try"
        wire.carry(sent(b"too late"))
        line.plug()
        assert until(lambda: heard.states[-1])
        assert heard.said[-1] == SerialData(stamp=7, open=True)
        assert line.read() == b"", "what was told to a line that was not there is never told late"
        wire.carry(sent(b"again"))
        assert line.read_to(b"again") == b"again"
        line.write(b"yes")
        assert until(lambda: heard.data == b"yes")


def test_the_last_word_is_written_and_nothing_is_brought_after_it(tmp_path: Path) -> None:
    with plugged(tmp_path) as line:
        for _ in range(20):
            with wired(str(line.link)) as (wire, heard):
                assert until(lambda: heard.states)
                wire.carry(sent(b"go"))
                wire.carry(sent(b"stop"))
            assert line.read(0.05).endswith(b"stop")
            count = len(heard.said)
            wire.carry(sent(b"more"))
        line.unplug()
        until(lambda: False, 0.3)
        assert len(heard.said) == count


def test_the_last_word_waits_a_little_for_the_line(tmp_path: Path) -> None:
    with plugged(tmp_path) as line:
        held = os.open(line.link, os.O_RDWR | os.O_NOCTTY)
        with wired(str(line.link)) as (wire, heard):
            assert until(lambda: heard.states)
            termios.tcflow(held, termios.TCOOFF)
            wire.carry(sent(b"stop"))
            again = Timer(0.05, termios.tcflow, (held, termios.TCOON))
            again.start()
        assert line.read() == b"stop"
        again.join()
        with wired(str(line.link)) as (wire, heard):
            assert until(lambda: heard.states)
            termios.tcflow(held, termios.TCOOFF)
            wire.carry(sent(b"stop"))
        os.close(held)


def test_a_wire_that_is_closed_while_its_device_opens_brings_nothing_later(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, go_on = Event(), Event()

    def slow(device: str) -> Serial:
        begun.set()
        assert go_on.wait(LONG)
        raise NoLine("too late", True)

    monkeypatch.setattr(serial_wire, "opened", slow)
    with wired("slow") as (wire, heard):
        assert begun.wait(LONG)
    go_on.set()
    assert wire._thread is not None
    wire._thread.join(LONG)
    assert heard.said == []


def test_a_wire_that_was_never_opened_closes() -> None:
    wire = SerialWire("/dev/null")
    wire.carry(sent(b"a"))
    wire.close()
    assert not Heard().said
