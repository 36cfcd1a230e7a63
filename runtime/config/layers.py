"""Merges layers of configuration into typed sections, and says where each value came from.

A section is a `msgspec.Struct` with `forbid_unknown_fields`; ranges are `msgspec.Meta` annotations.
"""

from __future__ import annotations

import copy
import difflib
import math
import re
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from runtime.errors import PushlaneError

Values = dict[str, Any]
_AT = re.compile(r"^(?P<what>.*?)(?: - at `\$\.?(?P<path>[^`]*)`)?$", re.DOTALL)
_UNKNOWN = re.compile(r"unknown field `(?P<field>[^`]*)`")


class ConfigError(PushlaneError):
    """A configuration value is wrong; the message names the file, the key and what was expected."""


@dataclass(frozen=True)
class Layer:
    """Values from one place. Later layers override earlier ones.

    Attributes:
        origin: where the values come from, in words a user recognises: a file, an option.
        values: section -> key -> value, nested as in TOML.
    """

    origin: str
    values: Values


@dataclass(frozen=True)
class Effective:
    """The configuration that holds.

    Attributes:
        sections: section -> its structure.
        origins: dotted key -> origin, for every key that is not at its default.
    """

    sections: dict[str, msgspec.Struct]
    origins: dict[str, str]

    def rows(self) -> Iterator[tuple[str, object, str]]:
        """Return (dotted key, value, origin) of every value, defaults included."""
        for section, structure in self.sections.items():
            yield from self._rows(section, msgspec.to_builtins(structure))

    def _rows(self, key: str, value: object) -> Iterator[tuple[str, object, str]]:
        if isinstance(value, dict) and value:
            for name, inner in value.items():
                yield from self._rows(f"{key}.{name}", inner)
            return
        origin = next((self.origins[part] for part in _prefixes(key) if part in self.origins), "default")
        yield key, value, origin


def read_toml(path: Path) -> Layer:
    """Return the layer that a TOML file holds.

    Raises:
        ConfigError: the file is missing, or no TOML.
    """
    try:
        return Layer(str(path), tomllib.loads(path.read_text()))
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not valid TOML: {error}") from error


def read_assignments(assignments: Sequence[str], origin: str = "--set") -> Layer:
    """Return the layer of `section.key=value` texts; values are TOML, and text needs no quotes.

    Raises:
        ConfigError: a text is no assignment.
    """
    values: Values = {}
    for text in assignments:
        key, equals, value = text.partition("=")
        parts = key.strip().split(".")
        if not equals or len(parts) < 2 or not all(parts):
            raise ConfigError(f"{origin} {text}: expected section.key=value, as in controller.k_gamma=0.2")
        inner = values
        for part in parts[:-1]:
            inner = inner.setdefault(part, {})
            if not isinstance(inner, dict):
                raise ConfigError(f"{origin} {text}: '{part}' already has a value, so it has no keys")
        try:
            found = tomllib.loads(f"value = {value}")
        except tomllib.TOMLDecodeError:
            found = {"value": value.strip()}
        if len(found) != 1:
            raise ConfigError(f"{origin} {text!r}: expected one value on one line")
        inner[parts[-1]] = found["value"]
    return Layer(origin, values)


def effective(
    kinds: Mapping[str, type[msgspec.Struct]], layers: Sequence[Layer], known: Collection[str] = ()
) -> Effective:
    """Merge `layers` over the defaults of `kinds`.

    Args:
        kinds: section -> its structure class.
        layers: weakest first.
        known: sections that there are elsewhere, to name beside those of `kinds` to who mistypes one.

    Raises:
        ConfigError: an unknown section or key, a wrong type, a value out of range, a number that is not finite.
    """
    merged: Values = {}
    origins: dict[str, str] = {}
    for layer in layers:
        for section, values in layer.values.items():
            if section not in kinds:
                hint = _hint(section, list(known or kinds))
                raise ConfigError(f"{layer.origin}: unknown section [{section}]{hint}")
            if not isinstance(values, dict):
                raise ConfigError(f"{layer.origin}: [{section}] is to be a table, not {values!r}")
        _merge(merged, layer.values, layer.origin, "", origins)
    sections = {}
    for section, kind in kinds.items():
        try:
            sections[section] = msgspec.convert(merged.get(section, {}), kind)
        except msgspec.ValidationError as error:
            raise _explain(error, section, kind, merged.get(section, {}), origins) from error
        _refuse_nonfinite(merged.get(section, {}), section, origins)
    return Effective(sections, origins)


def _merge(into: Values, values: Values, origin: str, prefix: str, origins: dict[str, str]) -> None:
    for key, value in values.items():
        path = f"{prefix}{key}"
        if isinstance(value, dict) and isinstance(into.get(key, {}), dict):
            _merge(into.setdefault(key, {}), value, origin, f"{path}.", origins)
        else:
            into[key] = copy.deepcopy(value)
            origins.pop(path, None)  # so that the order of origins is that of the layers
            for known in [one for one in origins if one.startswith(f"{path}.")]:
                del origins[known]
            origins[path] = origin


