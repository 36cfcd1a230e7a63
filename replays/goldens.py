"""The golden pushes: small recordings that are re-executed by the tests, and made anew by one command."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from replays import report
from replays.recording import Recording, load
from replays.replay import replay
from runtime import topics
from runtime.config.layers import Layer
from runtime.messages import FailureCause, PushOutcome, PushStatus

FOLDER = Path(__file__).parent / "recordings"

GOLDENS: dict[str, dict[str, dict[str, Any]]] = {
    "living-room-strict": {"sim": {"scene": "living-room", "seed": 1}},
    "corridor-1-relaxed": {"sim": {"scene": "corridor-1", "object": "can", "strategy": "relaxed", "seed": 3}},
    "1a-fixed-lookahead": {
        "sim": {"scene": "1A", "object": "blue-box", "strategy": "fixed-lookahead", "controller": "dipole", "seed": 4}
    },
    "wide-bend-slow-links": {
        "sim": {"scene": "wide-bend", "object": "cart", "strategy": "switching", "seed": 5},
        "timing": {"latency": {"command": 0.02}, "duration": {"strategy": 0.06, "controller": 0.005}},
    },
    "corridor-2-failed": {
        "sim": {"scene": "corridor-2", "object": "plane", "controller": "centroid", "strategy": "relaxed", "seed": 6}
    },
}
"""Name of the file -> configuration. Different strategies, controllers, scenes and objects; one push fails."""


def check_all(say: Callable[[str], None]) -> bool:
    """Re-execute every golden. Returns whether all are identical."""
    same = True
    for path in paths():
        found = replay(load(path))
        say(f"{path.stem}: {outcome(found.recording)}: {report.verdict(found)}")
        for reason in found.reasons:
            say(f"  {reason}")
        same = same and found.identical and found.recording.damage is None
    return same


def record_all(say: Callable[[str], None]) -> bool:
    """Record every golden anew, and say what changed. Returns whether nothing did."""
    from experiments.session import prepare, run

    FOLDER.mkdir(exist_ok=True)
    same = True
    for name, values in GOLDENS.items():
        old = FOLDER / f"{name}.mcap"
        with TemporaryDirectory(dir=FOLDER) as folder:
            new = Path(folder) / old.name
            run(prepare([Layer(f"golden {name}", values)]), new)
            changes = ["is new"] if not old.exists() else list(_changes(load(old), load(new)))
            if changes:
                new.replace(old)
        same = same and not changes
        say(f"{name}: {outcome(load(old))}: {'; '.join(changes) or 'unchanged'}")
    for path in paths():
        if path.stem not in GOLDENS:
            path.unlink()
            same = False
            say(f"{path.stem}: removed")
    return same


def paths() -> list[Path]:
    """Return the recordings there are."""
    return sorted(FOLDER.glob("*.mcap"))


def outcome(recording: Recording) -> str:
    """Return how the push in `recording` ended, in words."""
    last = max((key for key in recording.samples if key[0] == topics.PUSH_STATUS.name), default=None)
    if last is None:
        return "no push"
    status = PushStatus.FromString(recording.samples[last].payload)
    words = [PushOutcome.Name(status.outcome).lower()]
    if status.cause != FailureCause.CAUSE_NONE:
        words.append(FailureCause.Name(status.cause).lower())
    return f"{', '.join(words)} after {status.elapsed:.1f} s"


def _changes(old: Recording, new: Recording) -> Iterator[str]:
    if outcome(old) != outcome(new):
        yield f"was {outcome(old)}"
    for topic in sorted({topic for topic, _ in (*old.samples, *new.samples)}):
        before = {key: sample.payload for key, sample in old.samples.items() if key[0] == topic}
        after = {key: sample.payload for key, sample in new.samples.items() if key[0] == topic}
        different = sum(before.get(key) != payload for key, payload in after.items())
        if different or len(before) != len(after):
            yield f"{topic}: {len(before)} became {len(after)}, {different} differ"
    if old.config != new.config:
        yield "configuration changed"
    if old.journals != new.journals or old.snapshots != new.snapshots:
        yield "journals or snapshots changed"
