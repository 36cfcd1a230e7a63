"""One file of a recording. It begins, for each service, with a snapshot that everything needed after is recorded of."""

from __future__ import annotations

from pathlib import Path

import msgspec

from runtime.recorder.header import END_NAME, Header
from runtime.recorder.writer import Recorder
from runtime.sample import INCARNATION, Sample
from runtime.topics import TOPICS


class Part:
    """Writes samples to one file.

    A snapshot that a service gave by itself may be followed by messages that were on their way before the file
    began. So what a service says of itself (snapshots, journal) is held back until the snapshot it was asked for, or
    the first one of its life, has come. What it publishes is written at once.

    Args:
        path: a new file.

    Raises:
        CannotRecord: the file cannot be opened, or is there already.
    """

    def __init__(self, path: Path, header: Header, config: bytes) -> None:
        self.recorder = Recorder(path, header, config)
        self.journals: dict[str, int] = {}
        self._begun: set[str] = set()
        self._wanted: dict[str, int] = {}
        self._held: dict[str, list[Sample]] = {}
        self._latched: set[tuple[str, int]] = set()
        self._asked = False

    @property
    def path(self) -> Path:
        """Return the file."""
        return self.recorder.path

    def write(self, sample: Sample) -> None:
        """Write one sample, or hold it back.

        Raises:
            CannotRecord: the disk is full, or the like.
        """
        kind, _, node = sample.topic.partition("/")
        if kind not in ("snapshot", "journal"):
            self._write_message(sample)
        elif node in self._begun:
            self._write_own(kind, node, sample)
        elif self._begins(kind, node, sample):
            self._begun.add(node)
            self._held.pop(node, None)
            self._write_own(kind, node, sample)
        else:
            self._held.setdefault(node, []).append(sample)

    def begin(self, node: str, snapshot: int) -> None:
        """Begin the story of `node` at its snapshot of this number, which may have come already, or is on its way."""
        self._wanted[node] = snapshot
        held = self._held.pop(node, [])
        for sample in held:
            self.write(sample)

    def begin_all(self) -> list[str]:
        """Stop waiting for nodes that did not answer: their story may begin in its middle. Returns their names."""
        self._asked = True
        silent = [node for node in self._held if node not in self._wanted]
        for node in silent:
            for sample in self._held.pop(node):
                self.write(sample)
        return silent

    def close(self, running: list[str], following: str) -> None:
        """End the file.

        Args:
            running: nodes that go on.
            following: name of the next part, or "".

        Raises:
            CannotRecord: that was not possible.
        """
        last = {node: self.journals[node] for node in running if node in self.journals}
        try:
            self.recorder.note(END_NAME, {"running": msgspec.json.encode(last).decode(), "next": following})
        finally:
            self.recorder.close()

    def _begins(self, kind: str, node: str, sample: Sample) -> bool:
        if node not in self._wanted and self._asked:
            return True
        if kind != "snapshot":
            return False
        first_of_life = sample.sequence % INCARNATION == 1
        return first_of_life or (node in self._wanted and sample.sequence >= self._wanted[node])

    def _write_own(self, kind: str, node: str, sample: Sample) -> None:
        if kind == "journal":
            # A batch bears the number of the entry after its last; one that was missed comes after later ones.
            self.journals[node] = max(sample.sequence - 1, self.journals.get(node, 0))
        self.recorder(sample)

    def _write_message(self, sample: Sample) -> None:
        if sample.topic in TOPICS and TOPICS[sample.topic].latched:
            name = (sample.topic, sample.sequence)
            if name in self._latched:
                return  # came as answer and by subscription
            self._latched.add(name)
        self.recorder(sample)


def free_name(base: Path, number: int) -> Path:
    """Return `base` with the first number from `number` on that gives a file which is not there."""
    while (path := base.with_stem(f"{base.stem}-{number}")).exists():
        number += 1
    return path
