"""Which protobuf class and schema belongs to a topic."""

from __future__ import annotations

from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from runtime.messages import Health, Journal, Log, Reply, Request, Snapshot
from runtime.topics import TOPICS

_NODE_TOPICS: dict[str, type[Message]] = {
    "journal": Journal,
    "snapshot": Snapshot,
    "health": Health,
    "request": Request,
    "reply": Reply,
    "log": Log,
}


def message_type(topic: str) -> type[Message]:
    """Return the message class of a topic, a node's own topics included.

    Raises:
        KeyError: no such topic.
    """
    if topic in TOPICS:
        return TOPICS[topic].message
    return _NODE_TOPICS[topic.split("/", maxsplit=1)[0]]


def descriptor_set(file: Any) -> FileDescriptorSet:
    """Return the schema of a protobuf channel: the file descriptor with all it imports, in order of need."""
    found: dict[str, Any] = {}

    def visit(descriptor: Any) -> None:
        for dependency in descriptor.dependencies:
            visit(dependency)
        found.setdefault(descriptor.name, descriptor)

    visit(file)
    result = FileDescriptorSet()
    for descriptor in found.values():
        descriptor.CopyToProto(result.file.add())
    return result
