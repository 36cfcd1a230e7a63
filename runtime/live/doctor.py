"""Examines a system from outside: what is wrong, or will be, each finding with its remedy.

Nothing here is needed for safety: the base stops by the driver's own clock whatever these checks say.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import zenoh
from google.protobuf.message import DecodeError

from runtime import registry
from runtime.bus.certificates import BadCertificate
from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import NoBus, client
from runtime.live.endpoints import certificates_of, sockets
from runtime.live.finding import Finding, Grade
from runtime.live.hosts import HostAnswer, all_versions, ask_hosts
from runtime.live.record import NoSystem, ask_for_plan
from runtime.live.watch import Tally
from runtime.messages import Health, PushGoal, PushPhase, PushStatus
from runtime.topics import COMMAND, PUSH_GOAL, PUSH_RESPONSE, PUSH_STATUS, TOPICS

_PATIENCE = 2.0
_OFFSET, _JUMP = 0.05, 0.1
_ENOUGH = 0.8
_LITTLE, _TOO_LITTLE = 5e9, 5e8
_LONG_QUEUE = 50
_SLOW = 0.2


def examine(bus: BusConfig, duration: float) -> list[Finding]:
    """Look at this machine and at the running system, listening to it for `duration` s."""
    findings = [*sockets(bus), *certificates_of(bus.tls)]
    reached = not any(one.grade is Grade.FAIL for one in findings)
    try:
        with client(bus, patience=_PATIENCE) as session:
            return [*findings, *_examine_running(session, bus, duration)]
    except BadCertificate:
        return findings  # said already
    except NoBus as error:
        remedy = "start it: pushlane run SYSTEM.toml; or set bus.connect, in --config or --set, to where it runs"
        if reached and bus.tls is not None:
            remedy = "make certificates of all machines in the same folder, with the names that they are called by"
        elif reached:
            remedy = (
                "something else listens there (ss -ltnp says what), or it does not speak Zenoh: choose another port"
            )
        return [*findings, Finding(Grade.FAIL, "system", str(error).partition(";")[0], remedy)]


def _examine_running(session: zenoh.Session, bus: BusConfig, duration: float) -> list[Finding]:
    keys = Keys(bus.robot)
    try:
        nodes = ask_for_plan(session, keys, patience=_PATIENCE).nodes
    except NoSystem as error:
        remedy = "is it another robot? --set bus.robot=NAME; else start pushlane run"
        if bus.tls is not None:
            remedy += "; or your certificate is in no list of the robot's [bus.access]"
        return [Finding(Grade.FAIL, "system", str(error), remedy)]
    alive = [
        str(reply.ok.key_expr).rpartition("/")[2]
        for reply in session.liveliness().get(keys.node("*"), timeout=2.0)
        if reply.ok is not None
    ]
    answers = ask_hosts(session, keys)
    tally, health, statuses, goal = _listen(session, keys, duration)
    return [
        *services(nodes, alive),
        *versions(all_versions(), answers),
        *clocks(answers),
        *disks(answers),
        *rates(tally, nodes, alive, statuses, goal),
        *healths(health),
    ]


def _listen(
    session: zenoh.Session, keys: Keys, duration: float
) -> tuple[Tally, dict[str, tuple[Health, Health]], list[PushStatus], PushGoal]:
    """Return what came, the first and last health message of each node, how the push went, and its newest goal."""
    tally = Tally()
    health: dict[str, tuple[Health, Health]] = {}
    statuses: list[PushStatus] = []
    goal = PushGoal()

    def hear(sample: zenoh.Sample) -> None:
        topic, payload = keys.name(str(sample.key_expr)), bytes(sample.payload)
        tally.add(topic, len(payload), time.monotonic())
        try:
            if topic.startswith("health/"):
                found = Health.FromString(payload)
                health[found.node] = (health.get(found.node, (found, found))[0], found)
            elif topic == PUSH_STATUS.name:
                statuses.append(PushStatus.FromString(payload))
            elif topic == PUSH_GOAL.name:
                goal.ParseFromString(payload)
        except DecodeError:
            return  # the rates say that something came

    begin = time.monotonic()
    subscriber = session.declare_subscriber(keys.everything(), hear)
    time.sleep(duration)
    subscriber.undeclare()
    tally.seconds = time.monotonic() - begin
    return tally, health, statuses, goal


def services(nodes: Sequence[str], alive: Sequence[str]) -> list[Finding]:
    """Return which services of the plan are up."""
    missing = [name for name in nodes if name not in alive]
    if not missing:
        return [Finding(Grade.OK, "services", f"all {len(nodes)} are up")]
    return [
        Finding(
            Grade.FAIL,
            f"service {name}",
            "is not up",
            f"start its host, or pushlane run SYSTEM.toml --only {name} --join; the launcher says why one died",
        )
        for name in missing
    ]


def versions(here: Mapping[str, str], answers: Sequence[HostAnswer]) -> list[Finding]:
    """Return in which versions the hosts of the system, and this machine, differ."""
    main = ", ".join(f"{name} {here[name]}" for name in ("python", "eclipse-zenoh", "protobuf", "mcap", "rerun-sdk"))
    found = []
    for answer in answers:
        report = answer.report
        for name, version in sorted(here.items()):
            there = report.versions.get(name, "missing")
            if there != version:
                remedy = (
                    "run make setup from the same commit on both: replay is then exact, and links understand each other"
                )
                found.append(
                    Finding(Grade.WARN, f"version of {name}", f"{there} on {report.host}, here {version}", remedy)
                )
    return found or [Finding(Grade.OK, "versions", f"{main}; the same on {_count(len(answers), 'host')}")]


def clocks(answers: Sequence[HostAnswer]) -> list[Finding]:
    """Return how far the clocks of the hosts are from ours, and whether one jumped since its system started."""
    found = []
    for answer in answers:
        name = f"clock of {answer.report.host}"
        text = f"{1000 * answer.offset:+.2f} ms +- {1000 * answer.uncertainty:.2f} ms from ours"
        if abs(answer.offset) - answer.uncertainty > _OFFSET:
            remedy = "synchronise both with chrony or systemd-timesyncd: ages that tools show are off by this"
            found.append(Finding(Grade.WARN, name, text, remedy))
        else:
            found.append(Finding(Grade.OK, name, text))
        jump = (answer.report.wall - answer.report.steady) / 1e9
        if abs(jump) > _JUMP:
            text = f"was set by {jump:+.3f} s since the system started; messages are stamped with the time from before"
            found.append(Finding(Grade.WARN, name, text, "restart the system once the clock is right"))
    return found


def disks(answers: Sequence[HostAnswer]) -> list[Finding]:
    """Return how much room recordings have."""
    found = []
    for answer in answers:
        report = answer.report
        if not report.folder:
            continue
        grade = Grade.FAIL if report.free < _TOO_LITTLE else Grade.WARN if report.free < _LITTLE else Grade.OK
        remedy = "" if grade is Grade.OK else "move old recordings away, or set live.recordings to another disk"
        text = f"{report.free / 1e9:.1f} GB free for recordings in {report.folder}"
        found.append(Finding(grade, f"disk of {report.host}", text, remedy))
    return found


def rates(
    tally: Tally, nodes: Sequence[str], alive: Sequence[str], statuses: Sequence[PushStatus], goal: PushGoal
) -> list[Finding]:
    """Return the topics of these nodes that come too seldom by the table of topics, and those that nobody publishes.

    Args:
        statuses: of the push, in the time that `tally` covers; `goal` is the newest one.
    """
    contracts = {name: registry.service_class(name).contract for name in nodes}
    publishers = {topic: name for name, kind in contracts.items() for topic in kind.wired}
    publishers |= {topic: name for name, kind in contracts.items() for topic in kind.outputs}
    phases = {status.phase for status in statuses}
    # A push that began or ended meanwhile was too short for its rates.
    pushing = phases == {PushPhase.PUSHING}
    excused = set() if pushing else {topic for topic in TOPICS if _only_pushing(topic)}
    if PushPhase.ENDED in phases:
        excused.add(PUSH_STATUS.name)  # its last value stays, and is only said again and again
    if "predictive" not in (goal.strategy, goal.controller):
        excused.add(PUSH_RESPONSE.name)
    found, good = [], 0
    for topic, row in TOPICS.items():
        publisher = publishers.get(topic)
        if row.rate is None or publisher is None:
            continue
        measured = tally.rate(topic) if topic in tally.counts else 0.0
        text = f"{measured:.1f} Hz, {row.rate:g} Hz expected"
        if measured >= _ENOUGH * row.rate or topic in excused:
            good += 1
        elif publisher not in alive:
            found.append(Finding(Grade.FAIL, f"topic {topic}", f"{text}: nobody publishes it", f"start '{publisher}'"))
        elif measured == 0.0:
            remedy = (
                f"look at the output of '{publisher}' and at pushlane nodes; access control may refuse its messages"
            )
            found.append(Finding(Grade.FAIL, f"topic {topic}", f"silent, though '{publisher}' is up", remedy))
        else:
            remedy = f"its publisher '{publisher}' or the link is too slow: pushlane nodes shows handlers and queues"
            found.append(Finding(Grade.WARN, f"topic {topic}", text, remedy))
    note = "" if pushing else "; no push is under way, so those of a push may be silent"
    return [*found, Finding(Grade.OK, "rates", f"{good} topics come as the table says{note}")]


def _only_pushing(topic: str) -> bool:
    return topic == COMMAND.name or (topic.startswith("push/") and topic != PUSH_STATUS.name)


def healths(nodes: Mapping[str, tuple[Health, Health]]) -> list[Finding]:
    """Return which services lose messages or fall behind. Each has its first and its last health message."""
    found = []
    for name, (first, last) in sorted(nodes.items()):
        if last.queue_length > _LONG_QUEUE:
            text = f"{last.queue_length} messages wait in its queue"
            found.append(Finding(Grade.WARN, f"service {name}", text, "its handlers are too slow for what comes"))
        if last.busy_max > _SLOW:
            text = f"its slowest handler took {1000 * last.busy_max:.0f} ms in a second"
            found.append(Finding(Grade.WARN, f"service {name}", text, "the machine is busy, or the map too large"))
        before = {row.topic: row for row in first.inputs}
        for row in last.inputs:
            old = before.get(row.topic)
            lost = row.lost - (old.lost if old is not None else 0)
            refused = row.refused - (old.refused if old is not None else 0)
            if lost:
                text = f"{lost} messages of '{row.topic}' never came"
                found.append(
                    Finding(Grade.WARN, f"service {name}", text, "the link is lossy or full: pushlane topics bw")
                )
            if refused:
                text = f"refused {refused} messages of '{row.topic}': {row.refusal or 'see its output'}"
                remedy = "somebody else publishes this topic, or hosts run different versions"
                found.append(Finding(Grade.WARN, f"service {name}", text, remedy))
    if not found and nodes:
        found.append(Finding(Grade.OK, "health", f"{_count(len(nodes), 'service')}: nothing lost or refused meanwhile"))
    return found


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