def _explain(
    error: msgspec.ValidationError, section: str, kind: type[msgspec.Struct], values: Values, origins: dict[str, str]
) -> ConfigError:
    match = _AT.match(str(error))
    what, path = (match["what"], match["path"] or "") if match else (str(error), "")
    if "[...]" in path:
        path = _named(path, kind, values, str(error))
    key = f"{section}.{path}" if path else section
    unknown = _UNKNOWN.search(what)
    if unknown:
        key = f"{key}.{unknown['field']}"
        what = f"no such key{_hint(unknown['field'], _known_fields(kind, path))}"
    else:
        found = _at(values, path)
        choices = _choices(kind, path)
        what = f"expected one of {', '.join(choices)}" if choices else what[:1].lower() + what[1:]
        what += f" (found {found!r})" if found is not None and path else ""
    return ConfigError(f"{_origin(key, origins)}: {key}: {what}")


def _choices(kind: type[msgspec.Struct], path: str) -> list[str]:
    """Return the values that may stand at `path`, as TOML writes them, if they can be counted."""
    found: msgspec.inspect.Type = msgspec.inspect.type_info(kind)
    for part in filter(None, re.split(r"\.|(?=\[)", path)):
        inner = [one for option in _options(found) for one in _inside(option, part)]
        if len(inner) != 1:
            return []
        found = inner[0]
    options = [one for one in _options(found) if not isinstance(one, msgspec.inspect.NoneType)]
    values: list[object] = []
    for one in options:
        if isinstance(one, msgspec.inspect.LiteralType):
            values += one.values
        elif isinstance(one, msgspec.inspect.EnumType):
            values += [member.value for member in one.cls]
        elif isinstance(one, msgspec.inspect.BoolType):
            values += ["true", "false"]
        else:
            return []
    return [str(value) for value in values]


def _options(kind: msgspec.inspect.Type) -> list[msgspec.inspect.Type]:
    """Return what a value may be: the parts of a union, or the one type."""
    while isinstance(kind, msgspec.inspect.Metadata):
        kind = kind.type
    return (
        [one for part in kind.types for one in _options(part)]
        if isinstance(kind, msgspec.inspect.UnionType)
        else [kind]
    )


def _inside(kind: msgspec.inspect.Type, part: str) -> list[msgspec.inspect.Type]:
    """Return the type of what `part` of a path leads to: a field, a key or an index."""
    if isinstance(kind, msgspec.inspect.StructType):
        return [field.type for field in kind.fields if field.encode_name == part]
    if isinstance(kind, msgspec.inspect.DictType):
        return [kind.value_type]
    if isinstance(kind, msgspec.inspect.TupleType):
        index = part.strip("[]")
        return [kind.item_types[int(index)]] if index.isdigit() and int(index) < len(kind.item_types) else []
    if isinstance(kind, msgspec.inspect.CollectionType):
        return [kind.item_type]
    return []


def _named(path: str, kind: type[msgspec.Struct], values: Values, text: str) -> str:
    """Return `path` with the key of the dict that msgspec writes as [...], found by leaving the others out."""
    before, _, after = path.partition("[...]")
    items = _at(values, before)
    for key, value in items.items() if isinstance(items, dict) else ():
        alone = copy.deepcopy(values)
        inner = _at(alone, before)
        inner.clear()
        inner[key] = value
        try:
            msgspec.convert(alone, kind)
        except msgspec.ValidationError as error:
            if str(error) == text:
                return f"{before}.{key}{after}"
    return path


def _at(values: Any, path: str) -> Any:
    """Return what `path` leads to, or None."""
    for part in filter(None, re.split(r"\.|(?=\[)", path)):
        if part.startswith("["):
            index = part.strip("[]")
            values = values[int(index)] if isinstance(values, list) and index.isdigit() else None
        else:
            values = values.get(part) if isinstance(values, dict) else None
    return values


def _origin(key: str, origins: dict[str, str]) -> str:
    """Return where the value at `key` came from, or that of a key above or below it."""
    plain = re.sub(r"\[[^]]*\]", "", key)
    above = next((origins[part] for part in _prefixes(plain) if part in origins), None)
    # Below: the layer that spoke last is the one that upset what held before.
    below = [origin for known, origin in origins.items() if known.startswith(f"{plain}.")]
    return above or (below[-1] if below else "default")


def _known_fields(kind: type, path: str) -> list[str]:
    for part in filter(None, path.split(".")):
        field = next((f for f in msgspec.structs.fields(kind) if f.encode_name == part), None)
        if field is None or not isinstance(field.type, type) or not issubclass(field.type, msgspec.Struct):
            return []
        kind = field.type
    return [field.encode_name for field in msgspec.structs.fields(kind)]


def _hint(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    if close:
        return f"; did you mean '{close[0]}'?"
    return f"; expected one of {', '.join(known)}" if known else ""


def _refuse_nonfinite(value: object, key: str, origins: dict[str, str]) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(f"{_origin(key, origins)}: {key}: expected a finite number (found {value})")
    if isinstance(value, dict):
        for name, inner in value.items():
            _refuse_nonfinite(inner, f"{key}.{name}", origins)
    if isinstance(value, list | tuple):
        for index, inner in enumerate(value):
            _refuse_nonfinite(inner, f"{key}[{index}]", origins)


def _prefixes(key: str) -> list[str]:
    parts = key.split(".")
    return [".".join(parts[:count]) for count in range(len(parts), 0, -1)]
