"""The service contract: a deterministic state machine with declared inputs, outputs, timers and requests.

A service is given events one at a time, each with a logical time, and yields messages. What a handler does
depends on the service's configuration, its state, the newest message of each input, the event and the logical
time; on nothing else. Hosts (`runtime.node`) do everything that touches the world.

    class Echo(Service):
        heard = Input(topics.OBJECT_STATE)
        said = Output(topics.PUSH_TARGET)

        @on(heard)
        def repeat(self, heard: ObjectState, now: Time) -> Effects:
            yield self.said(PushTarget(stamp=now))
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar, overload

from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from runtime import messages, state
from runtime.time import SECOND, Time
from runtime.topics import Delivery, Topic

M = TypeVar("M", bound=Message)
F = TypeVar("F", bound=Callable[..., object])


@dataclass(frozen=True, slots=True)
class Publication:
    """A message that a handler wants published."""

    topic: str
    message: Message


@dataclass(frozen=True, slots=True)
class Answer:
    """What a handler says to a request."""

    accepted: bool
    reason: str = ""


Effects = Iterable[Publication | Answer]


class BadService(TypeError):
    """A service class breaks the contract."""


class Input(Generic[M]):
    """A topic the service consumes. On an instance, its newest message so far, or None.

    Messages are shared and must not be changed.

    Args:
        delivery: what the queue keeps while the service is busy; the topic's own by default.
        wired: comes over a wire of the service's own host (`runtime.live.wire`) where no other service publishes it.
    """

    def __init__(self, topic: Topic[M], delivery: Delivery | None = None, wired: bool = False) -> None:
        self.topic = topic
        self.delivery = delivery or topic.delivery
        self.wired = wired

    @overload
    def __get__(self, instance: None, owner: type[Service]) -> Input[M]: ...
    @overload
    def __get__(self, instance: Service, owner: type[Service]) -> M | None: ...
    def __get__(self, instance: Service | None, owner: type[Service]) -> Input[M] | M | None:
        if instance is None:
            return self
        return instance.latest.get(self.topic.name)  # type: ignore[return-value]


class Output(Generic[M]):
    """A topic the service publishes. Calling it with a message makes the publication to yield."""

    def __init__(self, topic: Topic[M]) -> None:
        self.topic = topic

    def __call__(self, message: M) -> Publication:
        return Publication(self.topic.name, message)


class Timer:
    """A periodic event. Firing n is due n periods after the service started, n = 1, 2, ...

    Args:
        period: s, a number or a function of the service's configuration.
    """

    def __init__(self, period: float | Callable[[Any], float]) -> None:
        self.period = period

    def seconds(self, config: object) -> float:
        """Return the period in s under `config`."""
        return self.period(config) if callable(self.period) else self.period


class RequestInput(Generic[M]):
    """A request the service answers. Its handler yields exactly one `Answer`, with or without messages."""

    def __init__(self, name: str, message: type[M]) -> None:
        self.name = name
        self.message = message

    def accept(self) -> Answer:
        """Return the answer that the request will be carried out."""
        return Answer(accepted=True)

    def refuse(self, reason: str) -> Answer:
        """Return the answer that the request will not be carried out, and why."""
        return Answer(accepted=False, reason=reason)


def on(source: Input[Any] | Timer | RequestInput[Any]) -> Callable[[F], F]:
    """Make the decorated method the handler of `source`.

    Handlers of inputs and requests take (message, now), handlers of timers take (now). They are generators of
    `Publication` and `Answer`, or return None.
    """

    def mark(handler: F) -> F:
        handler.__source__ = source  # type: ignore[attr-defined]
        return handler

    return mark


@dataclass(frozen=True)
class Contract:
    """What a service class declares, by name in declaration order."""

    inputs: dict[str, Input[Any]]
    outputs: dict[str, Output[Any]]
    timers: dict[str, Timer]
    requests: dict[str, RequestInput[Any]]
    handlers: dict[str, str]  # name of a topic, timer or request -> name of the method
    sees_truth: bool  # may subscribe to what is for scoring only

    @property
    def wired(self) -> list[str]:
        """Return the topics that come over a wire of the service's own host, where nobody else publishes them."""
        return [name for name, source in self.inputs.items() if source.wired]


