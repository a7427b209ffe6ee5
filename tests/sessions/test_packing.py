"""Messages packed from plain values, against the encoder of rosbags and the one of CycloneDDS."""

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monochord.capture.dds import messages
from monochord.sessions.codec import decode, encode, header, typestore
from monochord.sessions.packing import pack

TOUCH, EVENT = "monochord_msgs/msg/Touch", "monochord_msgs/msg/Event"
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12)
numbers = st.floats(width=64)
estimates = st.tuples(numbers, numbers, st.booleans(), texts)


@given(stamp=st.integers(0, 2**31 - 1), frame=texts, each=st.tuples(*[estimates] * 6))
def test_a_message_of_any_texts_is_that_of_rosbags(stamp: int, frame: str, each: tuple[Any, ...]) -> None:
    estimate = typestore().types["monochord_msgs/msg/Estimate"]
    names = ("contact", "position", "force", "slip", "tracked_position", "tracked_force")
    parts = {
        name: estimate(value=value, std=std, valid=valid, why_not=reason)
        for name, (value, std, valid, reason) in zip(names, each, strict=True)
    }
    data = encode(
        TOUCH,
        header=header(stamp, frame),
        start=stamp,
        window=0.1,
        latency=2e-3,
        touched=-1,
        slides=1,
        **parts,
    )
    raw = [value for part in each[:4] for value in part]
    tracked = [value for part in each[4:] for value in part]
    seconds, rest = divmod(stamp, 10**9)
    assert pack(TOUCH, seconds, rest, frame, stamp, 0.1, 2e-3, *raw, -1, 1, *tracked) == data


def test_a_message_is_that_of_the_dds_library() -> None:
    event = messages.Event(header=messages.header(7, "nut"), kind="slip", text="é", data="{}")
    assert pack(EVENT, 0, 7, "nut", "slip", "é", "{}") == event.serialize(use_version_2=False)
    flag = messages.Bool(data=True)
    assert pack("std_msgs/msg/Bool", True) == flag.serialize(use_version_2=False)


def test_a_message_is_read_back() -> None:
    message = decode(EVENT, pack(EVENT, 3, 5, "nut", "slip", "", '{"delay": 0.02}'))
    assert (message.header.stamp.sec, message.header.frame_id, message.kind) == (3, "nut", "slip")
    assert message.data == '{"delay": 0.02}'


@pytest.mark.parametrize("values", [(0, 7), (0, 7, "nut", 1), (0, "nut", 7), (0.5, 7, "nut")])
def test_values_that_are_not_the_fields_are_refused(values: tuple[Any, ...]) -> None:
    with pytest.raises(struct.error):
        pack("std_msgs/msg/Header", *values)
