"""A real rclpy, in a virtual environment of its own, hears what Monochord publishes, and is heard."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from tests.devices.robot import WrenchPublisher

from monochord.capture.instruments.pose_dds import PoseDds
from monochord.lab.pose_publisher import PosePublisher, PublisherSettings
from monochord.sessions.codec import typestore

ROOT = Path(__file__).parents[2]
PYTHON = Path(os.environ.get("MONOCHORD_ROS_PYTHON") or ROOT / ".venv-ros" / "bin" / "python")
DOMAIN = 1 + os.getpid() % 99  # another run of the tests has another one
TURN = [0.0, 0.0, 0.6, 0.8]
NODE = str(ROOT / "ros" / "monochord_ros" / "monochord_ros" / "sensor.py")
SLOW_SENSOR = """
import pathlib, signal, sys, time
folder = pathlib.Path(sys.argv[1])
stop = []
signal.signal(signal.SIGINT, lambda *_: stop.append(0))
folder.joinpath("begun").touch()
while not stop:
    time.sleep(0.02)
time.sleep(1.5)
folder.joinpath("ended").write_text(str(len(stop)))
"""


@contextmanager
def rclpy_node(script: str, *arguments: str) -> Generator["subprocess.Popen[str]"]:
    """Run a script of this folder under a Python with rclpy; the test is skipped where there is none."""
    if not PYTHON.is_file():
        pytest.skip(f"no Python with rclpy at {PYTHON} (make ros, or set MONOCHORD_ROS_PYTHON)")
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(DOMAIN),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }
    command = [str(PYTHON), str(Path(__file__).parent / script), *arguments]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        yield process
        process.kill()


@pytest.fixture
def listener() -> Iterator["subprocess.Popen[str]"]:
    """An rclpy node in a process, until it has received 200 poses and 50 wrenches and sent 200 answers."""
    with rclpy_node("ros_listener.py", "200", "50", "200") as process:
        yield process


@pytest.mark.real_time
def test_rclpy_and_monochord_exchange_messages(listener: "subprocess.Popen[str]") -> None:
    poses = np.array([[0.01 * k, 0.0, 1e-3, *TURN] for k in range(100)])
    wrenches = np.tile([0.0, 0.1, 1.5, 0.0, 0.0, -0.2], (100, 1))
    settings = PublisherSettings(rate=200.0, domain=DOMAIN, frame="string")
    assert listener.stdout
    assert listener.stdout.readline() == "ready\n"
    with (
        PosePublisher(poses, settings),
        WrenchPublisher(wrenches, 50.0, domain=DOMAIN),
        PoseDds(topic="/answer", frame="robot", domain=DOMAIN).open() as sensor,
    ):
        messages = [json.loads(line) for line in listener.stdout]
        readings = sensor.poll()
    poses = [message for message in messages if "pose" in message]
    assert len(poses) > 100
    assert all(
        message["frame"] == "string" and np.allclose(message["pose"], [0.0, 0.0, 1e-3, *TURN])
        for message in poses
    )
    assert all(np.diff([sec + 1e-9 * ns for sec, ns in (message["stamp"] for message in poses)]) > 0.0)
    assert sum(message.get("wrench") == wrenches[0].tolist() for message in messages) > 25
    hashes = messages[-1]["hashes"]
    assert set(hashes) == {"geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"}
    for name, seen in hashes.items():
        assert typestore().hash_rihs01(name).removeprefix("RIHS01_") in seen.lower()
    answers = np.concatenate([part.values for part in readings])
    assert len(answers) > 50
    assert np.all(np.diff(answers[:, 0]) == 1.0)


@pytest.mark.real_time
def test_rclpy_subscribes_to_a_live_sensor() -> None:
    """One newton at 80 mm of the simulated sensor, in real time; the messages are those of ROS 2."""
    touch = "{start = 0.5, position = 0.08, force = 1.0}"
    options = ["source.script=[" + touch + "]", "source.build=1", f"sinks.ros2.domain={DOMAIN}"]
    sensor = ["live", "demo", "--source", "twin", "--sink", "ros2=/sensor"]
    command = [sys.executable, "-m", "monochord", *sensor]
    with rclpy_node("ros_subscriber.py", "400") as subscriber:
        assert subscriber.stdout
        assert subscriber.stdout.readline() == "ready\n"
        live = subprocess.Popen([*command, *(word for option in options for word in ("--set", option))])
        heard = json.loads(subscriber.stdout.readline())
        live.terminate()
        assert live.wait(60) == 0
    received, delays = heard["received"], np.array(heard["delays"])
    assert {frame for frame, _ in (*received["touch"], *received["wrench"])} == {"string"}
    assert np.median([position for _, position in received["touch"]]) == pytest.approx(0.08, abs=5e-3)
    assert np.median([force for _, force in received["wrench"][-200:]]) == pytest.approx(1.0, abs=0.7)
    assert np.mean(received["contact"][-200:]) > 0.9
    assert np.mean(received["slip"][-200:]) < 0.5
    assert received["diagnostics"][-1][1] == "sensor"
    assert np.median(delays) < 1.0
    assert heard["topics"]["/sensor/estimates"] == ["monochord_msgs/msg/Touch"]
    assert heard["topics"]["/sensor/events"] == ["monochord_msgs/msg/Event"]
    assert heard["topics"]["/diagnostics"] == ["diagnostic_msgs/msg/DiagnosticArray"]
    assert heard["topics"]["/sensor/markers"] == ["visualization_msgs/msg/MarkerArray"]
    assert len(heard["hashes"]) == 7
    for name, seen in heard["hashes"].items():
        assert typestore().hash_rihs01(name).removeprefix("RIHS01_") in seen.lower()


@pytest.mark.slow
@pytest.mark.real_time
def test_the_node_of_the_ros_package_publishes_below_its_name() -> None:
    """The node runs under rclpy and starts Monochord in the environment of this test."""
    touch = "source.script=[{start = 0.3, position = 0.08, force = 1.0}]"
    executable = f"{sys.executable} -m monochord"
    values = {"executable": executable, "source": "twin", "settings": f"['{touch}', 'source.build=1']"}
    parameters = [word for name, value in values.items() for word in ("-p", f"{name}:={value}")]
    names = ["-r", "__ns:=/", "-r", "__node:=sensor"]
    with (
        rclpy_node("ros_subscriber.py", "200") as subscriber,
        rclpy_node(NODE, "--ros-args", *parameters, *names) as node,
    ):
        assert subscriber.stdout
        assert subscriber.stdout.readline() == "ready\n"
        heard = json.loads(subscriber.stdout.readline())
        node.send_signal(signal.SIGINT)
        assert node.wait(60) == 0
    assert len(heard["received"]["wrench"]) == 200
    assert heard["topics"]["/sensor/touch"] == ["geometry_msgs/msg/PointStamped"]


def test_the_node_asked_again_to_end_still_waits_for_its_sensor(tmp_path: Path) -> None:
    """``ros2 launch`` sends SIGTERM to a node that SIGINT has not ended within 5 s."""
    script = tmp_path / "slow_sensor.py"
    script.write_text(SLOW_SENSOR, encoding="utf-8")
    executable = f"executable:={sys.executable} {script} {tmp_path}"
    with rclpy_node(NODE, "--ros-args", "-p", executable) as node:
        end = time.monotonic() + 60.0
        while not (tmp_path / "begun").exists():
            assert time.monotonic() < end
            time.sleep(0.05)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGINT):
            node.send_signal(number)
            time.sleep(0.3)
        assert node.wait(60) == 0
        assert (tmp_path / "ended").read_text(encoding="utf-8") == "1"


def test_the_node_says_what_to_do_where_monochord_is_not_found(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "monochord"
    with rclpy_node(NODE, "--ros-args", "-p", f"executable:={missing}") as node:
        assert node.wait(60) == 1
    said = capfd.readouterr().err
    assert str(missing) in said
    assert "Traceback" not in said
