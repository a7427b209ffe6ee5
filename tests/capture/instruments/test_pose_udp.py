import json
import resource
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.ports import free_ports

from monochord.capture.instruments.base import Connection
from monochord.capture.instruments.pose_udp import PoseUdp
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Readings


@pytest.fixture
def port() -> int:
    return free_ports(1)[0]


@pytest.fixture
def robot(port: int) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", port))
        yield sock


def send(robot: socket.socket, **fields: Any) -> None:
    robot.send(json.dumps({"position": [0.1, 0.2, 0.3], **fields}).encode())


def poll(connection: Connection) -> Readings:
    time.sleep(0.02)
    (readings,) = connection.poll()
    return readings


def test_a_pose_is_read_with_all_fields(port: int, robot: socket.socket) -> None:
    with PoseUdp(address=str(port)).open() as connection:
        time.sleep(0.1)  # a kernel that stamped no datagrams before takes a moment to begin
        before = time.monotonic()
        send(robot, stamp=1.5, orientation=[0, 0, 0, 2], sequence=7)
        after = time.monotonic()
        got = poll(connection)
    assert got.values.tolist() == [[0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]]
    assert (got.sequence.tolist(), got.device_time.tolist()) == ([7], [1_500_000_000])
    assert before - 1e-3 <= got.time[0] <= after + 1e-3  # the kernel's time, not the poll's


def test_the_position_alone_will_do(port: int, robot: socket.socket) -> None:
    with PoseUdp(address=f"127.0.0.1:{port}").open() as connection:
        send(robot)
        got = poll(connection)
        assert (got.sequence[0], got.device_time[0], got.values[0, 6]) == (-1, -1, 1.0)


@pytest.mark.parametrize(
    "datagram",
    [
        b"",
        b"\xff\xfe",
        b"{}",
        b"[1, 2, 3]",
        b'{"position": [1, 2]}',
        b'{"position": [1, 2, null]}',
        b'{"position": [1, 2, 1e999]}',
        b'{"position": [NaN, 0, 0]}',
        b'{"position": [1, 2, 3], "orientation": [0, 0, 0, 0]}',
        b'{"position": [1, 2, 3], "stamp": 1e30}',
        b'{"position": [1, 2, 3], "sequence": -5}',
        b'{"position": [1, 2, 3], "sequence": 99999999999999999999}',
        b'{"position": [1e308, 0, 0]}',
        b'{"position": [0, -1.1e7, 0]}',
        b'{"position": [Infinity, 0, 0]}',
        b'{"position": [-Infinity, 0, 0]}',
        b'{"position": [1, 2, 3], "orientation": [0, 0, 0, 1e300]}',
        b'{"position": [1, 2, 3], "stamp": NaN}',
        b'{"position": [1, 2, ' + b"9" * 4000 + b"]}",
        b'{"position": [1, 2, 3], "more": ' + b"[" * 1900 + b"]" * 1900 + b"}",
        b'{"position": [1, 2, 3], "\xb1": 4}',
        b"[" * 4000,
        b" " * 60_000,
        b" " * 9000,
    ],
)
def test_what_is_no_pose_is_counted_and_passed_over(port: int, robot: socket.socket, datagram: bytes) -> None:
    with PoseUdp(address=str(port)).open() as connection:
        robot.send(datagram)
        send(robot)
        got = poll(connection)
        assert got.time.size == 1
        assert connection.health.faulty == 1


@pytest.mark.parametrize("unread", [b'"\xb1"', b"1e999", b"-0e-400"])
def test_a_pose_beside_what_is_not_read_is_read(port: int, robot: socket.socket, unread: bytes) -> None:
    with PoseUdp(address=str(port)).open() as connection:
        robot.send(b'{"position": [1, 2, 3], "more": ' + unread + b"}")
        assert poll(connection).time.size == 1


