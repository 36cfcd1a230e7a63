"""A node in another process, as the scheduler sees it."""

from __future__ import annotations

import msgspec
import zenoh

from runtime.bus.keys import Keys
from runtime.errors import PushlaneError
from runtime.lockstep import protocol
from runtime.messages import Request
from runtime.sample import Sample
from runtime.service import Service
from runtime.time import Time, nanoseconds


class StepFailed(PushlaneError):
    """A worker could not carry out a step, or did not answer."""


class RemoteNode:
    """Steps one worker. Has the part of `runtime.node.Node` that the scheduler uses.

    Args:
        kind: class of the worker's service; only its contract is used here.
        config: the service's configuration.
        patience: s to wait for an answer.

    Raises:
        StepFailed: the worker does not answer or cannot build its service.
    """

    def __init__(
        self, session: zenoh.Session, keys: Keys, kind: type[Service], config: msgspec.Struct, patience: float = 30.0
    ) -> None:
        self.name = kind.name
        self.contract = kind.contract
        self._start: Time = 0
        self._session = session
        self._key = keys.step(kind.name)
        self._patience = patience
        self._periods = {name: nanoseconds(timer.seconds(config)) for name, timer in kind.contract.timers.items()}
        self._step(protocol.Build(msgspec.to_builtins(config)))

    @property
    def start(self) -> Time:
        """Return when the service's life began, ns."""
        return self._start

    def begin(self, now: Time) -> list[Sample]:
        """Start the service's life at `now`. Returns its first snapshot."""
        self._start = now
        return self._step(protocol.Begin(now))

    def due(self) -> list[tuple[Time, str]]:
        """Return when each timer fires first: (due, timer)."""
        return [(self._start + period, name) for name, period in self._periods.items()]

    def period(self, timer: str) -> Time:
        """Return the period of `timer` in ns."""
        return self._periods[timer]

    def consume(self, sample: Sample, now: Time, finish: Time) -> list[Sample]:
        """Give the service a message."""
        row = (sample.topic, sample.sequence, sample.time, sample.payload)
        return self._step(protocol.Consume(*row, now, finish))

    def fire(self, timer: str, number: int, now: Time, finish: Time) -> list[Sample]:
        """Give the service firing `number` of `timer`."""
        return self._step(protocol.Fire(timer, number, now, finish))

    def ask(self, request: Request, now: Time, finish: Time) -> list[Sample]:
        """Ask the service."""
        return self._step(protocol.Ask(request.SerializeToString(deterministic=True), now, finish))

    def take_snapshot(self, now: Time) -> Sample:
        """Return the node's whole state."""
        return self._step(protocol.Snap(now))[0]

    def flush(self, now: Time) -> Sample | None:
        """Return the journal entries since the last flush, or None."""
        samples = self._step(protocol.Flush(now))
        return samples[0] if samples else None

    def end(self, now: Time) -> list[Sample]:
        """End the service's life in good order. Returns its last words and the last journal batch."""
        return self._step(protocol.End(now))

    def stop(self) -> None:
        """End the worker."""
        self._step(protocol.Stop())

    def _step(self, step: protocol.Step) -> list[Sample]:
        for reply in self._session.get(self._key, payload=protocol.encode(step), timeout=self._patience):
            if reply.ok is None:
                continue
            done = protocol.decode_done(bytes(reply.ok.payload))
            if done.error:
                failure = StepFailed(f"worker '{self.name}': {done.error}")
                failure.exit_code = done.code
                raise failure
            return done.published()
        raise StepFailed(f"worker '{self.name}' did not answer a {type(step).__name__} within {self._patience:g} s")
