"""Which services a system is made of."""

from __future__ import annotations

_SKILL = ("corridor", "strategy", "learner", "controller", "task")
SENSES = {"truth": ("perception",), "sensors": ("camera", "floor", "mapping", "tracker")}
BASES = {
    "direct": ("driver",),
    "serial": ("emulated-serial", "robotino-serial"),
    "rest": ("emulated-rest", "robotino-rest"),
}
"""The nodes of a simulated base by what lies between it and its driver; the first of them holds the simulated world."""
SYSTEMS = {(sense, link): (*base, *SENSES[sense], *_SKILL) for sense in SENSES for link, base in BASES.items()}
"""The services of a simulated session by perception and link, in scheduling order: it breaks ties between timers."""
NODES = SYSTEMS["truth", "direct"]

_REAL = ("opencv-camera", "floor", "mapping", "tracker", *_SKILL)
REAL = {
    "robotino-serial": ("robotino-serial", "robotino-laser", *_REAL),
    "robotino-rest": ("robotino-rest", *_REAL),
}
"""The services of a system on a real base, by the driver of that base. It has a wire to it; nothing is simulated."""

EVERY = tuple(dict.fromkeys(name for names in (*SYSTEMS.values(), *REAL.values()) for name in names))
"""Every service that is in some system."""
