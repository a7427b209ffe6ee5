import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from tests.waiting import wait_for

from monochord.capture.dds import messages as ros
from monochord.capture.dds.participant import URI, Participant
from monochord.core.errors import DeviceError, InputError

DOMAIN = 1 + os.getpid() % 99  # another run of the tests has another one


def pose(x: float) -> ros.PoseStamped:
    turn = ros.Quaternion(0.0, 0.0, 0.0, 1.0)
    return ros.PoseStamped(
        header=ros.header(1, "f"), pose=ros.Pose(position=ros.Point(x, 0.0, 0.0), orientation=turn)
    )


def threads() -> int:
    return len(list(Path("/proc/self/task").iterdir()))


def test_messages_arrive_in_order_with_their_time() -> None:
    received: list[tuple[Any, float]] = []
    before = threads()
    with Participant(domain=DOMAIN) as here, Participant(domain=DOMAIN) as there:
        writer = here.writer("pose", "PoseStamped")
        reader = there.reader("/pose", "PoseStamped", lambda message, now: received.append((message, now)))
        wait_for(lambda: writer.listeners and reader.writers)
        began = time.monotonic()
        for k in range(500):
            writer.write(pose(float(k)), time.time_ns())
        wait_for(lambda: len(received) == 500)
        ended = time.monotonic()
    assert [message.pose.position.x for message, _ in received] == [float(k) for k in range(500)]
    assert all(began <= now <= ended for _, now in received)
    wait_for(lambda: threads() == before)
    assert URI not in os.environ


def test_messages_of_another_process_arrive() -> None:
    code = (
        "import select, sys\n"
        "from monochord.capture.dds import messages as ros\n"
        "from monochord.capture.dds.participant import Participant\n"
        f"with Participant(domain={DOMAIN}) as here:\n"
        "    writer = here.writer('far', 'WrenchStamped')\n"
        "    force, torque = ros.Vector3(1.0, 2.0, 3.0), ros.Vector3(4.0, 5.0, 6.0)\n"
        "    wrench = ros.Wrench(force=force, torque=torque)\n"
        "    while not select.select([sys.stdin], [], [], 0.05)[0]:\n"
        "        writer.write(ros.WrenchStamped(header=ros.header(5, 'x'), wrench=wrench), 5)\n"
    )
    received: list[Any] = []
    with Participant(domain=DOMAIN) as here:
        here.reader("far", "WrenchStamped", lambda message, _: received.append(message))
        with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE) as process:
            wait_for(lambda: received)
            assert process.stdin
            process.stdin.close()
            assert process.wait(60) == 0
    assert received[0].wrench.torque.z == 6.0


def test_domains_do_not_mix(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN + 1))
    with Participant() as here, Participant(domain=DOMAIN) as there:
        assert here.domain == DOMAIN + 1
        writer = here.writer("pose", "PoseStamped")
        there.reader("pose", "PoseStamped", lambda *_: None)
        time.sleep(0.1)
        assert writer.listeners == 0


@pytest.mark.parametrize(
    ("options", "given"), [({"domain": 233}, "233"), ({"domain": -1}, "-1"), ({"interface": '"/>'}, '"/>')]
)
def test_options_that_make_no_sense_are_refused(options: dict[str, Any], given: str) -> None:
    with pytest.raises(InputError, match=given):
        Participant(**options)


def test_an_environment_that_makes_no_sense_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "nine")
    with pytest.raises(InputError, match="'nine'"):
        Participant()


def test_an_interface_that_is_not_there_is_one_line() -> None:
    with pytest.raises(DeviceError, match="'nowhere'"):
        Participant(domain=90, interface="nowhere")
    assert URI not in os.environ


@pytest.mark.parametrize("topic", ["", "a b", "/a//b"])
def test_a_topic_without_a_name_is_refused(topic: str) -> None:
    with Participant(domain=DOMAIN) as here, pytest.raises(InputError):
        here.writer(topic, "PoseStamped")


def test_without_the_library_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cyclonedds.domain", None)
    with pytest.raises(InputError, match="cyclonedds"):
        Participant()


def test_importing_the_package_loads_no_dds() -> None:
    code = "import sys, monochord.capture.dds.participant; print('cyclonedds' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "False\n"
