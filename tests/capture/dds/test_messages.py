from typing import Any

import pytest

from monochord.capture.dds import messages as ros
from monochord.sessions.codec import typestore

STORE = typestore()
KINDS = (
    ros.PoseStamped, ros.WrenchStamped, ros.TFMessage, ros.PointStamped, ros.Bool, ros.DiagnosticArray,
    ros.Touch, ros.Event,
)  # fmt: skip
HEADER = ros.header(1_500_000_000, "string")
POSE = ros.PoseStamped(
    header=HEADER,
    pose=ros.Pose(position=ros.Point(0.1, 0.2, 0.3), orientation=ros.Quaternion(0.0, 0.0, 0.6, 0.8)),
)


@pytest.mark.parametrize("kind", KINDS)
def test_names_and_hashes_are_those_that_ros_2_gives(kind: type[Any]) -> None:
    name = ros.ros_name(kind)
    assert ros.TYPE_HASHES[name] == STORE.hash_rihs01(name)


def test_an_independent_reader_decodes_the_bytes() -> None:
    message: Any = STORE.deserialize_cdr(POSE.serialize(), "geometry_msgs/msg/PoseStamped")
    assert (message.header.stamp.sec, message.header.stamp.nanosec, message.header.frame_id) == (
        1,
        500_000_000,
        "string",
    )
    assert (message.pose.position.y, message.pose.orientation.w) == (0.2, 0.8)
    moved = ros.Transform(translation=ros.Vector3(1.0, 2.0, 3.0), rotation=ros.Quaternion(0.0, 0.0, 0.0, 1.0))
    part = ros.TransformStamped(header=HEADER, child_frame_id="tool", transform=moved)
    many: Any = STORE.deserialize_cdr(
        ros.TFMessage(transforms=[part, part]).serialize(), "tf2_msgs/msg/TFMessage"
    )
    assert [p.child_frame_id for p in many.transforms] == ["tool", "tool"]
    assert many.transforms[1].transform.translation.z == 3.0


def test_a_stamp_is_nanoseconds() -> None:
    assert ros.nanoseconds(ros.header(1_700_000_000_123_456_789, "").stamp) == 1_700_000_000_123_456_789
