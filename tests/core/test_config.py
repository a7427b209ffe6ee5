import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monochord.core.config import dump_toml, from_tree, load_toml, override, table, to_tree
from monochord.core.errors import InputError


class Window(Enum):
    HANN = "hann"
    FLAT = "flat"


@dataclass(frozen=True, slots=True, kw_only=True)
class Framing:
    length: float = 0.1
    hop: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    string: str
    partials: int = 16
    side: Literal["near", "far"] = "far"
    shape: Window = Window.HANN
    take: Path = Path("take.wav")
    framing: Framing = Framing()
    limit: float | None = None
    quiet: bool = False
    calibration: tuple[tuple[float, float], ...] = ()
    layers: tuple[Framing, ...] = ()
    by_name: Mapping[str, Framing] = field(default_factory=dict)
    fallback: Framing | None = None

    def __post_init__(self) -> None:
        if self.partials < 1:
            raise InputError(f"{self.partials} partials", "1 or more")
        if self.partials > 100:
            message = "at most 100 partials"
            raise ValueError(message)


def refused(tree: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        from_tree(Reader, {"string": "e4", **tree}, where="part")
    line = str(caught.value)
    assert "\n" not in line
    assert "`" not in line
    assert "msgspec" not in line
    return line


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"partails": 3}, "part.partails 'partials'"),
    ({"framing": {"hopp": 1}}, "part.framing.hopp length 'hop'"),
    ({"fallback": {"hopp": 1}}, "part.fallback.hopp length"),
    ({"layers": [{}, {"hopp": 1}]}, "part.layers[1].hopp length"),
    ({"by_name": {"a": {"hopp": 1}}}, "part.by_name.a.hopp length"),
    ({"partials": "many"}, "part.partials many whole"),
    ({"partials": 2.5}, "part.partials 2.5 whole"),
    ({"partials": True}, "part.partials True whole"),
    ({"framing": {"hop": "q"}}, "part.framing.hop q number"),
    ({"framing": 3}, "part.framing 3 table length"),
    ({"side": "fat"}, "part.side fat near 'far'"),
    ({"shape": "han"}, "part.shape han flat 'hann'"),
    ({"take": 7}, "part.take 7 path"),
    ({"limit": "low"}, "part.limit low number"),
    ({"limit": math.nan}, "part.limit nan number"),
    ({"limit": "nan"}, "part.limit nan number"),
    ({"framing": {"hop": "nan"}}, "part.framing.hop nan number"),
    ({"quiet": "yes"}, "part.quiet yes true"),
    ({"string": 4}, "part.string 4 text"),
    ({"calibration": [[1, 2], [1, "x"]]}, "part.calibration[1][1] x number"),
    ({"calibration": [[1]]}, "part.calibration[0] [1] 2"),
    ({"calibration": 5}, "part.calibration 5 list"),
    ({"by_name": {"a": {"hop": "q"}}}, "hop q number"),
    ({"partials": 0}, "0 partials 1"),
    ({"partials": 101}, "100 partials"),
]
"""Values that cannot be, and what the line names: where, what was given, what was expected."""


@pytest.mark.parametrize(("tree", "words"), REFUSED)
def test_what_cannot_be_is_refused_by_where_it_stands(tree: dict[str, Any], words: str) -> None:
    line = refused(tree)
    assert not [word for word in words.split() if word not in line], line


def test_a_field_left_out_is_named() -> None:
    with pytest.raises(InputError, match=r"part\.string"):
        from_tree(Reader, {}, where="part")
    with pytest.raises(InputError, match="'string'"):
        from_tree(Reader, {})


def test_text_is_read_as_the_field_wants_it() -> None:
    tree = {"string": "7", "partials": "3", "quiet": "true", "limit": "inf", "shape": "flat"}
    made = from_tree(Reader, tree)
    assert made == Reader(string="7", partials=3, quiet=True, limit=math.inf, shape=Window.FLAT)


