"""A session recorded while it is estimated, read back by our own reader and by others."""

import json
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from monochord.core.errors import InputError
from monochord.core.types import Block, Estimate, Prediction, Signal, StreamHealth, Tracked
from monochord.core.windows import windows
from monochord.live.events import Event
from monochord.live.health import Note
from monochord.live.sinks.base import Run, Update
from monochord.live.sinks.mcap import Mcap
from monochord.sessions import SessionReader, check, read_session
from monochord.sessions.exports.foxglove import Foxglove

RATE = 44100
SIGNAL = Signal(sample_rate=RATE, channels=2)
NOISE = np.random.default_rng(3).standard_normal((2, RATE)).astype(np.float32)
POSITION = Estimate(value=0.12, std=2e-4, unit="m")
KEYS = ("column", "estimate", "key")
NOTHING = Estimate.abstain("m", "no contact")


def updates(blocks: list[Block], began: float | None) -> list[Update]:
    cut = windows(blocks, size=4410, hop=441, sample_rate=RATE)
    return [
        Update(
            prediction=Prediction(
                start=window.start, time=window.start / RATE, estimates={"position": POSITION}, latency=1e-3
            ),
            window=window,
            health=StreamHealth(),
            truth={},
            skipped=0,
            adc_time=None if began is None else began + window.start / RATE,
            at_hand=time.monotonic() if began is None else began + (window.start + 4410) / RATE,
        )
        for window in cut
    ]


def written(path: Path, given: list[Update]) -> SessionReader:
    with Mcap(path=str(path)).open(Run(signal=SIGNAL)) as writer:
        for each in given:
            writer.write(each)
    assert check(path).sound
    return read_session(path)


@pytest.mark.parametrize("timed", [True, False])
def test_every_frame_is_there_once(tmp_path: Path, *, timed: bool) -> None:
    began = time.monotonic() - 5.0
    session = written(tmp_path / "a.mcap", updates([Block(samples=NOISE, start=0)], began if timed else None))
    np.testing.assert_array_equal(session.audio.samples, NOISE)
    assert session.audio.gaps == ()
    track = session.readings("estimates")
    np.testing.assert_allclose(track.time, 0.1 + np.arange(91) / 100, atol=1e-6)
    assert set(track.column("position")) == {0.12}
    assert set(track.column("position_std")) == {2e-4}
    if timed:
        wall = session.clock.epoch_ns * 1e-9
        assert wall == pytest.approx(time.time() - (time.monotonic() - began), abs=0.5)


def test_lost_frames_and_skipped_windows_are_gaps(tmp_path: Path) -> None:
    blocks = [
        Block(samples=NOISE[:, :10000], start=0),
        Block(samples=NOISE[:, 10700:], start=10700, dropped=700),
    ]
    given = [each for each in updates(blocks, 100.0) if not 30000 < each.window.start < 36000]
    session = written(tmp_path / "a.mcap", given)
    last = max(each.window.start for each in given if each.window.start <= 30000) + 4410
    first = min(each.window.start for each in given if each.window.start >= 36000)
    assert session.audio.gaps == ((10000, 10700), (last, first))
    there = np.ones(RATE, bool)
    there[10000:10700] = there[last:first] = False
    np.testing.assert_array_equal(session.audio.samples, NOISE * there)


def test_events_notes_and_reasons_are_events_of_the_session(tmp_path: Path) -> None:
    given = updates([Block(samples=NOISE, start=0)], 100.0)
    hum = Note(key="hum", level="warning", sentence="Mains hum.", remedy="Ground it.", since=0.2)
    touch = Event(name="contact", on=True, time=0.35, delay=0.02, confidence=0.9)
    for k in (20, 21, 22):
        away = {"position": NOTHING, "force": replace(NOTHING, reason="sliding")}
        given[k] = replace(given[k], prediction=replace(given[k].prediction, estimates=away), notes=(hum,))
    given[27] = replace(given[27], events=(touch,))
    session = written(tmp_path / "a.mcap", given)
    seen = {(event.kind, event.text, *(event.data.get(key) for key in KEYS)) for event in session.events}
    late = {event.text for event in session.events if event.kind == "left_out"}.pop()
    assert seen == {
        ("left_out", late, "force", None, None),
        ("left_out", late, "force_std", None, None),
        ("abstention", "no contact", None, "position", None),
        ("abstention", "sliding", None, "force", None),
        ("abstention", "", None, "position", None),
        ("note", "Mains hum.", None, None, "hum"),
        ("note_ends", "Mains hum.", None, None, "hum"),
        ("contact_begins", "", None, None, None),
    }
    assert len(session.events) == len(seen)
    (begins,) = (event for event in session.events if event.kind == "contact_begins")
    assert begins.time == pytest.approx(0.35, abs=1e-6)
    assert begins.data == {"delay": 0.02, "confidence": 0.9}
    position = session.readings("estimates").column("position")
    assert np.flatnonzero(np.isnan(position)).tolist() == [20, 21, 22]


