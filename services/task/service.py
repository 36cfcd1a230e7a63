"""Accepts goals, watches the push and says how it ends (Sec. 6.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from runtime import topics
from runtime.messages import (
    CancelRequest,
    Corridor,
    FailureCause,
    ObjectState,
    PushGoal,
    PushOutcome,
    PushPhase,
    PushStatus,
    RobotPose,
    Visibility,
)
from runtime.service import Effects, Input, Output, Publication, RequestInput, Service, Timer, on
from runtime.time import Time, seconds
from services.geometry.angles import difference
from services.geometry.corridor import CorridorGeometry
from services.geometry.wire import geometry, vector
from services.names import CONTROLLERS, STRATEGIES, method
from services.task.arrival import Arrival
from services.task.config import YAW_PRECISION, TaskConfig
from services.task.progress import Progress

_MIN_PRECISION = 0.005
_MAX_COORDINATE = 1e4


@dataclass
class TaskState:
    """What the task knows of the current push.

    Attributes:
        goal: the one accepted last; its id is 0 before the first.
        accepted: when, ns.
        status: as published last.
        seen: when the object was last seen or predicted, ns.
        oriented: when its orientation was last seen, ns.
        best, turned: m along Q and rad, the distance to go and the turn left when there was progress last; since: when,
            ns.
        within: object states in a row that were within the precision.
        arrival: where the object was lately.
    """

    goal: PushGoal = field(default_factory=PushGoal)
    accepted: Time = 0
    status: PushStatus = field(default_factory=PushStatus)
    progress: Progress = field(default_factory=Progress)
    seen: Time = 0
    oriented: Time = 0
    best: float = math.inf
    turned: float = math.inf
    since: Time = 0
    within: int = 0
    arrival: Arrival = field(default_factory=Arrival)


class TaskService(Service):
    """Turns a request into push/goal, follows the push, and reports its outcome and its cause."""

    name = "task"
    Config = TaskConfig

    robot = Input(topics.ROBOT_POSE)
    object = Input(topics.OBJECT_STATE)
    corridor = Input(topics.CORRIDOR)
    goal = Output(topics.PUSH_GOAL)
    status = Output(topics.PUSH_STATUS)
    ask_goal = RequestInput("push/goal", PushGoal)
    ask_cancel = RequestInput("push/cancel", CancelRequest)
    report = Timer(0.2)

    config: TaskConfig
    state: TaskState

    def __init__(self, config: TaskConfig) -> None:
        super().__init__(config)
        self.state = TaskState()
        self.state.status.phase = PushPhase.IDLE
        self._geometry: CorridorGeometry | None = None

    def thaw(self) -> None:
        """Rebuild the geometry of the newest corridor."""
        self._geometry = None if self.corridor is None else geometry(self.corridor)

    @on(ask_goal)
    def accept(self, request: PushGoal, now: Time) -> Effects:
        """Take a goal, with defaults for what it leaves open, or say why not."""
        refusal = self._refusal(request)
        if refusal:
            yield self.ask_goal.refuse(refusal)
            return
        yield self.ask_goal.accept()
        goal = PushGoal()
        goal.CopyFrom(request)
        goal.stamp, goal.id, goal.active = now, self.state.goal.id + 1, True
        goal.strategy, goal.controller = self._method(request)
        goal.precision = request.precision or self.config.precision
        goal.time_limit = request.time_limit or self.config.time_limit
        if goal.HasField("yaw"):
            goal.yaw_precision = request.yaw_precision or self.config.yaw_precision
        self.state = TaskState(goal=goal, accepted=now, seen=now, oriented=now)
        self.state.status.CopyFrom(PushStatus(goal_id=goal.id, phase=PushPhase.PLANNING))
        if self.object is not None:
            o, g = self.object.position, goal.position
            self.state.status.distance_left = math.hypot(g.x - o.x, g.y - o.y)
        yield self.goal(goal)
        yield self.say(
            f"goal {goal.id} at ({goal.position.x:.2f}, {goal.position.y:.2f}) m accepted: "
            f"{goal.strategy}, {goal.controller}, {goal.precision:g} m{_orientation(goal)}",
            now,
        )
        yield self._report(now)

    @on(ask_cancel)
    def cancel(self, request: CancelRequest, now: Time) -> Effects:
        """End the push on request."""
        if not self.state.goal.active:
            yield self.ask_cancel.refuse("no push is under way")
            return
        yield self.ask_cancel.accept()
        yield from self._end(PushOutcome.CANCELLED, FailureCause.CAUSE_NONE, request.reason or "cancelled", now)

    @on(corridor)
    def begin(self, corridor: Corridor, now: Time) -> Effects:
        """Start to push when there is a corridor, and end when there can be none."""
        self._geometry = geometry(corridor)
        if not self.state.goal.active or corridor.goal_id != self.state.goal.id:
            return
        if not corridor.found:
            yield from self._end(PushOutcome.FAILED, FailureCause.NO_PATH, corridor.reason, now)
        elif self.state.status.phase == PushPhase.PLANNING:
            self.state.status.phase = PushPhase.PUSHING
            self.state.since = now
            yield self.say(f"pushing through a corridor of {len(corridor.path.x)} points", now)
            yield self._report(now)
        else:
            self.state.best = math.inf  # the new path changes the distance to go

    @on(object)
    def watch(self, object: ObjectState, now: Time) -> Effects:
        """Follow the object: delivered, out of the corridor, lost, or on its way."""
        if not self.state.goal.active:
            return
        status = self.state.status
        if object.visibility == Visibility.LOST:
            self.state.arrival, self.state.within = Arrival(), 0
            if status.phase == PushPhase.PUSHING:
                status.phase = PushPhase.WAITING
                yield self.say("object lost from view", now, "WARNING")
                yield self._report(now)
            return
        self.state.seen = now
        if object.HasField("yaw"):
            self.state.oriented = now
        if status.phase == PushPhase.WAITING:
            status.phase = PushPhase.PUSHING
            yield self.say("object seen again", now)
        if object.visibility == Visibility.PREDICTED:
            return  # what is only thought of it decides nothing
        if self.robot is None or self._geometry is None or status.phase != PushPhase.PUSHING:
            return
        self._measure(self._geometry, self.robot, object, now)
        self.state.within = self.state.within + 1 if self._arrived(object) else 0
        if self.state.within >= self.config.confirmations:
            yield from self._end(PushOutcome.DELIVERED, FailureCause.CAUSE_NONE, "", now)
            return
        cause = self._failure(now)
        if cause != FailureCause.CAUSE_NONE:
            yield from self._end(PushOutcome.FAILED, cause, self._words(cause), now)

    @on(report)
    def tick(self, now: Time) -> Effects:
        """Publish the status, and end pushes that take too long."""
        if self.state.goal.active:
            yield from self._time_out(now)
        if self.state.goal.active or self.state.goal.id == 0:
            yield self._report(now)

    def _refusal(self, request: PushGoal) -> str:
        if self.state.goal.active:
            return f"goal {self.state.goal.id} is under way; cancel it first"
        if max(abs(request.position.x), abs(request.position.y)) > _MAX_COORDINATE:
            return f"position ({request.position.x}, {request.position.y}) is beyond {_MAX_COORDINATE:g} m"
        if request.strategy and request.strategy not in STRATEGIES:
            return f"no strategy is called '{request.strategy}'; expected one of {', '.join(STRATEGIES)}"
        if request.controller and request.controller not in CONTROLLERS:
            return f"no controller is called '{request.controller}'; expected one of {', '.join(CONTROLLERS)}"
        if request.precision and request.precision < _MIN_PRECISION:
            return f"precision {request.precision} m is below {_MIN_PRECISION} m"
        if request.time_limit < 0:
            return f"time limit {request.time_limit} s is below 0"
        return self._refusal_of_yaw(request)

    def _method(self, request: PushGoal) -> tuple[str, str]:
        return method(request.strategy, request.controller, (self.config.strategy, self.config.controller))

    def _refusal_of_yaw(self, request: PushGoal) -> str:
        if not request.HasField("yaw"):
            return "yaw_precision is of no use without yaw" if request.yaw_precision else ""
        if request.yaw_precision and not YAW_PRECISION[0] <= request.yaw_precision <= YAW_PRECISION[1]:
            return f"yaw_precision {request.yaw_precision} rad is not from {YAW_PRECISION[0]} to {YAW_PRECISION[1]}"
        strategy, _ = self._method(request)
        if strategy != "predictive":
            return f"strategy '{strategy}' does not turn objects to an orientation; expected 'predictive'"
        if self.object is not None and not self.object.HasField("yaw"):
            return "the tracker does not see this object's orientation: a goal with yaw cannot be judged"
        return ""

    def _measure(self, corridor: CorridorGeometry, robot: RobotPose, object: ObjectState, now: Time) -> None:
        state, status, config = self.state, self.state.status, self.config
        r, o, g = np.array((robot.pose.x, robot.pose.y)), vector(object.position), state.goal.position
        state.progress.add(r, o)
        status.distance_left = math.hypot(g.x - o[0], g.y - o[1])
        if state.goal.HasField("yaw") and object.HasField("yaw"):
            status.yaw_left = abs(difference(object.yaw, state.goal.yaw))
            if status.yaw_left <= state.turned - config.stall_turn:
                self._progressed(state.best, now)
        status.robot_path_length = state.progress.robot_length
        status.object_path_length = state.progress.object_length
        status.robot_violations += corridor.field.value(r[0], r[1]) < -config.violation_tolerance
        status.object_violations += corridor.field.value(o[0], o[1]) < -config.violation_tolerance
        to_go = corridor.distance_to_go(o)
        if to_go <= state.best - config.stall_progress:
            self._progressed(to_go, now)

    def _progressed(self, best: float, now: Time) -> None:
        """Note progress: `best` is to go, m. To turn again what was turned away on the way counts as well."""
        state = self.state
        state.best, state.since = best, now
        if state.status.HasField("yaw_left"):
            state.turned = state.status.yaw_left
        state.progress.progressed()

    def _arrived(self, object: ObjectState) -> bool:
        """Tell whether the object is within the precision by two standard deviations: noise must not decide.

        With a strategy that can wait it is to be at rest there as well; then all that was seen of it at rest counts.
        """
        goal, status, config = self.state.goal, self.state.status, self.config
        turned = goal.HasField("yaw")
        if turned and not object.HasField("yaw"):
            self.state.arrival = Arrival()
            return False
        left, yaw_left, count = status.distance_left, status.yaw_left, 1
        variance = max(object.covariance[0], object.covariance[3]) if object.covariance else 0.0
        shared = min(self._shared(), variance)
        variance -= shared
        if goal.strategy == "predictive":
            arrival = self.state.arrival
            rest = max(config.rest, arrival.needed(variance, config.rest_speed))
            if turned:
                rest = max(rest, arrival.needed(object.yaw_variance, config.rest_turn))
            arrival.add(object, rest)
            if not arrival.covers(rest):
                return False
            speed, turning = arrival.speed()
            if speed > config.rest_speed or (turned and turning > config.rest_turn):
                return False
            age, x, y, yaw = arrival.mean()
            # What still creeps has gone on since.
            left = math.hypot(goal.position.x - x, goal.position.y - y) + age * speed
            yaw_left = abs(difference(yaw, goal.yaw)) + age * turning
            count = len(arrival.seen)
        # Where so little is known that no place would do, within half of the precision is as sure as it gets.
        doubt = min(2.0 * math.sqrt(shared + variance / count), 0.5 * goal.precision)
        if left + doubt > goal.precision:
            return False
        return not turned or yaw_left + 2.0 * math.sqrt(object.yaw_variance / count) <= goal.yaw_precision

    def _shared(self) -> float:
        """Return the variance, m^2, that the robot's own place puts into every observation of the object."""
        if not self.config.shared or self.robot is None or len(self.robot.covariance) != 9:
            return 0.0
        covariance = self.robot.covariance
        return max(covariance[0], covariance[4])

    def _failure(self, now: Time) -> FailureCause:
        """Return why the push has failed, or none while it has not."""
        state, config = self.state, self.config
        if config.stop_on_violation and state.status.object_violations:
            return FailureCause.OBJECT_OUT
        if config.stop_on_violation and state.status.robot_violations:
            return FailureCause.ROBOT_OUT
        idle = seconds(now - state.since)
        late = seconds(now - state.accepted) >= state.goal.time_limit
        # At the time limit too: without progress for half the patience it is no longer time that is lacking.
        if idle >= config.stall_after or (late and idle >= 0.5 * config.stall_after):
            return FailureCause.ORBIT if state.progress.orbiting() else FailureCause.STALL
        return FailureCause.TIME_LIMIT if late else FailureCause.CAUSE_NONE

    def _words(self, cause: FailureCause) -> str:
        idle = f"no progress for {seconds(self.state.status.stamp - self.state.since):.0f} s"
        return {
            FailureCause.ROBOT_OUT: "the robot's centre left the pushing corridor",
            FailureCause.OBJECT_OUT: "the object's centre left the pushing corridor",
            FailureCause.STALL: idle,
            FailureCause.ORBIT: f"{idle}, the robot circles the object",
            FailureCause.TIME_LIMIT: f"not delivered within {self.state.goal.time_limit:g} s",
        }[cause]

    def _time_out(self, now: Time) -> Effects:
        """End a push of which nothing is heard any more; what is heard is judged in `watch`."""
        status, config = self.state.status, self.config
        elapsed = seconds(now - self.state.accepted)
        if seconds(now - self.state.seen) > config.lost_after:
            reason = f"the object was not seen for {config.lost_after:g} s"
            yield from self._end(PushOutcome.FAILED, FailureCause.OBJECT_LOST, reason, now)
        elif self.state.goal.HasField("yaw") and seconds(now - self.state.oriented) > config.lost_after:
            reason = f"the object's orientation was not seen for {config.lost_after:g} s"
            yield from self._end(PushOutcome.FAILED, FailureCause.OBJECT_LOST, reason, now)
        elif status.phase == PushPhase.PLANNING and elapsed > config.planning_limit:
            reason = f"no corridor within {config.planning_limit:g} s"
            yield from self._end(PushOutcome.FAILED, FailureCause.NO_PATH, reason, now)
        elif elapsed > self.state.goal.time_limit:
            yield from self._end(PushOutcome.FAILED, FailureCause.TIME_LIMIT, self._words(FailureCause.TIME_LIMIT), now)

    def _end(self, outcome: PushOutcome, cause: FailureCause, reason: str, now: Time) -> Effects:
        status, goal = self.state.status, self.state.goal
        status.phase, status.outcome, status.cause, status.reason = PushPhase.ENDED, outcome, cause, reason
        goal.active = False
        ended = PushGoal()
        ended.CopyFrom(goal)
        ended.stamp = now
        yield self.goal(ended)
        yield self.say(
            f"goal {goal.id} {PushOutcome.Name(outcome).lower()}{': ' if reason else ''}{reason}",
            now,
            "INFO" if outcome == PushOutcome.DELIVERED else "WARNING",
        )
        yield self._report(now)

    def _report(self, now: Time) -> Publication:
        status = self.state.status
        status.stamp = now
        if self.state.goal.active or status.phase == PushPhase.ENDED:
            status.elapsed = seconds(now - self.state.accepted)
        return self.status(status)


def _orientation(goal: PushGoal) -> str:
    """Return the orientation that `goal` asks for, in words; empty if none."""
    if not goal.HasField("yaw"):
        return ""
    return f", turned to {math.degrees(goal.yaw):.0f} degrees within {math.degrees(goal.yaw_precision):.0f}"
