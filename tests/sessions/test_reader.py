from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from tests.sessions.made import EPOCH, FEEDS, RATE, make

from monochord.core.errors import InputError
from monochord.sessions import read_session


def test_what_was_written_is_read_again(tmp_path: Path) -> None:
    make(tmp_path / "a.mcap", seconds=2.0, seed=3)
    session = read_session(tmp_path / "a.mcap")
    assert session.complete
    assert session.streams == ("wrench", "pose", "oven")
    assert session.description.feeds == FEEDS
    random = np.random.default_rng(3)
    wrench, pose, oven = (session.readings(stream) for stream in session.streams)
    frame = 0
    for k in range(200):
        frame += 100 * (k == 100)
        samples = random.standard_normal((2, 441)).astype(np.float32)
        assert np.array_equal(session.audio.samples[:, frame : frame + 441], samples)
        frame += 441
        assert np.array_equal(wrench.values[10 * k : 10 * k + 10], random.standard_normal((10, 6)))
        assert np.array_equal(pose.values[2 * k : 2 * k + 2], random.standard_normal((2, 7)))
        assert np.array_equal(oven.values[k : k + 1], random.standard_normal((1, 2)))
    assert session.audio.gaps == ((44100, 44200),)
    assert not session.audio.samples[:, 44100:44200].any()
    np.testing.assert_allclose(wrench.time, np.arange(2000) / 1000, atol=1e-9)
    assert np.array_equal(pose.device_time[:3], EPOCH + np.array([0, 5_000_000, 10_000_000]))
    assert np.array_equal(wrench.device_time, 7 * np.arange(2000))
    assert np.flatnonzero(wrench.status)[0] == 5
    assert wrench.missing == 0
    assert np.array_equal(wrench.column("fz"), wrench.values[:, 2])
    assert session.labels.columns["contact"].all()
    assert np.isnan(session.labels.columns["position"]).sum() == 1000
    assert [event.data["n"] for event in session.events] == [0, 50, 100, 150]
    assert session.events[1].time == pytest.approx(0.5, abs=1e-9)
    assert session.clocks.offsets["realtime"].tolist() == [1.5e9, 1.5e9 + 50, 1.5e9 + 100, 1.5e9 + 150]


def test_the_audio_clock_is_the_converter_s(tmp_path: Path) -> None:
    make(tmp_path / "a.mcap")
    audio = read_session(tmp_path / "a.mcap").audio
    assert audio.time(RATE) == pytest.approx(1.0, abs=1e-6)
    assert audio.frame(1.5) == pytest.approx(1.5 * RATE, abs=0.1)
    assert audio.device_frame[0] == 7


def test_independent_readers_decode_every_message(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=1.0)
    session = read_session(path)
    counted: dict[str, int] = {}
    samples: list[float] = []
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            counted[channel.topic] = counted.get(channel.topic, 0) + 1
            if channel.topic == "/audio":
                samples += list(message.samples[: len(message.samples) // 2])
    ours = {topic: sum(1 for _ in session.messages(topic)) for topic in session.topics}
    assert counted == ours
    without_gap = np.delete(session.audio.samples[0], slice(*session.audio.gaps[0]))
    assert np.array_equal(np.array(samples, np.float32), without_gap)
    with AnyReader([path]) as bag:
        read = [bag.deserialize(raw, connection.msgtype) for connection, _, raw in bag.messages()]
    assert len(read) == sum(ours.values())


def test_what_is_no_session_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    for content in (b"", b"RIFF....", b"\x89MCAP0\r\n"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"a session"):
            read_session(path)
    with pytest.raises(InputError, match="No such file"):
        read_session(tmp_path / "none.mcap")
    make(path := tmp_path / "b.mcap", seconds=0.1)
    with pytest.raises(InputError, match=r"stream 'force'.*wrench, pose, oven"):
        read_session(path).readings("force")
    with pytest.raises(InputError, match=r"column 'f_z'.*fx, fy, fz"):
        read_session(path).readings("wrench").column("f_z")
