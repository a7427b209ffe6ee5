import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.lab.tiny import LATE, session, tiny

from monochord.core.errors import InputError
from monochord.lab import bench
from monochord.lab.bench import Outcome, delays, describe, make, outcome
from monochord.lab.plan import Assignment, ForceSensor
from monochord.lab.render import pieces, render
from monochord.lab.rendering import Rendering
from monochord.sessions import Session, SessionClock, SessionWriter, check, read_session
from monochord.sessions.alignment import align

LOSSY = tiny(force_sensor=ForceSensor(lost=0.01), force_rate=7000.0)
Made = tuple[Outcome, Session, Rendering, dict[str, float]]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    one = session("slide_000", LOSSY)
    outcome = make(one, tmp_path_factory.mktemp("made"))
    return outcome, read_session(outcome.path), render(one), delays(one)


def test_the_audio_comes_back_bit_for_bit_and_late(made: Made) -> None:
    _, there, sound, late = made
    np.testing.assert_array_equal(there.audio.samples, sound.microphones)
    assert there.audio.gaps == ()
    frames = np.array([0.0, 44100.0])
    np.testing.assert_allclose(there.audio.time(frames), frames / 44100.0 + late["audio"], atol=5e-5)
    steps = np.diff(there.audio.device_frame)
    assert set(steps[:-1].tolist()) == {4410}


def test_wrenches_come_late_jittered_counted_and_some_never(made: Made) -> None:
    _, there, sound, late = made
    track = there.readings("wrench")
    np.testing.assert_allclose(track.values, sound.wrench[track.sequence], rtol=0.0, atol=1e-12)
    over = track.time - sound.wrench_time[track.sequence] - late["wrench"]
    assert over.min() > -1e-6
    assert over.min() < 1e-5
    assert 5e-5 < over.mean() < 3e-4
    assert track.missing == pytest.approx(0.01 * len(sound.wrench), rel=0.3)
    assert track.feed.rate == 7000.0


def test_poses_carry_their_own_stamp(made: Made) -> None:
    _, there, sound, late = made
    track = there.readings("pose")
    np.testing.assert_allclose(track.values, sound.pose, rtol=0.0, atol=1e-12)
    sent = (track.device_time - there.clock.epoch_ns) / 1e9
    np.testing.assert_allclose(sent, sound.pose_time, atol=1e-6)
    assert (track.time - sent).min() == pytest.approx(late["pose"], abs=1e-4)


def test_labels_and_events_are_on_the_wrench_s_clock(made: Made) -> None:
    _, there, sound, late = made
    np.testing.assert_allclose(there.labels.time, sound.label_time + late["wrench"], atol=1e-8)
    for name, values in sound.labels.items():
        np.testing.assert_array_equal(there.labels.columns[name], values)
    assert len(there.events) == len(sound.events)
    first, true = there.events[0], sound.events[0]
    assert (first.kind, first.text) == (true.kind, true.text)
    taps = [event.time for event in there.events if event.kind == "tap"]
    np.testing.assert_allclose(
        taps, np.array([e.time for e in sound.events if e.kind == "tap"]) + late["wrench"], atol=1e-8
    )


def test_the_file_tells_all_and_passes_its_check(made: Made) -> None:
    outcome, there, _, late = made
    told = there.description
    assert there.complete
    assert told.simulated
    assert (told.name, told.material, told.radius, told.day) == ("slide_000", "plastic", 5e-3, 0)
    assert json.loads(told.more["delays"]) == late
    assert told.plan.startswith("name")
    assert told.string is not None
    assert check(outcome.path).sound
    assert there.clocks.offsets["realtime"][0] == pytest.approx(session("slide_000").epoch)
    assert np.diff(there.clocks.time) == pytest.approx(1.0, abs=0.11)
    assert outcome.tally.slip > 10
    assert outcome.seconds == pytest.approx(there.audio.samples.shape[1] / 44100)


@pytest.mark.parametrize("seed", range(3))
def test_taps_give_the_delays_away(seed: int, tmp_path: Path) -> None:
    outcome = make(session("hold_000", seed=seed), tmp_path)
    told, late = align(read_session(outcome.path)), delays(session("hold_000", seed=seed))
    assert told.flags == ()
    for stream, within in (("audio", 0.5e-3), ("pose", 4e-3)):
        for offset in told.lateness[stream].offsets:
            assert offset.value == pytest.approx(late[stream] - late["wrench"], abs=within)


def test_delays_are_each_session_s_own_and_in_range() -> None:
    found = [delays(session(name, seed=seed)) for name in ("hold_000", "slide_000") for seed in range(5)]
    for stream in ("audio", "wrench", "pose"):
        values = {late[stream] for late in found}
        low, high = getattr(LATE, stream)
        assert len(values) == 10
        assert low <= min(values) <= max(values) <= high


def test_the_same_seed_writes_the_same_bytes_and_another_does_not(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        (tmp_path / name).mkdir()
    first, again = (make(session("hold_000"), tmp_path / name) for name in ("a", "b"))
    other = make(session("hold_000", seed=1), tmp_path / "c")
    assert first.path.read_bytes() == again.path.read_bytes()
    assert first.checksum == again.checksum != other.checksum


def test_a_session_that_is_there_is_kept(tmp_path: Path) -> None:
    first = make(session("hold_000"), tmp_path)
    stamp = first.path.stat().st_mtime_ns
    again = make(session("hold_000"), tmp_path)
    assert again.kept
    assert not first.kept
    assert (again.checksum, again.tally, again.seconds) == (first.checksum, first.tally, first.seconds)
    assert first.path.stat().st_mtime_ns == stamp
    with pytest.raises(InputError, match="another folder"):
        make(session("hold_000", seed=1), tmp_path)


def test_a_session_that_ends_too_early_is_told_in_one_line(tmp_path: Path) -> None:
    told = describe(session("slide_000"))
    with SessionWriter(tmp_path / "a.mcap", told, SessionClock(epoch_ns=0)) as writer:
        writer.event(0.1, "drivers", "on")
    with pytest.raises(InputError, match=r"a\.mcap \(ends too early\): allowed is a whole one"):
        outcome(tmp_path / "a.mcap")


def test_two_that_make_the_same_session_do_not_mind_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = session("hold_000")

    def overtaken(told: Assignment) -> Iterator[Rendering]:
        yield from pieces(told)
        if told is one:
            make(session("hold_000"), tmp_path)

    monkeypatch.setattr(bench, "pieces", overtaken)
    first = make(one, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["hold_000.mcap"]
    assert read_session(first.path).complete


def test_a_killed_worker_leaves_nothing_that_counts(tmp_path: Path) -> None:
    code = (
        "from pathlib import Path\n"
        "from monochord.lab.bench import make\n"
        "from monochord.lab.plan import assignments\n"
        "from monochord.lab.plans import load_plan\n"
        f"make(assignments(load_plan('small'))[0], Path({str(tmp_path)!r}))\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    deadline = time.monotonic() + 60.0
    while not [part for part in tmp_path.glob("*.part-*") if part.stat().st_size > 2_000_000]:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not list(tmp_path.glob("*.mcap"))
    (part,) = tmp_path.glob("*.part-*")
    small = session("hold_000")
    part.rename(tmp_path / part.name.replace("hold_000", small.name))
    make(small, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["hold_000.mcap"]


def test_the_description_names_the_motion_that_is_repeated() -> None:
    told = describe(session("hold_000"))
    assert told.more["protocol"] == "hold"
    assert told.day == 1
    assert {feed.stream for feed in told.feeds} == {"wrench", "pose"}
