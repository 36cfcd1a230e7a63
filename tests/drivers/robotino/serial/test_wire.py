"""The wire on a bare pseudo-terminal: bytes both ways, which frames it drops, and what it says of a line that fails."""

from __future__ import annotations

import os
import subprocess
import sys
import termios
from pathlib import Path
from threading import Timer
from types import SimpleNamespace

import pytest
from serial import Serial
from serial.tools import list_ports

from drivers.robotino.serial.wire import SerialWire
from runtime.messages import SerialData
from tests.drivers.robotino.serial.bare import Heard, plugged, until, wired

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


def test_a_device_that_is_not_there_is_said_once_and_waited_for(tmp_path: Path) -> None:
    with wired(str(tmp_path / "robotino")) as (_, heard):
        assert until(lambda: heard.said)
        until(lambda: False, 0.8)
        assert [one.open for one in heard.said] == [False]
        assert heard.faults[0].startswith(f"{tmp_path}/robotino is not there: expected the serial device of a Robotino")
        with plugged(tmp_path):
            assert until(lambda: heard.states == [False, True])


def test_a_busy_device_is_waited_for(tmp_path: Path) -> None:
    with plugged(tmp_path) as line:
        with Serial(str(line.link), exclusive=True), wired(str(line.link)) as (_, heard):
            assert until(lambda: heard.said)
            assert "is busy: another program holds it, perhaps controld3" in heard.faults[0]
        with wired(str(line.link)) as (_, heard):
            assert until(lambda: heard.states == [True])
            with pytest.raises(OSError, match="lock"):
                Serial(str(line.link), exclusive=True)


def test_a_device_without_permission_says_the_group(tmp_path: Path) -> None:
    code = (
        "import os, sys; from drivers.robotino.serial.port import NoLine, opened\n"
        "os.getuid() or os.setuid(65534)\n"
        "try: opened(sys.argv[1])\nexcept NoLine as error: print(error, error.absent)"
    )
    with plugged(tmp_path) as line:
        name = os.path.realpath(line.link)
        os.chmod(name, 0)
        command = [sys.executable, "-c", code, name]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
        assert done.stdout.startswith(f"no permission for {name}: put the user into the group dialout"), done.stderr
        assert done.stdout.endswith("False\n")


@pytest.mark.parametrize("device", ["/dev/null", "/tmp", __file__])
def test_what_is_no_serial_device_is_said(device: str) -> None:
    with wired(device) as (_, heard):
        assert until(lambda: heard.said)
        assert device in heard.faults[0] and "expected" in heard.faults[0]
        assert heard.states == [False]


@pytest.mark.parametrize("device", ["", "auto"])
def test_the_robotino_is_found_among_the_serial_devices(
    device: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def port(path: object, vid: int | None, pid: int | None) -> SimpleNamespace:
        return SimpleNamespace(device=str(path), vid=vid, pid=pid)

    with plugged(tmp_path) as line:
        there = [port("/dev/ttyS0", None, None), port("/dev/ttyACM7", 0x1E29, 0x040E)]
        monkeypatch.setattr(list_ports, "comports", lambda: there)
        with wired(device) as (_, heard):
            assert until(lambda: heard.said)
            assert "expected one with USB id 1e29:040d" in heard.faults[0]
            there.append(port(line.link, 0x1E29, 0x040D))
            assert until(lambda: heard.states == [False, True])
        there.append(port("/dev/ttyACM9", 0x1E29, 0x040D))
        with wired(device) as (_, heard):
            assert until(lambda: heard.said)
            assert "/dev/ttyACM9" in heard.faults[0] and "are all Robotinos: expected one" in heard.faults[0]


def test_a_wire_that_was_never_opened_closes() -> None:
    wire = SerialWire("/dev/null")
    wire.carry(sent(b"a"))
    wire.close()
    assert not Heard().said
