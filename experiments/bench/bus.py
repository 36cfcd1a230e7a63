"""What our envelope, types, journal and host cost on top of raw Zenoh, between two processes.

Both are measured in the same run over the same hub: a raw publisher and a subscriber that queues for its main
thread, and two live hosts with a service each. Latency is from before the put to the handler.
"""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median, quantiles

import msgspec
import zenoh

from runtime import topics
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client, hub
from runtime.guard import Guard
from runtime.live.config import LiveConfig
from runtime.live.host import LiveHost
from runtime.lockstep.run import on_this_machine
from runtime.messages import Odometry, Pose2, Twist2
from runtime.node import Node
from runtime.service import Effects, Input, Output, Service, Timer, on
from runtime.time import Time

_RATE = 200.0
_SECONDS = 5.0
_BURST = 9_000
_BURSTS = 5
_PAUSE = 0.6
_RAW = "raw"


class Pace(msgspec.Struct, frozen=True):
    """How often the source speaks, and how many messages it sends at a time."""

    period: float = 1 / _RATE
    burst: int = 1


@dataclass
class Nothing:
    """No state."""


@dataclass
class Arrivals:
    """When messages came, ns, and how old each was, s."""

    times: list[Time] = field(default_factory=list)
    ages: list[float] = field(default_factory=list)

    def add(self, now: Time, stamp: Time) -> None:
        """Take one."""
        self.times.append(now)
        self.ages.append((now - stamp) / 1e9)

    def rates(self) -> list[float]:
        """Return messages a second of each burst: bursts are told apart by a pause."""
        ends = [i for i, (a, b) in enumerate(pairwise(self.times), 1) if b - a > 0.5e9 * _PAUSE]
        bursts = [self.times[a:b] for a, b in pairwise([0, *ends, len(self.times)])]
        return [len(burst) / max((burst[-1] - burst[0]) / 1e9, 1e-9) for burst in bursts if burst]


class Source(Service):
    """Publishes odometry at a rate."""

    name = "source"
    Config = Pace
    odometry = Output(topics.ODOMETRY)
    tick = Timer(lambda config: config.period)

    def __init__(self, config: Pace) -> None:
        super().__init__(config)
        self.state = Nothing()

    @on(tick)
    def speak(self, now: Time) -> Effects:
        """Send a burst."""
        for _ in range(self.config.burst):
            yield self.odometry(message(now))


class Listener(Service):
    """Notes how old each odometry is when its handler begins."""

    name = "listener"
    Config = Pace
    odometry = Input(topics.ODOMETRY)
    state: Arrivals

    def __init__(self, config: Pace) -> None:
        super().__init__(config)
        self.state = Arrivals()
        self.seen = Arrivals()

    @on(odometry)
    def hear(self, odometry: Odometry, now: Time) -> None:
        """Take one; kept outside of the state, which is for snapshots."""
        self.seen.add(now, odometry.stamp)


def message(now: Time) -> Odometry:
    """Return a message of usual size."""
    return Odometry(stamp=now, pose=Pose2(x=1.5, y=2.5, theta=0.5), twist=Twist2(vx=0.3), driver_sequence=7)


def main() -> None:
    """Print the figures."""
    bus = on_this_machine("bench").bus
    with hub(bus):
        for what, burst in (("latency", 1), ("throughput", _BURST)):
            listener = _start("listen", bus, burst)
            time.sleep(2.0)
            source = _start("speak", bus, burst)
            found = json.loads(listener.communicate(timeout=120)[0])
            source.wait(30)
            _print(what, found)


def _print(what: str, found: dict[str, list[float]]) -> None:
    ours, raw = found["ours"], found[_RAW]
    if what == "latency":
        print(f"one way between two processes over the hub, {_RATE:g} Hz, {len(raw)} messages each:")
        for name, ages in (("raw Zenoh", raw), ("typed, enveloped, journaled", ours)):
            cuts = quantiles(ages, n=100)
            print(f"  {name:<28} median {1e6 * median(ages):6.0f} us, p99 {1e6 * cuts[98]:6.0f} us")
        print(f"  ratio of the medians {median(ours) / median(raw):.2f} (bar: at most 1.2)")
    else:
        print(f"{_BURSTS} bursts of {_BURST} small messages, medians:")
        for name, rates in (("raw Zenoh", raw), ("ours", ours)):
            print(f"  {name:<10} {median(rates[:-1]) / 1000:6.1f} k/s, {rates[-1]:.0f} came")
        print(f"  ratio {median(ours[:-1]) / median(raw[:-1]):.2f} (bar: at least 0.5)")


def _start(role: str, bus: BusConfig, burst: int) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "experiments.bench.bus", role, bus.connect[0], str(burst)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def _speak(bus: BusConfig, burst: int) -> None:
    """Publish raw for a while, then as a live host."""
    sys.setswitchinterval(0.00025)
    keys = Keys(bus.robot)
    with client(bus) as session, Guard() as guard:
        publisher = session.declare_publisher(keys.topic(_RAW), congestion_control=zenoh.CongestionControl.BLOCK)
        for _ in range(round(_SECONDS * _RATE) if burst == 1 else _BURSTS):
            for _ in range(burst):
                publisher.put(message(time.time_ns()).SerializeToString())
            time.sleep(_period(burst))
        time.sleep(1.0)
        pace = Pace(burst=burst, period=_period(burst))
        host = LiveHost(Node(Source(pace), guard), session, keys, LiveConfig(snapshot_period=60.0))
        threading.Timer(_SECONDS if burst == 1 else (_BURSTS + 0.5) * _PAUSE, host.stop).start()
        host.run()


def _period(burst: int) -> float:
    return 1 / _RATE if burst == 1 else _PAUSE


def _listen(bus: BusConfig, burst: int) -> None:
    """Measure both, and print the figures as JSON."""
    sys.setswitchinterval(0.00025)
    keys = Keys(bus.robot)
    raw = Arrivals()
    inbox: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    with client(bus) as session, Guard() as guard:
        subscriber = session.declare_subscriber(keys.topic(_RAW), lambda sample: inbox.put(bytes(sample.payload)))
        wanted = round(_SECONDS * _RATE) if burst == 1 else _BURSTS * burst
        while len(raw.times) < wanted:
            try:
                odometry = Odometry.FromString(inbox.get(timeout=3.0 if raw.times else 30.0))
            except queue.Empty:
                break
            raw.add(time.time_ns(), odometry.stamp)
        subscriber.undeclare()
        service = Listener(Pace())
        host = LiveHost(Node(service, guard), session, keys, LiveConfig(snapshot_period=60.0))
        threading.Timer(_SECONDS + 2.0, host.stop).start()
        host.run()
    ours = service.seen
    if burst == 1:
        print(json.dumps({"ours": ours.ages, _RAW: raw.ages}))
    else:
        print(json.dumps({"ours": [*ours.rates(), len(ours.times)], _RAW: [*raw.rates(), len(raw.times)]}))


if __name__ == "__main__":
    place = BusConfig(robot="bench", connect=(sys.argv[2],))
    (_speak if sys.argv[1] == "speak" else _listen)(place, int(sys.argv[3]))
