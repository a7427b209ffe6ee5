from dataclasses import replace
from typing import Any

import pytest

from monochord.capture.recording.counters import FeedState, Level, RecordingState
from monochord.capture.recording.disk import DiskSpace
from monochord.capture.recording.watch import RecordingWatch
from monochord.core.types import Feed, InstrumentHealth, StreamHealth
from monochord.sessions import Event

SPACE = DiskSpace(free=1e12, size=1e6, left=1e6)
START = RecordingState(
    time=100.0,
    elapsed=0.0,
    frames=0,
    dropped=0,
    gaps=0,
    silent=0.0,
    health=StreamHealth(),
    levels=(Level(), Level()),
    feeds=(),
    space=SPACE,
)
FEED = FeedState(
    name="net_ft",
    feed=Feed(stream="wrench", columns=("fz",), units=("N",)),
    health=InstrumentHealth(),
    values={},
)


def at(time: float, **more: Any) -> RecordingState:
    return replace(START, time=100.0 + time, elapsed=time, **more)


def kinds(notices: list[Event]) -> list[str]:
    return [notice.kind for notice in notices]


def test_a_quiet_recording_has_no_events() -> None:
    watch = RecordingWatch(600.0)
    assert not [notice for k in range(100) for notice in watch.look(at(0.1 * k, feeds=(FEED,)))]


def test_a_gap_is_reported_with_its_frames() -> None:
    watch = RecordingWatch(600.0)
    watch.look(at(0.0))
    (notice,) = watch.look(at(0.1, gaps=1, dropped=44100))
    assert (notice.kind, notice.time) == ("gap", 100.1)
    assert notice.data == {"stream": "audio", "gaps": 1, "frames": 44100}


def test_a_microphone_that_picks_up_nothing_is_reported_until_it_does() -> None:
    watch = RecordingWatch(600.0)

    def look(time: float, *quiet: float) -> list[Event]:
        return watch.look(at(time, levels=tuple(Level(quiet=each) for each in quiet)))

    assert not look(0.9, 0.9, 0.9)
    (both,) = look(1.0, 1.0, 1.0)
    assert (both.kind, both.data) == ("silence", {"stream": "audio", "microphones": "1, 2"})
    assert not look(1.1, 1.1, 1.1)
    (one,) = look(1.2, 0.0, 1.2)
    assert (one.kind, one.data["microphones"]) == ("sound", "1")
    (again,) = look(2.5, 1.3, 2.5)
    assert (again.kind, again.data["microphones"]) == ("silence", "1")


def test_events_of_one_kind_are_a_second_apart_and_none_is_forgotten() -> None:
    watch = RecordingWatch(600.0)
    looks = [watch.look(at(0.1 * k, gaps=k, dropped=64 * k)) for k in range(1, 26)]
    looks.append(watch.look(at(2.51, gaps=26, dropped=64 * 26), last=True))
    reported = [notice for look in looks for notice in look]
    assert [round(notice.time - 100.0, 2) for notice in reported] == [0.1, 1.1, 2.1, 2.51]
    assert sum(float(notice.data["gaps"]) for notice in reported) == 26
    assert sum(float(notice.data["frames"]) for notice in reported) == 64 * 26


@pytest.mark.parametrize(
    ("kind", "worse"),
    [
        ("xrun", {"health": StreamHealth(xruns=2)}),
        ("reconnect", {"health": StreamHealth(reconnects=1)}),
        ("clipping", {"levels": (Level(clipped=5, clipping=True), Level())}),
        ("nan", {"levels": (Level(), Level(not_numbers=7))}),
        ("missing", {"feeds": (replace(FEED, health=InstrumentHealth(missing=3)),)}),
        ("out_of_order", {"feeds": (replace(FEED, health=InstrumentHealth(out_of_order=3)),)}),
        ("reconnect", {"feeds": (replace(FEED, health=InstrumentHealth(reconnects=1)),)}),
        ("fault", {"feeds": (replace(FEED, faulty=4, status=0x80010000),)}),
        ("uncounted", {"time_shift": 0.012}),
        ("clock_doubt", {"implausible_age": -1.0}),
        ("disk_low", {"space": DiskSpace(free=1e8, size=1e6, left=599.0)}),
        ("disk_slow", {"blocked": 0.3}),
    ],
)
def test_what_gets_worse_is_reported_once(kind: str, worse: dict[str, Any]) -> None:
    watch = RecordingWatch(600.0)
    watch.look(at(1.9, feeds=(FEED,)))
    (notice,) = watch.look(at(2.0, **{"feeds": (FEED,), **worse}))
    assert notice.kind == kind
    assert not watch.look(at(10.0, **{"feeds": (FEED,), **worse}))


def test_a_fault_has_the_status_word() -> None:
    (notice,) = RecordingWatch(600.0).look(at(1.0, feeds=(replace(FEED, faulty=4, status=0x80010000),)))
    assert notice.data["status"] == 0x80010000


@pytest.mark.parametrize("stream", ["audio", "net_ft"])
def test_silence_is_reported_when_it_begins_and_when_it_ends(stream: str) -> None:
    def silent(time: float, span: float) -> RecordingState:
        feed = replace(FEED, silent=span if stream == "net_ft" else 0.0)
        return at(time, feeds=(feed,), silent=span if stream == "audio" else 0.0)

    watch = RecordingWatch(600.0)
    assert kinds(watch.look(silent(1.0, 0.0))) == []
    (first,) = watch.look(silent(1.6, 0.6))
    assert (first.kind, first.data) == ("silent", {"stream": stream, "seconds": 0.6})
    assert not watch.look(silent(3.0, 2.0))
    (back,) = watch.look(silent(4.0, 0.0))
    assert (back.kind, back.data["stream"]) == ("back", stream)
    assert back.data["seconds"] == pytest.approx(3.0)


def test_a_disk_with_space_again_may_warn_again() -> None:
    watch = RecordingWatch(600.0)
    looks = [
        watch.look(at(t, space=replace(SPACE, left=left))) for t, left in ((2, 1), (3, 1), (4, 1e6), (5, 1))
    ]
    assert [kinds(look) for look in looks] == [["disk_low"], [], [], ["disk_low"]]


@pytest.mark.parametrize("step", [-3600.0, 0.06])
def test_a_clock_that_was_set_is_reported_with_its_step(step: float) -> None:
    watch = RecordingWatch(600.0)
    assert not watch.clocks(1.0, {"realtime": 1e9, "monotonic_raw": 0.1})
    assert not watch.clocks(2.0, {"realtime": 1e9 + 0.04, "monotonic_raw": 0.1})
    (notice,) = watch.clocks(3.0, {"realtime": 1e9 + 0.04 + step, "monotonic_raw": 0.1})
    assert (notice.kind, notice.data["clock"]) == ("clock_step", "realtime")
    assert notice.data["seconds"] == pytest.approx(step, abs=1e-6)
    assert not watch.clocks(4.0, {"realtime": 1e9 + 0.04 + step, "monotonic_raw": 0.1})
