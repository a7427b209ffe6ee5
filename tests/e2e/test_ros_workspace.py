"""The packages of `ros/` in a workspace that a real colcon builds, and its node, launched.

No Python package has ROS 2's ``launch``: `ros_launch.py` takes its place.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from studies.ros_scene import LINK, POSES, scene
from tests.e2e.test_ros import DOMAIN, PYTHON, ROOT
from tests.live.sinks.made import update
from tests.live.sinks.test_ros2 import TOUCHED

from monochord.sessions.codec import own_definitions, typestore

pytestmark = [pytest.mark.slow, pytest.mark.real_time, pytest.mark.timeout(900)]


def environment() -> dict[str, str]:
    """Return the environment of a shell in which ROS 2 is set up; the wheels have no file to source."""
    prefix = PYTHON.parent.parent
    before = {"PATH": PYTHON.parent, "AMENT_PREFIX_PATH": prefix, "CMAKE_PREFIX_PATH": prefix}
    paths = {
        name: os.pathsep.join(filter(None, [str(place), os.environ.get(name, "")]))
        for name, place in before.items()
    }
    ours = {
        "ROS_DOMAIN_ID": str(DOMAIN),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }
    return {**os.environ, **paths, **ours}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace of the packages, built as `ros/README.md` says; skipped where a tool is missing."""
    if not PYTHON.with_name("colcon").is_file():
        pytest.skip(f"no colcon beside {PYTHON} (make ros, or set MONOCHORD_ROS_PYTHON)")
    for tool in ("cmake", "make", "c++", "bash"):
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool}, which building messages takes")
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        pytest.skip("no Python.h, which building messages takes")
    folder = tmp_path_factory.mktemp("ros") / "workspace"
    shutil.copytree(ROOT / "ros", folder / "src", ignore=shutil.ignore_patterns("__pycache__"))
    _add_frames(folder / "src" / "tf2_msgs")
    colcon = subprocess.run(
        [str(PYTHON.with_name("colcon")), "build", "--event-handlers", "console_direct+"],
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert colcon.returncode == 0, colcon.stdout[-5000:]
    return folder


def _add_frames(folder: Path) -> None:
    """Add the package of the frames' messages, which no Python package has, from its definition."""
    (folder / "msg").mkdir(parents=True)
    definition = typestore().generate_msgdef("tf2_msgs/msg/TFMessage", ros_version=2)[0].partition("=====")[0]
    (folder / "msg" / "TFMessage.msg").write_text(definition, encoding="utf-8")
    for name in ("package.xml", "CMakeLists.txt"):
        text = (ROOT / "ros" / "monochord_msgs" / name).read_text(encoding="utf-8")
        text = re.sub(r'( *"msg/\w+\.msg"\n)+', '  "msg/TFMessage.msg"\n', text)
        (folder / name).write_text(
            text.replace("monochord_msgs", "tf2_msgs").replace("std_msgs", "geometry_msgs"), encoding="utf-8"
        )


@contextmanager
def sourced(workspace: Path, *command: str) -> Generator["subprocess.Popen[str]"]:
    """Run a command in a shell that has sourced the workspace."""
    shell = ["bash", "-c", 'source install/setup.bash && exec "$@"', "bash", *command]
    with subprocess.Popen(
        shell, cwd=workspace, env=environment(), stdout=subprocess.PIPE, text=True
    ) as process:
        yield process
        process.kill()


def test_colcon_builds_the_messages_that_monochord_publishes(workspace: Path) -> None:
    installed = workspace / "install/monochord_msgs/share/monochord_msgs/msg"
    hashes = {
        entry["type_name"]: entry["hash_string"]
        for path in installed.glob("*.json")
        for entry in json.loads(path.read_text(encoding="utf-8"))["type_hashes"]
    }
    own = {name for name in hashes if name.startswith("monochord_msgs/")}
    assert own == {f"monochord_msgs/msg/{name}" for name in own_definitions()}
    for name in own:
        assert hashes[name] == typestore().hash_rihs01(name)


def test_the_launched_sensor_is_understood_by_a_node_with_these_messages(workspace: Path) -> None:
    """A newton at 80 mm for a second, again and again, in real time, with a copy of the parameters."""
    touches = ", ".join(
        f"{{start = {start}.5, position = 0.08, force = 1.0, seconds = 1.0}}" for start in range(0, 40, 2)
    )
    shipped = workspace / "install/monochord_ros/share/monochord_ros/config/sensor.yaml"
    own = {
        "executable: monochord": f"executable: {sys.executable} -m monochord",
        "source: jack": "source: twin",
        'settings: [""]': f'settings: ["source.script=[{touches}]", "source.build=1"]',
    }
    text = shipped.read_text(encoding="utf-8")
    for default, value in own.items():
        assert default in text
        text = text.replace(default, value)
    (workspace / "my.yaml").write_text(text, encoding="utf-8")
    scripts = Path(__file__).parent
    launch = [str(PYTHON), str(scripts / "ros_launch.py"), "monochord_ros", "sensor.launch.py"]
    listen = [str(PYTHON), str(scripts / "ros_messages.py"), "/left/sensor", "400"]
    with (
        sourced(workspace, *listen) as listener,
        sourced(workspace, *launch, "namespace:=left", f"params_file:={workspace / 'my.yaml'}") as sensor,
    ):
        assert listener.stdout
        assert listener.stdout.readline() == "ready\n"
        received = json.loads(listener.stdout.readline())
        sensor.send_signal(signal.SIGINT)
        assert sensor.wait(60) == 0
    windows, events = received["touches"], received["events"]
    assert len(windows) >= 400
    assert {window["frame"] for window in windows} == {"string"}
    assert {window["window"] for window in windows} == {0.1}
    assert np.all(np.diff([window["start"] for window in windows]) > 0)
    touched = [window for window in windows if window["touched"] and window["tracked_position"][2]]
    assert np.median([window["tracked_position"][0] for window in touched]) == pytest.approx(0.08, abs=5e-3)
    assert np.median([window["tracked_force"][0] for window in touched]) == pytest.approx(1.0, abs=0.7)
    abstaining = [window for window in windows if not window["position"][2]]
    assert abstaining
    assert all(window["why_not"] and np.isnan(window["position"][0]) for window in abstaining)
    for kind, stamp, data in events:
        assert kind in {"contact_begins", "contact_ends", "slip_begins", "slip_ends"}
        assert abs(stamp - windows[-1]["stamp"]) < 30.0
        assert 0.0 <= data["confidence"] <= 1.0


def test_a_node_that_comes_later_reads_the_frames_of_the_strings(workspace: Path) -> None:
    shell = ["bash", "-c", "source install/setup.bash && env -0"]
    printed = subprocess.run(
        shell, cwd=workspace, env=environment(), stdout=subprocess.PIPE, text=True, check=True
    ).stdout
    sourced_environment = dict(line.split("=", 1) for line in printed.split("\0") if line)
    read = scene(str(PYTHON), dict.fromkeys(("left", "right"), [update(TOUCHED)] * 20), sourced_environment)
    assert {child: parent for parent, child, _ in read["frames"]} == dict.fromkeys(POSES, LINK)
    for _, child, numbers in read["frames"]:
        assert numbers == [*POSES[child][:3], 0.0, 0.0, 0.0, 1.0]
