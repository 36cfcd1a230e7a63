from __future__ import annotations

from importlib import import_module

import pytest
from google.protobuf.message import Message

from experiments.systems import SYSTEMS
from runtime import messages, topics
from runtime.errors import PushlaneError
from runtime.recorder.schema import message_type
from runtime.registry import SERVICES, UnknownService, service_class
from runtime.service import Service
from runtime.topics import TOPICS, Topic


@pytest.mark.parametrize("topic", TOPICS.values(), ids=TOPICS.keys())
def test_every_row_has_a_message_that_parses_an_empty_payload(topic: Topic[Message]) -> None:
    message = topic.message.FromString(b"")
    assert message.SerializeToString() == b""
    assert message_type(topic.name) is topic.message


def test_the_table_has_every_topic_of_the_module_once() -> None:
    declared = [value for value in vars(topics).values() if isinstance(value, Topic)]
    assert list(TOPICS.values()) == declared
    assert len({topic.name for topic in declared}) == len(declared)


@pytest.mark.parametrize("kind", ["journal", "snapshot", "health", "request", "reply", "log"])
def test_the_runtimes_own_topics_are_no_rows_and_have_their_types(kind: str) -> None:
    topic: Topic[Message] = getattr(topics, kind)("learner")
    assert topic.name == f"{kind}/learner"
    assert topic.name not in TOPICS
    assert message_type(topic.name) is topic.message


def test_messages_names_what_it_has() -> None:
    assert sorted(messages.__all__) == messages.__all__
    assert [name for name in messages.__all__ if not hasattr(messages, name)] == []


def classes() -> dict[str, type[Service]]:
    return {name: service_class(name) for name in SERVICES}


def test_every_registered_service_exists_under_its_name() -> None:
    assert {name: kind.name for name, kind in classes().items()} == {name: name for name in SERVICES}


@pytest.mark.parametrize("system", SYSTEMS.values(), ids=map(" over ".join, SYSTEMS))
def test_every_topic_is_published_by_at_most_one_service_of_a_system(system: tuple[str, ...]) -> None:
    publishers: dict[str, list[str]] = {}
    for name in system:
        for topic in service_class(name).contract.outputs:
            publishers.setdefault(topic, []).append(name)
    assert {topic: names for topic, names in publishers.items() if len(names) > 1} == {}
    assert set(publishers) <= set(TOPICS)


@pytest.mark.parametrize("system", SYSTEMS.values(), ids=map(" over ".join, SYSTEMS))
def test_every_input_of_a_service_has_a_publisher_in_its_system(system: tuple[str, ...]) -> None:
    kinds = {name: service_class(name) for name in system}
    published = {topic for kind in kinds.values() for topic in kind.contract.outputs}
    published.add("alive")  # by the launcher of a live system
    missing = {(name, topic) for name, kind in kinds.items() for topic in kind.contract.inputs} - {
        (name, topic) for name in kinds for topic in published
    }
    assert missing == set()


def test_no_service_listens_to_what_is_for_scoring_only() -> None:
    cheats = [
        f"{name}: {topic}"
        for name, kind in classes().items()
        if kind.__module__.startswith("services.")
        for topic, source in kind.contract.inputs.items()
        if source.topic.scoring_only
    ]
    assert cheats == []


def test_declarations_are_rows_of_the_table() -> None:
    for kind in classes().values():
        for name, source in (kind.contract.inputs | kind.contract.outputs).items():
            assert source.topic is TOPICS[name]


def test_an_unknown_service_is_refused_with_those_that_exist() -> None:
    with pytest.raises(UnknownService, match="'lerner'.*learner.*task"):
        service_class("lerner")


def test_errors_of_the_runtime_are_the_users_to_mend() -> None:
    for module, name in (
        ("runtime.state", "BadSnapshot"),
        ("runtime.guard", "Nondeterministic"),
        ("runtime.node", "BadMessage"),
        ("runtime.node", "BadHandler"),
        ("runtime.scheduler", "BadSystem"),
        ("runtime.config.layers", "ConfigError"),
        ("runtime.recorder.writer", "CannotRecord"),
    ):
        assert issubclass(getattr(import_module(module), name), PushlaneError)
