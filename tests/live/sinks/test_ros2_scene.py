"""What RViz and a robot's frames take of the sink: transforms, markers, the torque, and the node."""

import math
import os
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from scipy.spatial.transform import Rotation
from tests.live.sinks.made import SIGNAL, update
from tests.live.sinks.test_ros2 import TOUCHED, UNKNOWN, UNTOUCHED
from tests.waiting import wait_for

from monochord.capture.dds import messages
from monochord.capture.dds.participant import Participant
from monochord.core.errors import InputError
from monochord.core.types import Estimate
from monochord.live.delivery import Delivery
from monochord.live.sinks._ros_messages import Answer
from monochord.live.sinks._ros_scene import DIM, LENGTH_OF_NEWTON, STRING, WITHHELD, markers
from monochord.live.sinks.base import Run, Update
from monochord.live.sinks.ros2 import Ros2

pytestmark = pytest.mark.real_time
DOMAIN = 101 + os.getpid() % 99  # another run of the tests has another one
LENGTH = 0.2
ADD, DELETE = 0, 2
NO_POSITION = {**TOUCHED, "position": Estimate.abstain("m", "outside the sensing range")}
NO_FORCE = {**TOUCHED, "force": Estimate.abstain("N", "not at rest")}
HAND = Run(signal=SIGNAL, strings={"left": SIGNAL, "right": SIGNAL}, length=LENGTH)


@contextmanager
def latched(topic: str, kind: str) -> Generator[list[Any]]:
    """The messages of a topic that a reader takes which asks for those before it, too."""
    qos = Qos(
        Policy.Reliability.Reliable(max_blocking_time=0),
        Policy.Durability.TransientLocal,
        Policy.History.KeepLast(100),
    )
    received: list[Any] = []
    with Participant(domain=DOMAIN):
        here = DomainParticipant(DOMAIN)
        reader = DataReader(here, Topic(here, topic, getattr(messages, kind)), qos=qos)

        def take() -> bool:
            received.extend(reader.take(100))
            return bool(received)

        wait_for(take)
        yield received


def sent(run: Run, *updates: Update, topic: str, kind: str, **options: Any) -> list[Any]:
    """Return the messages of a topic that a subscriber takes of these updates."""
    received: list[Any] = []
    sink = Ros2(domain=DOMAIN, **options)
    with Participant(domain=DOMAIN) as here, sink.open(run) as writer:
        reader = here.reader(topic, kind, lambda message, _: received.append(message))
        wait_for(lambda: reader.writers)
        time.sleep(0.3)  # until the writer knows the reader, too
        for each in updates:
            writer.write(each)
        wait_for(lambda: received)
        time.sleep(0.1)
    return received


def drawn(estimates: dict[str, Estimate]) -> dict[int, Any]:
    """Return the markers of an update by number."""
    answer = Answer.of(update(estimates), tracked=True)
    return {marker.id: marker for marker in markers(answer, LENGTH, "string", 0)}


def colour(marker: Any) -> tuple[float, ...]:
    return (marker.color.r, marker.color.g, marker.color.b, marker.color.a)


@pytest.mark.parametrize(("position", "force"), [(0.08, 0.7), (0.151, 2.3)])
def test_the_torque_is_about_pickup_1(position: float, force: float) -> None:
    estimates = {
        **TOUCHED,
        "position": Estimate(value=position, std=2e-4, unit="m"),
        "force": Estimate(value=force, std=0.1, unit="N"),
    }
    (message,) = sent(Run(signal=SIGNAL), update(estimates), topic="/monochord/wrench", kind="WrenchStamped")
    at = message.wrench
    torque = np.cross([position, 0.0, 0.0], [0.0, 0.0, force])
    assert [at.torque.x, at.torque.y, at.torque.z] == torque.tolist()
    assert [at.force.x, at.force.y, at.force.z] == [0.0, 0.0, force]


def test_the_torque_of_a_withheld_position_is_no_number_and_without_contact_it_is_0() -> None:
    run, topic = Run(signal=SIGNAL), {"topic": "/monochord/wrench", "kind": "WrenchStamped"}
    (withheld,) = sent(run, update(NO_POSITION), **topic)
    assert withheld.wrench.force.z == 0.7
    assert math.isnan(withheld.wrench.torque.y)
    (untouched,) = sent(run, update(UNTOUCHED), **topic)
    assert (untouched.wrench.force.z, untouched.wrench.torque.y) == (0.0, 0.0)


