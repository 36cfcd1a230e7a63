"""Frames of Robotino 1 and 2, byte by byte as the reference lays them out (2.8)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.robotino.serial.rec import ANSWERED, BadRec, RecAnswer, RecCommand, frames


def test_a_command_stands_where_the_reference_says() -> None:
    frame = RecCommand(
        speeds=(270.0, -540.0, 0.0), outputs=(True, *[False] * 4, True, False, False), relays=(False, True),
        power=-100, zero=(False, False, True),
    ).encode()  # fmt: skip
    assert len(frame) == 47 and frame[:3] == b"REC" and frame[44:] == b"rec" and frame[3] == 0
    # Brake, DO0; positive; 10 units of 27 rpm; gains as the board has them.
    assert frame[4:14].hex() == "03020a00000000ffffff"
    assert frame[14:24].hex() == "25001400000000ffffff", "DO5 and relay 1; backwards at 20 units"
    assert frame[24:34].hex() == "01080000000000ffffff", "position to zero"
    assert frame[34:44].hex() == "01006400000000ffffff", "power output, backwards"
    assert RecCommand(speeds=(0.0, 0.0, 0.0), shutdown=True).encode()[3] == 0x02


@pytest.mark.parametrize("speeds", [(7000.0, 0.0, 0.0), (0.0, 0.0, -7000.0)])
def test_too_fast_does_not_fit(speeds: tuple[float, float, float]) -> None:
    with pytest.raises(BadRec, match="expected -255 to 255"):
        RecCommand(speeds=speeds).encode()


def answer() -> bytearray:
    frame = bytearray(ANSWERED)
    frame[:3], frame[98:] = b"REC", b"rec"
    return frame


def test_an_answer_stands_where_the_reference_says() -> None:
    frame = answer()
    frame[4] = 216  # battery, high 8 of 10 bits: 864 / 36.10 V
    frame[14 + 10], frame[14 + 11] = 1, 10
    frame[35 + 11] = 20
    frame[14 + 12 : 14 + 16] = (-1000).to_bytes(4, "little", signed=True)
    frame[14 + 16] = 0x11  # DI0 and the bumper
    frame[56 + 2] = 255  # slave 2, second converter: distance sensor 0
    frame[56 + 8] = 0b00110000  # and its two low bits
    frame[14 + 3] = 128  # slave 0, third converter: analog input 0
    frame[14] = 39  # motor current: 156 / 156 A
    found = RecAnswer.decode(bytes(frame))
    assert found.speeds == (270, -540, 0) and found.positions == (1000, 0, 0)
    assert found.battery == pytest.approx(23.93, abs=0.01)
    assert found.bumper and found.inputs == (True, *[False] * 7)
    assert found.distances[0] == pytest.approx(1023 * 2.55 / 1024) and sum(found.distances[1:]) == 0.0
    assert found.analog[0] == pytest.approx(5.0)
    assert found.currents[0] == pytest.approx(1.0)


@given(st.binary(max_size=60).filter(lambda one: b"R" not in one), st.integers(1, 150))
def test_answers_are_found_after_noise_and_in_pieces(noise: bytes, cut: int) -> None:
    whole = noise + bytes(answer()) + bytes(answer())
    first, rest = frames(whole[:cut])
    second, _ = frames(rest + whole[cut:])
    assert first + second == [bytes(answer())] * 2


@given(st.binary(max_size=130))
def test_whatever_comes_is_read_or_refused(data: bytes) -> None:
    frames(data)
    try:
        RecAnswer.decode(data)
    except BadRec:
        return
    assert len(data) == ANSWERED
