from typing import Any

import pytest

from monochord.capture.dds import messages as ros
from monochord.sessions.codec import nanoseconds, typestore

STORE = typestore()
HASHES = {
    "geometry_msgs/msg/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "geometry_msgs/msg/WrenchStamped": "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
    "geometry_msgs/msg/PointStamped": "4c0296af86e01e562e9e0405d138a01537247580076c58ea38d7923ac1045897",
    "std_msgs/msg/Bool": "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "monochord_msgs/msg/Event": "9b8cf54af5d83ef54b860f77751929b18c423d863598f15b33ad94d895780b57",
    "monochord_msgs/msg/Touch": "7c015ad0689250638198f4669677c7e9eb5b4350e93327715a790f02db70c561",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}
"""Hashes that ROS 2 Jazzy gives the types, without RIHS01_."""
HEADER = ros.header(1_500_000_000, "string")
POSE = ros.PoseStamped(
    header=HEADER,
    pose=ros.Pose(position=ros.Point(0.1, 0.2, 0.3), orientation=ros.Quaternion(0.0, 0.0, 0.6, 0.8)),
)


@pytest.mark.parametrize("name", HASHES)
def test_names_and_hashes_are_those_that_ros_2_gives(name: str) -> None:
    kind: type[Any] = getattr(ros, name.rpartition("/")[2])
    assert ros.ros_name(kind) == name
    assert STORE.hash_rihs01(name) == f"RIHS01_{HASHES[name]}"


def test_a_name_that_no_package_has_is_no_message() -> None:
    with pytest.raises(AttributeError, match="no message 'Tuoch'"):
        _ = ros.Tuoch


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
    assert nanoseconds(ros.header(1_700_000_000_123_456_789, "").stamp) == 1_700_000_000_123_456_789
