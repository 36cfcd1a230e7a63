"""The folder of a run: what it was begun with, and every finished trial, so that it can be gone on with."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import msgspec

import runtime
from experiments.paper.trial import Outcome
from runtime.config.layers import ConfigError, Layer
from runtime.errors import PushlaneError
from runtime.outputs import writing
from runtime.recorder import header

_RUN, _TRIALS, _PARQUET = "run.json", "trials.jsonl", "trials.parquet"

# What a push is computed from; the rest of experiments/ only looks on.
_SOURCES = ("runtime", "services", "drivers", "experiments/session.py", "experiments/scoring.py")


class BadRun(PushlaneError):
    """The folder holds a run that cannot be gone on with; the message says why."""

    exit_code = 2


class Facts(msgspec.Struct, frozen=True, kw_only=True):
    """What a run was begun with.

    Attributes:
        settings: origin and values of each layer that the user gave.
        first_seed: of trial 0 in every cell.
        code: digest of the source that pushes are computed from.
        commit, dirty, host, cpu, versions: see `runtime.recorder.header.Header`.
        processor: its name.
        begun: date and time, UTC.
    """

    settings: str
    first_seed: int
    code: str
    commit: str
    dirty: bool
    host: str
    processor: str
    cpu: list[str]
    versions: dict[str, str]
    begun: str


class Store:
    """The folder of a run, open for adding trials."""

    def __init__(self, folder: Path, layers: Sequence[Layer], first_seed: int) -> None:
        """Begin a run in `folder`, or go on with the one there.

        Raises:
            ConfigError: the folder cannot be written.
            BadRun: what is there was begun with other settings, another seed or other code, or cannot be read.
        """
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            new = facts(layers, first_seed)
            if (folder / _RUN).exists():
                self.facts = _facts_in(folder)
                _compare(folder, self.facts, new)
            else:
                self.facts = new
                (folder / _RUN).write_bytes(msgspec.json.format(msgspec.json.encode(new)))
            self.outcomes = _trials_in(folder, mend=True)
            self._file = (folder / _TRIALS).open("ab")
        except OSError as error:
            raise ConfigError(f"--output {folder}: {error.strerror or error}") from error

    def add(self, outcome: Outcome) -> None:
        """Keep one more trial, on the disk at once."""
        with writing(self.folder / _TRIALS):
            self._file.write(msgspec.json.encode(outcome) + b"\n")
            self._file.flush()
        self.outcomes.append(outcome)

    def close(self) -> None:
        """Write trials.parquet, in an order that does not depend on how many processes there were."""
        self.outcomes.sort(key=lambda one: one.key)
        with writing(self.folder / _TRIALS):
            self._file.close()
        with writing(self.folder / _PARQUET):
            write_parquet(self.outcomes, self.folder / _PARQUET)


def stored(folder: Path) -> tuple[Facts, list[Outcome]]:
    """Return what a run in `folder` was begun with, and its trials, sorted.

    Raises:
        BadRun: there is none, or it cannot be read.
    """
    return _facts_in(folder), sorted(_trials_in(folder), key=lambda one: one.key)


def facts(layers: Sequence[Layer], first_seed: int) -> Facts:
    """Return the facts of a run that begins here and now."""
    head = header.of_this_machine("local", first_seed, [])
    return Facts(
        settings=msgspec.json.encode([layer.values for layer in layers], order="sorted").decode(),
        first_seed=first_seed,
        code=code_digest(),
        commit=head.commit,
        dirty=head.dirty,
        host=head.host,
        processor=_processor(),
        cpu=head.cpu,
        versions=head.versions,
        begun=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )


def code_digest() -> str:
    """Return a digest of the source, scenes and objects that pushes are computed from."""
    root = Path(runtime.__file__).parent.parent
    digest = hashlib.sha256()
    for source in _SOURCES:
        place = root / source
        files = [place] if place.is_file() else sorted([*place.rglob("*.py"), *place.rglob("*.toml")])
        for file in files:
            digest.update(str(file.relative_to(root)).encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def write_parquet(outcomes: Iterable[Outcome], file: Path) -> None:
    """Write `outcomes`, a row each, a column for every attribute."""
    import pyarrow as pa
    from pyarrow import parquet

    kinds = {
        "str": pa.string(),
        "float": pa.float64(),
        "float | None": pa.float64(),
        "int": pa.int64(),
        "bool": pa.bool_(),
    }
    annotations = {
        name: note for one in reversed(Outcome.__mro__) for name, note in getattr(one, "__annotations__", {}).items()
    }
    schema = pa.schema([(name, kinds[str(annotations[name])]) for name in Outcome.__struct_fields__])
    parquet.write_table(pa.Table.from_pylist([msgspec.structs.asdict(one) for one in outcomes], schema), file)


def _facts_in(folder: Path) -> Facts:
    try:
        return msgspec.json.decode((folder / _RUN).read_bytes(), type=Facts)
    except (OSError, msgspec.MsgspecError) as error:
        raise BadRun(f"{folder / _RUN}: {error}; expected the folder of a run of `pushlane experiment`") from error


def _trials_in(folder: Path, mend: bool = False) -> list[Outcome]:
    file = folder / _TRIALS
    content = file.read_bytes() if file.exists() else b""
    whole = content[: content.rfind(b"\n") + 1]
    if mend and whole != content:
        # A process that was killed while writing left half a line; its trial is run again.
        file.write_bytes(whole)
    try:
        return [msgspec.json.decode(line, type=Outcome) for line in whole.splitlines()]
    except msgspec.MsgspecError as error:
        raise BadRun(f"{file}: {error}; expected a trial in every line") from error


def _compare(folder: Path, old: Facts, new: Facts) -> None:
    for name, what in (("settings", "settings"), ("first_seed", "--seed"), ("code", "code (digest of the source)")):
        was, is_ = getattr(old, name), getattr(new, name)
        if was != is_:
            raise BadRun(
                f"--output {folder}: its run was begun with {what} {was}, this one has {is_}; "
                "expected the same, or another folder"
            )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return ""
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
