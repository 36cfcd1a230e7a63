"""How long the predictive method thinks: handler times of its three services over one push.

In CPU time of this thread: what it takes on a core of its own, whatever else the machine does.
"""

from __future__ import annotations

from time import thread_time
from typing import Any

import numpy as np

from experiments.session import prepare, run
from runtime.config.layers import Layer
from runtime.node import Node

_TICKS = {"strategy": "object/state", "learner": "object/state", "controller": "tick"}
"""The event at which each service thinks; at the others it only notes a message."""


def main() -> None:
    """Print the figures."""
    method = {"scene": "corridor-2", "object": "cart", "strategy": "predictive", "controller": "predictive"}
    session = prepare([Layer("bench", {"sim": {**method, "seed": 1, "time_limit": 30.0}})])
    run(session)  # warm up
    took: dict[str, list[float]] = {name: [] for name in _TICKS}
    original = Node._run

    def timed(self: Node, source: str, handler: Any, *args: object) -> Any:
        begin = thread_time()
        try:
            return original(self, source, handler, *args)
        finally:
            if _TICKS.get(self.name) == source:
                took[self.name].append(thread_time() - begin)

    Node._run = timed  # type: ignore[method-assign]
    try:
        run(session)
    finally:
        Node._run = original  # type: ignore[method-assign]
    print("the predictive method, handlers of one push (bar: p99 of a tick under 5 ms on one core):")
    for name, times in took.items():
        ticks = 1000 * np.array(times)
        p50, p99 = np.percentile(ticks, [50, 99])
        print(
            f"  {name:<10} {len(ticks):5d} ticks, median {p50:.2f} ms, p99 {p99:.2f} ms, longest {ticks.max():.2f} ms"
        )


if __name__ == "__main__":
    main()
