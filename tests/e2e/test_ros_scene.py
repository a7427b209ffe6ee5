"""A real rclpy reads what the sink shows of the strings: node, markers, and wrenches with their torque."""

import subprocess
from typing import Any

import numpy as np
import pytest
from studies.ros_scene import scene
from tests.e2e.test_ros import PYTHON
from tests.live.sinks.made import update
from tests.live.sinks.test_ros2 import TOUCHED, UNKNOWN

from monochord.core.types import Estimate
from monochord.sessions.codec import typestore

pytestmark = pytest.mark.real_time
ROUNDS = 40


@pytest.fixture(scope="module")
def read() -> dict[str, Any]:
    """What rclpy reads of two strings: one is touched at forty places, of the other nothing is known."""
    if not PYTHON.is_file():
        pytest.skip(f"no Python with rclpy at {PYTHON} (make ros, or set MONOCHORD_ROS_PYTHON)")
    known = [str(PYTHON), "-c", "import visualization_msgs.msg"]
    if subprocess.run(known, capture_output=True, check=False).returncode:
        pytest.skip(f"{PYTHON} has no visualization_msgs (make ros)")
    random = np.random.default_rng(7)
    places, forces = random.uniform(0.05, 0.15, ROUNDS), random.uniform(0.1, 2.0, ROUNDS)
    touched = [
        update({
            **TOUCHED,
            "position": Estimate(value=float(place), std=2e-4, unit="m"),
            "force": Estimate(value=float(force), std=0.1, unit="N"),
        })
        for place, force in zip(places, forces, strict=True)
    ]  # fmt: skip
    return scene(str(PYTHON), {"left": touched, "right": [update(UNKNOWN)] * ROUNDS})


def test_the_sink_is_a_node_with_its_topics(read: dict[str, Any]) -> None:
    node = read["nodes"]["/hand"]
    assert node["/hand/markers"] == ["visualization_msgs/msg/MarkerArray"]
    assert node["/tf_static"] == ["tf2_msgs/msg/TFMessage"]
    assert node["/hand/left/wrench"] == node["/hand/right/wrench"] == ["geometry_msgs/msg/WrenchStamped"]
    assert len(node) == 15  # six of each string, diagnostics, markers, frames


def test_the_types_are_those_of_ros(read: dict[str, Any]) -> None:
    assert set(read["hashes"]) == {"visualization_msgs/msg/MarkerArray", "tf2_msgs/msg/TFMessage"}
    for name, seen in read["hashes"].items():
        assert typestore().hash_rihs01(name).removeprefix("RIHS01_") in seen.lower()


def test_a_wrench_has_the_torque_about_pickup_1_to_the_bit(read: dict[str, Any]) -> None:
    places = {(frame, stamp): x for frame, stamp, x in read["touches"]}
    assert len(read["wrenches"]) == ROUNDS  # none where nothing is known
    for frame, stamp, *wrench in read["wrenches"]:
        force = wrench[2]
        assert wrench == [0.0, 0.0, force, 0.0, -places[frame, stamp] * force, 0.0]


def test_markers_show_the_touch_and_dim_the_string_of_which_nothing_is_known(read: dict[str, Any]) -> None:
    places = {(frame, stamp): x for frame, stamp, x in read["touches"]}
    assert 2 <= len(read["markers"]) <= ROUNDS // 5
    last = {(marker["frame"], marker["number"]): marker for marker in read["markers"][-1]}
    assert len(last) == 8
    touch = last["left_string", 1]
    assert touch["at"] == [places["left_string", touch["time"]], 0.0, 0.0]
    assert last["left_string", 2]["points"][1][2] > 0.0
    bright, dim = (last[frame, 0]["colour"][3] for frame in ("left_string", "right_string"))
    assert bright == 1.0
    assert dim < 0.5
    assert [last["right_string", number]["action"] for number in (1, 2)] == [2, 2]
    assert last["right_string", 3]["text"] == "position: gap"
