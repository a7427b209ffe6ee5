import time
from typing import Any

import numpy as np
import pytest
from tests.devices.robot import UdpRobot, UdpSettings
from tests.ports import free_ports

from monochord.capture.instruments.pose_udp import PoseUdp
from monochord.core.errors import InputError
from monochord.lab.pose_publisher import PosePublisher, PublisherSettings

POSES = np.array([[1e-3 * k, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for k in range(50)])


@pytest.fixture
def port() -> int:
    return free_ports(1)[0]


def test_each_pose_leaves_at_its_time_and_bears_the_robots_stamp(port: int) -> None:
    settings = UdpSettings(port=port, delay=0.03, clock_error=0.5)
    with PoseUdp(address=str(port)).open() as connection, UdpRobot(POSES, settings) as robot:
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


def test_arrays_of_other_shapes_are_refused() -> None:
    with pytest.raises(InputError, match=r"\(3, 6\)"):
        PosePublisher(np.zeros((3, 6)))
    with pytest.raises(InputError, match=r"\(0, 7\)"):
        PosePublisher(np.zeros((0, 7)))


@pytest.mark.parametrize("options", [{"rate": 0.0}, {"rate": 1e6}, {"delay": -1.0}])
def test_settings_that_make_no_sense_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        PublisherSettings(**options)
