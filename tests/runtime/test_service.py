from __future__ import annotations

import pytest

from runtime import topics
from runtime.messages import CancelRequest, Log, Odometry
from runtime.service import BadService, Input, Output, RequestInput, Service, Timer, on
from runtime.time import SECOND, Time, nanoseconds, seconds
from tests.support import Listener, Nothing, Pace


def test_the_contract_is_read_from_the_class() -> None:
    contract = Listener.contract
    assert list(contract.inputs) == ["odometry", "command"]
    assert list(contract.timers) == ["beat"]
    assert list(contract.requests) == ["push/cancel"]
    assert contract.outputs == {}
    assert contract.handlers == {
        "odometry": "hear_odometry",
        "command": "hear_command",
        "beat": "keep_time",
        "push/cancel": "answer",
    }


def test_an_input_without_handler_is_only_remembered() -> None:
    class Quiet(Service):
        name = "quiet"
        Config = Nothing
        odometry = Input(topics.ODOMETRY)

    quiet = Quiet(Nothing())
    assert quiet.odometry is None
    quiet.latest["odometry"] = Odometry(driver_sequence=7)
    assert quiet.odometry is not None and quiet.odometry.driver_sequence == 7


def test_a_subclass_keeps_what_it_inherits() -> None:
    class Echo(Listener):
        name = "echo"
        pose = Output(topics.ROBOT_POSE)

    assert list(Echo.contract.inputs) == ["odometry", "command"]
    assert list(Echo.contract.outputs) == ["robot/pose"]
    assert Listener.contract.outputs == {}


def test_an_overridden_handler_replaces_the_inherited_one() -> None:
    class Other(Listener):
        @on(Listener.odometry)
        def hear_odometry(self, odometry: Odometry, now: Time) -> None:
            pass

    assert Other.contract.handlers["odometry"] == "hear_odometry"


def test_a_timer_without_handler_is_refused() -> None:
    with pytest.raises(BadService, match="Forgetful has no handler for tick, push/cancel"):

        class Forgetful(Service):
            tick = Timer(1.0)
            cancel = RequestInput("push/cancel", CancelRequest)


def test_two_handlers_of_one_input_are_refused() -> None:
    with pytest.raises(BadService, match="Double handles 'odometry' twice"):

        class Double(Service):
            odometry = Input(topics.ODOMETRY)

            @on(odometry)
            def one(self, odometry: Odometry, now: Time) -> None: ...

            @on(odometry)
            def two(self, odometry: Odometry, now: Time) -> None: ...


def test_a_handler_of_something_undeclared_is_refused() -> None:
    elsewhere = Input(topics.ODOMETRY)
    with pytest.raises(BadService, match=r"Stray\.hear handles something"):

        class Stray(Service):
            @on(elsewhere)
            def hear(self, odometry: Odometry, now: Time) -> None: ...


def test_a_timer_named_like_an_input_keeps_its_own_handler_or_is_refused() -> None:
    try:

        class Namesakes(Service):
            heard = Input(topics.COMMAND)
            command = Timer(1.0)

            @on(command)
            def tick(self, now: Time) -> None: ...

    except BadService:
        return
    assert "command" not in Namesakes.contract.inputs or Namesakes.contract.handlers.get("command") != "tick"


def test_a_timer_takes_its_period_from_the_configuration() -> None:
    assert Listener.beat.seconds(Pace(0.25)) == 0.25
    assert Timer(0.5).seconds(Nothing()) == 0.5


def test_a_log_line_carries_the_logical_time() -> None:
    said = Listener(Pace()).say("here", 3 * SECOND + 25, level="WARNING")
    assert said.topic == "log/listener"
    assert isinstance(said.message, Log)
    assert (said.message.timestamp.seconds, said.message.timestamp.nanos) == (3, 25)
    assert (said.message.message, said.message.name) == ("here", "listener")
    assert said.message.level == Log.Level.WARNING


def test_times_convert_to_the_nearest_nanosecond() -> None:
    assert nanoseconds(0.1) == 100_000_000
    assert nanoseconds(1e-9) == 1
    assert nanoseconds(0.29) == 290_000_000
    assert seconds(1_500_000_000) == 1.5