def test_what_is_known_to_be_true_and_followed_is_beside_it(tmp_path: Path) -> None:
    given = [
        replace(
            each,
            truth={"contact": 1.0},
            tracked=Tracked(estimates={"position": POSITION}),
            decided={"slip": False},
        )
        for each in updates([Block(samples=NOISE, start=0)], 100.0)
    ]
    session = written(tmp_path / "a.mcap", given)
    assert session.description.simulated
    track = session.readings("estimates")
    assert set(track.column("true_contact")) == {1.0}
    assert np.isnan(track.column("true_position")).all()
    assert set(track.column("tracked_position")) == {0.12}
    assert set(track.column("decided_slip")) == {0.0}


def test_a_quantity_and_its_error_have_one_unit(tmp_path: Path) -> None:
    force = Estimate(value=0.5, std=0.1, unit="N")
    given = [
        replace(
            each,
            prediction=replace(each.prediction, estimates={"position": POSITION, "force": force}),
            tracked=Tracked(estimates={"position": POSITION, "force": force}),
            truth={"contact": 1.0},
        )
        for each in updates([Block(samples=NOISE[:, :8820], start=0)], 100.0)
    ]
    (feed,) = written(tmp_path / "a.mcap", given).description.feeds
    unit = dict(zip(feed.columns, feed.units, strict=True))
    for prefix in ("", "tracked_"):
        for name, own in (("position", "m"), ("force", "N")):
            assert unit[f"{prefix}{name}"] == unit[f"{prefix}{name}_std"] == own
    assert (unit["true_position"], unit["true_force"], unit["latency"]) == ("m", "N", "s")
    assert unit["true_contact"] == "1"


def test_a_session_without_a_window_is_a_whole_one(tmp_path: Path) -> None:
    assert written(tmp_path / "a.mcap", []).audio.samples.shape[1] == 0


def test_it_plays_again_through_the_same_loop(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from monochord.cli import run

    out = str(tmp_path / "out.mcap")
    twin = ["--source", "twin", "--set", "source.speed=0", "--seconds", "1.5"]
    assert run(["live", "demo", *twin, "--json", "--sink", f"mcap={out}"]) == 0
    first = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert run(["live", "demo", out, "--json"]) == 0
    again = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["position"] for line in again] == [line["position"] for line in first]
    assert [line["contact"] for line in again] == [line["contact"] for line in first]
    stored = read_session(Path(out)).readings("estimates").column("contact")
    told = [math.nan if line["contact"] is None else line["contact"] for line in first]
    np.testing.assert_array_equal(stored, told)  # where contact abstains, both are NaN


def test_it_is_exported_for_foxglove_with_a_field_for_each_estimate(tmp_path: Path) -> None:
    session = written(tmp_path / "a.mcap", updates([Block(samples=NOISE, start=0)], 100.0))
    Foxglove().write([session], tmp_path / "out")
    with AnyReader([tmp_path / "out" / "a"]) as bag:
        estimates = [
            bag.deserialize(data, connection.msgtype)
            for connection, _, data in bag.messages()
            if connection.topic == "/estimates"
        ]
    rows: list[Any] = estimates
    assert [row.position for row in rows] == [0.12] * 91
    assert [row.position_std for row in rows] == [2e-4] * 91


def test_a_file_that_exists_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("mine")
    sink = Mcap(path=str(tmp_path / "a.mcap"))
    with pytest.raises(InputError, match=r"a\.mcap"), sink.open(Run(signal=SIGNAL)):
        pass
    assert (tmp_path / "a.mcap").read_text() == "mine"
