"""The packages for a ROS 2 workspace: definitions that are Monochord's own, and a node that starts it."""

import doctest
import importlib.util
import json
import re
from pathlib import Path
from typing import Any

import pytest

from monochord.live import LiveRun
from monochord.live.sinks.ros2 import Ros2
from monochord.sessions.codec import own_definitions

ROS = Path(__file__).parents[2] / "ros"


def sensor() -> Any:
    """The module of the node, which imports rclpy only when it runs."""
    spec = importlib.util.spec_from_file_location("sensor", ROS / "monochord_ros/monochord_ros/sensor.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_definitions_are_those_that_monochord_writes() -> None:
    shipped = {path.stem: path.read_text(encoding="utf-8") for path in (ROS / "monochord_msgs/msg").iterdir()}
    assert shipped == own_definitions()
    built = re.findall(
        r'"msg/(\w+)\.msg"', (ROS / "monochord_msgs/CMakeLists.txt").read_text(encoding="utf-8")
    )
    assert sorted(built) == sorted(shipped)


def test_every_parameter_is_in_the_file_with_its_default() -> None:
    text = (ROS / "monochord_ros/config/sensor.yaml").read_text(encoding="utf-8")
    written = dict(re.findall(r"^    (\w+): (.*?)\s+#", text, re.MULTILINE))
    expected = sensor().PARAMETERS
    assert set(written) == set(expected)
    for name, value in expected.items():
        plain = written[name]
        assert (plain if isinstance(value, str) and value else json.loads(plain)) == value


def test_the_nodes_command_line_is_one_that_monochord_takes() -> None:
    module = sensor()
    assert doctest.testmod(module).failed == 0
    given = {
        **module.PARAMETERS,
        "source": "twin",
        "tracked": False,
        "frame_id": "nut",
        "settings": ["source.seed=1"],
    }
    words = module.command(given, "/lab/left")
    assert words[:5] == ["monochord", "live", "demo", "--source", "twin"]
    settings = dict(word.split("=", 1) for word in words[words.index("--set") :] if word != "--set")
    assert settings["source.seed"] == "1"
    options = {key.removeprefix("sinks.ros2."): value for key, value in settings.items() if "sinks" in key}
    tree = {"sinks": {"ros2": {"namespace": words[words.index("--sink") + 1].split("=")[1], **options}}}
    (sink,) = LiveRun.read({**tree, "estimator": {"name": "closed_form"}}).sinks
    place, node = "/lab/left", "/lab/left_strings"
    assert sink == Ros2(namespace=place, frame="nut", interface="lo", tracked=False, node=node)


def test_rviz_shows_what_the_sink_publishes_as_it_is_started_without_options() -> None:
    yaml = pytest.importorskip("yaml", reason="PyYAML, which only this test reads with")
    text = (ROS / "monochord_ros/config/strings.rviz").read_text(encoding="utf-8")
    shown = yaml.safe_load(text)["Visualization Manager"]
    sink = Ros2()
    topics = {each["Topic"]["Value"] for each in shown["Displays"] if "Topic" in each}
    assert topics == {f"{sink.namespace}/markers", f"{sink.namespace}/wrench"}
    assert shown["Global Options"]["Fixed Frame"] == f"{sink.frame}_link"
    installed = (ROS / "monochord_ros/setup.py").read_text(encoding="utf-8")
    assert "config/strings.rviz" in installed
