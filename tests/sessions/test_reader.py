"""What was written is read again, in the order in which it was given, by us and by other readers."""

import json
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from tests.sessions.made import EPOCH, FEEDS, RATE, block, description, make, readings

from monochord.core.errors import InputError
from monochord.core.types import POSE, Feed
from monochord.sessions import (
    AudioTrack,
    Description,
    ReadingTrack,
    SessionClock,
    SessionReader,
    SessionWriter,
    read_session,
)

WIDTH = {feed.stream: len(feed.columns) for feed in FEEDS}
COLUMNS = ("time", "values", "sequence", "device_time", "status")
STEPS = st.one_of(
    st.tuples(st.just("audio"), st.integers(1, 6000), st.sampled_from([0, 0, 1, 777])),
    st.tuples(st.sampled_from([*WIDTH]), st.integers(0, 300), st.integers(-300, 300)),
    st.tuples(st.sampled_from(["labels", "event", "clocks"]), st.integers(1, 300), st.integers(-300, 300)),
    st.tuples(st.just("flush"), st.just(0), st.just(0)),
)
"""What a recorder may do next: with how much, and after what leap of the device's time, in readings."""


@settings(max_examples=25, deadline=None)
@given(steps=st.lists(STEPS, max_size=14), closed=st.booleans())
@example(steps=[("wrench", 5, 300), ("event", 1, 0), ("wrench", 5, -200), ("event", 2, -50)], closed=True)
def test_whatever_is_written_is_read_again_in_its_order(
    steps: list[tuple[str, int, int]], *, closed: bool
) -> None:
    random, sound, gaps = np.random.default_rng(len(steps)), [np.zeros((2, 0), np.float32)], []
    taken: dict[str, list[Any]] = {name: [] for name in (*WIDTH, "labels", "event", "clocks")}
    frame = moment = 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        writer = SessionWriter(path, description(), SessionClock(epoch_ns=EPOCH, origin=100.0))
        for kind, size, leap in steps:
            moment = max(moment + leap, 0)
            if kind == "audio":
                gaps += [(frame, frame + leap)] if leap else []
                frame += leap
                samples = random.standard_normal((2, size)).astype(np.float32)
                writer.audio(block(0, samples, start=frame, dropped=leap))
                sound += [np.zeros((2, leap), np.float32), samples]
                frame += size
            elif kind in WIDTH:
                batch = readings(kind, moment, size, WIDTH[kind], 1000.0, random)
                writer.readings(batch)
                taken[kind].append(batch)
            elif kind == "labels":
                place = np.where(np.arange(size) % 3, random.random(size), np.nan)
                writer.labels(100.0 + (moment + np.arange(size)) / 1000, {"position": place})
                taken[kind].append(place)
            elif kind == "event":
                writer.event(100.0 + moment / 1000, "note", "ü\n", n=size)
                taken[kind].append((moment, size))
            elif kind == "clocks":
                writer.clocks(100.0 + moment / 1000, {"jack": size})
                taken[kind].append(size)
            else:
                writer.flush()
        (writer.close if closed else writer.flush)()
        session = read_session(path)
        assert session.complete is closed
        assert np.array_equal(session.audio.samples, np.concatenate(sound, axis=1))
        assert session.audio.gaps == tuple(gaps)
        for stream, batches in ((name, taken[name]) for name in WIDTH):
            track = session.readings(stream)
            for column in COLUMNS if batches else ():
                expected = np.concatenate([getattr(each, column) for each in batches])
                read = getattr(track, column) + (100.0 if column == "time" else 0)
                kept = column not in ("device_time", "status") or stream != "pose"
                assert not kept or read == pytest.approx(expected, abs=1e-6 * (column == "time")), column
        assert len(session.labels.time) == sum(map(len, taken["labels"]))
        if taken["labels"]:
            expected = np.concatenate(taken["labels"])
            assert np.array_equal(session.labels.columns["position"], expected, equal_nan=True)
        events = [(round(1000 * each.time), each.data["n"]) for each in session.events]
        assert events == sorted(taken["event"], key=lambda event: event[0])
        assert session.clocks.offsets.get("jack", np.zeros(0)).tolist() == taken["clocks"]
        writer.close()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> SessionReader:
    """A session of a second, to be read alone."""
    path = tmp_path_factory.mktemp("made") / "a.mcap"
    make(path, seconds=1.0, seed=3)
    return read_session(path)


def test_audio_and_readings_have_their_devices_clocks(made: SessionReader) -> None:
    assert made.audio.time(RATE) == pytest.approx(1.0, abs=1e-6)
    assert made.audio.frame(0.7) == pytest.approx(0.7 * RATE, abs=0.1)
    assert made.audio.device_frame[0] == 7
    wrench, pose = made.readings("wrench"), made.readings("pose")
    assert np.array_equal(pose.device_time[:3], EPOCH + np.array([0, 5_000_000, 10_000_000]))
    assert np.flatnonzero(wrench.status)[0] == 5
    assert np.array_equal(wrench.column("fz"), wrench.values[:, 2])