finite = st.floats(allow_nan=False)
framings = st.builds(Framing, length=finite, hop=finite)
readers = st.builds(
    Reader,
    string=st.text(),
    partials=st.integers(1, 100),
    side=st.sampled_from(["near", "far"]),
    shape=st.sampled_from(Window),
    take=st.sampled_from([Path("a b/c.wav"), Path("/d")]),
    framing=framings,
    limit=st.none() | finite,
    quiet=st.booleans(),
    calibration=st.lists(st.tuples(finite, finite)).map(tuple),
    layers=st.lists(framings, max_size=3).map(tuple),
    by_name=st.dictionaries(st.text(min_size=1), framings, max_size=3),
    fallback=st.none() | framings,
)


@settings(max_examples=40)
@given(readers)
def test_the_resolved_copy_gives_the_same_configuration(reader: Reader) -> None:
    assert from_tree(Reader, tomllib.loads(dump_toml(to_tree(reader)))) == reader


names = st.from_regex(r"[a-z][a-z0-9_]{0,5}", fullmatch=True)
values = st.integers(-(2**63), 2**63 - 1) | st.booleans() | finite


@given(st.lists(names, min_size=1, max_size=4), values)
def test_an_override_sets_its_value_and_leaves_the_rest(path: list[str], value: float) -> None:
    before: dict[str, Any] = {"Other": {"value": 1}}
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    node: Any = override(before, [f"{'.'.join(path)}={text}"])
    assert node["Other"] == {"value": 1}
    for name in path:
        node = node[name]
    assert node == value
    assert type(node) is type(value)
    assert before == {"Other": {"value": 1}}


def test_later_overrides_win() -> None:
    assert override({}, ["a.b=1", "a.c=2", "a.b=3"]) == {"a": {"b": 3, "c": 2}}


@pytest.mark.parametrize(
    ("text", "value"),
    [("[1, 2]", [1, 2]), ("a b", "a b"), ("", ""), ("x=y", "x=y"), ('"3"', "3"), ("1\nb = 2", "1\nb = 2")],
)
def test_an_override_is_a_toml_value_or_plain_text(text: str, value: object) -> None:
    assert override({}, [f"a={text}"]) == {"a": value}


@pytest.mark.parametrize("assignment", ["hop", "=1", "a..b=1", ".a=1", "a.=1", "set.x=1"])
def test_an_override_that_is_malformed_or_goes_through_a_value_is_refused(assignment: str) -> None:
    with pytest.raises(InputError):
        override({"set": 1}, [assignment])


def test_toml_is_read(tmp_path: Path) -> None:
    path = tmp_path / "live.toml"
    path.write_text("[framing]\nhop = 0.02\n", encoding="utf-8")
    assert load_toml(path) == {"framing": {"hop": 0.02}}


@pytest.mark.parametrize(
    "content",
    [b"hop = ", b"\xff\xfe", b"a = 1\na = 2", b"a = " + b"9" * 5000, b"a = " + b"[" * 5000, None],
    ids=["no value", "no text", "twice", "long", "nested", "absent"],
)
def test_what_is_not_toml_is_refused_by_its_file(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "live.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"live\.toml.*TOML"):
        load_toml(path)
    with pytest.raises(InputError):
        load_toml(tmp_path)


def test_an_override_beyond_what_python_reads_is_refused() -> None:
    for text in ("9" * 5000, "0x" + "f" * 5000, "[" * 5000):
        line = refused(override({}, [f"partials={text}"]))
        assert "option 'part" in line
        assert len(line) < 200
    with pytest.raises(InputError, match="NAME"):
        override({}, [".".join("a" * 5000) + "=1"])


def test_bytes_that_are_no_text_are_refused() -> None:
    assert "UTF-8" in refused({"string": "take\udcff"})
    assert "UTF-8" in refused({"by_name": {"\ud800": {}}})


def test_what_a_dataclass_refuses_is_no_cause_of_itself() -> None:
    with pytest.raises(InputError, match="0 partials") as caught:
        from_tree(Reader, {"string": "e4", "partials": 0})
    seen: list[BaseException] = []
    error: BaseException | None = caught.value
    while error is not None:
        assert error not in seen
        seen.append(error)
        error = error.__cause__ or error.__context__


def test_what_is_no_table_is_refused() -> None:
    with pytest.raises(InputError, match=r"source.*5.*table"):
        table({"source": 5}, "source")
