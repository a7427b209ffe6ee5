import os
import subprocess
import sys
import time

import numpy as np
import pytest
from tests.waiting import wait_for

from monochord.capture.dds import messages as ros
from monochord.capture.dds.participant import Participant
from monochord.capture.instruments import pose_dds
from monochord.capture.instruments.base import Connection
from monochord.capture.instruments.pose_dds import PoseDds
from monochord.core.errors import InputError
from monochord.core.types import POSE, Readings
from monochord.lab.pose_publisher import PosePublisher, PublisherSettings

DOMAIN = 1 + os.getpid() % 99  # another run of the tests has another one
UPRIGHT = ros.Quaternion(0.0, 0.0, 0.0, 1.0)


def collect(connection: Connection, count: int) -> list[Readings]:
    parts = list[Readings]()

    def complete() -> bool:
        parts.extend(connection.poll())
        return sum(part.time.size for part in parts) >= count

    wait_for(complete)
    return parts


def test_a_published_pose_is_read_with_its_stamp() -> None:
    poses = np.array([[1e-3 * k, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for k in range(100)])
    settings = PublisherSettings(rate=200.0, domain=DOMAIN)
    with (
        PoseDds(domain=DOMAIN, rate=200.0, frame="string").open() as connection,
        PosePublisher(poses, settings) as robot,
    ):
        assert connection.feed.columns == POSE
        collect(connection, 5)
        offset = time.time() - time.monotonic()
        begin = time.monotonic() + 0.1
        robot.begin_at(begin)
        parts = collect(connection, 200)
        assert connection.health.out_of_order == connection.health.missing == 0
    values, times, ticks = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("values", "time", "device_time")
    )
    moving = (values[:, 0] > 0) & (values[:, 0] < 0.0985)
    taken = begin + values[moving, 0] / 1e-3 / 200.0
    assert moving.sum() > 50
    assert np.allclose(ticks[moving] * 1e-9 - offset, taken, atol=1e-3)
    late = times[moving] - taken
    assert np.all(late > 0.0)


