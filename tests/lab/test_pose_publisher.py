import os
import time
from typing import Any

import numpy as np
import pytest
from tests.ports import free_ports
from tests.waiting import wait_for

from monochord.capture.dds.participant import Participant
from monochord.capture.instruments.pose_udp import PoseUdp
from monochord.core.errors import InputError
from monochord.lab.pose_publisher import PosePublisher, PublisherSettings

DOMAIN = 1 + os.getpid() % 99  # another run of the tests has another one
POSES = np.array([[1e-3 * k, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for k in range(50)])


@pytest.fixture
def port() -> int:
    return free_ports(1)[0]


def stamp(message: Any) -> float:
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def silent_but_udp(port: int, **options: Any) -> PublisherSettings:
    return PublisherSettings(topic="", wrench_topic="", udp=f"127.0.0.1:{port}", **options)


def test_each_pose_leaves_at_its_time_and_bears_the_robots_stamp(port: int) -> None:
    settings = silent_but_udp(port, delay=0.03, clock_error=0.5)
    with PoseUdp(address=str(port)).open() as connection, PosePublisher(POSES, settings) as robot:
        begin = time.monotonic() + 0.1003
        robot.begin_at(begin)
        offset = time.time() - time.monotonic()
        time.sleep(0.8)
        (got,) = connection.poll()
        assert connection.health.missing == 0
    index = np.rint(got.values[:, 0] / 1e-3)
    moving = (index > 0) & (index < len(POSES) - 1)
    assert np.array_equal(np.diff(index[moving]), np.ones(moving.sum() - 1))
    assert index[-1] == len(POSES) - 1
    taken = begin + index[moving] / 100.0
    assert 0.03 <= (got.time[moving] - taken).min() < 0.05
    assert np.allclose(got.device_time[moving] * 1e-9 - offset - taken, 0.5, atol=2e-3)


def test_wrenches_have_a_topic_and_a_rate_of_their_own() -> None:
    received: dict[str, list[Any]] = {"pose": [], "wrench": []}
    wrenches = np.array([[0.0, 0.0, float(k), 0.0, 0.0, 0.0] for k in range(25)])
    settings = PublisherSettings(rate=100.0, wrench_rate=50.0, domain=DOMAIN, frame="bench")
    with Participant(domain=DOMAIN) as here, PosePublisher(POSES, settings, wrenches=wrenches) as robot:
        here.reader("pose", "PoseStamped", lambda message, _: received["pose"].append(message))
        here.reader("wrench", "WrenchStamped", lambda message, _: received["wrench"].append(message))
        wait_for(lambda: robot.listeners == 2)
        robot.begin_at(time.monotonic() + 0.1)
        wait_for(lambda: received["wrench"] and received["wrench"][-1].wrench.force.z == 24.0)
        end = stamp(received["wrench"][-1])
        wait_for(lambda: stamp(received["pose"][-1]) > end)
    assert {message.wrench.force.z for message in received["wrench"]} == set(range(25))
    assert received["wrench"][0].header.frame_id == "bench"
    begin = stamp(next(message for message in received["wrench"] if message.wrench.force.z == 1.0))
    poses = sum(begin < stamp(message) <= end for message in received["pose"])
    wrenches_sent = sum(begin < stamp(message) <= end for message in received["wrench"])
    assert poses == pytest.approx(2 * wrenches_sent, abs=1)


def test_arrays_of_other_shapes_are_refused() -> None:
    with pytest.raises(InputError, match=r"\(3, 6\)"):
        PosePublisher(np.zeros((3, 6)))
    with pytest.raises(InputError, match=r"\(3, 7\)"):
        PosePublisher(POSES, wrenches=np.zeros((3, 7)))


@pytest.mark.parametrize("options", [{"rate": 0.0}, {"wrench_rate": 1e6}, {"delay": -1.0}, {"udp": "host"}])
def test_settings_that_make_no_sense_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        PublisherSettings(**options)