def test_a_pose_whose_clock_ros_cannot_hold_keeps_it_all_the_same(tmp_path: Path) -> None:
    feed = Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4, rate=250.0, ticks=1e3)
    batch = readings("pose", 5, 20, 7, 250.0, np.random.default_rng(0))
    with SessionWriter(tmp_path / "a.mcap", description(feeds=(feed,))) as writer:
        writer.readings(batch)
    track = read_session(tmp_path / "a.mcap").readings("pose")
    assert np.array_equal(track.device_time, batch.device_time)
    assert np.array_equal(track.values, batch.values)


def test_independent_readers_decode_every_message(made: SessionReader) -> None:
    counted: Counter[str] = Counter()
    samples: list[float] = []
    with made.path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            counted[channel.topic] += 1
            if channel.topic == "/audio":
                samples += list(message.samples[: len(message.samples) // 2])
    ours = {topic: sum(1 for _ in made.messages(topic)) for topic in made.topics}
    assert counted == ours
    without_gap = np.delete(made.audio.samples[0], slice(*made.audio.gaps[0]))
    assert np.array_equal(np.array(samples, np.float32), without_gap)
    with AnyReader([made.path]) as bag:
        read = [bag.deserialize(raw, connection.msgtype) for connection, _, raw in bag.messages()]
    assert len(read) == sum(ours.values())


def test_what_is_no_session_is_refused(made: SessionReader, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    for content in (b"", b"RIFF....", b"\x89MCAP0\r\n"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=path.name):
            read_session(path)
    with pytest.raises(InputError, match=r"none\.mcap"):
        read_session(tmp_path / "none.mcap")
    with pytest.raises(InputError, match=r"'force'.*wrench, pose, oven"):
        made.readings("force")
    with pytest.raises(InputError, match=r"'f_z'.*fx, fy, fz"):
        made.readings("wrench").column("f_z")


def test_fields_of_a_newer_version_are_preserved() -> None:
    text = json.dumps({**json.loads(Description(name="a", sample_rate=1).dump()), "humidity": 0.4})
    assert Description.load(text).more == {"humidity": "0.4"}


def test_the_clock_keeps_nanoseconds() -> None:
    clock = SessionClock(epoch_ns=1_763_740_000_123_456_789, origin=98765.4321)
    stamps = clock.stamps(98765.4321 + np.array([0.0, 1e-9, 3600.0]))
    assert np.abs(stamps - clock.epoch_ns - np.array([0, 1, 3_600_000_000_000])).max() <= 15
    again = SessionClock(epoch_ns=clock.epoch_ns).stamps(clock.seconds(stamps))
    assert np.array_equal(again, stamps)


def track(frames: np.ndarray, times: np.ndarray) -> AudioTrack:
    return AudioTrack(
        samples=np.zeros((2, 10), np.float32),
        sample_rate=44100,
        anchor_frame=frames,
        anchor_time=times,
        device_frame=np.full(len(frames), -1),
    )


@pytest.mark.parametrize("off", [-80e-6, 35e-6])
def test_the_rate_of_a_converter_is_estimated(off: float) -> None:
    random = np.random.default_rng(0)
    frames = np.arange(0.0, 60 * 44100, 4410)
    times = 0.25 + frames / 44100 * (1 + off) + 20e-6 * random.standard_normal(len(frames))
    times[::37] += 0.02  # late wake-ups
    audio = track(frames, times)
    assert audio.time(30 * 44100) == pytest.approx(0.25 + 30 * (1 + off), abs=10e-6)
    assert audio.frame(audio.time(1234.5)) == pytest.approx(1234.5, abs=1e-6)


def test_with_few_anchors_the_nominal_rate_stands() -> None:
    assert track(np.zeros(0), np.zeros(0)).time(44100) == 1.0
    assert track(np.array([441.0]), np.array([2.01])).time(44541) == pytest.approx(3.01)
    frames = np.arange(0.0, 20000, 4410)
    audio = track(frames, frames / 44100 * 1.01)
    assert audio.time(44100) - audio.time(0) == pytest.approx(1.0)


def test_a_device_that_stood_still_is_noticed_and_a_late_moment_is_not() -> None:
    frames = np.arange(0.0, 20 * 44100, 4410)
    times = frames / 44100
    times[50] += 0.03
    assert track(frames, times).unevenness < 1e-4
    times[120:] += 0.004
    assert track(frames, times).unevenness > 1.5e-3
    assert track(frames[:3], times[:3]).unevenness == 0.0


def test_missing_readings_are_counted_and_a_restart_is_none() -> None:
    sequence = np.array([5, 6, 9, 10, 0, 1, 4])
    n = len(sequence)
    readings = ReadingTrack(
        feed=Feed(stream="a", columns=("b",), units=("",)),
        time=np.arange(n) / 10,
        values=np.zeros((n, 1)),
        sequence=sequence,
        device_time=np.full(n, -1),
        status=np.zeros(n, np.uint32),
    )
    assert readings.missing == 4
