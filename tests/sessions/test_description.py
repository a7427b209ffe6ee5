"""What a session is said to be: nothing is written that no reader reads."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.sessions.made import RATE, block, description

from monochord.core.errors import InputError
from monochord.core.types import Feed
from monochord.sessions import Description, SessionClock, SessionWriter, check, read_session, recover

ROOM: dict[str, Any] = {"stream": "room", "columns": ("temperature",), "units": ("K",)}


def room(**more: Any) -> Callable[[], tuple[Feed, ...]]:
    return lambda: (Feed(**{**ROOM, **more}),)


def described(**more: Any) -> Description:
    return description(**{name: each() if callable(each) else each for name, each in more.items()})


def _nested(depth: int) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    for _ in range(depth):
        tree = {"inner": tree}
    return tree


CIRCULAR: dict[str, Any] = {}
CIRCULAR["again"] = CIRCULAR
REFUSED: dict[str, dict[str, Any]] = {
    "a number in more": {"more": {"temperature": 21.5}},
    "a table in more": {"more": {"room": {"temperature": "warm"}}},
    "a number as key": {"more": {1: "one"}},
    "a seed beyond any": {"seed": 10**30},
    "radius nan": {"radius": math.nan},
    "radius beyond a float": {"radius": 10**400},
    "half a day": {"day": 1.5},
    "day true": {"day": True},
    "a number as material": {"material": 3},
    "a number as name": {"name": 5},
    "bytes as notes": {"notes": b"loud"},
    "half a surrogate in notes": {"notes": "\ud800"},
    "half a surrogate as key": {"more": {"\ud800": "here"}},
    "half a surrogate in plan": {"plan": "\udc80"},
    "too long": {"notes": "x" * 5_000_000},
    "too deep": {"sensor": _nested(60)},
    "circular": {"sensor": CIRCULAR},
    "too many digits": {"sensor": {"serial": 10**5000}},
    "a set": {"sensor": {"channels": {1, 2}}},
    "an array": {"sensor": {"gains": np.zeros(2)}},
    "gain nan": {"preamp_gains": (math.nan,)},
    "versions as numbers": {"versions": {"monochord": 1}},
    "a fraction of a rate": {"sample_rate": 44100.5},
    "a name of a string": {"string": "prototype"},
    "simulated perhaps": {"simulated": "perhaps"},
    "feed: a number in details": {"feeds": room(details={"serial": 12345})},
    "feed: a table in details": {"feeds": room(details={"at": {"x": "1"}})},
    "feed: rate nan": {"feeds": room(rate=math.nan)},
    "feed: rate as words": {"feeds": room(rate="often")},
    "feed: ticks beyond a float": {"feeds": room(ticks=10**400)},
    "feed: a number as column": {"feeds": room(columns=(3,))},
    "feed: no unit": {"feeds": room(units=(None,))},
    "feed: a number as stream": {"feeds": room(stream=5)},
    "feed: half a surrogate": {"feeds": room(columns=("\ud800",))},
}
READ: dict[str, dict[str, Any]] = {
    "NumPy scalars": {"day": np.int64(3), "radius": np.float32(0.5), "simulated": np.bool_(True)},
    "a whole float as rate": {"sample_rate": 44100.0},
    "radius inf": {"radius": math.inf},
    "NaN in the sensor": {"sensor": {"gauge": math.nan}},
    "a path": {"notes": Path("notes.txt")},
    "text as columns": {"feeds": room(columns="x", units="m")},
    "zero bytes": {"notes": "a\0b", "feeds": room(columns=("a\0b",))},
    "long names": {"notes": "x" * 3_000_000, "feeds": room(columns=("x" * 100_000,))},
    "a long stream": {"feeds": room(stream="x" * 70_000)},
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_reader_reads_is_refused_before_there_is_a_file(case: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with pytest.raises(InputError):
        SessionWriter(path, described(**REFUSED[case]))
    assert not path.exists()


@pytest.mark.parametrize("case", READ)
def test_what_is_written_is_read(case: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with SessionWriter(path, described(**{"feeds": (), **READ[case]})) as writer:
        writer.audio(block(0, np.zeros((2, RATE // 10), np.float32), start=0))
    assert read_session(path).description.dump() == writer.description.dump()
    assert check(path).sound, check(path).faults
    assert not recover(path).repaired


def test_a_clock_of_numpy_numbers_is_read(tmp_path: Path) -> None:
    path, clock = tmp_path / "a.mcap", SessionClock(epoch_ns=np.int64(10**18), origin=np.float64(2.5))  # pyright: ignore[reportArgumentType]
    with SessionWriter(path, Description(name="a", sample_rate=RATE), clock) as writer:
        writer.event(2.75, "mark")
    session = read_session(path)
    assert (session.clock.epoch_ns, session.clock.origin) == (10**18, 2.5)
    assert session.events[0].time == 0.25


@pytest.mark.parametrize("text", ["\ud800", "a\ud800b"])
def test_an_event_that_no_reader_reads_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.mcap"
    with SessionWriter(path, Description(name="a", sample_rate=RATE)) as writer:
        with pytest.raises(InputError):
            writer.event(writer.clock.origin, "mark", text)
        with pytest.raises(InputError):
            writer.event(writer.clock.origin, "mark", "", note=text)
        writer.event(writer.clock.origin, "mark", "kept", number=math.nan)
    assert [event.text for event in read_session(path).events] == ["kept"]
    assert check(path).sound


@pytest.mark.parametrize("state", ["whole", "cut off", "damaged"])
@pytest.mark.parametrize("version", ["9", "2", "10", "1.1"])
def test_a_session_of_a_later_format_is_left_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str, state: str
) -> None:
    path = tmp_path / "a.mcap"
    monkeypatch.setattr("monochord.sessions._layout.FORMAT", version)
    with SessionWriter(path, description(feeds=())) as writer:
        writer.audio(block(0, np.ones((2, RATE), np.float32), start=0))
        writer.flush()
        cut = path.read_bytes()
    monkeypatch.undo()
    if state == "cut off":
        path.write_bytes(cut)
    elif state == "damaged":
        whole = bytearray(path.read_bytes())
        whole[-5000:-4000] = bytes(1000)
        path.write_bytes(whole)
    before = path.read_bytes()
    for use in (read_session, check, recover):
        with pytest.raises(InputError, match=rf"format {version}, written by a later version"):
            use(path)
    assert path.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir()] == ["a.mcap"]


def test_a_damaged_format_is_mended(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with SessionWriter(path, description(feeds=())) as writer:
        writer.audio(block(0, np.ones((2, RATE), np.float32), start=0))
    whole = path.read_bytes()
    assert whole.count(b"format\x01\0\0\0001") == 1
    path.write_bytes(whole.replace(b"format\x01\0\0\0001", b"format\x01\0\0\0q"))
    assert recover(path).repaired
    assert path.read_bytes() == whole