class Service:
    """Base class of all services.

    A subclass sets `name` and `Config`, declares inputs, outputs, timers and requests as class attributes, and
    sets `self.state` to a dataclass in `__init__(config)`. Everything that changes lives in `self.state`. What is
    derived from it for speed is made in `thaw`.
    """

    name: ClassVar[str]
    Config: ClassVar[type[Any]]
    contract: ClassVar[Contract]
    sees_truth: ClassVar[bool] = False
    """Only what stands in for perception may take what is for scoring only."""

    state: object
    latest: dict[str, Message]

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        cls.contract = _read_contract(cls)

    def __init__(self, config: Any) -> None:
        self.config = config
        self.latest = {}

    def finish(self, now: Time) -> Effects | None:  # noqa: ARG002, for those who have last words
        """Publish last words: the service's life ends in good order at `now`. A killed one has none."""
        return None

    def freeze(self) -> None:
        """Bring everything that `state` is to hold into it. Called before a snapshot."""

    def thaw(self) -> None:
        """Rebuild what is derived from `state` and `latest`. Called after a restore."""

    def snapshot(self) -> bytes:
        """Return the whole state."""
        self.freeze()
        return state.encode(self.state)

    def restore(self, snapshot: bytes, latest: dict[str, Message]) -> None:
        """Take up the state that `snapshot` gives, and the newest messages of the inputs.

        Raises:
            BadSnapshot: these bytes are no snapshot of this service.
        """
        self.state = state.decode(type(self.state), snapshot)
        self.latest = latest
        self.thaw()

    def say(self, text: str, now: Time, level: str = "INFO") -> Publication:
        """Return a log line to yield."""
        stamp = Timestamp(seconds=now // SECOND, nanos=now % SECOND)
        number = messages.Log.Level.Value(level)
        line = messages.Log(timestamp=stamp, level=number, message=text, name=self.name)  # type: ignore[arg-type]
        return Publication(f"log/{self.name}", line)


def _read_contract(cls: type[Service]) -> Contract:
    members: dict[str, object] = {}
    for base in reversed(cls.__mro__):
        members.update(vars(base))
    inputs = [value for value in members.values() if isinstance(value, Input)]
    timers = {name: value for name, value in members.items() if isinstance(value, Timer)}
    requests = [value for value in members.values() if isinstance(value, RequestInput)]
    outputs = [value for value in members.values() if isinstance(value, Output)]
    names = {id(value): value.topic.name for value in inputs}
    names |= {id(value): value.name for value in requests}
    names |= {id(value): name for name, value in timers.items()}
    clash = sorted(set(timers) & ({value.topic.name for value in inputs} | {value.name for value in requests}))
    if clash:
        raise BadService(f"{cls.__name__}: timer '{clash[0]}' is called like a topic or a request")
    handlers: dict[str, str] = {}
    # A method that overrides a handler handles the same source.
    sources = {
        method: value.__source__  # type: ignore[attr-defined]
        for base in reversed(cls.__mro__)
        for method, value in vars(base).items()
        if hasattr(value, "__source__")
    }
    for method, source in sources.items():
        if id(source) not in names:
            raise BadService(f"{cls.__name__}.{method} handles something that {cls.__name__} does not declare")
        if names[id(source)] in handlers:
            raise BadService(f"{cls.__name__} handles '{names[id(source)]}' twice")
        handlers[names[id(source)]] = method
    unanswered = [name for name in [*timers, *(r.name for r in requests)] if name not in handlers]
    if unanswered:
        raise BadService(f"{cls.__name__} has no handler for {', '.join(unanswered)}")
    return Contract(
        inputs={value.topic.name: value for value in inputs},
        outputs={value.topic.name: value for value in outputs},
        timers=timers,
        requests={value.name: value for value in requests},
        handlers=handlers,
        sees_truth=cls.sees_truth,
    )
