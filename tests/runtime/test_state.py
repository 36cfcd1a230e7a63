from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

import hypothesis.extra.numpy as hnp
import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from runtime import state
from runtime.messages import ObjectState, PushGoal, Vector2
from tests.support import PACKAGES, imported, sources


class Phase(Enum):
    IDLE = "idle"
    PUSHING = "pushing"


@dataclass
class Sampled:
    angles: NDArray[np.float64]
    counts: dict[str, NDArray[np.int64]] = field(default_factory=dict)


@dataclass
class Whole:
    number: int
    ratio: float
    text: str
    raw: bytes
    phase: Phase
    grid: NDArray[np.float64]
    inner: Sampled
    many: list[Sampled]
    pair: tuple[float, int]
    object: ObjectState
    goal: PushGoal | None = None
    maybe: NDArray[np.float64] | None = None


@dataclass
class Box:
    array: NDArray[np.float64]


@dataclass
class Lot:
    generator: np.random.Generator


DTYPES = st.one_of(
    hnp.boolean_dtypes(),
    hnp.integer_dtypes(endianness="?"),
    hnp.unsigned_integer_dtypes(endianness="?"),
    hnp.floating_dtypes(endianness="?"),
    hnp.complex_number_dtypes(endianness="?"),
    hnp.unicode_string_dtypes(min_len=1, max_len=4),
    hnp.byte_string_dtypes(min_len=1, max_len=4),
    hnp.datetime64_dtypes(max_period="s"),
    hnp.timedelta64_dtypes(max_period="s"),
)
ARRAYS = DTYPES.flatmap(lambda dtype: hnp.arrays(dtype, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0)))
SAMPLED = st.builds(Sampled, ARRAYS, st.dictionaries(st.text(max_size=4), ARRAYS, max_size=2))
MESSAGES = st.builds(
    lambda x, y, stamp: ObjectState(stamp=stamp, position=Vector2(x=x, y=y), yaw=x),
    st.floats(allow_nan=False),
    st.floats(allow_nan=False),
    st.integers(-(2**63), 2**63 - 1),
)
WHOLES = st.builds(
    Whole,
    number=st.integers(-(2**63), 2**63 - 1),
    ratio=st.floats(),
    text=st.text(),
    raw=st.binary(),
    phase=st.sampled_from(Phase),
    grid=ARRAYS,
    inner=SAMPLED,
    many=st.lists(SAMPLED, max_size=2),
    pair=st.tuples(st.floats(), st.integers(0, 100)),
    object=MESSAGES,
    goal=st.none() | st.builds(PushGoal, id=st.integers(0, 2**64 - 1)),
    maybe=st.none() | ARRAYS,
)
EXAMPLE = Whole(
    number=-7,
    ratio=0.5,
    text="chair",
    raw=b"\0\1",
    phase=Phase.PUSHING,
    grid=np.arange(6.0).reshape(2, 3),
    inner=Sampled(np.array([0.1, 0.2])),
    many=[Sampled(np.zeros(1), {"a": np.arange(3)})],
    pair=(1.5, 2),
    object=ObjectState(stamp=3, position=Vector2(x=1, y=2)),
    maybe=np.ones(2),
)


