"""Who publishes what to whom: as services declare it, or of those that are up, with measured rates."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field

from runtime import registry
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.live.watch import listen
from runtime.topics import ALIVE, TOPICS

_LAUNCHER = "launcher"


@dataclass(frozen=True)
class Graph:
    """Services and the topics between them.

    Attributes:
        nodes: those that are there.
        outputs, inputs: node -> topics.
        rates: topic -> measured Hz; empty where nothing was measured.
        strangers: topics that come although no service that is up declares them.
    """

    nodes: list[str]
    outputs: dict[str, list[str]]
    inputs: dict[str, list[str]]
    rates: dict[str, float] = field(default_factory=dict)
    strangers: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, names: list[str], rates: dict[str, float] | None = None) -> Graph:
        """Return the graph of these services and the launcher, by their declarations. Other names have no topics."""
        kinds = {name: registry.service_class(name).contract for name in names if name in registry.SERVICES}
        by_others = {topic for kind in kinds.values() for topic in kind.outputs}
        outputs = {
            # What a wire brings is published by the host that has the wire.
            name: sorted({*kind.outputs, *(topic for topic in kind.wired if topic not in by_others)})
            for name, kind in kinds.items()
        } | {_LAUNCHER: [ALIVE.name]}
        names = [*names, _LAUNCHER] if names else []
        known = {topic for topics in outputs.values() for topic in topics}
        strangers = sorted(topic for topic in rates or {} if topic in TOPICS and topic not in known)
        return cls(names, outputs, {name: sorted(kind.inputs) for name, kind in kinds.items()}, rates or {}, strangers)

    def listeners(self, topic: str) -> list[str]:
        """Return who consumes a topic."""
        return [name for name in self.nodes if topic in self.inputs.get(name, [])]

    def graphviz(self) -> Iterator[str]:
        """Return the lines of a Graphviz file."""
        yield "digraph pushlane {"
        yield "  rankdir=LR; node [shape=box];"
        for name in self.nodes:
            yield f"  {json.dumps(name)};"
        for publisher, topics in [*self.outputs.items(), *(("nobody that is up", [one]) for one in self.strangers)]:
            for topic in topics:
                label = json.dumps(f"{topic}{self._rate(topic)}")
                for listener in self.listeners(topic):
                    yield f"  {json.dumps(publisher)} -> {json.dumps(listener)} [label={label}];"
        yield "}"

    def tree(self) -> Iterator[str]:
        """Return lines for people: node, its topics, their listeners."""
        for name in self.nodes:
            yield name
            for topic in self.outputs.get(name, []):
                yield f"  {topic}{self._rate(topic)} -> {', '.join(self.listeners(topic)) or 'nobody'}"
            wanting = [
                topic for topic in self.inputs.get(name, []) if not self._published(topic) and topic not in self.rates
            ]
            if wanting:
                yield f"  waits for {', '.join(wanting)}, which nobody that is up publishes"
        for topic in self.strangers:
            yield f"{topic}{self._rate(topic)} comes, though nobody that is up declares it"

    def _published(self, topic: str) -> bool:
        return any(topic in topics for topics in self.outputs.values())

    def _rate(self, topic: str) -> str:
        if topic in self.rates:
            return f" {self.rates[topic]:.1f} Hz"
        return " silent" if self.rates else ""


def running(bus: BusConfig, duration: float) -> Graph:
    """Return the graph of what is up, measured for `duration` s.

    Raises:
        NoBus: there is no meeting point.
    """
    with client(bus) as session:
        answers = session.liveliness().get(Keys(bus.robot).node("*"), timeout=2.0)
        alive = sorted(str(one.ok.key_expr).rpartition("/")[2] for one in answers if one.ok is not None)
    tally = listen(bus, "**", duration)
    order = [name for name in registry.SERVICES if name in alive]
    others = [name for name in alive if name not in order]
    return Graph.of([*order, *others], {topic: tally.rate(topic) for topic in tally.counts})
