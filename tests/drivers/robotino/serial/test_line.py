"""The double on its terminal, spoken to by pyserial and by the system alone, in captured frames (reference 2.7)."""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from select import select
from time import monotonic

import pytest
from serial import Serial, SerialException

from drivers.robotino.plant import IdealPlant
from drivers.robotino.serial.board import Board
from drivers.robotino.serial.line import Noise, PtyLine
from tests.drivers.robotino.serial.bare import LONG, framed, plain, until, whole
from tests.drivers.robotino.serial.test_codec import CAPTURED
from tests.figures import Figures

VERSIONS = bytes.fromhex("aa040001000300f8ff")
POLL, DRIVE = bytes.fromhex(CAPTURED["poll"]), bytes.fromhex(CAPTURED["drive and poll"])


@contextmanager
def bench(**values: object) -> Iterator[tuple[PtyLine, IdealPlant]]:
    """Yield a board whose wheels turn, but whose base stays where it is; at the volts of the captured answers."""
    plant = IdealPlant.at_rest()
    with PtyLine(Board(volts=24.1), plant, **values) as line:  # type: ignore[arg-type]
        yield line, plant


@contextmanager
def client(line: PtyLine) -> Iterator[Serial]:
    with Serial(line.device, 115200, timeout=LONG, write_timeout=LONG, exclusive=True) as port:
        yield port


def asked(port: Serial, frame: bytes, length: int) -> bytes:
    port.write(frame)
    return port.read(length)


def test_the_versions_are_answered_as_captured() -> None:
    expected = bytes.fromhex(CAPTURED["versions answered"])
    with bench() as (line, _), client(line) as port:
        assert asked(port, VERSIONS, len(expected)) == expected


def test_the_readings_are_answered_as_captured() -> None:
    expected = bytes.fromhex(CAPTURED["readings answered"])
    with bench() as (line, _), client(line) as port:
        port.write(framed("0c050018fcffff" + "0c0502e8030000"))  # positions -1000 and 1000
        for byte in framed("090300efff" + "0903010000" + "0903021100"):  # rpm -17, 0, 17
            port.write(bytes((byte,)))
        port.timeout = 0.3
        assert port.read(1) == b"", "what only sets something is not answered"
        port.timeout = LONG
        port.write(framed("090300efff" + "0903010000" + "0903021100" + "3400" + "0500" + "2400"))
        # The first answer may come while the ramp still runs.
        assert len(port.read(len(expected))) == len(expected)
        assert asked(port, framed("3400" + "0500" + "2400"), len(expected)) == expected


def test_every_captured_question_is_answered_by_one_whole_frame() -> None:
    with bench() as (line, plant), client(line) as port:
        for name in ("hw version", "start-up", "poll", "drive and poll", "escaped payload", "motor timeout"):
            port.timeout = LONG
            answer = asked(port, bytes.fromhex(CAPTURED[name]), 1)
            port.timeout = 0.3
            answer += port.read(1000)
            payload = plain(answer)
            assert payload[-21:-19] == b"\x41\x10" and payload[-3:] == b"\x27\x01\x00", "65 and 39 at the end"
        assert plant.twist == (0.0, 0.0, 0.0)


def test_a_client_that_sets_nothing_on_its_terminal_hears_the_board_and_no_echo() -> None:
    expected = bytes.fromhex(CAPTURED["versions answered"])
    with bench() as (line, _):
        for _ in range(3):
            file = os.open(line.device, os.O_RDWR | os.O_NOCTTY)
            os.write(file, b"\n\r\x03" + VERSIONS)
            data = b""
            while len(data) < len(expected) and select([file], [], [], LONG)[0]:
                data += os.read(file, 1000)
            os.close(file)
            assert data == expected


def test_a_client_that_does_not_read_blocks_nobody() -> None:
    with bench() as (line, plant), client(line) as port:
        for _ in range(600):
            port.write(DRIVE)
        assert until(lambda: plant.twist != (0.0, 0.0, 0.0))
        assert until(lambda: plant.twist == (0.0, 0.0, 0.0)), "its watchdog runs"
        port.reset_input_buffer()
        port.timeout = 0.3
        while port.read(4096):
            pass
        assert plain(asked(port, VERSIONS, 200))[:7] == b"\x02\x053.0.0"


