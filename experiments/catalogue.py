"""What `pushlane sim --list` names."""

from __future__ import annotations

from drivers.sapien import objects, scene
from services.names import CONTROLLERS, STRATEGIES

_STRATEGY_TITLES = {
    "strict": "long push-lines inside the object corridor, (1)-(3)",
    "relaxed": "long push-lines that the larger of robot and object fits beside, (4)-(6)",
    "fixed-lookahead": "a point of the path 0.1 m ahead",
    "switching": "strict where the corridor is wide, relaxed where it is narrow (Sec. 7.1)",
    "predictive": "plans pushes in a learned model of the object; not in the paper (docs/predictive.md)",
}
_CONTROLLER_TITLES = {
    "adaptive": "blends pushing and relocating, learns the object on the fly, (7)-(13)",
    "non-adaptive": "the same with the prior held",
    "centroid": "aligns with the object's centre (Hermans et al. 2013)",
    "dipole": "follows a dipole field (Igarashi et al. 2010)",
    "predictive": "follows the predictive strategy's plan; not in the paper (docs/predictive.md)",
}


def entries() -> dict[str, dict[str, str]]:
    """Return kind -> name -> title."""
    return {
        "scenes": {name: scene.get(name).title for name in scene.names()},
        "objects": {name: objects.get(name).title for name in objects.names()},
        "strategies": {name: _STRATEGY_TITLES[name] for name in STRATEGIES},
        "controllers": {name: _CONTROLLER_TITLES[name] for name in CONTROLLERS},
    }


def as_json() -> dict[str, list[dict[str, str]]]:
    """Return the catalogue for JSON."""
    return {kind: [{"name": name, "title": title} for name, title in rows.items()] for kind, rows in entries().items()}


def text() -> str:
    """Return the catalogue for reading."""
    lines = []
    for kind, rows in entries().items():
        lines.append(f"{kind}:")
        lines += [f"  {name:<18} {title}" for name, title in rows.items()]
    return "\n".join(lines)
