"""Access control at the hub: what [bus.access] means in Zenoh's rules.

Deny is the default, and a rule allows what lies inside its key expression. So no rule names a pattern of topics that
somebody may publish: a put to `*` would go past a rule that denies `command`, but lies inside none that allows.
What a host may publish and answer is what the contracts of its services say.
"""

from __future__ import annotations

from collections.abc import Iterable

from runtime import registry, topics
from runtime.bus.config import AccessConfig
from runtime.bus.keys import Keys
from runtime.topics import ALIVE, TOPICS

Rule = dict[str, object]

_RECORDER = "recorder"
"""Runs beside the services of any host, and is asked to start and stop."""


def access_control(access: AccessConfig, keys: Keys) -> dict[str, object]:
    """Return Zenoh's `access_control` for the robot of `keys`.

    Raises:
        UnknownService: a host is to run a service that does not exist.
    """
    rules: list[Rule] = _see(keys)
    subjects = sorted({*access.hosts, *access.operators, *access.watchers})
    policies = [_policy(rules, subjects)]
    special = [(_operate(keys), access.operators)] if access.operators else []
    special += [(_serve(host, services, keys), (host,)) for host, services in access.hosts.items()]
    for own, who in special:
        rules = [*rules, *own]
        policies.append(_policy(own, who))
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in subjects],
        "policies": policies,
    }


def _see(keys: Keys) -> list[Rule]:
    """What everybody with a name may: subscribe, ask for last values and snapshots, see who is up; so also record."""
    told = [keys.latched("**"), keys.snapshot("*"), keys.sent("*"), keys.host("*"), keys.session()]
    heard = [keys.everything()]
    return [
        _rule("see: subscribe", "ingress", ["declare_subscriber"], heard),
        _rule("see: receive", "egress", ["put"], heard),
        _rule("see: ask", "ingress", ["query"], told),
        _rule("see: be told", "egress", ["reply"], told),
        _rule("see: who is up", "ingress", ["liveliness_query", "declare_liveliness_subscriber"], [keys.node("*")]),
        _rule("see: be told who is up", "egress", ["liveliness_token"], [keys.node("*")]),
        # A publisher that may not see that somebody subscribes sends nothing.
        _rule("see: be subscribed", "egress", ["declare_subscriber"], heard),
    ]


def _operate(keys: Keys) -> list[Rule]:
    """What operators may besides: ask for something to be done."""
    asked = [keys.request("**")]
    return [
        _rule("operate: ask", "ingress", ["query"], asked),
        _rule("operate: be answered", "egress", ["reply"], asked),
    ]


def _serve(host: str, services: Iterable[str], keys: Keys) -> list[Rule]:
    """What a host may besides: publish and answer for its services, its launcher and its recorder."""
    published = [keys.topic(topic(_RECORDER).name) for topic in (topics.request, topics.reply, topics.log)]
    answered = [keys.host("*"), keys.request("recording/*")]
    for name in services:
        contract = registry.service_class(name).contract
        outputs = [*contract.outputs, *contract.wired]
        if ALIVE.name in contract.inputs:
            # Where the hub is a bare router, the launcher beside the driver calls the roll and tells of the session.
            outputs.append(ALIVE.name)
            answered.append(keys.session())
        own = (topics.journal, topics.snapshot, topics.health, topics.request, topics.reply, topics.log)
        published += [keys.topic(topic) for topic in (*outputs, *(topic(name).name for topic in own))]
        answered += [keys.request(request) for request in contract.requests]
        answered += [keys.latched(topic) for topic in outputs if TOPICS[topic].latched]
    own_keys = [key(name) for name in services for key in (keys.snapshot, keys.sent)]
    # Who asks all nodes at once asks a pattern, and is answered at it: only who answers at all is told apart.
    asked = [*answered, *([keys.snapshot("*"), keys.sent("*")] if own_keys else [])]
    nodes = [keys.node(name) for name in (*services, _RECORDER)]
    return [
        _rule(f"{host}: publish", "ingress", ["put"], published),
        _rule(f"{host}: offer answers", "ingress", ["declare_queryable"], [*answered, *own_keys]),
        _rule(f"{host}: be asked", "egress", ["query"], asked),
        _rule(f"{host}: answer", "ingress", ["reply"], asked),
        _rule(f"{host}: be up", "ingress", ["liveliness_token"], nodes),
    ]


def _rule(name: str, flow: str, messages: list[str], keys: list[str]) -> Rule:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys}


def _policy(rules: Iterable[Rule], subjects: Iterable[str]) -> dict[str, object]:
    return {"rules": [rule["id"] for rule in rules], "subjects": list(subjects)}
