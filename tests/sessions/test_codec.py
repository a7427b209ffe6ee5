import numpy as np
import pytest

from monochord.core.types import POSE, WRENCH, Feed
from monochord.sessions import codec


@pytest.mark.parametrize("name", [*codec.TOPICS.values(), codec.WRENCHES, codec.READINGS, codec.POSES])
def test_every_type_has_a_definition_with_all_that_it_needs(name: str) -> None:
    text = codec.definition(name)
    assert text.strip()
    if "Header" in text:
        assert "MSG: std_msgs/Header" in text
        assert "MSG: builtin_interfaces/Time" in text


def test_a_pose_comes_back() -> None:
    values = np.array([0.1, -0.2, 3e-3, 0.0, 0.0, 0.6, 0.8])
    stamp, pose = codec.pose_of(
        codec.decode(codec.POSES, codec.encode_pose(1_763_740_000_999_999_999, values))
    )
    assert stamp == 1_763_740_000_999_999_999
    assert pose == tuple(values)


def test_bytes_are_little_endian_cdr() -> None:
    data = codec.encode(codec.TEXT, data="abc")
    assert data[:12] == b"\x00\x01\x00\x00\x04\x00\x00\x00abc\x00"
    assert codec.decode(codec.TEXT, memoryview(data)).data == "abc"


def test_a_stream_s_type_goes_by_its_columns() -> None:
    units = ("m",) * 7
    assert codec.type_of(Feed(stream="pose", columns=POSE, units=units, ticks=1e9)) == codec.POSES
    assert codec.type_of(Feed(stream="pose", columns=POSE, units=units, ticks=1e3)) == codec.READINGS
    assert codec.type_of(Feed(stream="second", columns=WRENCH, units=units[:6])) == codec.WRENCHES
    assert codec.type_of(Feed(stream="oven", columns=("t",), units=("K",))) == codec.READINGS
