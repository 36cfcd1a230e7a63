"""What a replay finds, as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from replays.differences import Differences
from replays.recording import Recording
from runtime.sample import Sample
from runtime.time import Time


class Comparison(Enum):
    """How outputs are compared."""

    BYTES = "bytes"
    TOLERANCES = "tolerances"


@dataclass(frozen=True)
class Finding:
    """One thing that is not as it was recorded.

    Attributes:
        node: whose journal shows it.
        entry: number of the journal entry.
        time: logical time, ns.
        text: what and where, for people.
        topic, sequence: the message concerned, if one is.
    """

    node: str
    entry: int
    time: Time
    text: str
    topic: str = ""
    sequence: int = 0


@dataclass(frozen=True)
class InputValue:
    """The newest message of an input when the first divergence happened."""

    topic: str
    sequence: int
    text: str


@dataclass
class TopicResult:
    """How one output topic of one node compares."""

    recorded: int = 0
    replayed: int = 0
    identical: int = 0
    missing: int = 0  # recorded, not given by the replay
    extra: int = 0  # given by the replay, not recorded
    beyond: int = 0  # differ by more than is allowed
    first: Time | None = None  # of the first divergence
    differences: Differences = field(default_factory=Differences)

    def add(self, other: TopicResult) -> None:
        """Take in what another incarnation of the same service gave."""
        self.recorded += other.recorded
        self.replayed += other.replayed
        self.identical += other.identical
        self.missing += other.missing
        self.extra += other.extra
        self.beyond += other.beyond
        self.first = other.first if self.first is None else self.first
        self.differences.join(other.differences)


@dataclass
class NodeResult:
    """The replay of one node.

    Attributes:
        start, end: logical time covered, ns.
        snapshot: number of the snapshot it started from; 0 for the service's own beginning.
        events: handled.
        findings: in the order of the journal.
        complete: the whole journal was executed.
        inputs: what the service knew when it first diverged; empty if it never did.
        note: what is missing from the coverage, if anything.
    """

    node: str
    start: Time = 0
    end: Time = 0
    snapshot: int = 0
    events: int = 0
    topics: dict[str, TopicResult] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    inputs: list[InputValue] = field(default_factory=list)
    complete: bool = True
    note: str = ""
    overlay: list[tuple[Sample | None, Sample | None]] = field(default_factory=list)

    @property
    def identical(self) -> bool:
        """Return whether nothing differs beyond what the comparison allows."""
        return not self.findings


@dataclass(frozen=True)
class ChangedSetting:
    """A setting that the replay has other than the recording.

    Attributes:
        key: dotted.
        recorded, replayed: the values, as JSON or TOML have them.
    """

    key: str
    recorded: object
    replayed: object


@dataclass
class Report:
    """The replay of a session."""

    recording: Recording
    comparison: Comparison
    reasons: list[str]  # why bytes are not compared
    changed: list[str]  # configuration keys changed for this replay
    nodes: list[NodeResult] = field(default_factory=list)
    changes: list[ChangedSetting] = field(default_factory=list)  # the same, every value with the recorded one

    @property
    def identical(self) -> bool:
        """Return whether all nodes are."""
        return all(node.identical for node in self.nodes)
