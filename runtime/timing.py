"""The [timing] section of the configuration: how slow links and services are in virtual time."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from runtime.scheduler import BadSystem, Timing
from runtime.time import nanoseconds
from runtime.topics import TOPICS

Seconds = Annotated[float, Meta(ge=0, le=60)]


class TimingConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How slow links and services are in virtual time, to see what that does to a push."""

    latency: Annotated[
        dict[str, Seconds],
        Meta(description="s from publication to arrival, by topic, or by 'topic>service' for one link"),
    ] = {}
    duration: Annotated[dict[str, Seconds], Meta(description="s that each handler of a service takes")] = {}
    snapshot_period: Annotated[float, Meta(ge=0.1, le=3600, description="s between the snapshots of each service")] = (
        5.0
    )
    journal_period: Annotated[
        float, Meta(ge=0.01, le=0.25, description="s between the journal batches of each service")
    ] = 0.1

    def timing(self) -> Timing:
        """Return it as the scheduler takes it.

        Raises:
            BadSystem: a topic does not exist.
        """
        latency = {}
        for link, delay in self.latency.items():
            topic, _, node = link.partition(">")
            if topic not in TOPICS:
                raise BadSystem(f"timing.latency: no topic '{topic}'; expected one of {', '.join(TOPICS)}")
            latency[(topic, node or "*")] = nanoseconds(delay)
        return Timing(
            latency=latency,
            duration={name: nanoseconds(delay) for name, delay in self.duration.items()},
            snapshot_period=nanoseconds(self.snapshot_period),
            journal_period=nanoseconds(self.journal_period),
        )
