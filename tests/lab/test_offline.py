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
from monochord.core.types import Floats
from monochord.datasets.build import build_dataset
from monochord.lab import offline
from monochord.lab.assignment import Assignment
from monochord.lab.offline import (
    CollectedSession,
    Transport,
    WindowCounts,
    arrive,
    count_windows,
    delays,
    describe,
    make,
    summarise,
)  # fmt: skip
from monochord.lab.plan import ForceSensor, Group
from monochord.lab.render import Rendering, pieces, render
from monochord.sessions import SessionClock, SessionReader, SessionWriter, check, read_session
from monochord.sessions.alignment import align

LOSSY = tiny(force_sensor=ForceSensor(lost=0.01), force_rate=7000.0)
Made = tuple[CollectedSession, SessionReader, Rendering, dict[str, float]]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    one = session("slide_000", LOSSY)
    result = make(one, tmp_path_factory.mktemp("made"))
    return result, read_session(result.path), render(one), delays(one)


def test_the_audio_comes_back_bit_for_bit_and_late(made: Made) -> None:
    _, session_, sound, delay = made
    np.testing.assert_array_equal(session_.audio.samples, sound.microphones)
    assert session_.audio.gaps == ()
    frames = np.array([0.0, 44100.0])
    np.testing.assert_allclose(session_.audio.time(frames), frames / 44100.0 + delay["audio"], atol=5e-5)
    steps = np.diff(session_.audio.device_frame)
    assert set(steps[:-1].tolist()) == {4410}


def test_wrenches_come_late_jittered_counted_and_some_never(made: Made) -> None:
    _, session_, sound, delay = made
    track = session_.readings("wrench")
    np.testing.assert_allclose(track.values, sound.wrench[track.sequence], rtol=0.0, atol=1e-12)
    over = track.time - sound.wrench_time[track.sequence] - delay["wrench"]
    assert over.min() > -1e-6
    assert over.min() < 1e-5
    assert 5e-5 < over.mean() < 3e-4
    assert track.missing == pytest.approx(0.01 * len(sound.wrench), rel=0.3)
    assert track.feed.rate == 7000.0


def test_poses_carry_their_own_stamp(made: Made) -> None:
    _, session_, sound, delay = made
    track = session_.readings("pose")
    np.testing.assert_allclose(track.values, sound.pose, rtol=0.0, atol=1e-12)
    sent = (track.device_time - session_.clock.epoch_ns) / 1e9
    np.testing.assert_allclose(sent, sound.pose_time, atol=1e-6)
    assert (track.time - sent).min() == pytest.approx(delay["pose"], abs=1e-4)


def test_labels_and_events_are_on_the_wrench_s_clock(made: Made) -> None:
    _, session_, sound, delay = made
    np.testing.assert_allclose(session_.labels.time, sound.label_time + delay["wrench"], atol=1e-8)
    for name, values in sound.labels.items():
        np.testing.assert_array_equal(session_.labels.columns[name], values)
    assert len(session_.events) == len(sound.events)
    first, true = session_.events[0], sound.events[0]
    assert (first.kind, first.text) == (true.kind, true.text)
    taps = [event.time for event in session_.events if event.kind == "tap"]
    np.testing.assert_allclose(
        taps, np.array([e.time for e in sound.events if e.kind == "tap"]) + delay["wrench"], atol=1e-8
    )


def test_the_file_has_its_description_and_passes_its_check(made: Made) -> None:
    result, session_, _, delay = made
    description = session_.description
    assert session_.complete
    assert description.simulated
    assert (description.name, description.material, description.radius, description.day) == (
        "slide_000",
        "plastic",
        5e-3,
        0,
    )
    assert json.loads(description.more["delays"]) == delay
    assert description.plan.startswith("name")
    assert description.string is not None
    assert description.more["protocol"] == "slide"
    assert {feed.stream for feed in description.feeds} == {"wrench", "pose"}
    assert check(result.path).sound
    assert session_.clocks.offsets["realtime"][0] == pytest.approx(session("slide_000").epoch)
    assert np.diff(session_.clocks.time) == pytest.approx(1.0, abs=0.11)
    assert result.windows.slip > 10
    assert result.seconds == pytest.approx(session_.audio.samples.shape[1] / 44100)


@pytest.fixture(scope="module")
def hold(tmp_path_factory: pytest.TempPathFactory) -> CollectedSession:
    return make(session("hold_000"), tmp_path_factory.mktemp("hold"))


def test_the_delays_are_recovered_from_the_taps(hold: CollectedSession) -> None:
    alignment, delay = align(read_session(hold.path)), delays(session("hold_000"))
    assert alignment.flags == ()
    for stream, within in (("audio", 0.5e-3), ("pose", 4e-3)):
        for offset in alignment.lateness[stream].offsets:
            assert offset.value == pytest.approx(delay[stream] - delay["wrench"], abs=within)


def test_delays_are_each_session_s_own_and_in_range() -> None:
    drawn = [delays(session(name, seed=seed)) for name in ("hold_000", "slide_000") for seed in range(5)]
    for stream in ("audio", "wrench", "pose"):
        values = {delay[stream] for delay in drawn}
        low, high = getattr(LATE, stream)
        assert len(values) == 10
        assert low <= min(values) <= max(values) <= high


def test_another_seed_makes_another_session(hold: CollectedSession, tmp_path: Path) -> None:
    assert make(session("hold_000", seed=1), tmp_path).checksum != hold.checksum