def test_the_transform_of_the_frame_is_read() -> None:
    def part(child: str, x: float) -> ros.TransformStamped:
        moved = ros.Transform(translation=ros.Vector3(x, 0.0, 0.0), rotation=UPRIGHT)
        return ros.TransformStamped(header=ros.header(7, "base"), child_frame_id=child, transform=moved)

    options = PoseDds(topic="/tf", kind="tf", frame="tool", domain=DOMAIN)
    with options.open() as connection, Participant(domain=DOMAIN) as robot:
        writer = robot.writer("tf", "TFMessage")
        wait_for(lambda: writer.listeners)
        writer.write(ros.TFMessage(transforms=[part("elbow", 1.0), part("tool", 2.0)]), 7)
        (readings,) = collect(connection, 1)
    assert readings.values.tolist() == [[2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]
    assert readings.device_time.tolist() == [7]


def test_what_is_no_pose_is_counted_and_a_stamp_that_goes_back_too() -> None:
    def pose(x: float, stamp: int, turn: ros.Quaternion = UPRIGHT) -> ros.PoseStamped:
        inside = ros.Pose(position=ros.Point(x, 0.0, 0.0), orientation=turn)
        return ros.PoseStamped(header=ros.header(stamp, "f"), pose=inside)

    with PoseDds(topic="/odd", domain=DOMAIN).open() as connection, Participant(domain=DOMAIN) as robot:
        writer = robot.writer("odd", "PoseStamped")
        wait_for(lambda: writer.listeners)
        writer.write(pose(float("nan"), 1), 1)
        writer.write(pose(1.0, 2, ros.Quaternion(0.0, 0.0, 0.0, 0.0)), 2)
        writer.write(pose(2.0, 9), 9)
        writer.write(pose(3.0, 5), 5)
        parts = collect(connection, 2)
        assert connection.health.faulty == 2
        assert connection.health.out_of_order == 1
    assert np.concatenate([part.values for part in parts])[:, 0].tolist() == [2.0, 3.0]


class Raw(str):
    """A text that goes out as other bytes than its own."""

    __slots__ = ()

    def encode(self, encoding: str = "utf-8", errors: str = "strict") -> bytes:
        return b"\xff\xfe\x80"


def test_nonsense_is_counted_and_the_next_message_is_read() -> None:
    def pose(x: float, sec: int = 1, nanosec: int = 0, frame: str = "f") -> ros.PoseStamped:
        inside = ros.Pose(position=ros.Point(x, 0.0, 0.0), orientation=UPRIGHT)
        header = ros.Header(stamp=ros.Time(sec=sec, nanosec=nanosec), frame_id=frame)
        return ros.PoseStamped(header=header, pose=inside)

    with PoseDds(topic="/mad", domain=DOMAIN).open() as connection, Participant(domain=DOMAIN) as robot:
        writer = robot.writer("mad", "PoseStamped")
        wait_for(lambda: writer.listeners)
        for message in (
            pose(1e308),
            pose(float("-inf")),
            pose(1.0, sec=-1),
            pose(1.0, nanosec=1_000_000_000),
            pose(1.0, sec=-(1 << 31), nanosec=(1 << 32) - 1),
            pose(1.0, frame=Raw("x")),
            pose(2.0, sec=(1 << 31) - 1),
            pose(3.0, sec=0, nanosec=999_999_999),
        ):
            writer.write(message, 1)
        parts = collect(connection, 2)
        assert connection.health.faulty == 6
    assert np.concatenate([part.values for part in parts])[:, 0].tolist() == [2.0, 3.0]
    ticks = np.concatenate([part.device_time for part in parts])
    assert ticks.tolist() == [((1 << 31) - 1) * 10**9, 999_999_999]


def test_a_message_longer_than_the_limit_is_not_put_together() -> None:
    """The robot's own configuration lets it send any length; it repeats what late discovery may miss."""
    code = (
        "import select, sys\n"
        "from monochord.capture.dds import messages as ros\n"
        "from monochord.capture.dds.participant import Participant\n"
        "turn = ros.Quaternion(0.0, 0.0, 0.0, 1.0)\n"
        f"with Participant(domain={DOMAIN}) as robot:\n"
        "    writer = robot.writer('long', 'PoseStamped')\n"
        "    while not select.select([sys.stdin], [], [], 0.05)[0]:\n"
        "        for x, size in ((1.0, 1 << 19), (2.0, 17 << 16), (3.0, 1)):\n"
        "            pose = ros.Pose(position=ros.Point(x, 0.0, 0.0), orientation=turn)\n"
        "            writer.write(ros.PoseStamped(header=ros.header(1, 'f' * size), pose=pose), 1)\n"
    )
    general = '<Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast>'
    discovery = '<ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers>'
    uri = f"<General>{general}</General><Discovery>{discovery}</Discovery>"
    environment = {**os.environ, "CYCLONEDDS_URI": f"<CycloneDDS><Domain>{uri}</Domain></CycloneDDS>"}
    received = list[float]()
    with (
        PoseDds(topic="/long", domain=DOMAIN).open() as connection,
        subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, env=environment) as robot,
    ):
        deadline = time.monotonic() + 60.0
        while min(received.count(1.0), received.count(3.0)) < 3:
            assert time.monotonic() < deadline, f"received {received} within 60 s"
            time.sleep(0.02)
            received += [x for part in connection.poll() for x in part.values[:, 0].tolist()]
        robot.communicate(timeout=60)
        received += [x for part in connection.poll() for x in part.values[:, 0].tolist()]
    assert 2.0 not in received


def test_poses_that_nobody_polls_are_counted_as_missing_beyond_a_bound(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pose_dds, "MAX_PENDING", 10)
    with PoseDds(topic="/many", domain=DOMAIN).open() as connection, Participant(domain=DOMAIN) as robot:
        writer = robot.writer("many", "PoseStamped")
        wait_for(lambda: writer.listeners)
        for x in range(25):
            inside = ros.Pose(position=ros.Point(float(x), 0.0, 0.0), orientation=UPRIGHT)
            writer.write(ros.PoseStamped(header=ros.header(x, "f"), pose=inside), x)
        wait_for(lambda: connection.health.missing >= 15)
        (readings,) = connection.poll()
        assert readings.values[:, 0].tolist() == list(range(15, 25))
        assert connection.health.missing == 15


def test_a_publisher_that_goes_and_comes_back_is_followed() -> None:
    pose = np.array([[0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    settings = PublisherSettings(domain=DOMAIN)
    with PoseDds(domain=DOMAIN).open() as connection:
        for times in range(3):
            with PosePublisher(pose, settings):
                collect(connection, 5)
            assert connection.health.reconnects == times


def test_tf_without_a_frame_is_refused() -> None:
    with pytest.raises(InputError, match="frame"), PoseDds(kind="tf").open():
        pass
