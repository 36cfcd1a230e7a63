"""An operator hears of his own push, of no other, and of the end of the system."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Iterator

import pytest
import zenoh

from runtime.bus.config import BusConfig
from runtime.bus.keys import Keys
from runtime.bus.session import hub
from runtime.live import operate
from runtime.messages import PushGoal, PushOutcome, PushPhase, PushStatus, Reply, Vector2
from tests.live_system import free_endpoint

GOAL = PushGoal(position=Vector2(x=1.0, y=0.0))


class Task:
    """Stands in for the task service: says what it is told to, and keeps saying the last push's end."""

    def __init__(self, session: zenoh.Session, keys: Keys) -> None:
        self._publisher = session.declare_publisher(keys.topic("push/status"))
        self._keys = keys
        self.asked: queue.SimpleQueue[int] = queue.SimpleQueue()
        self.last = PushStatus(goal_id=1, phase=PushPhase.ENDED, outcome=PushOutcome.FAILED)
        self._told = session.declare_queryable(keys.latched("push/status"), self._tell)
        self._asked = session.declare_queryable(keys.request("push/goal"), self._accept)

    def say(self, goal_id: int, phase: PushPhase, outcome: PushOutcome = PushOutcome.OUTCOME_UNSPECIFIED) -> None:
        self._publisher.put(PushStatus(goal_id=goal_id, phase=phase, outcome=outcome).SerializeToString())

    def _tell(self, query: zenoh.Query) -> None:
        query.reply(str(query.key_expr), self.last.SerializeToString())
        query.drop()

    def _accept(self, query: zenoh.Query) -> None:
        # A slow answer, and the old end is told again meanwhile.
        for _ in range(3):
            self.say(1, PushPhase.ENDED, PushOutcome.FAILED)
            time.sleep(0.05)
        query.reply(str(query.key_expr), Reply(accepted=True).SerializeToString())
        query.drop()
        self.asked.put(1)


@pytest.fixture
def system() -> Iterator[tuple[Task, BusConfig]]:
    endpoint = free_endpoint()
    bus = BusConfig(robot="operated", listen=(endpoint,), connect=(endpoint,))
    with hub(bus) as session:
        yield Task(session, Keys(bus.robot)), bus


def follow(task: Task, bus: BusConfig, story: list[tuple[int, PushPhase, PushOutcome]]) -> bool:
    """Follow a push of which `story` is told once it was accepted."""

    def tell() -> None:
        task.asked.get(timeout=10.0)
        for one in story:
            task.say(*one)
            time.sleep(0.05)

    teller = threading.Thread(target=tell)
    teller.start()
    try:
        return operate.follow_push(bus, GOAL, lambda _: None)
    finally:
        teller.join()


NOTHING = PushOutcome.OUTCOME_UNSPECIFIED


def test_the_end_of_the_push_before_is_not_ours(system: tuple[Task, BusConfig]) -> None:
    story = [
        (1, PushPhase.ENDED, PushOutcome.FAILED),
        (2, PushPhase.PUSHING, NOTHING),
        (2, PushPhase.ENDED, PushOutcome.DELIVERED),
    ]
    assert follow(*system, story)


def test_a_system_that_speaks_of_another_push_has_lost_ours(system: tuple[Task, BusConfig]) -> None:
    with pytest.raises(operate.PushLost, match="goal 2"):
        follow(*system, [(2, PushPhase.PUSHING, NOTHING), (0, PushPhase.IDLE, NOTHING)])


def test_silence_and_no_task_is_the_end(system: tuple[Task, BusConfig], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operate, "_SILENCE_LIMIT", 0.3)
    with pytest.raises(operate.PushLost, match="task service is gone"):
        follow(*system, [(2, PushPhase.PUSHING, NOTHING)])
