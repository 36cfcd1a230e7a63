"""What each service costs in a push from sensors: its handlers' times, by what they handle."""

from __future__ import annotations

from collections import defaultdict
from time import process_time, thread_time
from typing import Any

import numpy as np

from experiments.session import Session, prepare, run
from runtime.config.layers import Layer
from runtime.node import Node

_SENSES: dict[str, dict[str, bool]] = {
    "tags": {},
    "appearance": {"tagged": False},
    "depth": {"tagged": False, "depth": True},
}
_LIMIT = 12.0
_RARE = 5
"""handlers that ran less often are left out"""


def main() -> None:
    """Print the figures."""
    for sense, values in _SENSES.items():
        sim = {"perception": "sensors", "seed": 1, "strategy": "predictive", "controller": "predictive"}
        session = prepare([Layer("bench", {"sim": {**sim, "time_limit": _LIMIT, **values}})])
        _report(sense, session)


def _report(sense: str, session: Session) -> None:
    spent: dict[tuple[str, str], list[float]] = defaultdict(list)
    original: Any = Node._run

    def timed(node: Node, *args: Any, **kwargs: Any) -> Any:
        # The thread's own time: others on this machine do not count, nor does the renderer's other threads' work.
        begin = thread_time()
        try:
            return original(node, *args, **kwargs)
        finally:
            spent[(node.name, _handled(args))].append(thread_time() - begin)

    whole = process_time()
    node_class: Any = Node
    node_class._run = timed
    try:
        run(session)
    finally:
        node_class._run = original
    whole = process_time() - whole
    mapping = session.effective.sections["mapping"].particles  # type: ignore[attr-defined]
    camera = session.effective.sections["camera"].scene.camera  # type: ignore[attr-defined]
    print(
        f"seen by {sense}: CPU ms of a handler at p50 and p99, {camera.width} x {camera.height} pixels, "
        f"{mapping} particles, {session.sim.scene}"
    )
    for (name, source), times in spent.items():
        if len(times) < _RARE:
            continue
        low, high = (1000.0 * float(np.quantile(times, share)) for share in (0.5, 0.99))
        print(f"  {name:<12} {source:<14} {low:8.2f} {high:8.2f}   ({len(times)} times)")
    print(f"  all of it: {whole:.1f} s of CPU for {_LIMIT:.0f} s, the drawing of pictures with it")


def _handled(args: tuple[Any, ...]) -> str:
    """Return the name of what a handler was called for."""
    return str(args[0]) if args else ""
