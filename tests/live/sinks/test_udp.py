import json
import math
import socket
import time

import pytest
from tests.live.sinks import made
from tests.live.sinks.made import SIGNAL

from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Estimate, Tracked
from monochord.live.events import Event
from monochord.live.health import Note
from monochord.live.sinks._record import unix_nanoseconds
from monochord.live.sinks.base import NotDeliveredError, Run, Update
from monochord.live.sinks.jsonl import Jsonl
from monochord.live.sinks.udp import Udp

ESTIMATES = {
    "position": Estimate(value=0.12, std=2e-4, unit="m"),
    "force": Estimate.abstain("N", "not at rest"),
    "contact": Estimate(value=0.99, std=math.inf, unit="1"),
}


def update(**taken: float) -> Update:
    return made.update(
        ESTIMATES,
        {"position": 0.1201, "slip": math.nan},
        tracked=Tracked(estimates={"position": Estimate(value=0.1203, std=math.inf, unit="m")}),
        decided={"contact": True},
        events=(Event(name="slip", on=False, time=0.1, delay=0.01, confidence=0.9),),
        notes=(Note(key="hum", level="warning", sentence="", remedy="", since=0.0),),
        **taken,
    )


@pytest.mark.parametrize("everything", [True, False])
def test_a_receiver_gets_what_jsonl_writes_with_a_count_and_a_stamp(
    capsys: pytest.CaptureFixture[str], *, everything: bool
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10.0)
        to = f"localhost:{receiver.getsockname()[1]}"
        with (
            Udp(to=to, everything=everything).open(Run(signal=SIGNAL)) as writer,
            Jsonl(everything=everything).open(Run(signal=SIGNAL)) as lines,
        ):
            for _ in range(3):
                writer.write(update())
                lines.write(update())
        datagrams = [json.loads(receiver.recv(65536)) for _ in range(3)]
    written = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    for sequence, (datagram, line) in enumerate(zip(datagrams, written, strict=True)):
        assert datagram.pop("sequence") == sequence
        assert abs(datagram.pop("stamp") - time.time()) < 60.0
        if everything:
            assert datagram["tracked_position"] == 0.1203
            assert datagram["tracked_position_std"] is None
            assert datagram["decided_contact"] is True
            (event,) = datagram["events"]
            assert event == {"name": "slip", "on": False, "time": 0.1, "delay": 0.01, "confidence": 0.9}
            assert datagram["notes"] == ["hum"]
        assert datagram == line


def test_the_stamp_is_the_converters_time_or_else_when_the_sound_was_at_hand() -> None:
    now, wall = time.monotonic(), time.time()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10.0)
        with Udp(to=str(receiver.getsockname()[1])).open(Run(signal=SIGNAL)) as writer:
            writer.write(update(adc_time=now - 1000.1, at_hand=now - 10.0))
            writer.write(update(at_hand=now - 10.0))
        stamps = [json.loads(receiver.recv(65536))["stamp"] for _ in range(2)]
    assert stamps == pytest.approx([wall - 1000.0, wall - 10.0], abs=0.5)


def test_the_stamp_follows_a_clock_that_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    now, wall = time.monotonic(), time.time_ns()
    given = update(adc_time=now)
    before = unix_nanoseconds(given)
    monkeypatch.setattr(time, "time_ns", lambda: wall + 3600 * 10**9)
    assert unix_nanoseconds(given) - before == pytest.approx(3600 * 10**9, abs=10**9)


def test_nobody_need_receive() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as once:
        once.bind(("127.0.0.1", 0))
        port = once.getsockname()[1]
    with Udp(to=str(port)).open(Run(signal=SIGNAL)) as writer:
        for _ in range(10):
            writer.write(update())


def test_a_datagram_that_the_system_does_not_send_is_no_fault_of_the_sink() -> None:
    # Broadcasts need an option of the socket: the system refuses this one.
    with Udp(to="255.255.255.255:9880").open(Run(signal=SIGNAL)) as writer, pytest.raises(NotDeliveredError):
        writer.write(update())


@pytest.mark.parametrize("to", ["", "localhost", "localhost:", "localhost:0", "localhost:65536", "9880:x"])
def test_what_is_no_address_is_refused(to: str) -> None:
    with pytest.raises(InputError, match=f"'{to}'"), Udp(to=to).open(Run(signal=SIGNAL)):
        pass


def test_an_ipv6_address_is_refused_as_such() -> None:
    with pytest.raises(InputError, match=r"'\[::1\]'.*IPv4"), Udp(to="[::1]:1").open(Run(signal=SIGNAL)):
        pass


def test_an_unknown_host_is_refused() -> None:
    with (
        pytest.raises(DeviceError, match=r"nobody\.invalid"),
        Udp(to="nobody.invalid:1").open(Run(signal=SIGNAL)),
    ):
        pass
