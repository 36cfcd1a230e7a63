"""A system split over two hosts whose network is cut, or loses and delays: the base stands, then the push goes on.

The robot's host has the hub and the recorder. What is asserted is read from the recording made there: the truth, and
the journals, which say what each service consumed and when.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot
from pathlib import Path

import pytest
import zenoh

from experiments.session import prepare
from experiments.systems import NODES
from replays import chain, report
from replays.recording import Recording, load
from replays.replay import replay
from runtime.bus import envelope
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import client
from runtime.config.layers import Layer
from runtime.journal import Entry
from runtime.messages import (
    Alive,
    EntryKind,
    ObjectState,
    Odometry,
    PushOutcome,
    PushPhase,
    RobotPose,
    RobotStatus,
    Truth,
    VelocityCommand,
)
from runtime.sample import Sample
from tests.figures import Figures
from tests.live_system import START_LIMIT, System
from tests.netbridge import Bridge, End, bridged
from tests.netns import hosts, needs_netns

REST = 0.02
"""m/s below which the base stands still: truth has no noise."""
DEADLINE = 0.2
"""s that a command may be old."""
STOPPING = 0.4
"""s within which the base must be seen at rest after the last command that it may obey: the bar is 0.3 s; truth comes
every 0.05 s."""

ON_ROBOT = ("driver", "controller")
ONLY_DRIVER = ("driver",)


@dataclass
class Split(System):
    """A system on two hosts, as a test sees it over a link that stays whole.

    Attributes:
        recording: made on the robot.
        outputs: host -> file with what its processes said.
        arrivals: when each truth reached the test by way of the robot's hub, s, monotonic.
    """

    bridge: Bridge = field(kw_only=True)
    recording: Path = field(kw_only=True)
    outputs: dict[str, Path] = field(kw_only=True)
    arrivals: list[float] = field(default_factory=list, kw_only=True)

    def said(self, host: str) -> str:
        """Return what the launcher of `host` and its services have said."""
        return self.outputs[host].read_text()


@contextmanager
def split(folder: Path, on_robot: Sequence[str], **sections: dict[str, object]) -> Iterator[Split]:
    """Run the services `on_robot` on one host and the others on another one, and end them."""
    sim = {"scene": "open", "goal": [0.6, 0.1], "object": "cylinder", "seed": 2, "time_limit": 120}
    net = f"10.190.{os.getpid() % 250}"
    with hosts(1) as (robot,), _namespace("laptop") as laptop:
        ends = (
            End(robot.prefix[-1], f"pltc{os.getpid() % 10000}r", f"{net}.1/24"),
            End(laptop, f"pltc{os.getpid() % 10000}l", f"{net}.2/24"),
        )
        system_file = folder / "system.toml"
        on_laptop = [name for name in NODES if name not in on_robot]
        system_file.write_text(
            _toml("bus", {"robot": "split", "listen": [f"tcp/{host}:7447" for host in (robot.address, f"{net}.1")]})
            + _toml("sim", sim)
            + _toml("hosts", {"robot": list(on_robot), "laptop": on_laptop})
            + "".join(_toml(name, values) for name, values in sections.items())
        )
        goal = prepare([Layer("test", {"sim": sim})]).goal
        recording = folder / "split.mcap"
        outputs = {"robot": folder / "robot.txt", "laptop": folder / "laptop.txt"}
        command = [sys.executable, "-u", "-m", "runtime.cli.main", "run", str(system_file)]
        outside = BusConfig(robot="split", connect=(f"tcp/{robot.address}:7447",))
        with bridged(*ends) as bridge:
            started: list[subprocess.Popen[bytes]] = []

            def start(host: str, prefix: Sequence[str], address: str, *more: str) -> None:
                place = ["--set", f'bus.connect=["tcp/{address}:7447"]']
                with outputs[host].open("wb") as output:
                    line = [*prefix, *command, "--host", host, *place, *more]
                    started.append(subprocess.Popen(line, stdout=output, stderr=subprocess.STDOUT))

            try:
                start("robot", robot.prefix, robot.address, "-o", str(recording))
                start("laptop", ("ip", "netns", "exec", laptop), f"{net}.1", "--join")
                with client(outside, patience=30.0) as session:
                    system = Split(
                        launcher=None,  # type: ignore[arg-type]  # the launchers are processes of their own here
                        bus=outside,
                        keys=Keys("split"),
                        session=session,
                        goal=goal,
                        bridge=bridge,
                        recording=recording,
                        outputs=outputs,
                    )
                    _listen(system)
                    try:
                        system.wait(lambda: _are_up(system, started), START_LIMIT, "all services up")
                        yield system
                    except AssertionError:
                        for host in outputs:
                            print(f"--- {host}\n{system.said(host)}")
                        raise
            finally:
                bridge.heal()
                for process in reversed(started):
                    process.send_signal(signal.SIGTERM)
                    try:
                        process.wait(20.0)
                    except subprocess.TimeoutExpired:
                        process.kill()
                        process.wait()


def _listen(system: Split) -> None:
    def hear(sample: zenoh.Sample) -> None:
        topic = system.keys.name(str(sample.key_expr))
        with suppress(envelope.BadEnvelope):
            system.heard.setdefault(topic, []).append(envelope.opened(topic, sample))
            if topic == "truth":
                system.arrivals.append(time.monotonic())

    system.session.declare_subscriber(system.keys.everything(), hear)


def _are_up(system: Split, started: list[subprocess.Popen[bytes]]) -> bool:
    assert all(process.poll() is None for process in started), "a launcher has ended"
    return all("all services are up" in system.said(host) for host in system.outputs)


@contextmanager
def _namespace(name: str) -> Iterator[str]:
    """Make a namespace without any link yet."""
    name = f"plt{os.getpid() % 10000}{name}"
    subprocess.run(["ip", "netns", "add", name], check=True)
    try:
        subprocess.run(["ip", "-n", name, "link", "set", "lo", "up"], check=True)
        yield name
    finally:
        subprocess.run(["ip", "netns", "del", name], check=True)


def _toml(section: str, values: dict[str, object]) -> str:
    lines = [f"{key} = {value!r}".replace("'", '"') for key, value in values.items()]
    return "\n".join([f"[{section}]", *lines, "", ""])


@dataclass(frozen=True)
class Taken:
    """A command that the driver consumed.

    Attributes:
        time: when, ns; sent: when it was published, ns.
        age: s since the odometry that it names was published.
        moving: it asks for more than standing still.
        orphaned: by the newest roll that the driver had, its controller was gone.
    """

    time: int
    sent: int
    age: float
    moving: bool
    orphaned: bool


class Story:
    """What the recording says of base and commands."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.journals = {name: chain.read(recording, name) for name in NODES}
        self.speeds = [
            (truth.stamp, hypot(truth.robot_twist.vx, truth.robot_twist.vy))
            for truth in (Truth.FromString(sample.payload) for sample in self.of("truth"))
        ]
        readings = [Odometry.FromString(sample.payload) for sample in self.of("odometry")]
        stamps = {reading.driver_sequence: reading.stamp for reading in readings}
        self.rolls = [
            (entry.number, set(Alive.FromString(recording.samples[("alive", entry.sequence)].payload).nodes))
            for entry in self.consumed("driver", "alive")
        ]
        self.taken = []
        for entry in self.consumed("driver", "command"):
            sample = recording.samples[("command", entry.sequence)]
            command = VelocityCommand.FromString(sample.payload)
            age = (entry.time - stamps[command.driver_sequence]) / 1e9
            rolls = [roll for number, roll in self.rolls if number < entry.number]
            orphaned = bool(rolls) and "controller" not in rolls[-1]
            self.taken.append(Taken(entry.time, sample.time, age, _moves(command), orphaned))

    def of(self, topic: str) -> list[Sample]:
        """Return the samples of a topic."""
        return [sample for sample in self.recording.samples.values() if sample.topic == topic]

    def consumed(self, node: str, topic: str) -> list[Entry]:
        """Return the entries of a journal that say that a message of `topic` was consumed."""
        return [e for e in self.journals[node] if e.kind == EntryKind.MESSAGE and e.name == topic]

    def fresh(self) -> list[Taken]:
        """Return the commands that the driver may obey."""
        return [one for one in self.taken if one.age <= DEADLINE and not one.orphaned]

    def longest_motion_without_command(self) -> float:
        """Return the longest that the base was seen moving after the newest command it may obey, s."""
        longest = 0.0
        for stamp, speed in self.speeds:
            if speed >= REST:
                newest = max((one.time for one in self.fresh() if one.time <= stamp), default=None)
                assert newest is not None, f"the base moved at {stamp} ns, before any command"
                longest = max(longest, (stamp - newest) / 1e9)
        return longest

    def speeding_up(self) -> list[int]:
        """Return when the base got faster although no fresh command asked it to move, ns."""
        moving = [one.time for one in self.fresh() if one.moving]
        return [
            stamp
            for (_, before), (stamp, speed) in pairwise(self.speeds)
            if speed > before + 0.005 and not any(0 <= stamp - one <= STOPPING * 1e9 for one in moving)
        ]

    def rest_after(self, moment: int) -> tuple[float, float, float]:
        """Return how the base stopped after `moment`, when a cut began.

        Returns:
            s between its last fresh command and rest; s between the last one that moves it and rest; and when the next
            one moved it again, s after `moment`.
        """
        fresh = self.fresh()
        again = next(one.time for one in fresh if one.moving and one.time > moment + 10**9)
        last = max(one.time for one in fresh if one.moving and one.time < again)
        rest = next(stamp for stamp, speed in self.speeds if stamp >= last and speed < REST)
        newest = max(one.time for one in fresh if one.time <= rest)
        moved = [stamp for stamp, speed in self.speeds if rest <= stamp <= again and speed >= REST]
        assert not moved, f"the base moved {len(moved)} times without a fresh command"
        return (rest - newest) / 1e9, (rest - last) / 1e9, (again - moment) / 1e9

    def sent_between(self, begin: int, end: int) -> list[Taken]:
        """Return the commands that the driver took, whenever that was, of those sent in a span of time."""
        return [one for one in self.taken if begin <= one.sent <= end]


