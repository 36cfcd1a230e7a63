"""The fuzzer itself: that it finds what is wrong, and a thousand of its inputs."""

from __future__ import annotations

import pytest

from experiments.fuzz.__main__ import BODIES, FRAMES, fuzz
from experiments.fuzz.feeds import RestFeed, SerialFeed


def test_a_thousand_inputs_to_each_parser(capsys: pytest.CaptureFixture[str]) -> None:
    fuzz("serial", FRAMES, SerialFeed(), 1000, 5)
    fuzz("REST", BODIES, RestFeed(), 1000, 5)
    assert capsys.readouterr().out.count("1000 inputs survived") == 2


def test_a_parser_that_fails_is_told_with_its_input(capsys: pytest.CaptureFixture[str]) -> None:
    def fragile(data: bytes) -> None:
        if b"\xff" in data:
            raise IndexError("out of range")

    with pytest.raises(IndexError):
        fuzz("fragile", FRAMES, fragile, 1000, 1)
    said = capsys.readouterr().err
    assert b"\xff" in bytes.fromhex(said.rsplit(" ", 1)[1].strip())
