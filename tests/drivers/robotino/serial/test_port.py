"""What is said of a serial device that cannot be opened, and how a Robotino's is found."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from serial import Serial
from serial.tools import list_ports

from tests.drivers.robotino.serial.bare import plugged, until, wired


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