def _moves(command: VelocityCommand) -> bool:
    return hypot(command.twist.vx, command.twist.vy) > 1e-6 or abs(command.twist.omega) > 1e-6


def check_whole(story: Story) -> None:
    """Nothing twice, no old position was acted on, the driver counts as we do, and everything replays."""
    recording = story.recording
    assert recording.doubled == []
    for name, rows in story.journals.items():
        consumed = [(e.name, e.sequence) for e in rows if e.kind == EntryKind.MESSAGE]
        assert len(set(consumed)) == len(consumed), f"'{name}' consumed a message twice"
    status = RobotStatus.FromString(story.of("status")[-1].payload)
    assert status.commands_accepted == sum(1 for one in story.fresh() if one.time <= status.stamp)
    assert status.commands_stale >= sum(1 for one in story.taken if one.age > DEADLINE and one.time <= status.stamp)
    found = replay(recording)
    assert found.identical, "\n".join(report.text(found))
    assert all(node.complete for node in found.nodes), "\n".join(report.text(found))


def oldest_position(story: Story) -> float:
    """Return the greatest age of a position that the controller sent a command to move by, s."""
    known: dict[str, int] = {}
    oldest = 0.0
    kinds = {"object/state": ObjectState, "robot/pose": RobotPose}
    for entry in story.journals["controller"]:
        if entry.kind == EntryKind.MESSAGE and entry.name in kinds:
            sample = story.recording.samples[(entry.name, entry.sequence)]
            known[entry.name] = kinds[entry.name].FromString(sample.payload).stamp
        elif entry.kind == EntryKind.PRODUCED and entry.name == "command":
            sample = story.recording.samples.get(("command", entry.sequence))
            if sample is not None and _moves(VelocityCommand.FromString(sample.payload)):
                oldest = max(oldest, (entry.time - min(known.values())) / 1e9)
    return oldest


