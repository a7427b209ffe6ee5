"""In LeRobot: found by its name, built from a configuration, recorded beside a robot's joints, read back.

LeRobot needs an environment of its own, without Monochord, in which these tests run with pytest's options
``-c /dev/null --rootdir . --noconftest``.
"""

import json
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

if find_spec("lerobot") is None:
    pytest.skip("LeRobot is not installed: it has an environment of its own", allow_module_level=True)

from lerobot.cameras.configs import CameraConfig
from lerobot.cameras.utils import make_cameras_from_configs
from lerobot.robots.config import RobotConfig
from lerobot.robots.robot import Robot
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from lerobot.utils.import_utils import register_third_party_plugins

FPS, STEPS = 30, 45


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def port() -> Iterator[int]:
    """A port to which datagrams come, 100 a second, of a touch that slides from 50 mm on at 20 mm/s."""
    at, ended = free_port(), threading.Event()

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for sequence in range(100_000):
                place = 0.05 + 2e-4 * sequence
                touch = {"contact": 0.99, "position": place, "position_std": 1e-3, "force": 1.0, "slip": 0.9}
                values = {"sequence": sequence, "time": 0.01 * sequence, "decided_contact": True, **touch}
                sender.sendto(json.dumps(values).encode(), ("127.0.0.1", at))
                if ended.wait(0.01):
                    return

    thread = threading.Thread(target=send)
    thread.start()
    yield at
    ended.set()
    thread.join()


def built(**options: Any) -> Any:
    """Return a camera as LeRobot builds one: its package found by name, its configuration by its type."""
    register_third_party_plugins()
    config = CameraConfig.get_choice_class("monochord")(**options)
    return make_cameras_from_configs({"touch": config})["touch"]


def test_pictures_come_fresh_and_at_once(port: int) -> None:
    with built(port=port, width=64, height=100) as camera:
        first, second = camera.async_read(), camera.async_read()
        assert first.shape == (100, 64, 3)
        assert first.dtype == np.uint8
        assert not np.array_equal(first, second)
        assert np.array_equal(camera.read_latest().shape, second.shape)
        assert camera.vector[camera.names.index("position")] == pytest.approx(0.06, abs=0.02)
        with pytest.raises(DeviceAlreadyConnectedError):
            camera.connect()
    with pytest.raises(DeviceNotConnectedError):
        camera.read()


def test_no_datagram_names_the_command() -> None:
    camera, begun = built(port=free_port()), time.monotonic()
    with pytest.raises(TimeoutError, match="monochord live demo --source jack --sink udp="):
        camera.connect()
    assert 0.9 < time.monotonic() - begun < 2.0
    assert not camera.is_connected


@RobotConfig.register_subclass("one_joint")
@dataclass(kw_only=True)
class OneJointConfig(RobotConfig):
    cameras: dict[str, CameraConfig]


class OneJoint(Robot):
    """A robot of one joint, which is where it was sent, with cameras and the touch's numbers."""

    config_class, name = OneJointConfig, "one_joint"
    is_calibrated = True

    def __init__(self, config: OneJointConfig) -> None:
        super().__init__(config)
        self.cameras = make_cameras_from_configs(config.cameras)
        self.touch: Any = self.cameras["touch"]
        self.joint = 0.0

    @property
    def observation_features(self) -> dict[str, Any]:
        pictures = {name: (each.height, each.width, 3) for name, each in self.cameras.items()}
        return {"joint.pos": float, **dict.fromkeys(self.touch.names, float), **pictures}

    @property
    def action_features(self) -> dict[str, Any]:
        return {"joint.pos": float}

    @property
    def is_connected(self) -> bool:
        return self.touch.is_connected

    def connect(self, calibrate: bool = True) -> None:  # noqa: FBT001, FBT002  (LeRobot's)
        self.touch.connect()

    def get_observation(self) -> dict[str, Any]:
        pictures = {name: each.async_read() for name, each in self.cameras.items()}
        numbers = zip(self.touch.names, map(float, self.touch.vector), strict=True)
        return {"joint.pos": self.joint, **dict(numbers), **pictures}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        self.joint = action["joint.pos"]
        return action

    def disconnect(self) -> None:
        self.touch.disconnect()

    def calibrate(self) -> None: ...

    def configure(self) -> None: ...


def test_an_episode_is_recorded_and_read_back(port: int, tmp_path: Path) -> None:
    """Joint, picture and numbers of each step, through LeRobot's own robot and dataset."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
    from lerobot.datasets.utils import build_dataset_frame, hw_to_dataset_features

    register_third_party_plugins()
    camera = CameraConfig.get_choice_class("monochord")(port=port, width=64, height=100)
    robot = OneJoint(OneJointConfig(id="one", calibration_dir=tmp_path / "none", cameras={"touch": camera}))
    features = hw_to_dataset_features(robot.observation_features, "observation", use_video=False)
    features |= hw_to_dataset_features(robot.action_features, "action", use_video=False)
    root = tmp_path / "episode"
    dataset = LeRobotDataset.create("monochord/touch", FPS, features, root, use_videos=False)
    robot.connect()
    seen: list[dict[str, Any]] = []
    for step in range(STEPS):
        seen.append(robot.get_observation())
        action = robot.send_action({"joint.pos": 0.1 * step})
        frame = build_dataset_frame(features, seen[-1], "observation")
        frame |= build_dataset_frame(features, action, "action")
        dataset.add_frame({**frame, "task": "slide along the string"})
        time.sleep(1.0 / FPS)
    robot.disconnect()
    dataset.save_episode()
    dataset.finalize()
    places = [each["position"] for each in seen]
    assert places == sorted(places)
    assert places[-1] > places[0] + 0.02
    read = LeRobotDataset("monochord/touch", root=root)
    assert (read.num_episodes, read.num_frames) == (1, STEPS)
    state = features["observation.state"]["names"]
    for step in (0, STEPS // 2, STEPS - 1):
        item = read[step]
        picture = (255.0 * np.asarray(item["observation.images.touch"])).round().astype(np.uint8)
        assert np.array_equal(picture.transpose(1, 2, 0), seen[step]["touch"])
        values = dict(zip(state, np.asarray(item["observation.state"]).tolist(), strict=True))
        assert values == pytest.approx({name: seen[step][name] for name in state}, rel=1e-6)
        assert values["position_known"] == 1.0
