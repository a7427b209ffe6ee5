import socket
import time
from typing import Any

import numpy as np
import pytest
from tests.ports import free_ports

from monochord.capture.instruments.udp import Udp
from monochord.core.errors import InputError


def open_at_any_port(**options: Any) -> tuple[Udp, int]:
    (port,) = free_ports(1)
    return Udp(address=str(port), **options), port


def test_columns_are_read_by_name() -> None:
    options, port = open_at_any_port(
        stream="room", columns=("temperature", "humidity"), units=("K", ""), rate=2.0
    )
    with options.open() as connection, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as thermometer:
        assert connection.feed.units == ("K", "")
        for datagram in (
            b'{"values": {"humidity": 0.4, "temperature": 293}, "stamp": 2, "sequence": 3}',
            b'{"values": {"temperature": 294, "colour": 1}, "sequence": 5}',
            b'{"values": {"temperature": "warm"}}',
            b'{"values": {"temperature": 1e999}}',
            b'{"values": {"temperature": -1e300}}',
            b'{"values": {"temperature": NaN}}',
            b'{"values": {"temperature": ' + b"9" * 3000 + b"}}",
            b'{"values": ' + b'{"temperature":' * 200 + b"1" + b"}" * 201,
            b'{"values": {"temperature": 1, "temperature": 295}, "sequence": 6}',
        ):
            thermometer.sendto(datagram, ("127.0.0.1", port))
        time.sleep(0.02)
        (got,) = connection.poll()
        assert got.stream == "room"
        assert np.array_equal(got.values, [[293.0, 0.4], [294.0, np.nan], [295.0, np.nan]], equal_nan=True)
        assert got.sequence.tolist() == [3, 5, 6]
        assert connection.health.faulty == 6
        assert connection.health.missing == 1


@pytest.mark.parametrize(
    ("options", "given"),
    [
        ({"stream": "Room 1"}, "'Room 1'"),
        ({"columns": ()}, "columns"),
        ({"columns": ("a", "a")}, "a, a"),
        ({"columns": ("a", "b"), "units": ("m",)}, "1 units"),
        ({"stream": "wrench"}, "'wrench'"),
        ({"rate": -1.0}, "-1"),
    ],
)
def test_options_that_make_no_sense_are_refused(options: dict[str, Any], given: str) -> None:
    with pytest.raises(InputError, match=given), open_at_any_port(**options)[0].open():
        pass