def test_gaps_repeats_and_restarts_are_distinguished(port: int, robot: socket.socket) -> None:
    with PoseUdp(address=str(port), rate=100.0).open() as connection:
        for sequence, stamp in [(0, 1.0), (1, 1.01), (4, 1.04), (3, 1.03), (4, 1.04), (5, 1.05)]:
            send(robot, sequence=sequence, stamp=stamp)
        got = poll(connection)
        assert got.sequence.tolist() == [0, 1, 4, 5]
        assert connection.health.missing == 2
        assert connection.health.out_of_order == 2
        send(robot, sequence=0, stamp=1.1)  # its program was started again, its clock went on
        assert poll(connection).sequence.tolist() == [10]
        assert connection.health.reconnects == 1
        assert connection.health.missing == 6
        send(robot, sequence=0, stamp=0.0)  # its computer was started again
        send(robot, sequence=1, stamp=0.01)
        assert np.diff(poll(connection).sequence).tolist() == [1]
        assert connection.health.reconnects == 2


def test_a_clock_that_jumps_about_loses_no_more_than_a_count_may(port: int, robot: socket.socket) -> None:
    with PoseUdp(address=str(port), rate=100e3).open() as connection:
        send(robot, sequence=(1 << 62) - 1, stamp=0.0)
        for _ in range(100):
            send(robot, sequence=0, stamp=9.1e9)
            send(robot, sequence=0, stamp=0.0)
        got = poll(connection)
        assert got.time.size == 201
        assert np.diff(got.sequence).max() <= 1 << 30
        assert connection.health.reconnects == 200


def test_a_flood_costs_no_memory_and_what_follows_is_read(port: int, robot: socket.socket) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with PoseUdp(address=str(port)).open() as connection:
        for _ in range(100):
            for size in (0, 1, 4097, 60_000):
                robot.send(b"x" * size)
            assert connection.poll() == []
        send(robot)
        assert poll(connection).time.size == 1
        assert connection.health.faulty == 400
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 16 << 10  # KiB


@pytest.mark.parametrize("host", ["", ":"])
def test_without_a_host_it_listens_to_this_machine_alone(port: int, host: str) -> None:
    with PoseUdp(address=f"{host}{port}").open():
        bound = [row.split()[1] for row in Path("/proc/self/net/udp").read_text().splitlines()[1:]]
    assert f"0100007F:{port:04X}" in bound
    assert f"00000000:{port:04X}" not in bound


def test_without_a_count_a_stamp_that_goes_back_is_counted_and_recorded(
    port: int, robot: socket.socket
) -> None:
    with PoseUdp(address=str(port)).open() as connection:
        for stamp in (5.0, 6.0, 2.0, 3.0):
            send(robot, stamp=stamp)
        assert poll(connection).device_time.tolist() == [5 * 10**9, 6 * 10**9, 2 * 10**9, 3 * 10**9]
        send(robot, stamp=1.0)
        poll(connection)
        assert connection.health.out_of_order == 2
        assert connection.health.readings == 5


def test_a_port_that_is_taken_is_one_line(port: int) -> None:
    with PoseUdp(address=str(port)).open():  # noqa: SIM117
        with pytest.raises(DeviceError, match=str(port)), PoseUdp(address=str(port)).open():
            pass


@pytest.mark.parametrize("address", ["", "robot", "127.0.0.1:", "127.0.0.1:70000", "9" * 5000])
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(InputError, match=f"'{address[:100]}"), PoseUdp(address=address).open():
        pass


@pytest.mark.parametrize(
    "fields", [{"rpy": [0, 0, 1]}, {"a": 1, "b": 2, "c": 3}, {"euler": [1, 2, 3]}, {"rotation": []}]
)
def test_a_rotation_of_another_name_is_not_read_as_upright(
    port: int, robot: socket.socket, fields: dict[str, Any], caplog: pytest.LogCaptureFixture
) -> None:
    with PoseUdp(address=str(port)).open() as connection:
        for _ in range(3):
            send(robot, **fields)
        time.sleep(0.02)
        assert connection.poll() == []
        assert connection.health.faulty == 3
        send(robot, orientation=[0, 0, 1, 0], **fields)
        assert poll(connection).values[0, 3:].tolist() == [0.0, 0.0, 1.0, 0.0]
    refused, unread = caplog.messages
    assert "orientation" in refused
    assert unread.endswith(f"not read: {', '.join(sorted(fields))}")


def test_other_names_are_named_as_unread_once(
    port: int, robot: socket.socket, caplog: pytest.LogCaptureFixture
) -> None:
    with PoseUdp(address=str(port)).open() as connection:
        for _ in range(3):
            send(robot, mode="auto")
        assert len(poll(connection).time) == 3
    assert caplog.messages == ["monochord: poses: not read: mode"]
