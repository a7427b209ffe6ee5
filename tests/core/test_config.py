import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Literal

import pytest
from hypothesis import given
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


@pytest.mark.parametrize(
    ("tree", "line"),
    [
        ({"partails": 3}, "option 'part.partails': allowed is string, partials,"),
        ({"partails": 3}, "did you mean 'partials'?"),
        ({"framing": {"hopp": 1}}, "option 'part.framing.hopp': allowed is length, hop; did you mean 'hop'?"),
        ({"fallback": {"hopp": 1}}, "option 'part.fallback.hopp': allowed is length, hop"),
        ({"layers": [{}, {"hopp": 1}]}, "option 'part.layers[1].hopp': allowed is length, hop"),
        ({"by_name": {"a": {"hopp": 1}}}, "option 'part.by_name.a.hopp': allowed is length, hop"),
        ({"partials": "many"}, "option 'part.partials' = 'many': allowed is a whole number"),
        ({"partials": 2.5}, "option 'part.partials' = 2.5: allowed is a whole number"),
        ({"partials": True}, "option 'part.partials' = True: allowed is a whole number"),
        ({"framing": {"hop": "q"}}, "option 'part.framing.hop' = 'q': allowed is a number"),
        ({"framing": 3}, "option 'part.framing' = 3: allowed is a table of length, hop"),
        ({"side": "fat"}, "option 'part.side' = 'fat': allowed is near, far; did you mean 'far'?"),
        ({"shape": "han"}, "option 'part.shape' = 'han': allowed is hann, flat; did you mean 'hann'?"),
        ({"take": 7}, "option 'part.take' = 7: allowed is a path"),
        ({"limit": "low"}, "option 'part.limit' = 'low': allowed is a number or nothing"),
        ({"limit": math.nan}, "option 'part.limit' = nan: allowed is a number or nothing"),
        ({"limit": "nan"}, "option 'part.limit' = nan: allowed is a number or nothing"),
        ({"framing": {"hop": "nan"}}, "option 'part.framing.hop' = nan: allowed is a number"),
        ({"quiet": "yes"}, "option 'part.quiet' = 'yes': allowed is true or false"),
        ({"string": 4}, "option 'part.string' = 4: allowed is text"),
        ({"calibration": [[1, 2], [1, "x"]]}, "option 'part.calibration[1][1]' = 'x': allowed is a number"),
        (
            {"calibration": [[1]]},
            "option 'part.calibration[0]' = [1]: allowed is a list of 2: a number, a number",
        ),
        ({"calibration": 5}, "option 'part.calibration' = 5: allowed is a list, each a list of 2"),
        ({"by_name": {"a": {"hop": "q"}}}, "'q': allowed is a number"),
        ({"partials": 0}, "0 partials: allowed is 1 or more"),
        ({"partials": 101}, "at most 100 partials"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tree: dict[str, Any], line: str) -> None:
    assert line in refused(tree)


def test_a_field_left_out_is_named() -> None:
    with pytest.raises(InputError, match=r"^option 'part\.string' \(not given\): allowed is text$"):
        from_tree(Reader, {}, where="part")
    with pytest.raises(InputError, match=r"^option 'string' \(not given\)"):
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


@pytest.mark.parametrize("assignment", ["hop", "=1", "a..b=1", ".a=1", "a.=1"])
def test_a_malformed_override_is_refused(assignment: str) -> None:
    with pytest.raises(InputError, match=r"allowed is NAME\.NAME=VALUE"):
        override({}, [assignment])


def test_an_override_through_a_value_is_refused() -> None:
    with pytest.raises(InputError, match="allowed is a table at 'hop'"):
        override({"hop": 1}, ["hop.x=1"])


def test_toml_is_read(tmp_path: Path) -> None:
    path = tmp_path / "live.toml"
    path.write_text("[framing]\nhop = 0.02\n", encoding="utf-8")
    assert load_toml(path) == {"framing": {"hop": 0.02}}


@pytest.mark.parametrize("content", [b"hop = ", b"\xff\xfe", b"a = 1\na = 2"])
def test_what_is_not_toml_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "live.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"^configuration .*live\.toml .*: allowed is TOML text$"):
        load_toml(path)


@pytest.mark.parametrize("name", ["absent.toml", "."])
def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="allowed is a readable TOML file"):
        load_toml(tmp_path / name)


def test_toml_beyond_what_python_reads_is_refused(tmp_path: Path) -> None:
    for number, text in enumerate(("a = " + "9" * 5000, "a = " + "[" * 5000)):
        file = tmp_path / f"{number}.toml"
        file.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match="TOML text"):
            load_toml(file)


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
    with pytest.raises(InputError, match="option 'source' = 5: allowed is a table"):
        table({"source": 5}, "source")
