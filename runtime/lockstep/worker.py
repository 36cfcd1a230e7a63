"""A lockstep worker: hosts one service in its own process and does what the scheduler's queries say.

Run as `python -m runtime.lockstep.worker NAME --robot ROBOT --connect ENDPOINT`.
"""

from __future__ import annotations

import argparse
import queue
import signal
import sys
from types import FrameType

import msgspec
import zenoh

from runtime import registry
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.errors import PushlaneError
from runtime.guard import Guard
from runtime.lockstep import protocol
from runtime.messages import Request
from runtime.node import Node
from runtime.sample import Sample

_PATIENCE = 5.0


class _Stopped(Exception):
    """The scheduler, or a signal, says that it is over."""


class Worker:
    """Carries out steps on one node."""

    def __init__(self, name: str, guard: Guard) -> None:
        self._name = name
        self._guard = guard
        self._node: Node | None = None

    def step(self, data: bytes) -> protocol.Done:
        """Carry out one step, an error included: the scheduler is to hear of it.

        Raises:
            _Stopped: it was the last one.
        """
        try:
            samples = self._carry_out(protocol.decode_step(data))
        except PushlaneError as error:
            return protocol.Done(error=str(error), code=error.exit_code)
        except msgspec.MsgspecError as error:
            return protocol.Done(error=f"no step: {error}")
        return protocol.Done([(s.topic, s.sequence, s.time, s.payload) for s in samples])

    def _carry_out(self, step: protocol.Step) -> list[Sample]:
        match step:
            case protocol.Build(config):
                kind = registry.service_class(self._name)
                self._node = Node(kind(msgspec.convert(config, kind.Config)), self._guard)
                return []
            case protocol.Stop():
                raise _Stopped
        node = self._node
        if node is None:
            raise PushlaneError(f"worker '{self._name}' was stepped before it was built")
        match step:
            case protocol.Begin(now):
                return node.begin(now)
            case protocol.Consume(topic, sequence, time, payload, now, finish):
                return node.consume(Sample(topic, sequence, time, payload), now, finish)
            case protocol.Fire(timer, number, now, finish):
                return node.fire(timer, number, now, finish)
            case protocol.Ask(request, now, finish):
                return node.ask(Request.FromString(request), now, finish)
            case protocol.Snap(now):
                return [node.take_snapshot(now)]
            case protocol.Flush(now):
                batch = node.flush(now)
                return [] if batch is None else [batch]
            case protocol.End(now):
                return node.end(now)
        raise PushlaneError(f"worker '{self._name}' does not know the step {type(step).__name__}")


def serve(name: str, bus: BusConfig) -> None:
    """Serve steps until told to stop."""
    keys = Keys(bus.robot)
    registry.service_class(name)  # import before the token says that this worker is ready
    queries: queue.SimpleQueue[zenoh.Query] = queue.SimpleQueue()
    with client(bus, _PATIENCE) as session, Guard() as guard:
        worker = Worker(name, guard)
        queryable = session.declare_queryable(keys.step(name), queries.put)
        token = session.liveliness().declare_token(keys.node(name))
        try:
            while True:
                query = queries.get()
                data = b"" if query.payload is None else bytes(query.payload)
                query.reply(keys.step(name), protocol.encode(worker.step(data)))
                query.drop()
        except _Stopped:
            query.reply(keys.step(name), protocol.encode(protocol.Done()))
            query.drop()
        finally:
            token.undeclare()
            queryable.undeclare()


def _end(number: int, _: FrameType | None) -> None:
    raise SystemExit(128 + number)


def main() -> None:
    """Run the worker that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name")
    parser.add_argument("--robot", default="robot")
    parser.add_argument("--connect", action="append", required=True)
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, _end)
    try:
        serve(given.name, BusConfig(robot=given.robot, connect=tuple(given.connect)))
    except PushlaneError as error:
        print(f"worker {given.name}: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