def test_unplugged_and_plugged_in_again_under_the_same_name(tmp_path: Path) -> None:
    link = tmp_path / "robotino"
    expected = bytes.fromhex(CAPTURED["versions answered"])
    with bench(link=link) as (line, plant):
        assert line.device == str(link)
        with client(line) as port:
            port.write(DRIVE)
            assert until(lambda: plant.twist != (0.0, 0.0, 0.0))
            line.unplug()
            assert not link.is_symlink()
            with pytest.raises(SerialException):
                port.read(1000)
            assert until(lambda: plant.twist == (0.0, 0.0, 0.0)), "the board runs on, and its watchdog"
        line.unplug()
        line.plug()
        line.plug()
        with client(line) as port:
            assert asked(port, VERSIONS, len(expected)) == expected
    assert not link.is_symlink()
    link.write_text("mine")
    with pytest.raises(FileExistsError, match="is there already"), PtyLine(Board(), plant, link=link):
        pass
    assert link.read_text() == "mine"


def test_a_board_that_hangs_is_silent_and_one_that_is_reset_has_forgotten() -> None:
    with bench() as (line, _), client(line) as port:
        port.write(framed("0c050018fcffff"))
        assert plain(asked(port, framed("0d00"), 44))[2:6] == b"\x18\xfc\xff\xff"
        line.hangs = True
        port.timeout = 0.3
        assert asked(port, VERSIONS, 1) == b""
        line.hangs = False
        assert port.read(1) == b"", "what it was told while it hung is lost"
        port.timeout = LONG
        line.reset()
        assert plain(asked(port, framed("0d00"), 44))[2:6] == b"\0\0\0\0"


def test_noise_comes_as_often_as_it_is_said_and_alike_from_one_seed() -> None:
    data = bytes(100_000)

    def spoiled(seed: int, **values: float) -> bytes:
        return Noise(**values).spoil(data, random.Random(seed))

    # Three standard deviations of 1,000 in 100,000 are 94.
    assert len(spoiled(1, lost=0.01)) == pytest.approx(99_000, abs=95)
    assert len(spoiled(1, inserted=0.01)) == pytest.approx(101_000, abs=95)
    flipped = spoiled(1, flipped=0.01)
    assert len(flipped) == 100_000 and sum(map(bool, flipped)) == pytest.approx(1000, abs=95)
    assert {one.bit_count() for one in flipped} == {0, 1}
    assert spoiled(1, lost=0.01, flipped=0.01) == spoiled(1, lost=0.01, flipped=0.01)
    assert spoiled(1, flipped=0.01) != spoiled(2, flipped=0.01)


def test_noise_acts_both_ways_and_can_be_taken_away() -> None:
    expected = bytes.fromhex(CAPTURED["versions answered"])
    with bench() as (line, plant), client(line) as port:
        port.timeout = 0.3
        line.noise = Noise(lost=1.0)
        assert asked(port, DRIVE, 1) == b"" and plant.twist == (0.0, 0.0, 0.0), "the board has not heard it"
        line.noise = Noise(flipped=0.01)
        said = b"".join(asked(port, VERSIONS, 40) for _ in range(40)) + port.read(4096)
        answer = said.split(b"\xaa")[1:]
        # What the board makes of a spoiled question is whole; only the way back spoils that.
        assert 0 < sum(map(whole, answer)) < len(answer)
        line.noise = Noise()
        port.read(1000)
        port.timeout = LONG
        assert asked(port, VERSIONS, len(expected)) == expected


def test_the_watchdog_stops_the_wheels(figures: Figures) -> None:
    with bench() as (line, plant), client(line) as port:
        for _ in range(10):
            port.write(DRIVE)
            until(lambda: False, 0.02)
        with line.lock:
            assert plant.twist != (0.0, 0.0, 0.0)
        since = monotonic()
        assert until(lambda: plant.twist == (0.0, 0.0, 0.0))
        figures(f"after its last frame the board stopped the wheels within {monotonic() - since:.3f} s")