def start_push(system: Split, pushing_for: float) -> None:
    assert system.ask_for_push().accepted
    system.wait(lambda: system.status().phase == PushPhase.PUSHING, 10.0, "pushing")
    system.wait(lambda: any(_moves(command) for command in system.commands()), 5.0, "commands")
    time.sleep(pushing_for)


def commands_flow(system: Split, since: int) -> None:
    """Wait until the driver takes commands again."""

    def taken() -> int:
        return RobotStatus.FromString(system.heard["status"][-1].payload).commands_accepted

    before = taken()
    system.wait(lambda: taken() > before + 5, 20.0, "commands again")


def longest_wait(system: Split) -> float:
    """Return the longest that nothing came from the driver to another process of the robot, s."""
    return max(b - a for a, b in pairwise(system.arrivals))


def no_restarts(system: Split) -> None:
    for host in system.outputs:
        text = system.said(host)
        assert "was killed" not in text and " ended with " not in text, text


@pytest.mark.alone
@needs_netns
@pytest.mark.parametrize(
    ("on_robot", "patience"),
    [
        # Commands themselves cross the link. The controller is made patient, so that it goes on asking for motion all
        # through the cut: only the driver stands between old commands and the wheels.
        pytest.param(ONLY_DRIVER, 5.0, id="controller-on-laptop"),
        # Positions cross the link.
        pytest.param(ON_ROBOT, 0.5, id="controller-on-robot", marks=pytest.mark.slow),
    ],
)
def test_a_cut_network_stops_the_base_and_the_push_goes_on_by_itself(
    on_robot: Sequence[str], patience: float, tmp_path: Path, figures: Figures
) -> None:
    crossing = "controller" not in on_robot
    cuts: list[tuple[float, int, int]] = []
    with split(tmp_path, on_robot, controller={"patience": patience}) as system:
        start_push(system, 1.0)
        # Shorter than the lease, and not long before TCP tries again: what was sent comes late. Longer: the links are
        # given up.
        for seconds in (1.2, 5.0):
            system.bridge.cut()
            begin = time.time_ns()
            time.sleep(seconds)
            system.bridge.heal()
            cuts.append((seconds, begin, time.time_ns()))
            commands_flow(system, cuts[-1][2])
            time.sleep(1.0)
        status = system.wait_for_end(60.0)
        no_restarts(system)
    story = Story(load(system.recording))
    came = [(one.time, VelocityCommand.FromString(one.payload)) for one in system.heard["command"]]
    lines, bursts, obeyed = [], [], []
    for seconds, begin, end in cuts:
        stopping, ramp, again = story.rest_after(begin)
        # What the laptop sent later than this knows no reading young enough.
        late = [command for sent, command in came if begin + DEADLINE * 1e9 <= sent <= end]
        taken = story.sent_between(begin + int(DEADLINE * 1e9), end)
        bursts.append(sum(map(_moves, late)))
        obeyed += [one for one in taken if one.age <= DEADLINE] if crossing else []
        oldest = max((one.age for one in taken), default=0.0)
        lines.append(
            f"cut for {seconds} s: base at rest {stopping:.2f} s after the last fresh command ({ramp:.2f} s after the "
            f"last that moves it); moved again {again - (end - begin) / 1e9:.2f} s after healing; of commands sent "
            f"meanwhile {len(late)} reached the robot ({bursts[-1]} ask for motion), the driver took {len(taken)}, the "
            f"oldest {oldest:.2f} s"
        )
    longest = story.longest_motion_without_command()
    figures("\n".join(lines))
    figures(
        f"longest motion without a fresh command {longest:.2f} s; "
        f"oldest position acted on {oldest_position(story):.2f} s; "
        f"longest wait on the robot {longest_wait(system):.2f} s"
    )
    assert longest <= STOPPING
    assert not story.speeding_up()
    assert not obeyed
    if crossing:
        assert bursts[0] > 0, "no old command came: the burst was not tried"
    assert longest_wait(system) <= 1.0, "the cut stopped traffic between processes of the robot"
    assert oldest_position(story) <= patience + 0.01
    assert status.outcome == PushOutcome.DELIVERED, status
    check_whole(story)