def test_a_reader_that_comes_later_gets_the_frames_of_all_strings() -> None:
    poses = {"left_string": (0.0, 0.01, 0.0, 0.0, 0.0, 0.0), "right_string": (0.1, 0.0, 0.02, 0.1, 0.2, 1.5)}
    sink = Ros2(domain=DOMAIN, link="finger", poses=poses)
    with sink.open(HAND), latched("rt/tf_static", "TFMessage") as received:
        (message,) = received
    assert [each.child_frame_id for each in message.transforms] == list(poses)
    assert {each.header.frame_id for each in message.transforms} == {"finger"}
    for each, (x, y, z, *angles) in zip(message.transforms, poses.values(), strict=True):
        place, turn = each.transform.translation, each.transform.rotation
        assert (place.x, place.y, place.z) == (x, y, z)
        expected = Rotation.from_euler("xyz", angles).as_matrix()
        assert np.allclose(Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix(), expected)


def test_without_a_link_each_string_has_its_own() -> None:
    with Ros2(domain=DOMAIN).open(HAND), latched("rt/tf_static", "TFMessage") as received:
        (message,) = received
    links = {each.child_frame_id: each.header.frame_id for each in message.transforms}
    assert links == {"left_string": "left_string_link", "right_string": "right_string_link"}


def test_no_frames_are_published_where_a_robots_description_has_them() -> None:
    with Participant(domain=DOMAIN) as here, Ros2(domain=DOMAIN, tf=False).open(HAND):
        reader = here.reader("/tf_static", "TFMessage", lambda *_: None)
        other = here.reader("/monochord/markers", "MarkerArray", lambda *_: None)
        wait_for(lambda: other.writers)
        assert reader.writers == 0


@pytest.mark.parametrize(
    ("options", "given"),
    [
        ({"poses": {"string": (0.0,) * 6}}, "'string'.*left_string, right_string"),
        ({"link": "finger"}, "left_string, right_string.*'finger'.*poses"),
        ({"link": "finger", "poses": {"left_string": (0.0,) * 6}}, "no pose of right_string"),
        (
            {"link": "left_string", "poses": dict.fromkeys(("left_string", "right_string"), (0.0,) * 6)},
            "link",
        ),
    ],
)
def test_frames_that_make_no_tree_are_refused(options: dict[str, Any], given: str) -> None:
    with pytest.raises(InputError, match=given), Ros2(domain=DOMAIN, **options).open(HAND):
        pass


@pytest.mark.parametrize("pose", [(0.0,) * 5, (0.0, 0.0, 0.0, 0.0, 0.0, math.nan)])
def test_a_pose_is_six_finite_numbers(pose: tuple[float, ...]) -> None:
    options: dict[str, Any] = {"poses": {"string": pose}}
    with pytest.raises(InputError, match="poses"):
        Ros2(**options)


def test_a_touch_is_drawn_at_its_place_with_its_force() -> None:
    string, touch, arrow, text = drawn(TOUCHED).values()
    assert [(point.x, point.y, point.z) for point in string.points] == [(0.0, 0.0, 0.0), (LENGTH, 0.0, 0.0)]
    assert colour(string) == STRING
    assert (touch.action, touch.pose.position.x, touch.pose.position.z) == (ADD, 0.08, 0.0)
    assert touch.color.a == 1.0
    tail, tip = arrow.points
    assert (arrow.action, tail.x, tail.z, tip.x) == (ADD, 0.08, 0.0, 0.08)
    assert tip.z == pytest.approx(0.7 * LENGTH_OF_NEWTON)
    assert text.text == "80.0 mm ± 0.2, 0.70 N ± 0.10"


def test_a_touch_is_as_wide_as_two_standard_errors_on_each_side() -> None:
    vague = Estimate(value=0.08, std=5e-3, unit="m")
    assert drawn({**TOUCHED, "position": vague})[1].scale.x == pytest.approx(0.02)
    hopeless = Estimate(value=0.08, std=1.0, unit="m")
    assert drawn({**TOUCHED, "position": hopeless})[1].scale.x == LENGTH


