"""A bag that mcap-ros2-support and rosbags read, with what Foxglove needs to play and plot it."""

import json
from collections.abc import Iterator
from functools import partial, reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from tests.sessions.made import make

from monochord.core.errors import InputError
from monochord.sessions import SessionReader, codec, read_session
from monochord.sessions.exports.foxglove import Foxglove

TYPES = {
    "/audio": "foxglove_msgs/msg/RawAudio",
    "/wrench": "geometry_msgs/msg/WrenchStamped",
    "/pose": "geometry_msgs/msg/PoseStamped",
    "/oven": "monochord_msgs/msg/OvenReading",
    "/labels": "monochord_msgs/msg/LabelsReading",
    "/rosout": "rcl_interfaces/msg/Log",
    "/description": "std_msgs/msg/String",
}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> SessionReader:
    path = tmp_path_factory.mktemp("sessions") / "made.mcap"
    make(path, seconds=0.6)
    return read_session(path)


@pytest.fixture(scope="module")
def bag(session: SessionReader, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("bags") / "out"
    Foxglove().write([session], out)
    return out


def by_mcap(bag: Path) -> Iterator[tuple[str, str, int, Any]]:
    """Messages as mcap-ros2-support decodes them, by the definitions in the file alone."""
    with (bag / "made" / "made.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message, content in reader.iter_decoded_messages():
            assert schema is not None
            yield channel.topic, schema.name, message.log_time, content


def by_rosbags(bag: Path) -> Iterator[tuple[str, str, int, Any]]:
    """Messages as rosbags decodes them, by the definitions in the file alone."""
    with AnyReader([bag / "made"]) as reader:
        for connection, stamp, data in reader.messages():
            content = reader.deserialize(data, connection.msgtype)
            yield connection.topic, connection.msgtype, stamp, content


readers = pytest.mark.parametrize("read", [by_mcap, by_rosbags])


@readers
def test_every_topic_has_its_type_and_all_its_messages(bag: Path, session: SessionReader, read: Any) -> None:
    seen: dict[str, str] = {}
    counts = dict.fromkeys(TYPES, 0)
    stamps: list[int] = []
    for topic, kind, stamp, _ in read(bag):
        seen[topic] = kind
        counts[topic] += 1
        stamps.append(stamp)
    assert seen == TYPES
    assert stamps == sorted(stamps)
    assert counts == {
        "/audio": len(list(session.decoded("/audio"))),
        "/wrench": len(session.readings("wrench").time),
        "/pose": len(session.readings("pose").time),
        "/oven": len(session.readings("oven").time),
        "/labels": len(session.labels.time),
        "/rosout": len(session.events),
        "/description": 1,
    }
    assert min(counts.values()) > 0


@readers
def test_the_sound_is_that_of_the_session_in_sixteen_bits(
    bag: Path, session: SessionReader, read: Any
) -> None:
    parts: list[np.ndarray] = []
    for topic, _, stamp, content in read(bag):
        if topic == "/audio":
            time = content.timestamp
            assert (content.format, content.sample_rate, content.number_of_channels) == ("pcm-s16", 44100, 2)
            assert time.sec * 1_000_000_000 + time.nanosec == stamp
            parts.append(np.frombuffer(bytes(content.data), "<i2").reshape(-1, 2))
    heard = np.concatenate(parts).T
    whole = np.concatenate([block.samples.reshape(2, -1) for _, block in session.decoded("/audio")], axis=1)
    np.testing.assert_array_equal(heard, np.clip(np.rint(whole * 32767), -32768, 32767))


@readers
def test_readings_keep_their_times_and_values(bag: Path, session: SessionReader, read: Any) -> None:
    force, oven, poses, labels = [], [], [], []
    for topic, _, stamp, content in read(bag):
        if topic == "/wrench":
            f, t = content.wrench.force, content.wrench.torque
            force.append([stamp, f.x, f.y, f.z, t.x, t.y, t.z])
            at = content.header.stamp
            assert at.sec * 1_000_000_000 + at.nanosec == stamp
        elif topic == "/oven":
            oven.append([content.temperature, content.door])
        elif topic == "/pose":
            poses.append([content.pose.position.x, content.pose.orientation.w])
            assert content.header.frame_id == "string"
        elif topic == "/labels":
            labels.append(content.contact)
    wrench, epoch = session.readings("wrench"), session.clock.epoch_ns
    rows = np.array(force)
    np.testing.assert_allclose((rows[:, 0] - epoch) * 1e-9, wrench.time, atol=1e-6)
    np.testing.assert_array_equal(rows[:, 1:], wrench.values)
    np.testing.assert_array_equal(oven, session.readings("oven").values)
    np.testing.assert_array_equal(poses, session.readings("pose").values[:, [0, 6]])
    np.testing.assert_array_equal(labels, session.labels.columns["contact"])


def test_the_layout_shows_fields_that_are_there(bag: Path) -> None:
    layout = json.loads((bag / "layout.json").read_text(encoding="utf-8"))
    contents = {topic: content for topic, _, _, content in by_mcap(bag)}
    paths = [
        path["value"]
        for name, panel in layout["configById"].items()
        if name.startswith("Plot!")
        for path in panel["paths"]
    ]
    assert {path.partition(".")[0] for path in paths} == {"/wrench", "/pose", "/oven", "/labels"}
    for path in paths:
        topic, *fields = path.split(".")
        assert isinstance(reduce(getattr, fields, contents[topic]), float)
    assert layout["configById"]["Audio!sound"]["topic"] == "/audio"
    assert layout["configById"]["RosOut!events"]["topicToRender"] == "/rosout"
    placed = json.dumps(layout["layout"])
    assert all(json.dumps(name) in placed for name in layout["configById"])


def poses_in(frame: str, path: Path, patch: pytest.MonkeyPatch) -> SessionReader:
    """Return a session whose poses are in a frame, as another program may write them."""
    with patch.context() as context:
        context.setattr(codec, "encode_pose", partial(codec.encode_pose, frame=frame))
        make(path, seconds=0.1)
    return read_session(path)


@pytest.mark.parametrize(
    ("frames", "panels"),
    [
        (("string",), {"3D!pose": "string"}),
        (("robot_base",), {"3D!pose": "robot_base"}),
        (("robot_base", "string", "robot_base"), {"3D!pose": "robot_base", "3D!pose2": "string"}),
        (("",), {"3D!pose": None}),
    ],
)
def test_the_pose_is_shown_in_its_own_frame(
    frames: tuple[str, ...], panels: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sessions = [poses_in(frame, tmp_path / f"made{k}.mcap", monkeypatch) for k, frame in enumerate(frames)]
    Foxglove().write(sessions, tmp_path / "out")
    layout = json.loads((tmp_path / "out" / "layout.json").read_text(encoding="utf-8"))
    shown = {name: panel for name, panel in layout["configById"].items() if name.startswith("3D!")}
    assert {name: panel.get("followTf") for name, panel in shown.items()} == panels
    assert all(panel["topics"] == {"/pose": {"visible": True}} for panel in shown.values())
    assert all(json.dumps(name) in json.dumps(layout["layout"]) for name in shown)


def test_a_gain_makes_quiet_sound_louder(session: SessionReader, tmp_path: Path) -> None:
    Foxglove(gain=20.0).write([session], tmp_path / "out")
    loud = next(m for topic, _, _, m in by_mcap(tmp_path / "out") if topic == "/audio")
    _, block = next(session.decoded("/audio"))
    whole = np.clip(np.rint(block.samples.reshape(2, -1) * 327670.0), -32768, 32767)
    np.testing.assert_array_equal(np.frombuffer(bytes(loud.data), "<i2").reshape(-1, 2).T, whole)
    with pytest.raises(InputError, match="500"):
        Foxglove(gain=500.0).write([session], tmp_path / "again")
