"""Frames and tags against what the manufacturer's controld3 sent and a bench board answered (reference 2.7)."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.robotino.serial import tags
from drivers.robotino.serial.framing import Decoder, Frame, TooLong, encode
from drivers.robotino.serial.tags import BadTag, MotorReadings, Power, Tag

CAPTURED = {
    "hw version": "aa02000100fdff",
    "start-up": "aa54000100030053010053010153010242090000803bc600803b4644010042090100803bc600803b4644010142"
    "090200803bc600803b4644010242090300803bc600803b464401031201001301005f05010000803f6000558af0",
    "poll": "aa0c0034000500200022002400450010ff",
    "drive and poll": "aa1b00090300efff09030100000903021100340005002000220024004500dbfc",
    "escaped payload": "aa1b0009030025fb090301558a010903023103340005002000220024004500dbfc",
    "motor timeout": "aa20000903000000090301000009030200000903030000340005002000220024004500c6fe",
    "versions answered": "aa23000205332e302e300405312e322e334110cdccc0410000c03f0001000060ea00002701008ff8",
    "readings answered": "aa68003528efff00001100000018fcffff00000000e8030000000000000000003f000000000000003f00000000"
    "06249a99993e9a99993e9a99993e9a99993e9a99993e9a99993e9a99993e9a99993e9a99993e2501004110cdcc"
    "c0410000c03f0001000060ea0000270100bae0",
}  # fmt: skip
POLL = tags.request(
    Tag.GET_ALL_MOTOR_READINGS, Tag.GET_DISTANCE_SENSORS, Tag.GET_ALL_ANALOG_INPUTS, Tag.GET_ALL_DIGITAL_INPUTS,
    Tag.GET_BUMPER, Tag.GET_GYRO_Z_ANGLE,
)  # fmt: skip


def captured(name: str) -> list[tuple[int, bytes]]:
    (frame,) = Decoder().feed(bytes.fromhex(CAPTURED[name]))
    assert not frame.fault
    return tags.unpacked(frame.payload)


@pytest.mark.parametrize("name", CAPTURED)
def test_captured_frames_there_and_back_byte_for_byte(name: str) -> None:
    frame = bytes.fromhex(CAPTURED[name])
    (found,) = Decoder().feed(frame)
    assert found.fault == ""
    assert encode(tags.packed(tags.unpacked(found.payload))) == frame


def test_what_is_sent_is_what_controld3_sends() -> None:
    assert encode(tags.packed(POLL)).hex() == CAPTURED["poll"]
    assert encode(tags.packed([*tags.speeds((-17.0, 0.0, 17.0)), *POLL])).hex() == CAPTURED["drive and poll"]
    assert encode(tags.packed([*tags.speeds((-1243.2, 425.9, 817.4)), *POLL])).hex() == CAPTURED["escaped payload"]


def test_what_the_captured_answers_say() -> None:
    found = dict(captured("readings answered"))
    assert tags.motor_readings(found[Tag.ALL_MOTOR_READINGS]) == MotorReadings(
        (-17, 0, 17, 0), (-1000, 0, 1000, 0), (0.5, 0.0, 0.5, 0.0)
    )
    assert tags.distance_volts(found[Tag.DISTANCE_SENSORS]) == pytest.approx((0.3,) * 9)
    assert tags.flag(Tag.BUMPER, found[Tag.BUMPER]) is False
    assert tags.power(found[Tag.POWER_SOURCE_READINGS]) == Power(pytest.approx(24.1), 1.5, False, 1, 0, False, 60000)
    versions = dict(captured("versions answered"))
    assert tags.text(versions[Tag.HW_VERSION]) == "3.0.0" and tags.text(versions[Tag.SW_VERSION]) == "1.2.3"


def test_the_answers_are_made_byte_for_byte() -> None:
    power = tags.pack_power(Power(24.1, 1.5, False, 1, 0, False, 60000))
    made = [
        tags.pack_motor_readings(MotorReadings((-17, 0, 17, 0), (-1000, 0, 1000, 0), (0.5, 0.0, 0.5, 0.0))),
        tags.pack_distance_volts([0.3] * 9),
        (Tag.BUMPER, b"\0"),
        power,
        (Tag.POWER_BUTTON, b"\0"),
    ]
    assert encode(tags.packed(made)).hex() == CAPTURED["readings answered"]


@given(st.lists(st.binary(max_size=128), max_size=6), st.binary(max_size=20), st.data())
def test_frames_are_found_however_they_are_cut_and_whatever_lies_between(
    payloads: list[bytes], noise: bytes, data: st.DataObject
) -> None:
    noise = noise.replace(b"\xaa", b"")
    stream = noise.join(encode(one) for one in payloads) + noise
    decoder, found = Decoder(), []
    while stream:
        cut = data.draw(st.integers(1, len(stream)))
        found += decoder.feed(stream[:cut])
        stream = stream[cut:]
    assert found == [Frame(one) for one in payloads]


@given(st.binary(max_size=128), st.data())
def test_one_wrong_byte_never_gives_another_payload(payload: bytes, data: st.DataObject) -> None:
    """But for errors that cancel in a sum: one byte alone never does."""
    frame = bytearray(encode(payload))
    at = data.draw(st.integers(0, len(frame) - 1))
    frame[at] ^= data.draw(st.integers(1, 255))
    good = [one.payload for one in Decoder().feed(bytes(frame)) if not one.fault]
    # An escape more or less moves all bytes after it, whose sum then hits by chance one time in 65536.
    if 0x55 not in bytes(frame) and 0x55 not in encode(payload):
        assert all(one == payload for one in good)


@given(st.binary(max_size=600))
def test_a_frame_after_rubbish_is_found(rubbish: bytes) -> None:
    decoder = Decoder()
    decoder.feed(rubbish)
    decoder.feed(encode(b"\x34\x00"))
    assert decoder.feed(encode(b"\x05\x00"))[-1] == Frame(b"\x05\x00")


@given(st.binary(max_size=200))
def test_tags_there_and_back_or_refused(payload: bytes) -> None:
    try:
        found = tags.unpacked(payload)
    except BadTag:
        return
    assert tags.packed(found) == payload


@pytest.mark.parametrize(
    ("read", "data"),
    [
        (tags.motor_readings, b"\0" * 39),
        (tags.motor_readings, b"\0" * 36 + struct.pack("<f", float("nan"))),
        (tags.distance_volts, struct.pack("<9f", *[0.3] * 8, float("inf"))),
        (tags.distance_volts, struct.pack("<9f", *[0.3] * 8, 7.0)),
        (tags.power, b"\0" * 15),
        (tags.gyro, struct.pack("<ff", float("nan"), 0.0)),
        (lambda data: tags.flag(Tag.BUMPER, data), b"\2"),
    ],
)
def test_wrong_data_is_refused(read: object, data: bytes) -> None:
    with pytest.raises(BadTag, match="expected"):
        read(data)  # type: ignore[operator]


def test_a_payload_that_is_too_long_is_refused() -> None:
    with pytest.raises(TooLong, match="129 bytes, expected at most 128"):
        encode(bytes(129))
