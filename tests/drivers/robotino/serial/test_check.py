"""A check of a board: what each reading says in words, and that a bad device gives rows and no exception."""

from __future__ import annotations

import os
from pathlib import Path
from threading import Thread

import pytest
from serial import Serial

from drivers.robotino.health import Row
from drivers.robotino.plant import IdealPlant
from drivers.robotino.serial.board import Board
from drivers.robotino.serial.check import read_all
from drivers.robotino.serial.line import Noise, PtyLine
from tests.drivers.robotino.serial.bare import LONG, Bare, framed, plugged
from tests.drivers.robotino.serial.test_codec import CAPTURED

ANSWERED = bytes.fromhex(CAPTURED["versions answered"])


def words(rows: list[Row]) -> dict[str, tuple[str, str]]:
    assert len({one.name for one in rows}) == len(rows)
    assert all(one.milliseconds >= 0.0 for one in rows)
    return {one.name: (one.state, one.words) for one in rows}


def answered(line: Bare, answer: bytes, timeout: float = LONG) -> tuple[dict[str, tuple[str, str]], bytes]:
    """Return what a check says of a device that answers so, and what it was asked."""
    asked = bytearray()

    def play() -> None:
        asked.extend(line.read_to(b"\xff"))
        line.write(answer)

    far = Thread(target=play)
    far.start()
    rows = read_all(str(line.link), timeout)
    far.join()
    return words(rows), bytes(asked)


def test_a_board_says_all_it_can_and_does_not_move() -> None:
    plant = IdealPlant.at_rest()
    plant.distances = (0.1, 0.2, *plant.distances[2:])
    plant.bumper = True
    with PtyLine(Board(volts=24.1, gyro=True), plant) as line:
        found = words(read_all(line.device, LONG))
        assert plant.twist == (0.0, 0.0, 0.0)
    assert found == {
        "line": ("ok", line.device),
        "hardware": ("ok", "3.0.0"),
        "firmware": ("ok", "1.2.3"),
        "motors": ("ok", "0 0 0 rpm, 0 0 0 ticks, 0.00 0.00 0.00 A"),
        "distances": ("ok", "0.10 0.20 0.41 0.41 0.41 0.41 0.41 0.41 0.41 m"),
        "bumper": ("ok", "pressed"),
        "power": ("ok", "24.1 V, 1.5 A, lead, on its battery, chargers: 1"),
        "analog inputs": ("ok", "0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 V"),
        "digital inputs": ("ok", "0 0 0 0 0 0 0 0"),
        "gyro": ("ok", "0.000 rad, 0.000 rad/s"),
    }


def test_a_board_without_a_gyro_and_with_a_low_battery() -> None:
    with PtyLine(Board(volts=18.5), IdealPlant.at_rest()) as line:
        found = words(read_all(line.device, LONG))
    assert found["gyro"] == ("missing", "no gyro on this board")
    state, said = found["power"]
    assert state == "bad" and said.startswith("battery low: 18.5 V") and said.endswith("off in 60 s")


def test_the_question_sets_nothing(tmp_path: Path) -> None:
    with plugged(tmp_path) as line:
        found, asked = answered(line, bytes.fromhex(CAPTURED["readings answered"]))
    # Ids 1, 3, 52, 5, 36, 32, 34, 69 of the reference's table, each without data, in one frame.
    assert asked == bytes.fromhex("aa1000" + "01000300340005002400200022004500" + "08ff")
    assert found["motors"] == ("ok", "-17 0 17 rpm, -1000 0 1000 ticks, 0.50 0.00 0.50 A")
    assert found["distances"] == ("ok", " ".join(["0.41"] * 9) + " m")
    assert found["bumper"] == ("ok", "not pressed")
    assert found["hardware"] == ("missing", "not in the answer: expected HW_VERSION")


def test_readings_that_cannot_be_are_bad_rows(tmp_path: Path) -> None:
    with plugged(tmp_path) as line:
        found, _ = answered(line, framed("3401" + "00" + "350200002501072004000000002104000000002302" + "0000"))
        assert found["motors"] == ("bad", "ALL_MOTOR_READINGS with 2 bytes, expected 40")
        assert found["bumper"] == ("bad", "BUMPER is 7, expected 0 or 1")
        assert found["analog inputs"] == ("bad", "4 bytes, expected 32")
        assert found["digital inputs"] == ("bad", "2 bytes, expected 1")


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"U-Boot 2013.04\r\nlogin: ", "23 bytes, but no answer in them: no frame"),
        (ANSWERED[:-1] + b"\0", "40 bytes, but no answer in them: checksum 8f f88f"),
        (framed("fc03" + b"no!".hex() + "270100"), '13 bytes, but no answer in them: the board says "no!"'),
        (framed("0509"), "longer than"),
    ],
)
def test_what_is_no_answer_is_said(tmp_path: Path, answer: bytes, said: str) -> None:
    with plugged(tmp_path) as line:
        found, _ = answered(line, answer, 1.0)
    assert found.keys() == {"line", "board"}
    assert found["board"][0] == "bad" and said in found["board"][1] and "expected a Robotino" in found["board"][1]


def test_silence_is_said(tmp_path: Path) -> None:
    with plugged(tmp_path) as line:
        rows = read_all(str(line.link), 0.2)
    assert words(rows)["board"] == (
        "missing", "no answer within 0.2 s: expected a Robotino 3 or 4 that is switched on",
    )  # fmt: skip
    assert rows[1].milliseconds >= 200.0
    with PtyLine(Board(), IdealPlant.at_rest()) as pty:
        pty.noise = Noise(lost=1.0)
        assert words(read_all(pty.device, 0.2))["board"][0] == "missing"


def test_devices_that_cannot_be_asked(tmp_path: Path) -> None:
    (absent,) = read_all(str(tmp_path / "nothing"))
    assert (absent.name, absent.state) == ("line", "missing") and "is not there" in absent.words
    (none,) = read_all("/dev/null")
    assert none.state == "bad" and "is no serial device" in none.words
    with plugged(tmp_path) as line:
        with Serial(str(line.link), exclusive=True):
            (busy,) = read_all(str(line.link))
        assert busy.state == "bad" and "controld3" in busy.words

        def pull() -> None:
            line.read_to(b"\xff")
            os.close(line.master)

        far = Thread(target=pull)
        far.start()
        (gone,) = read_all(str(line.link), LONG)
        far.join()
        line.master = -1
        assert gone.state == "bad" and "is gone" in gone.words
