"""Key expressions. Everything of one robot lies under pushlane/ROBOT/; what begins with @ is no topic."""

from __future__ import annotations

import re

from runtime.errors import PushlaneError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


class BadName(PushlaneError):
    """A robot's name cannot be part of a key."""


class Keys:
    """The keys of one robot.

    Raises:
        BadName: `robot` is not made of letters, digits, '_', '.' and '-'.
    """

    def __init__(self, robot: str) -> None:
        if not _NAME.fullmatch(robot):
            raise BadName(f"robot '{robot}' is no name: expected letters, digits, '_', '.' and '-', at most 64")
        self.root = f"pushlane/{robot}"

    def topic(self, name: str) -> str:
        """Return the key of a topic."""
        return f"{self.root}/{name}"

    def everything(self) -> str:
        """Return the expression of all topics; those of the runtime included, requests not."""
        return f"{self.root}/**"

    def name(self, key: str) -> str:
        """Return the topic of a key of this robot."""
        return key.removeprefix(f"{self.root}/")

    def request(self, name: str) -> str:
        """Return the key at which the request `name` is asked."""
        return f"{self.root}/@request/{name}"

    def latched(self, topic: str) -> str:
        """Return the key at which the last value of a latched topic is asked for."""
        return f"{self.root}/@latched/{topic}"

    def node(self, name: str) -> str:
        """Return the liveliness key of a node."""
        return f"{self.root}/@node/{name}"

    def step(self, name: str) -> str:
        """Return the key at which a lockstep worker is stepped."""
        return f"{self.root}/@step/{name}"

    def snapshot(self, name: str) -> str:
        """Return the key at which a node is asked for a snapshot."""
        return f"{self.root}/@snapshot/{name}"

    def sent(self, name: str) -> str:
        """Return the key at which a node is asked for messages that it sent."""
        return f"{self.root}/@sent/{name}"

    def session(self) -> str:
        """Return the key at which the launcher tells header and configuration of the session."""
        return f"{self.root}/@session"

    def host(self, name: str) -> str:
        """Return the key at which a launcher is asked about its machine."""
        return f"{self.root}/@host/{name}"