def same(a: object, b: object) -> bool:
    """Compare bit by bit: NaN equals NaN, 0.0 is not -0.0, an int is no float."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, float) and isinstance(b, float):
        return np.float64(a).tobytes() == np.float64(b).tobytes()
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, Sampled | Whole):
        return same(vars(a), vars(b))
    return a == b


@given(WHOLES)
def test_nested_states_come_back_bit_by_bit(whole: Whole) -> None:
    data = state.encode(whole)
    back = state.decode(Whole, data)
    assert same(back, whole)
    assert state.encode(back) == data


@given(ARRAYS)
def test_a_restored_array_is_its_own_and_can_be_written(array: NDArray[np.float64]) -> None:
    back = state.decode(Box, state.encode(Box(array))).array
    assert back.flags.writeable and back.flags.owndata
    assert not np.shares_memory(back, array)


@pytest.mark.parametrize(
    "view",
    [
        np.arange(12.0).reshape(3, 4).T,
        np.asfortranarray(np.arange(12.0).reshape(3, 4)),
        np.arange(12.0)[::-3],
        np.broadcast_to(np.array([1.0, 2.0]), (3, 2)),
    ],
)
def test_arrays_that_do_not_lie_in_one_piece_keep_their_values(view: NDArray[np.float64]) -> None:
    assert np.array_equal(state.decode(Box, state.encode(Box(view))).array, view)


@given(
    seed=st.integers(0, 2**128),
    draws=st.lists(st.sampled_from(["u32", "u64", "normal", "f32", "jump"]), max_size=12),
)
def test_a_restored_generator_goes_on_with_the_very_same_stream(seed: int, draws: list[str]) -> None:
    generator = np.random.default_rng(seed)
    draw: dict[str, Callable[[np.random.Generator], object]] = {
        "u32": lambda g: g.integers(0, 2**32, dtype=np.uint32),  # keeps the other half of a 64-bit word for later
        "u64": lambda g: g.integers(0, 2**64, dtype=np.uint64),
        "normal": lambda g: g.normal(),
        "f32": lambda g: g.random(dtype=np.float32),
        "jump": lambda g: g.permutation(5).tolist(),
    }
    for name in draws:
        draw[name](generator)
    oracle = copy.deepcopy(generator)
    restored = state.decode(Lot, state.encode(Lot(generator))).generator
    assert restored.bit_generator.state == oracle.bit_generator.state
    for name in ("u32", "normal", "u32", "u32", "u64", "f32", "jump"):
        assert draw[name](restored) == draw[name](oracle)


def test_a_half_used_word_is_kept() -> None:
    generator = np.random.default_rng(3)
    generator.integers(0, 2**32, dtype=np.uint32)
    assert generator.bit_generator.state["has_uint32"] == 1
    restored = state.decode(Lot, state.encode(Lot(generator))).generator
    assert restored.bit_generator.state == generator.bit_generator.state


def test_another_bit_generator_is_a_mistake_of_the_service() -> None:
    with pytest.raises(TypeError, match="PCG64"):
        state.encode(Lot(np.random.Generator(np.random.MT19937(1))))


@dataclass
class Table:
    rows: dict[str, int] = field(default_factory=dict)


def test_a_restored_dict_is_walked_in_the_same_order() -> None:
    """A service that walks over a dict must do so alike whether it was restored or not."""
    table = Table({"beta": 1, "alpha": 2})
    assert list(state.decode(Table, state.encode(table)).rows) == ["beta", "alpha"]


@dataclass
class Measure:
    value: float = 0.0


def test_a_whole_number_in_a_float_field_gives_the_same_bytes_after_a_restore() -> None:
    """`self.state.value = 0` passes mypy; the snapshot after a restore must not differ for it."""
    first = state.encode(Measure(0))
    assert state.encode(state.decode(Measure, first)) == first


@pytest.mark.parametrize("value", [np.array([object()]), np.array([{}, None])])
def test_arrays_of_objects_are_refused(value: NDArray[np.float64]) -> None:
    """Their bytes are addresses."""
    with pytest.raises(TypeError):
        state.encode(Box(value))


def test_structured_arrays_come_back_or_are_refused() -> None:
    array = np.zeros(2, [("x", "f8"), ("y", "i4")])
    try:
        data = state.encode(Box(array))
    except TypeError:
        return
    assert state.decode(Box, data).array.dtype == array.dtype


def test_a_type_that_cannot_be_kept_is_named() -> None:
    with pytest.raises(TypeError, match="complex"):
        state.encode(Measure(1j))  # type: ignore[arg-type]


@dataclass
class OneThing:
    a: int = 1
    b: str = ""


def test_a_snapshot_of_another_class_is_refused_even_if_all_fields_have_defaults() -> None:
    with pytest.raises(state.BadSnapshot):
        state.decode(Measure, state.encode(OneThing()))


def test_the_wrong_kind_of_field_is_named() -> None:
    with pytest.raises(state.BadSnapshot, match=r"number"):
        state.decode(Whole, msgspec.msgpack.encode(("Whole", {"number": "seven"})))


def intact_or_refused(kind: type[object], data: bytes) -> None:
    """Decode; anything but a state or `BadSnapshot` escapes and fails the test."""
    try:
        assert isinstance(state.decode(kind, data), kind)
    except state.BadSnapshot as error:
        assert kind.__name__ in str(error)


@given(st.integers(0, len(state.encode(EXAMPLE)) - 1))
def test_a_cut_snapshot_is_refused(length: int) -> None:
    with pytest.raises(state.BadSnapshot):
        state.decode(Whole, state.encode(EXAMPLE)[:length])


@given(st.lists(st.tuples(st.integers(0, len(state.encode(EXAMPLE)) - 1), st.integers(1, 255)), min_size=1, max_size=4))
def test_flipped_bits_never_give_another_error(flips: list[tuple[int, int]]) -> None:
    data = bytearray(state.encode(EXAMPLE))
    for place, mask in flips:
        data[place] ^= mask
    intact_or_refused(Whole, bytes(data))


@given(st.integers(0, len(state.encode(Lot(np.random.default_rng(1)))) - 1), st.integers(1, 255))
def test_flipped_bits_in_a_generator_never_give_another_error(place: int, mask: int) -> None:
    data = bytearray(state.encode(Lot(np.random.default_rng(1))))
    data[place] ^= mask
    intact_or_refused(Lot, bytes(data))


@given(st.binary(max_size=60))
def test_noise_never_gives_another_error(data: bytes) -> None:
    for kind in (Whole, Box, Lot, OneThing):
        try:
            state.decode(kind, data)
        except state.BadSnapshot:
            continue


ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.binary(max_size=40)
    | st.sampled_from(["<f8", "|O", "(2,f8", ",", "f8,f8", "<M8[s]", "S", "V", "object", "<U1"])
    | st.text("(),[]<>|=fiuOSUVM8 ", max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=6,
)


DTYPE_TEXTS = st.sampled_from(["<f8", "|O", "(2,f8", ",", "f8,f8", "<M8[s]", "S", "V", "object", "<U1", "a"])
SHAPES = st.lists(st.integers(-2, 3), max_size=3) | st.lists(st.integers(0, 2**64 - 1), max_size=40) | ANYTHING
ARRAY_LIKE = st.tuples(DTYPE_TEXTS | st.text("(),[]<fiOUSM8", max_size=4) | ANYTHING, SHAPES, st.binary(max_size=17))
GENERATOR_LIKE = st.lists(st.binary(max_size=20) | st.integers(0, 300), min_size=4, max_size=4)


@given(ANYTHING | ARRAY_LIKE | GENERATOR_LIKE)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_wrong_content_of_special_fields_never_gives_another_error(content: object) -> None:
    intact_or_refused(Box, msgspec.msgpack.encode({"array": content}))
    intact_or_refused(Lot, msgspec.msgpack.encode({"generator": content}))


@pytest.mark.parametrize(
    "content",
    [
        ["(2,f8", [1], b""],
        [",", [1], b""],
        ["<f8", [2**63], b""],
        ["<f8", [1], b"1234567"],
        ["|O", [1], b"12345678"],
    ],
)
def test_arrays_that_cannot_be_are_refused(content: list[object]) -> None:
    with pytest.raises(state.BadSnapshot):
        state.decode(Box, msgspec.msgpack.encode({"array": content}))


@pytest.mark.parametrize("word", [b"\xff" * 16, b"\xff" * 40, b"\xff" * 9])
def test_generator_words_out_of_range_are_refused(word: bytes) -> None:
    with pytest.raises(state.BadSnapshot):
        state.decode(Lot, msgspec.msgpack.encode({"generator": [word] * 4}))


def test_bottomless_nesting_is_refused() -> None:
    with pytest.raises(state.BadSnapshot):
        state.decode(Box, b"\x81\xa5array" + b"\x91" * 100_000)


def test_nothing_pickles() -> None:
    """A snapshot or a message must not be able to run code."""
    forbidden = {"pickle", "_pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "copyreg"}
    found = [
        f"{path}:{line} imports {name}"
        for path, tree in sources(*PACKAGES)
        for name, line in imported(tree)
        if name.split(".")[0] in forbidden
    ]
    assert found == []
    loose = [str(path) for path, _ in sources(*PACKAGES) if "allow_pickle=True" in path.read_text()]
    assert loose == []