@pytest.mark.parametrize(
    ("estimates", "text"),
    [(UNKNOWN, "position: gap"), (NO_POSITION, "position: outside the sensing range, 0.70 N ± 0.10")],
)
def test_a_string_is_dimmed_where_the_position_is_withheld(estimates: dict[str, Estimate], text: str) -> None:
    shown = drawn(estimates)
    assert colour(shown[0]) == WITHHELD
    assert (shown[1].action, shown[2].action) == (DELETE, DELETE)
    assert shown[3].text == text


def test_a_touch_is_dimmed_where_the_force_is_withheld() -> None:
    shown = drawn(NO_FORCE)
    assert colour(shown[0]) == STRING
    assert (shown[1].action, shown[1].color.a, shown[2].action) == (ADD, DIM, DELETE)
    assert shown[3].text == "80.0 mm ± 0.2, force: not at rest"


def test_an_untouched_string_is_bright_and_has_no_touch() -> None:
    shown = drawn(UNTOUCHED)
    assert colour(shown[0]) == STRING
    assert (shown[1].action, shown[2].action, shown[3].text) == (DELETE, DELETE, "untouched")


def test_one_message_has_the_markers_of_all_strings_at_10_a_second() -> None:
    received: list[Any] = []
    with Participant(domain=DOMAIN) as here, Ros2(domain=DOMAIN).open(HAND) as writer:
        reader = here.reader("/monochord/markers", "MarkerArray", lambda message, _: received.append(message))
        wait_for(lambda: reader.writers)
        time.sleep(0.3)
        began = time.monotonic()
        while time.monotonic() < began + 0.5:
            writer.write(update(TOUCHED, string="left"))
            writer.write(update(UNTOUCHED, string="right"))
            time.sleep(0.005)
        wait_for(lambda: received)
        time.sleep(0.1)
    assert 2 <= len(received) <= 6
    shown = [(marker.header.frame_id, marker.id) for marker in received[-1].markers]
    assert shown == [(f"{name}_string", number) for name in ("left", "right") for number in range(4)]


def test_all_strings_have_their_topics_and_one_thread_writes_them() -> None:
    received: dict[str, list[Any]] = {"left": [], "right": []}
    with Participant(domain=DOMAIN) as here, Delivery([Ros2(domain=DOMAIN)], HAND, paced=True) as delivery:
        readers = [
            here.reader(f"/monochord/{name}/wrench", "WrenchStamped", lambda m, _, to=to: to.append(m))
            for name, to in received.items()
        ]
        wait_for(lambda: all(reader.writers for reader in readers))
        time.sleep(0.3)
        delivery.hand_over(update(TOUCHED, string="left"))
        delivery.hand_over(update(UNTOUCHED, string="right"))
        wait_for(lambda: all(received.values()))
    (left,), (right,) = received.values()
    assert (left.header.frame_id, left.wrench.force.z) == ("left_string", 0.7)
    assert (right.header.frame_id, right.wrench.force.z) == ("right_string", 0.0)
    assert [(each.sink, each.written) for each in delivery.delivered] == [("ros2", 2)]


@pytest.mark.parametrize(
    ("options", "place", "name"),
    [
        ({}, "/", "monochord"),
        ({"namespace": "/lab/left"}, "/lab", "left"),
        ({"namespace": ""}, "/", "monochord"),
        ({"namespace": "/lab/left", "node": "/lab/left_strings"}, "/lab", "left_strings"),
    ],
)
def test_the_node_has_every_writer(options: dict[str, Any], place: str, name: str) -> None:
    sink = Ros2(domain=DOMAIN, **options)
    with sink.open(Run(signal=SIGNAL)), latched("ros_discovery_info", "ParticipantEntitiesInfo") as received:
        (node,) = received[0].node_entities_info_seq
        identities = {bytes(each.data) for each in node.writer_gid_seq}
    assert (node.node_namespace, node.node_name) == (place, name)
    assert len(identities) == 9  # six of the window, diagnostics, markers, frames
    assert {identity[:12] for identity in identities} == {bytes(received[0].gid.data)[:12]}