def test_an_existing_session_is_not_replaced(hold: CollectedSession) -> None:
    stamp = hold.path.stat().st_mtime_ns
    again = make(session("hold_000"), hold.path.parent)
    assert again.kept
    assert not hold.kept
    assert (again.checksum, again.windows, again.seconds) == (hold.checksum, hold.windows, hold.seconds)
    with pytest.raises(InputError, match="hold_000"):
        make(session("hold_000", seed=1), hold.path.parent)
    assert hold.path.stat().st_mtime_ns == stamp


def test_a_session_that_ends_too_early_is_refused_in_one_line(tmp_path: Path) -> None:
    description = describe(session("slide_000"))
    with SessionWriter(tmp_path / "a.mcap", description, SessionClock(epoch_ns=0)) as writer:
        writer.event(0.1, "drivers", "on")
    with pytest.raises(InputError, match=r"a\.mcap"):
        summarise(tmp_path / "a.mcap")


def test_two_that_make_the_same_session_write_the_same_and_do_not_disturb_each_other(
    hold: CollectedSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = session("hold_000")

    def overtaken(one_session: Assignment) -> Iterator[Rendering]:
        yield from pieces(one_session)
        if one_session is one:
            make(session("hold_000"), tmp_path)

    monkeypatch.setattr(offline, "pieces", overtaken)
    first = make(one, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["hold_000.mcap"]
    assert first.path.read_bytes() == hold.path.read_bytes()
    assert read_session(first.path).complete


def test_a_killed_worker_leaves_nothing_that_counts(tmp_path: Path) -> None:
    code = (
        "from pathlib import Path\n"
        "from monochord.lab.offline import make\n"
        "from monochord.lab import assignments\n"
        "from monochord.lab.plans import load_plan\n"
        f"make(assignments(load_plan('small'))[0], Path({str(tmp_path)!r}))\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    deadline = time.monotonic() + 60.0
    while not [part for part in tmp_path.glob("*.part-*") if part.stat().st_size > 500_000]:
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


TAKEN = np.arange(20000) / 1000.0


def test_none_comes_before_its_delay_and_none_overtakes() -> None:
    index, arrival = arrive(TAKEN, Transport(delay=0.02, jitter=2e-3), np.random.default_rng(0))
    delay = arrival - TAKEN[index]
    assert len(index) == TAKEN.size
    assert delay.min() == pytest.approx(0.02, abs=1e-5)
    assert delay.mean() > 0.022
    assert (np.diff(arrival) >= 0.0).all()


def test_a_share_is_lost() -> None:
    index, arrival = arrive(TAKEN, Transport(lost=0.01), np.random.default_rng(0))
    assert len(index) == len(arrival)
    assert TAKEN.size - len(index) == pytest.approx(200, abs=60)
    assert (np.diff(index) > 0).all()


def test_none_overtakes_those_of_before() -> None:
    _, arrival = arrive(np.array([1.0, 1.1]), Transport(), np.random.default_rng(0), latest=1.05)
    assert arrival.tolist() == [1.05, 1.1]


TIME: Floats = np.arange(2000, dtype=np.float64) * 1e-3


def columns(**labels: tuple[float, float, float]) -> dict[str, np.ndarray]:
    """Each column is a value between two times and NaN, or 0 for contact, elsewhere."""
    values = {"contact": 0.0 * TIME, "force": np.nan * TIME, "slip": np.nan * TIME, "settled": 0.0 * TIME}
    for name, (first, last, value) in labels.items():
        values[name] = np.where((first - 1e-9 <= TIME) & (last - 1e-9 > TIME), value, values[name])
    return values


def test_kinds_of_windows() -> None:
    labels = columns(
        contact=(0.45, 1.65, 1.0), force=(0.45, 1.65, 1.0), slip=(1.05, 1.45, 1.0), settled=(0.6, 1.0, 1.0)
    )
    # Windows from 0.5 to 0.9 are static, of those from 1.0 to 1.4 the first and last slide for a half.
    assert count_windows(TIME, labels, 0.0, 2.0) == WindowCounts(
        static=6, settled=4, slip=3, clear=7, transition=2, other=2
    )


def test_a_force_that_moves_is_not_static() -> None:
    labels = columns(contact=(0.0, 2.0, 1.0), slip=(0.0, 2.0, 0.0))
    labels["force"] = np.where(TIME > 1.05, 3.0, 1.0)
    counts = count_windows(TIME, labels, 0.0, 2.0)
    assert (counts.static, counts.other) == (19, 1)


def test_only_with_the_drivers_on_and_sums() -> None:
    counts = count_windows(TIME, columns(), 0.5, 1.0)
    assert counts == WindowCounts(clear=5)
    assert counts + counts == WindowCounts(clear=10)


def test_too_few_labels_are_refused() -> None:
    with pytest.raises(InputError, match="1 times"):
        count_windows(TIME[:1], columns(), 0.0, 1.0)


def test_a_dataset_knows_how_the_object_of_a_session_is_held(tmp_path: Path) -> None:
    plan = tiny(
        groups=(Group(name="hold", grid=(1, 1), hold=0.3, builds=(1,), mount="light"),), world="plausible"
    )
    file = make(session("hold_000", plan), tmp_path).path
    (part,) = build_dataset([file], tmp_path / "dataset").manifest.parts
    assert part.mount == "light"