@pytest.mark.alone
@needs_netns
@pytest.mark.parametrize(
    "on_robot",
    [
        pytest.param(ONLY_DRIVER, id="controller-on-laptop"),
        pytest.param(ON_ROBOT, id="controller-on-robot", marks=pytest.mark.slow),
    ],
)
def test_loss_and_delay_move_nothing_late_and_the_push_goes_on_when_they_end(
    on_robot: Sequence[str], tmp_path: Path, figures: Figures
) -> None:
    crossing = "controller" not in on_robot
    # The link may break down for longer than the task waits for its object.
    with split(tmp_path, on_robot, task={"lost_after": 60.0}) as system:
        start_push(system, 1.0)
        system.bridge.worsen(loss=0.2, delay=0.1)
        begin = time.time_ns()
        time.sleep(10.0)
        system.bridge.heal()
        end = time.time_ns()
        commands_flow(system, end)
        status = system.wait_for_end(60.0)
        no_restarts(system)
        passed = system.bridge.counts()
    story = Story(load(system.recording))
    within = [one for one in story.taken if begin + 10**9 <= one.time <= end]
    fresh = [one for one in within if one.age <= DEADLINE]
    moved = [stamp for stamp, speed in story.speeds if begin + 10**9 <= stamp <= end and speed >= REST]
    again = next(one.time for one in story.fresh() if one.moving and one.time > end)
    longest = story.longest_motion_without_command()
    figures(
        f"20 % loss and 100 ms each way for 10 s: the driver took {len(within)} commands, {len(fresh)} fresh, "
        f"the oldest {max((one.age for one in within), default=0.0):.2f} s; the base moved in {len(moved)} looks; "
        f"moved again {(again - end) / 1e9:.2f} s after; longest motion without a fresh command {longest:.2f} s; "
        f"oldest position acted on {oldest_position(story):.2f} s; frames {passed}"
    )
    assert longest <= STOPPING
    assert not story.speeding_up()
    assert all(way["lost"] > 0 for way in passed)
    if crossing:
        assert within, "no late command came: nothing was tried"
        assert not fresh
        assert not moved
    assert oldest_position(story) <= 0.5 + 0.01
    assert status.outcome == PushOutcome.DELIVERED, status
    check_whole(story)


