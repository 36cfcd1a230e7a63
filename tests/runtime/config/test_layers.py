from __future__ import annotations

import math
import re
import tomllib
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from msgspec import Meta

from runtime.config.layers import ConfigError, Layer, effective, read_assignments, read_toml

Gain = Annotated[float, Meta(ge=0, le=10)]


class Inner(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    depth: Gain = 1.0
    label: str = "inner"


class Controller(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    k_gamma: Gain = 0.5
    k_alpha: Gain = 0.25
    enabled: bool = True
    steps: Annotated[int, Meta(ge=1)] = 3
    kind: Literal["adaptive", "centroid"] = "adaptive"
    gains: tuple[Gain, ...] = (1.0, 2.0)
    free: float = 0.0
    inner: Inner = Inner()


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


class Ends(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    left: Literal["open", "shut"] | None = None
    pair: tuple[Colour, int] = (Colour.RED, 1)
    many: list[Colour] = []
    either: Literal["auto"] | float = "auto"


class Links(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    latency: dict[str, Gain] = {}
    deep: dict[str, Inner] = {}
    ends: dict[str, Ends] = {}


KINDS: dict[str, type[msgspec.Struct]] = {"controller": Controller, "links": Links}


def toml(folder: Path, text: str, name: str = "robot.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def refusal(layer: Layer) -> str:
    with pytest.raises(ConfigError) as caught:
        effective(KINDS, [layer])
    return str(caught.value)


WRONG = [
    # section.key, TOML value, what the message must also say
    ("controler.k_gamma", "1.0", "did you mean 'controller'"),
    ("zzz.k_gamma", "1.0", "controller, links"),
    ("controller.k_gama", "1.0", "did you mean 'k_gamma'"),
    ("controller.zzz", "1.0", "k_alpha"),
    ("controller.inner.dept", "1.0", "did you mean 'depth'"),
    ("controller.k_gamma", '"fast"', "float"),
    ("controller.k_gamma", "true", "float"),
    ("controller.enabled", "1", r"expected one of true, false \(found 1\)"),
    ("controller.steps", "1.5", "int"),
    ("controller.steps", "0", ">= 1"),
    ("controller.k_gamma", "-0.1", ">= 0"),
    ("controller.k_gamma", "10.5", "<= 10"),
    ("controller.inner.depth", "11", "<= 10"),
    ("controller.inner", "3", "Inner|object"),
    ("controller.kind", '"centripetal"', r"expected one of adaptive, centroid \(found 'centripetal'\)"),
    ("controller.kind", "3", r"expected one of adaptive, centroid \(found 3\)"),
    ("links.ends.a.left", '"ajar"', r"expected one of open, shut \(found 'ajar'\)"),
    ("links.ends.a.pair", '["green", 1]', r"links.ends.a.pair\[0\]: expected one of red, blue \(found 'green'\)"),
    ("links.ends.a.many", '["red", "green"]', "expected one of red, blue"),
    ("links.ends.a.either", '"manual"', "manual"),
    ("controller.k_gamma", "nan", "nan"),
    ("controller.k_gamma", "inf", "inf"),
    ("controller.free", "nan", "finite"),
    ("controller.free", "-inf", "finite"),
    ("controller.inner.depth", "nan", "nan"),
    ("controller.gains", "[1.0, nan]", "finite|>= 0"),
    ("controller.gains", "[1.0, 11.0]", "<= 10"),
    ("controller.gains", '["x"]', "float"),
    ("links.latency.odometry", "11.0", "<= 10"),
    ("links.latency.odometry", '"slow"', "float"),
    ("links.latency.odometry", "nan", "finite|>= 0"),
    ("links.deep.a.depth", "11.0", "<= 10"),
    ("links.deep.a.zzz", "11.0", "zzz"),
]


@pytest.mark.parametrize(("key", "value", "says"), WRONG)
def test_a_wrong_value_in_a_file_is_refused_with_file_and_key(tmp_path: Path, key: str, value: str, says: str) -> None:
    section, _, rest = key.partition(".")
    path = toml(tmp_path, f"[{section}]\n{rest} = {value}\n")
    text = refusal(read_toml(path))
    assert str(path) in text
    assert (key if section in KINDS else section) in text
    assert re.search(says, text)


@pytest.mark.parametrize(("key", "value", "says"), WRONG)
def test_a_wrong_assignment_is_refused_with_option_and_key(key: str, value: str, says: str) -> None:
    section = key.partition(".")[0]
    text = refusal(read_assignments([f"{key}={value}"]))
    assert "--set" in text
    assert (key if section in KINDS else section) in text
    assert re.search(says, text)


def test_the_blame_is_on_the_layer_that_said_it(tmp_path: Path) -> None:
    good = read_toml(toml(tmp_path, "[controller]\nk_alpha = 1.0\nk_gamma = 2.0\n", "good.toml"))
    with pytest.raises(ConfigError, match=r"^--set: controller\.k_gamma"):
        effective(KINDS, [good, read_assignments(["controller.k_gamma=-1"])])
    bad = read_toml(toml(tmp_path, "[controller]\nk_gamma = -1\n", "bad.toml"))
    with pytest.raises(ConfigError, match=r"bad\.toml: controller\.k_gamma"):
        effective(KINDS, [bad, read_assignments(["controller.k_alpha=1"])])
    # What a later layer mended is nobody's fault any more.
    assert effective(KINDS, [bad, good]).sections["controller"] == Controller(k_gamma=2.0, k_alpha=1.0)


def test_a_section_must_be_a_table(tmp_path: Path) -> None:
    path = toml(tmp_path, "controller = 3\n")
    assert re.search(re.escape(str(path)) + r".*controller.*3", refusal(read_toml(path)))


@pytest.mark.parametrize(
    "text",
    ["[controller\n", "k = = 2", "[controller]\nk_gamma = 1\nk_gamma = 2\n", "[a]\n[a]\n"],
)
def test_what_is_no_toml_is_refused_with_the_file(tmp_path: Path, text: str) -> None:
    path = toml(tmp_path, text)
    with pytest.raises(ConfigError, match=re.escape(str(path))):
        read_toml(path)


def test_bytes_that_are_no_text_are_refused_with_the_file(tmp_path: Path) -> None:
    path = tmp_path / "noise.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=re.escape(str(path))):
        read_toml(path)


def test_a_missing_file_and_a_folder_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"missing\.toml.*[Nn]o such file"):
        read_toml(tmp_path / "missing.toml")
    with pytest.raises(ConfigError, match=re.escape(str(tmp_path))):
        read_toml(tmp_path)


def test_a_file_is_utf_8_wherever_it_is_read(tmp_path: Path) -> None:
    path = toml(tmp_path, '[controller.inner]\nlabel = "Möbel"\n')
    section = effective(KINDS, [read_toml(path)]).sections["controller"]
    assert isinstance(section, Controller) and section.inner.label == "Möbel"


def test_without_layers_the_defaults_hold() -> None:
    found = effective(KINDS, [])
    assert found.sections == {"controller": Controller(), "links": Links()}
    assert {origin for _, _, origin in found.rows()} == {"default"}


def test_every_value_has_the_origin_that_gave_it(tmp_path: Path) -> None:
    first = toml(
        tmp_path,
        "[controller]\nk_gamma = 1.0\nsteps = 4\ninner.depth = 2.0\n[links.latency]\nodometry = 0.5\nmap = 1.0\n",
    )
    layers = [read_toml(first), read_assignments(["controller.steps=5", "links.latency.map=2.0"])]
    rows = {key: (value, origin) for key, value, origin in effective(KINDS, layers).rows()}
    assert rows["controller.k_gamma"] == (1.0, str(first))
    assert rows["controller.steps"] == (5, "--set")
    assert rows["controller.inner.depth"] == (2.0, str(first))
    assert rows["controller.inner.label"] == ("inner", "default")
    assert rows["controller.k_alpha"] == (0.25, "default")
    assert rows["links.latency.odometry"] == (0.5, str(first))
    assert rows["links.latency.map"] == (2.0, "--set")
    assert rows["links.deep"] == ({}, "default")
    assert len(rows) == 13


def test_layers_are_not_changed_by_merging(tmp_path: Path) -> None:
    first = Layer("first", {"links": {"latency": {"odometry": 0.5}}})
    second = Layer("second", {"links": {"latency": {"odometry": 0.7, "map": 0.1}}})
    third = Layer("third", {"links": {"latency": {"scan": 0.2}}})
    effective(KINDS, [Layer("zeroth", {"links": {"latency": 3}}), first, second, third])
    assert first.values == {"links": {"latency": {"odometry": 0.5}}}
    assert second.values == {"links": {"latency": {"odometry": 0.7, "map": 0.1}}}


@pytest.mark.parametrize(
    "text", ["controller.k_gamma", "k_gamma=1", "=1", ".k=1", "controller.=1", "controller..k=1", ""]
)
def test_what_is_no_assignment_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match=r"expected section\.key=value"):
        read_assignments([text])


def test_a_value_and_a_table_of_one_name_are_refused() -> None:
    with pytest.raises(ConfigError, match="'inner' already has a value"):
        read_assignments(["controller.inner=3", "controller.inner.depth=1"])


def test_the_last_assignment_of_a_key_holds() -> None:
    assert read_assignments(["a.b=1", "a.b=2"]).values == {"a": {"b": 2}}


def value_of(text: str) -> object:
    return read_assignments([f"section.key={text}"]).values["section"]["key"]


@given(st.floats() | st.integers(-(2**63), 2**63 - 1) | st.booleans())
def test_numbers_and_booleans_are_read_as_toml_reads_them(value: float | bool) -> None:
    text = str(value).lower()
    found = value_of(text)
    assert type(found) is type(value)
    assert found == value or (isinstance(value, float) and math.isnan(value) and math.isnan(found))  # type: ignore[arg-type]
    assert repr(found) == repr(tomllib.loads(f"x = {text}")["x"])


@pytest.mark.parametrize("text", ["1e3", "0x1F", "1_000", "+2", "[1, 2]", '"1"', "'a b'", "{a = 1}", "-0.0", '"a # b"'])
def test_toml_spellings_are_read_as_toml_reads_them(text: str) -> None:
    assert repr(value_of(text)) == repr(tomllib.loads(f"x = {text}")["x"])


@given(st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"])))
def test_quoted_text_is_read_as_toml_reads_it(text: str) -> None:
    quoted = '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
    assert tomllib.loads(f"x = {quoted}")["x"] == text
    assert value_of(quoted) == text


@given(st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1))
def test_text_needs_no_quotes(text: str) -> None:
    try:
        tomllib.loads(f"x = {text}")
    except tomllib.TOMLDecodeError:
        assert value_of(text) == text
    else:
        assume(False)


@pytest.mark.parametrize("text", ["living-room", "a=b", "", "1.2.3", "yes", "drawer 4", "[broken", "../x.toml"])
def test_plain_words_are_text(text: str) -> None:
    assert value_of(text) == text


def test_one_assignment_sets_one_value() -> None:
    """Nothing behind a line break may be swallowed."""
    try:
        found = value_of("1\nother = 2")
    except ConfigError:
        return
    assert found == "1\nother = 2"
