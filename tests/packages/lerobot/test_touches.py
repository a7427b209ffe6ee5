"""Datagrams of the sink `udp` as pictures and numbers for LeRobot, without LeRobot."""

import json
import socket
import threading
from typing import Any

import numpy as np
import pytest

import monochord as mc
from lerobot_camera_monochord.datagrams import Receiver
from lerobot_camera_monochord.touches import Picture, Touch, names
from monochord.core.types import Signal
from monochord.live.sinks.udp import Udp

BLACK, UNTOUCHED, TOUCHED = [0, 0, 0], [32, 32, 32], [64, 64, 64]


def picture(width: int = 5, strings: tuple[str, ...] = (), height: int = 20) -> Picture:
    return Picture(height, width, length=0.2, force=2.0, strings=strings)


def touch(sequence: int, position: float = 0.05, **more: Any) -> dict[str, Any]:
    values = {"contact": 0.99, "position": position, "position_std": 0.0, "force": 1.0, "slip": 0.0}
    return {"sequence": sequence, "time": 0.01 * sequence, **values, **more}


def shades(seen: Picture, row: int = 0) -> list[list[int]]:
    return seen.image[row].tolist()


def test_the_place_is_a_row_from_pickup_1_at_the_top() -> None:
    seen = picture()
    for sequence, position in enumerate((0.0, 0.055, 0.199, 0.25, -0.1)):
        seen.add(touch(sequence, position))
    rows = [np.flatnonzero(seen.image[:, column, 0] == 255).tolist() for column in range(5)]
    assert rows == [[0], [5], [19], [19], [0]]
    seen.add(touch(5, 0.1, position_std=0.021))
    assert np.flatnonzero(seen.image[:, -1, 0] == 255).tolist() == [7, 8, 9, 10, 11, 12]


def test_force_and_slip_are_colours() -> None:
    seen = picture()
    seen.add(touch(0, force=0.5, slip=1.0))
    seen.add(touch(1, force=8.0))
    seen.add(touch(2, force=None, slip=None))
    assert seen.image[5, -3:].tolist() == [[255, 64, 255], [255, 255, 0], [255, 0, 0]]


def test_no_answer_is_not_no_contact() -> None:
    seen = picture()
    nothing = dict.fromkeys(("contact", "position", "force", "slip"))
    seen.add({"sequence": 0, **nothing})
    seen.add({"sequence": 1, **nothing, "contact": 0.02})
    seen.add({"sequence": 2, **nothing, "contact": 0.98})
    seen.add(touch(3, contact=0.98, decided_contact=False))  # a decision counts for more than a window
    seen.add({"sequence": 4, "position": 0.05})  # of a sink with everything=false: a place is a touch
    assert shades(seen) == [BLACK, UNTOUCHED, TOUCHED, UNTOUCHED, TOUCHED]
    assert seen.image[5, -1].tolist() == [255, 0, 0]


def test_unknown_numbers_are_zero_and_said_to_be() -> None:
    values = Touch.of({"contact": 0.9, "position": None, "force": 1.5, "slip": float("nan")}).vector()
    assert dict(zip(names([]), values.round(6).tolist(), strict=True)) == {
        "contact": pytest.approx(0.9),
        "contact_known": 1.0,
        "position": 0.0,
        "position_known": 0.0,
        "force": 1.5,
        "force_known": 1.0,
        "slip": 0.0,
        "slip_known": 0.0,
    }
    assert Touch.of({"position": 0.08, "tracked_position": None}).position is None
    assert Touch.of({"force": 10**400, "contact": True, "slip": "1"}).vector().tolist() == [0.0] * 8


def test_what_is_lost_is_black_and_what_is_late_is_left_out() -> None:
    seen = picture()
    seen.add(touch(0))
    seen.add(touch(3))
    assert shades(seen) == [BLACK, TOUCHED, BLACK, BLACK, TOUCHED]
    before = seen.image.copy()
    seen.add(touch(2, 0.15))
    assert np.array_equal(seen.image, before)
    seen.add(touch(1000))
    assert shades(seen) == [BLACK] * 4 + [TOUCHED]
    seen.add(touch(0, contact=0.1))
    assert shades(seen) == [BLACK] * 4 + [UNTOUCHED]  # a sender that began anew


