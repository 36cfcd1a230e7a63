"""Who gets on the bus, and what they may do there: with real sessions, and with settings an attacker would use."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import pytest
import zenoh

from runtime.bus.access import access_control
from runtime.bus.certificates import BadCertificate
from runtime.bus.config import AccessConfig, BusConfig, TlsConfig
from runtime.bus.keys import Keys
from runtime.bus.session import NoBus, client, hub
from tests.authority import Authority
from tests.figures import Figures
from tests.live_system import free_endpoint

HOSTS = {"robot": ("driver", "controller"), "laptop": ("perception", "corridor", "strategy", "learner", "task")}
SETTLE = 0.4
"""s for a put that is let through to arrive; on loopback it takes a millisecond."""


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("authority"))


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("foreign"))


def bus(endpoint: str, tls: TlsConfig, access: AccessConfig | None = None, lease: float = 2.0) -> BusConfig:
    return BusConfig(robot="guarded", listen=(endpoint,), connect=(endpoint,), tls=tls, access=access, lease=lease)


def tls_endpoint() -> str:
    return free_endpoint().replace("tcp/", "tls/")


def attack(endpoint: str, tls: dict[str, object], mode: str = "client") -> zenoh.Session:
    """Open a session with settings that our own client would not use."""
    config = zenoh.Config()
    settings = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 1000,
        "connect/exit_on_failure": True,
        "listen/endpoints": [],
        "transport/link/tls": tls,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


# --- Who gets in.


def test_a_certificate_of_the_authority_gets_in_and_both_sides_are_heard(authority: Authority) -> None:
    endpoint = tls_endpoint()
    with (
        hub(bus(endpoint, authority.host("robot"))) as robot,
        client(bus(endpoint, authority.host("laptop"))) as laptop,
    ):
        heard: list[bytes] = []
        robot.declare_subscriber("pushlane/guarded/there", lambda sample: heard.append(bytes(sample.payload)))
        until(lambda: bool(laptop.put("pushlane/guarded/there", b"x") or heard), "a put from the laptop")


def test_without_a_certificate_nobody_gets_in(authority: Authority) -> None:
    endpoint = tls_endpoint()
    robot = authority.host("robot")
    with hub(bus(endpoint, robot)):
        for tls in ({"root_ca_certificate": robot.ca}, {"root_ca_certificate": robot.ca, "enable_mtls": True}):
            with pytest.raises(zenoh.ZError):
                attack(endpoint, tls)
        with pytest.raises(zenoh.ZError):
            attack(endpoint.replace("tls/", "tcp/"), {})


def test_a_certificate_of_a_foreign_authority_is_refused_and_the_reason_is_told(
    authority: Authority, foreign: Authority
) -> None:
    endpoint = tls_endpoint()
    stranger = foreign.host("laptop")
    believing = TlsConfig(ca=authority.host("robot").ca, certificate=stranger.certificate, key=stranger.key)
    with hub(bus(endpoint, authority.host("robot"))):
        with pytest.raises(NoBus, match=r"refused our certificate .*own\.crt: unknown ca"):
            enter(bus(endpoint, believing))
        # And the other way round: who believes another authority does not believe this hub.
        with pytest.raises(NoBus, match="its certificate is not to be believed"):
            enter(bus(endpoint, stranger))


def test_an_expired_certificate_is_refused_and_the_reason_is_told(authority: Authority) -> None:
    endpoint = tls_endpoint()
    expired = authority.ending("old-laptop", "200101000000Z", "210101000000Z")
    with hub(bus(endpoint, authority.host("robot"))), pytest.raises(NoBus, match="refused our certificate .*expired"):
        enter(bus(endpoint, expired))
    endpoint = tls_endpoint()
    with hub(bus(endpoint, expired)), pytest.raises(NoBus, match="not to be believed: certificate has expired"):
        enter(bus(endpoint, authority.host("laptop")))


def test_a_hub_with_the_certificate_of_another_machine_is_refused(authority: Authority) -> None:
    # 127.0.0.2 is on this machine, but in no certificate.
    endpoint = tls_endpoint().replace("127.0.0.1", "127.0.0.2")
    with hub(bus(endpoint, authority.host("laptop"))), pytest.raises(NoBus, match="not to be believed: IP address"):
        enter(bus(endpoint, authority.host("robot")))
    with hub(bus(endpoint, authority.host("named", "127.0.0.2"))):
        enter(bus(endpoint, authority.host("robot")))


def test_an_operators_certificate_cannot_offer_a_meeting_point(authority: Authority) -> None:
    endpoint = tls_endpoint()
    with hub(bus(endpoint, authority.operator("anna"))), pytest.raises(NoBus, match="not to be believed"):
        enter(bus(endpoint, authority.host("laptop")))


def test_a_link_ends_when_its_certificate_does(authority: Authority, figures: Figures) -> None:
    endpoint = tls_endpoint()
    end = (datetime.now(UTC) + timedelta(seconds=4)).replace(microsecond=0)
    short = authority.ending("short", "200101000000Z", end.strftime("%y%m%d%H%M%SZ"))
    with hub(bus(endpoint, authority.host("robot"))) as robot, client(bus(endpoint, short)) as laptop:
        heard: list[float] = []
        robot.declare_subscriber("pushlane/guarded/there", lambda _: heard.append(time.time()))
        deadline = time.monotonic() + 8.0
        while time.monotonic() < deadline:
            laptop.put("pushlane/guarded/there", b"x")
            time.sleep(0.02)
    over = max(heard) - end.timestamp()
    figures(f"heard until {over:+.2f} s after the end of the certificate")
    assert min(heard) < end.timestamp(), "it was never let in"
    assert over < 2.5, "puts were heard seconds after the end"


# --- What they may do.


def enter(config: BusConfig) -> None:
    with client(config, patience=0.0):
        pass


def until(holds: Callable[[], bool], what: str, limit: float = 5.0) -> None:
    deadline = time.monotonic() + limit
    while not holds():
        assert time.monotonic() < deadline, f"not within {limit} s: {what}"
        time.sleep(0.02)


@dataclass
class Guarded:
    """A hub with access control, and a session of each that may and may not.

    Listeners and answerers get sessions of their own, since what stays within a session never passes the hub.
    """

    endpoint: str
    keys: Keys
    certificates: dict[str, TlsConfig]
    stack: ExitStack
    sessions: dict[str, zenoh.Session]

    def process(self, who: str) -> zenoh.Session:
        """Return a new session with the certificate of `who`."""
        return self.stack.enter_context(client(bus(self.endpoint, self.certificates[who])))

    def listen(self, who: str, key: str) -> list[bytes]:
        """Let another process of `who` subscribe to `key`. Returns where payloads will be."""
        found: list[bytes] = []
        self.process(who).declare_subscriber(key, lambda sample: found.append(bytes(sample.payload)))
        time.sleep(SETTLE)
        return found

    def answer(self, who: str, key: str) -> list[str]:
        """Let another process of `who` answer at `key` with its name. Returns where the questions will be."""
        asked: list[str] = []

        def tell(query: zenoh.Query) -> None:
            asked.append(str(query.key_expr))
            query.reply(key, who.encode())
            query.drop()

        self.process(who).declare_queryable(key, tell)
        time.sleep(SETTLE)
        return asked

    def ask(self, who: str, key: str) -> list[bytes]:
        """Return what `who` is answered at `key`."""
        return [bytes(one.ok.payload) for one in self.sessions[who].get(key, timeout=1.0) if one.ok is not None]


@pytest.fixture(scope="module")
def guarded(authority: Authority) -> Iterator[Guarded]:
    with opened(authority, AccessConfig(hosts=HOSTS, operators=("operator",), watchers=("watcher",))) as found:
        yield found


@contextmanager
def opened(authority: Authority, access: AccessConfig | None) -> Iterator[Guarded]:
    endpoint = tls_endpoint()
    own = {name: authority.host(name) for name in ("robot", "laptop")}
    own |= {name: authority.operator(name) for name in ("operator", "watcher", "nobody")}
    with ExitStack() as stack:
        stack.enter_context(hub(bus(endpoint, own["robot"], access)))
        sessions = {name: stack.enter_context(client(bus(endpoint, tls))) for name, tls in own.items()}
        yield Guarded(endpoint, Keys("guarded"), own, stack, sessions)


EVERYBODY = ("robot", "laptop", "operator", "watcher", "nobody")
MAY_PUBLISH = [
    ("command", ["robot"]),
    ("odometry", ["robot"]),
    ("truth", ["robot"]),
    ("snapshot/controller", ["robot"]),
    ("journal/driver", ["robot"]),
    ("push/target", ["laptop"]),
    ("push/goal", ["laptop"]),
    ("corridor", ["laptop"]),
    ("health/task", ["laptop"]),
    ("alive", ["robot"]),
    ("reply/recorder", ["robot", "laptop"]),
    ("of/nobody", []),
]


@pytest.mark.parametrize(("topic", "allowed"), MAY_PUBLISH)
def test_only_the_host_of_its_service_publishes_a_topic(guarded: Guarded, topic: str, allowed: list[str]) -> None:
    found = guarded.listen("robot", guarded.keys.topic(topic))
    for who in EVERYBODY:
        guarded.sessions[who].put(guarded.keys.topic(topic), who.encode())
    until(lambda: len(found) >= len(allowed), f"puts of {allowed}")
    time.sleep(SETTLE)
    assert sorted(found) == sorted(one.encode() for one in allowed)


WAYS_ROUND = [
    "pushlane/guarded/**",
    "pushlane/guarded/*",
    "pushlane/*/command",
    "pushlane/**",
    "**",
    "pushlane/guarded/comm$*",
]


@pytest.mark.parametrize("pattern", WAYS_ROUND)
def test_a_pattern_is_no_way_round_the_rules(guarded: Guarded, pattern: str) -> None:
    found = guarded.listen("robot", guarded.keys.topic("command"))
    for who in ("laptop", "operator", "watcher", "nobody"):
        guarded.sessions[who].put(pattern, who.encode())
    time.sleep(SETTLE)
    assert found == []
    guarded.sessions["robot"].put(guarded.keys.topic("command"), b"mine")
    until(lambda: found == [b"mine"], "the controller's own command")


@pytest.mark.parametrize("mode", ["peer", "router"])
def test_calling_oneself_something_else_is_no_way_round_the_rules(
    guarded: Guarded, authority: Authority, mode: str
) -> None:
    found = guarded.listen("robot", guarded.keys.topic("command"))
    laptop = authority.host("laptop")
    own = {"connect_certificate": laptop.certificate, "connect_private_key": laptop.key}
    session = attack(guarded.endpoint, {"root_ca_certificate": laptop.ca, "enable_mtls": True, **own}, mode)
    try:
        other = guarded.listen("robot", guarded.keys.topic("push/target"))
        time.sleep(1.0)
        session.put(guarded.keys.topic("command"), b"forged")
        session.put(guarded.keys.topic("push/target"), b"its own")
        until(lambda: other == [b"its own"], "what it may publish")
        time.sleep(SETTLE)
    finally:
        session.close()
    assert found == []


@pytest.mark.parametrize("request_name", ["push/goal", "push/cancel"])
def test_only_an_operator_is_answered_to_a_request(guarded: Guarded, request_name: str) -> None:
    key = guarded.keys.request(request_name)
    asked = guarded.answer("laptop", key)
    for who in ("robot", "laptop", "watcher", "nobody"):
        assert guarded.ask(who, key) == [], who
        assert guarded.ask(who, guarded.keys.request("**")) == [], who
    assert asked == []
    assert guarded.ask("operator", key) == [b"laptop"]
    assert len(asked) == 1


def test_only_the_host_of_a_service_answers_for_it(guarded: Guarded) -> None:
    key = guarded.keys.latched("status")
    for who in ("laptop", "operator", "nobody"):
        assert guarded.answer(who, key) == []
    assert guarded.ask("operator", key) == []
    guarded.answer("robot", key)
    assert guarded.ask("operator", key) == [b"robot"]
    assert guarded.ask("nobody", key) == []


def test_all_nodes_can_be_asked_at_once_and_only_those_of_the_right_hosts_answer(guarded: Guarded) -> None:
    def tell(who: str) -> Callable[[zenoh.Query], None]:
        def answer(query: zenoh.Query) -> None:
            query.reply(str(query.key_expr), who.encode())
            query.drop()

        return answer

    # As live hosts do: all answer at the pattern that was asked.
    for who, node in (("robot", "driver"), ("laptop", "task"), ("laptop", "controller"), ("operator", "strategy")):
        guarded.process(who).declare_queryable(guarded.keys.snapshot(node), tell(who))
    time.sleep(SETTLE)
    everyone = zenoh.ConsolidationMode.NONE
    replies = guarded.sessions["watcher"].get(guarded.keys.snapshot("*"), timeout=1.0, consolidation=everyone)
    assert sorted(bytes(one.ok.payload) for one in replies if one.ok) == [b"laptop", b"robot"]


def test_who_is_named_sees_everything_and_who_is_not_sees_nothing(guarded: Guarded) -> None:
    everything = {who: guarded.listen(who, guarded.keys.everything()) for who in EVERYBODY}
    nobody = guarded.listen("nobody", "**")
    guarded.sessions["robot"].put(guarded.keys.topic("odometry"), b"here")
    guarded.sessions["laptop"].put(guarded.keys.topic("push/status"), b"there")
    for who in ("robot", "laptop", "operator", "watcher"):
        until(lambda who=who: sorted(everything[who]) == [b"here", b"there"], who)  # type: ignore[misc]
    time.sleep(SETTLE)
    assert everything["nobody"] == []
    assert nobody == []


def test_only_the_host_of_a_service_says_that_it_is_up(guarded: Guarded) -> None:
    def up(who: str) -> list[str]:
        replies = guarded.sessions[who].liveliness().get(guarded.keys.node("*"), timeout=1.0)
        return sorted(str(one.ok.key_expr).rpartition("/")[2] for one in replies if one.ok)

    tokens = [
        guarded.sessions[who].liveliness().declare_token(guarded.keys.node(name))
        for who, name in (("laptop", "controller"), ("nobody", "task"), ("operator", "driver"))
    ]
    time.sleep(SETTLE)
    assert up("watcher") == []
    tokens.append(guarded.sessions["robot"].liveliness().declare_token(guarded.keys.node("controller")))
    until(lambda: up("watcher") == ["controller"], "the token of the controller")
    assert set(up("nobody")) <= {"task"}, "its own at most, which stays within its session"
    for token in tokens:
        token.undeclare()


def test_without_access_control_all_of_this_would_be_possible(authority: Authority) -> None:
    with opened(authority, None) as free:
        found = free.listen("robot", free.keys.topic("command"))
        free.answer("laptop", free.keys.request("push/goal"))
        free.sessions["nobody"].put("pushlane/*/comm$*", b"forged")
        until(lambda: found == [b"forged"], "the forged command")
        assert free.ask("nobody", free.keys.request("push/goal")) == [b"laptop"]


def test_a_rule_never_lets_publish_a_pattern(authority: Authority) -> None:
    rules = access_control(AccessConfig(hosts=HOSTS, operators=("operator",)), Keys("guarded"))["rules"]
    assert isinstance(rules, list)
    puts = [
        key for rule in rules if "put" in rule["messages"] and "ingress" in rule["flows"] for key in rule["key_exprs"]
    ]
    assert "pushlane/guarded/command" in puts
    assert [key for key in puts if "*" in key] == []
    assert len({rule["id"] for rule in rules}) == len(rules)


# --- Wrong settings.

TLS = {"ca": "ca.crt", "certificate": "own.crt", "key": "own.key"}
SECURE = {"listen": ["tls/127.0.0.1:1"], "connect": ["tls/127.0.0.1:1"], "tls": TLS}
WRONG = [
    ({"listen": ["tls/127.0.0.1:1"]}, "endpoint tls/127.0.0.1:1 needs bus.tls: expected ca, certificate and key"),
    ({"tls": TLS}, "endpoint tcp/127.0.0.1:7447 is not encrypted: expected tls/HOST:PORT"),
    ({**SECURE, "listen": ["tls/127.0.0.1:1", "tcp/127.0.0.1:2"]}, "endpoint tcp/127.0.0.1:2 is not encrypted"),
    ({**SECURE, "connect": ["tcp/127.0.0.1:1"]}, "endpoint tcp/127.0.0.1:1 is not encrypted"),
    ({"access": {"hosts": {"robot": []}}}, "bus.access needs bus.tls"),
    ({**SECURE, "access": {}}, "access without hosts: expected host -> services"),
    ({**SECURE, "access": {"hosts": {"robot": []}, "operators": ["*"]}}, "matching regex"),
    ({**SECURE, "tls": {"ca": "ca.crt"}}, "missing required field `certificate`"),
]


@pytest.mark.parametrize(("values", "says"), WRONG)
def test_settings_that_do_not_fit_together_are_refused(values: dict[str, object], says: str) -> None:
    with pytest.raises(msgspec.ValidationError) as caught:
        msgspec.convert(values, BusConfig)
    assert says in str(caught.value)


def test_files_that_are_wrong_are_named(authority: Authority, foreign: Authority, tmp_path: Path) -> None:
    good = authority.host("robot")
    loose = tmp_path / "loose.key"
    loose.write_bytes(Path(good.key).read_bytes())
    loose.chmod(0o644)
    nothing = tmp_path / "nothing.pem"
    nothing.write_text("nothing")
    cases = [
        ({"ca": str(tmp_path / "none.crt")}, r"bus\.tls\.ca: cannot read .*none\.crt: No such file"),
        ({"certificate": str(tmp_path)}, r"bus\.tls\.certificate: cannot read .*: Is a directory"),
        ({"key": str(nothing)}, r"bus\.tls\.key: .*nothing\.pem is no PEM key"),
        ({"ca": good.key}, r"bus\.tls\.ca: .*own\.key is no PEM certificate"),
        ({"key": str(loose)}, r"bus\.tls\.key: everybody may read .*loose\.key \(mode 644\): expected 600"),
        ({"key": foreign.host("robot").key}, r"do not fit together: KEY_VALUES_MISMATCH"),
    ]
    for change, says in cases:
        wrong = bus("tls/127.0.0.1:1", msgspec.structs.replace(good, **change))
        for opens in (hub, client):
            with pytest.raises(BadCertificate, match=says) as caught, opens(wrong):
                pass
            assert "\n" not in str(caught.value)


def test_who_only_connects_need_not_say_where_to_listen_and_then_cannot(authority: Authority) -> None:
    config = msgspec.convert(
        {"connect": [tls_endpoint()], "tls": msgspec.to_builtins(authority.host("robot"))}, BusConfig
    )
    with pytest.raises(NoBus, match=r"cannot listen at tcp/127\.0\.0\.1:7447"), hub(config):
        pass


def test_where_nobody_listens_it_says_so(authority: Authority) -> None:
    endpoint = tls_endpoint()
    with pytest.raises(NoBus, match=f"no hub at {endpoint}: .*refused"):
        enter(bus(endpoint, authority.host("robot")))


def test_a_port_that_never_answers_does_not_hang(authority: Authority) -> None:
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        endpoint = f"tls/127.0.0.1:{deaf.getsockname()[1]}"
        raised: list[Exception] = []

        def call() -> None:
            try:
                enter(bus(endpoint, authority.host("robot")))
            except NoBus as error:
                raised.append(error)

        thread = threading.Thread(target=call, daemon=True)
        thread.start()
        thread.join(20.0)
        assert [type(one) for one in raised] == [NoBus]
