"""The commands of the how-to pages run as shown, page by page, in a folder with what the pages presuppose.

The microphones are two twins of builds that no model was trained on, behind a real JACK server; the force
sensor and the robot are simulated devices on this machine. ``pytest -m slow tests/e2e/test_how_to.py -s``
prints each command with its seconds.
"""

import shlex
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from tests.contract.test_documents import command_lines, shown_commands
from tests.contract.test_layout import PAGES, ROOT
from tests.devices.robot import UdpRobot, UdpSettings
from tests.e2e.test_newcomer import BUILD, DAY, empty_server
from tests.e2e.test_robot_labels import guide
from tests.e2e.workshop import Reader
from tests.live.web.test_server import free
from tests.ports import free_ports

from monochord.lab.net_ft_device import NetFtDevice, NetFtSettings
from monochord.lab.pose_publisher import PosePublisher, PublisherSettings

pytestmark = [pytest.mark.jack, pytest.mark.slow, pytest.mark.real_time, pytest.mark.timeout(900)]
DOCS = ROOT / "docs"
TRAIN, LEARNING = "train.md", 3
"""The page whose first commands make the sessions, the dataset and the run of the workshop."""
DOMAIN = 97
LIBRARIES = "torch", "transformers", "onnxscript", "distributed", "cyclonedds", "matplotlib", "pyarrow"
TEXTS = {
    page.name: text
    for page, text in PAGES.items()
    if (page.parent == DOCS / "how-to" and page.name != "bring-up.md")
    or page == DOCS / "reference" / "twin.md"
}
"""The pages, without the one that `test_newcomer` follows."""
NAMES = sorted(name for name, text in TEXTS.items() if command_lines(text))
LABELLED = "The paper's bench", "An arm without a force sensor"
ROBOT = [shlex.split(line) for title in LABELLED for line in guide(title)]
"""Commands of record.md that `test_robot_labels` runs."""
BRING_UP = command_lines(PAGES[DOCS / "how-to" / "bring-up.md"])

CANNOT_RUN = {
    "--device 'USB Audio'": "there is no sound card of that name",
    "--source soundcard": "there is no sound card",
    "weights get ": "weights are downloaded from the internet",
    "feature.name=yamnet": "its weights are downloaded from the internet",
}
"""What keeps a command from running here, and why."""

PORT = free()
UDP, LEFT, RIGHT = free_ports(3)
SUBSTITUTIONS = {
    # names that a reader replaces
    "calibrate MODEL ": "calibrate demo ",
    # devices of this machine in place of those of a laboratory
    "system:capture_3": "card-01:capture_1",
    "system:capture_4": "card-01:capture_2",
    "system:": "card:",
    "net_ft=192.168.1.1": "net_ft={net_ft} --set net_ft.silence_seconds=5 --set net_ft.http_port={http}",
    "pose_udp=9871": f"pose_udp={LEFT}",
    "pose_udp=9872": f"pose_udp={RIGHT}",
    "192.168.1.5:9880": f"127.0.0.1:{UDP}",
    "tcp://10.0.0.5:8786": "{cluster}",
    "/shared/sessions": "shared",
    # ports that others may use
    "web=8500": f"web={PORT}",
    "web=8420": f"web={PORT}",
    "web=0.0.0.0:8420": f"web=0.0.0.0:{PORT}",
    # less of the same
    "collect quick": "collect small",
    "collect small --real-time": "collect short.toml --only hold --real-time",
    "collect paper ": "collect short.toml ",
    "--drift 3600": "--drift 10",
    "label touches.mcap": "label touches.mcap --touches 4",
    "bench recording": "bench recording --set seconds=2",
    "feature.name=ast ": "feature.name=ast --set noise.copies=0 --set optimiser.epochs=3 ",
    # short sessions like those of the plan of which the page speaks
    "build sessions --out dataset --held-out": "build objects --out dataset --held-out",
}
"""What is typed in place of what a page shows."""

MEANT = {
    "calibrate.md": {"take.wav": "guitar.wav"},
    "command-line.md": {"take.wav": "guitar.wav"},
    "sessions.md": {"take.wav": "at 48 kHz.wav"},
}
"""What a page means by a name, where it differs from the other pages."""


def shown(name: str) -> list[str]:
    """Return the commands of a page that run here, without those that another test runs."""
    own = zip(shown_commands(TEXTS[name]), command_lines(TEXTS[name]), strict=True)
    elsewhere = BRING_UP + (ROBOT if name == "record.md" else [])
    return [line for line, words in own if words not in elsewhere and not any(p in line for p in CANNOT_RUN)]


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reader]:
    """Somebody in the workshop, with the drivers on, a force sensor and a robot."""
    for needed in LIBRARIES:
        pytest.importorskip(needed)
    with ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
        patch.delenv("DISPLAY", raising=False)
        folder = tmp_path_factory.mktemp("workshop")
        patch.setenv("MONOCHORD_AST", str(folder / "ast"))
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        server = stack.enter_context(empty_server("how-to"))
        person = Reader(folder, server, stack, SUBSTITUTIONS)
        force = stack.enter_context(NetFtDevice(np.zeros((100, 6)), NetFtSettings(rate=1000.0)))
        person.ports |= {"net_ft": force.address, "http": force.http_port}
        pose = np.array([[0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
        stack.enter_context(PosePublisher(pose, PublisherSettings(topic="/tool_pose")))
        for port in (LEFT, RIGHT):
            stack.enter_context(UdpRobot(pose, UdpSettings(port=port)))
        person.does("on")
        other = person.start(["tests.e2e.box_of_parts", server, str(BUILD + 1), str(DAY)])
        other.until("ready", "out")
        other.type("on")
        for line in shown(TRAIN)[:LEARNING]:
            person.follow(line)
        person.prepare()
        yield person


def test_the_tables_are_of_shown_commands() -> None:
    lines = [line for text in TEXTS.values() for line in shown_commands(text)]
    assert not [part for part in (*CANNOT_RUN, *SUBSTITUTIONS) if not any(part in line for line in lines)]
    assert all(words in map(str, command_lines(TEXTS["record.md"])) for words in map(str, ROBOT))


@pytest.mark.parametrize("name", NAMES)
def test_the_commands_of_a_page_work(name: str, reader: Reader, tmp_path: Path) -> None:
    reader.open(tmp_path / "page", MEANT.get(name, {}))
    for line in shown(name)[LEARNING if name == TRAIN else 0 :]:
        touches = name == "calibrate.md" and "record" in line
        reader.follow(line, touches=touches)