@pytest.mark.alone
@needs_netns
def test_a_push_that_ended_while_the_network_was_cut_moves_nothing_afterwards(tmp_path: Path, figures: Figures) -> None:
    # The controller is on the robot: nobody tells it of the end, which the task on the laptop decides on.
    with split(tmp_path, ON_ROBOT) as system:
        system.goal.time_limit = 4.0
        start_push(system, 1.0)
        system.bridge.cut()
        time.sleep(5.0)
        system.bridge.heal()
        healed = time.time_ns()
        time.sleep(6.0)
        status = system.status()
        no_restarts(system)
    story = Story(load(system.recording))
    moved = [(stamp - healed) / 1e9 for stamp, speed in story.speeds if stamp > healed and speed >= REST]
    figures(f"a push ended during the cut: the base moved {max(moved, default=0.0):.2f} s after healing at most")
    assert status.phase == PushPhase.ENDED, status
    assert status.outcome == PushOutcome.FAILED
    assert max(moved, default=0.0) <= 4.0  # until the link is there again, and what was missed with it
    check_whole(story)


_ECHO = "import socket\ns = socket.socket(type=socket.SOCK_DGRAM)\ns.bind(('', 7000))\nprint(flush=True)\n"
_ECHO += "while True:\n    s.sendto(*s.recvfrom(100))\n"
_ASK = """
import socket, sys, time
s = socket.socket(type=socket.SOCK_DGRAM)
s.settimeout(0.5)
s.connect((sys.argv[1], 7000))
trips = []
for number in range(int(sys.argv[2])):
    begin = time.monotonic()
    s.send(bytes([number]))
    try:
        while s.recv(10) != bytes([number]):
            pass
        trips.append(time.monotonic() - begin)
    except TimeoutError:
        pass
print(len(trips), min(trips, default=0.0), max(trips, default=0.0))
"""


@pytest.mark.alone
@needs_netns
def test_the_bridge_of_these_tests_delays_loses_and_cuts() -> None:
    with _namespace("a") as a, _namespace("b") as b:
        ends = [End(name, f"pltb{os.getpid() % 10000}{name[-1]}", f"10.191.0.{n}/24") for n, name in ((1, a), (2, b))]
        with bridged(*ends, seed=5) as bridge:
            inside = [["ip", "netns", "exec", name, sys.executable, "-c"] for name in (a, b)]
            echo = subprocess.Popen([*inside[1], _ECHO], stdout=subprocess.PIPE)

            def ask(count: int) -> list[float]:
                command = [*inside[0], _ASK, "10.191.0.2", str(count)]
                return [float(word) for word in subprocess.run(command, capture_output=True, check=True).stdout.split()]

            try:
                assert echo.stdout is not None
                echo.stdout.readline()
                assert ask(20)[0] == 20
                bridge.worsen(delay=0.1)
                came, shortest, _ = ask(5)
                assert came == 5
                assert 0.2 <= shortest <= 0.3
                bridge.worsen(loss=0.4)
                before = bridge.counts()
                came, _, _ = ask(20)
                lost = sum(way["lost"] - old["lost"] for way, old in zip(bridge.counts(), before, strict=True))
                assert 0 < came < 20
                assert lost >= 20 - came
                bridge.cut()
                assert ask(2)[0] == 0
                bridge.heal()
                assert ask(5)[0] >= 4  # the first may wait for the other's address
            finally:
                echo.kill()
                echo.communicate()