def test_strings_are_bands_of_one_picture() -> None:
    seen, strings = picture(strings=("left", "right")), ("left", "right")
    for sequence in range(6):  # left is touched at 50 mm, right at 150
        at = sequence % 2
        time = 0.01 * (sequence // 2)
        seen.add(touch(sequence, (0.05, 0.15)[at], time=time, string=strings[at]))
    for band, row in (((0, 10), 2), ((10, 20), 7)):
        image = seen.image[slice(*band)]
        assert (image[row, 2:] == [255, 128, 0]).all()
        assert not image[:, :2].any()
    assert seen.vector.shape == (16,)
    said = dict(zip(names(strings), seen.vector.tolist(), strict=True))
    assert said["right_position"] == pytest.approx(0.15)
    with pytest.raises(ValueError, match="'thumb': expected left, right; configure"):
        seen.add(touch(6, string="thumb"))
    with pytest.raises(ValueError, match=r"'left': expected one string, without a name; .*strings: \[left\]"):
        picture().add(touch(0, string="left"))


@pytest.mark.parametrize("size", [{"height": 1, "strings": ("a", "b")}, {"width": 0}])
def test_a_picture_that_cannot_be_is_refused(size: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="expected a row for each string"):
        picture(**size)


def test_the_sink_s_datagrams_are_the_updates() -> None:
    """Through a socket, from the sink: numbers are the tracked estimates, and the picture has them all."""
    twin = mc.VirtualSensor("prototype", seed=1)
    updates: list[mc.Update] = []
    receiver = Receiver(picture(width=64, height=200), "127.0.0.1", 0)
    run = mc.Run(signal=Signal(sample_rate=44100, channels=2))
    with Udp(to=str(receiver.port)).open(run) as sink:
        for update in mc.listen(twin, seconds=0.7):
            if update.time == 0.0:
                twin.press(0.09, 1.0)
            sink.write(update)
            updates.append(update)
            receiver.next()
    image, vector = receiver.latest()
    receiver.close()
    last = updates[-1].tracked
    said = dict(zip(names([]), vector.tolist(), strict=True))
    assert said["position"] == pytest.approx(last.position.value)
    assert said["force"] == pytest.approx(last.force.value)
    assert said["contact"] == pytest.approx(last.contact.value)
    assert said["position_known"] == said["force_known"] == said["contact_known"] == 1.0
    columns = image[0, 64 - len(updates) :, 0]
    decided = [each.decided.get("contact") for each in updates]
    assert True in decided
    assert columns.tolist() == [{None: 0, False: 32, True: 64}[each] for each in decided]
    assert image[90, -1, 0] == 255
    assert image[100, -1, 0] == 64


def test_silence_names_the_command() -> None:
    receiver = Receiver(picture(), "127.0.0.1", 0)
    start = f"monochord live demo --source jack --sink udp=127.0.0.1:{receiver.port}"
    with pytest.raises(TimeoutError, match=start):
        receiver.next(0.05)
    with pytest.raises(TimeoutError, match=start):
        receiver.latest()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for other in (b"\xff", b"[1]", b"{}", b"[" * 60_000, json.dumps(touch(0)).encode()):
            sender.sendto(other, ("127.0.0.1", receiver.port))
    assert receiver.next()[0].any()  # what other programs send is left out
    with pytest.raises(TimeoutError, match=start):
        receiver.next(0.05)
    assert receiver.latest()[0].any()
    with pytest.raises(TimeoutError, match=start):
        receiver.latest(0.0)
    receiver.close()
    assert not [each for each in threading.enumerate() if each.name == f"monochord {receiver.port}"]


def test_a_port_in_use_is_refused_and_another_string_too() -> None:
    receiver = Receiver(picture(), "127.0.0.1", 0)
    with pytest.raises(ConnectionError, match=f"UDP port {receiver.port} of 127.0.0.1 cannot be opened"):
        Receiver(picture(), "127.0.0.1", receiver.port)
    with pytest.raises(ConnectionError, match="UDP port 70000"):
        Receiver(picture(), "127.0.0.1", 70000)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(json.dumps(touch(0, string="left")).encode(), ("127.0.0.1", receiver.port))
    with pytest.raises(ValueError, match="the string 'left'"):
        receiver.next()
    receiver.close()
