import dataclasses
import socket
import time
from typing import Any

import numpy as np
import pytest

from monochord.capture.instruments import _arrivals
from monochord.capture.instruments.base import Connection
from monochord.capture.instruments.net_ft import NetFt
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Readings
from monochord.lab.net_ft_device import NetFtDevice, NetFtSettings

RATE = 7000
RAMP = np.outer(np.arange(4 * RATE), [0.0, 0.0, 1e-3, 1e-5, 0.0, 0.0])


def sensor(device: NetFtDevice, **options: Any) -> NetFt:
    return NetFt(address=device.address, http_port=device.http_port, **options)


def listen(connection: Connection, seconds: float, every: float = 0.01) -> Readings:
    """Everything that comes in so long."""
    end, parts = time.monotonic() + seconds, list[Readings]()
    while time.monotonic() < end:
        time.sleep(every)
        parts += connection.poll()
    return joined(parts)


def joined(parts: list[Readings]) -> Readings:
    arrays = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in dataclasses.fields(Readings)
        if field.name != "stream"
    }
    return Readings(stream=parts[0].stream, **arrays)


def test_every_record_comes_in_order_with_its_time() -> None:
    with NetFtDevice(RAMP) as device, sensor(device).open() as connection:
        assert connection.feed.rate == connection.feed.ticks == RATE
        assert connection.feed.details["cfgcpf"] == "1000000"
        connection.poll()
        begin = time.monotonic() + 0.1
        device.begin_at(begin)
        got = listen(connection, 1.4)
        health = connection.health
    assert health.missing == health.out_of_order == health.faulty == health.reconnects == 0
    assert got.time.size > RATE
    assert np.all(np.diff(got.sequence) == 1)
    assert np.all(np.diff(got.device_time) == 1)
    assert np.all(np.diff(got.time) >= 0)
    index = np.rint(got.values[:, 2] / 1e-3)
    moving = (index > 0) & (index < len(RAMP) - 1)
    assert np.array_equal(np.diff(index[moving]), np.ones(moving.sum() - 1))
    late = got.time[moving] - (begin + index[moving] / RATE)
    assert 0.0 < late.min() < 5e-3  # the kernel's time, not the poll's
    assert np.allclose(got.values[moving, 3], index[moving] * 1e-5, atol=1e-6)


def test_what_is_missing_is_what_was_lost() -> None:
    settings = NetFtSettings(loss=0.02, jitter=1e-3, seed=4)
    with NetFtDevice(RAMP, settings) as device, sensor(device).open() as connection:
        got = listen(connection, 1.0)
        health = connection.health
    gaps = int(got.sequence[-1] - got.sequence[0]) + 1 - got.sequence.size
    assert health.missing == gaps
    assert 0.01 * RATE < health.missing <= device.lost


def test_a_late_begin_of_reading_costs_nothing() -> None:
    """A poll a third of a second late finds all that came: the kernel's buffer holds it."""
    with NetFtDevice(RAMP) as device, sensor(device).open() as connection:
        got = listen(connection, 0.4, every=0.33)
        assert connection.health.missing == 0
        assert connection.health.reconnects == 0
    assert np.all(np.diff(got.sequence) == 1)
    assert np.median(np.diff(got.time)) < 2e-3  # arrival, not the poll


def test_bias_makes_the_load_of_the_moment_zero() -> None:
    load = np.array([[1.0, -2.0, 3.0, 0.1, 0.2, -0.3]])
    with NetFtDevice(load) as device:
        with sensor(device).open() as connection:
            assert np.allclose(listen(connection, 0.1).values, load, atol=1e-6)
        with sensor(device, bias=True).open() as connection:
            assert np.allclose(listen(connection, 0.1).values, 0.0, atol=1e-6)


def test_a_latched_status_is_kept_and_counted_until_it_is_reset() -> None:
    settings = NetFtSettings(fault_after=0.0)
    with NetFtDevice(RAMP[:1], settings, begin=time.monotonic()) as device:
        with sensor(device).open() as connection:
            got = listen(connection, 0.1)
            assert connection.health.faulty == connection.health.readings > 0
        assert set(got.status.tolist()) == {0x80010000}
        with sensor(device, reset_latch=True).open() as connection:
            listen(connection, 0.1)
            assert connection.health.faulty == 0 < connection.health.readings


@pytest.mark.parametrize("restarts", [False, True])
def test_a_sensor_that_was_unplugged_comes_back_by_itself(*, restarts: bool) -> None:
    settings = NetFtSettings(silence=(0.3, 0.9), restarts=restarts)
    with NetFtDevice(RAMP, settings) as device, sensor(device).open() as connection:
        begin = time.monotonic()
        device.begin_at(begin)
        got = listen(connection, 1.5)
        health = connection.health
    away = np.diff(got.time).argmax()
    assert got.time[away] - begin == pytest.approx(0.3, abs=0.1)
    assert 0.85 < got.time[away + 1] - begin < 1.35
    assert health.reconnects == 1
    assert health.missing == int(got.sequence[-1] - got.sequence[0]) + 1 - got.sequence.size
    if restarts:  # its counters tell nothing, the time of arrival does
        assert health.missing == pytest.approx(RATE * (got.time[away + 1] - got.time[away]), rel=0.02)
    else:
        assert health.missing == np.sum(np.diff(got.device_time) - 1) >= 0.6 * RATE - 1
    assert np.all(np.diff(got.time) >= 0)


def test_counters_that_wrap_round_are_carried_on() -> None:
    settings = NetFtSettings(first_record=2**32 - 500, first_sample=2**32 - 900)
    with NetFtDevice(RAMP, settings) as device, sensor(device).open() as connection:
        got = listen(connection, 0.4)
        assert connection.health.missing == 0
    assert got.sequence[0] < 2**32 < got.sequence[-1]
    assert np.all(np.diff(got.sequence) == 1)
    assert np.all(np.diff(got.device_time) == 1)


def test_a_wall_clock_set_by_an_hour_moves_no_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock is set between two readings of it: stamps before and after then differ by an hour."""
    true = _arrivals.clock_offsets
    with NetFtDevice(RAMP) as device, sensor(device).open() as connection:
        before = listen(connection, 0.2)
        monkeypatch.setattr(_arrivals, "clock_offsets", lambda: {"realtime": true()["realtime"] + 3600.0})
        time.sleep(0.02)
        (stepped,) = connection.poll()  # the offset is new, the stamps are old
        monkeypatch.setattr(_arrivals, "clock_offsets", true)
        after = listen(connection, 0.2)
        now = time.monotonic()
    got = joined([before, stepped, after])
    assert np.all(np.diff(got.time) >= 0)
    assert np.diff(got.time).max() < 0.15
    assert got.time[-1] <= now


def test_garbage_and_strangers_are_passed_over() -> None:
    with NetFtDevice(RAMP) as device, sensor(device).open() as connection:
        client = device._client
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            for size in (0, 1, 35, 36, 37, 3000, 60_000):
                stranger.sendto(bytes(size), client)
                if size != 36:
                    device._socket.sendto(b"\xff" * size, client)
        got = listen(connection, 0.2)
        assert connection.health.missing == 0
        assert connection.health.faulty == 6  # the device's own; a stranger's do not even arrive
    assert np.all(np.diff(got.sequence) == 1)


def test_a_record_that_comes_too_late_or_twice_is_left_out() -> None:
    with NetFtDevice(RAMP[:1]) as device, sensor(device).open() as connection:
        device._records.command(0, 0, time.monotonic())
        listen(connection, 0.1)
        last = device._records._record
        for number in (last, last + 2, last + 1, last + 2, last + 3):
            record = np.array([number, number, 0, *range(6)], ">u4").tobytes()
            device._socket.sendto(record, device._client)
        time.sleep(0.05)
        (got,) = connection.poll()
        assert (got.sequence - last).tolist() == [0, 2, 3]
        assert connection.health.out_of_order == 2
        assert connection.health.missing == 1


def test_leaving_ends_its_stream() -> None:
    with NetFtDevice(RAMP) as device:
        with sensor(device).open() as connection:
            listen(connection, 0.05)
        time.sleep(0.1)
        sent = device.sent
        time.sleep(0.1)
        assert device.sent == sent
        assert connection.poll() == []


def test_a_box_that_is_off_is_one_line() -> None:
    with NetFtDevice(RAMP) as device:
        gone = sensor(device)
    with pytest.raises(DeviceError, match="127"), gone.open():
        pass


def test_a_box_that_does_not_stream_is_one_line() -> None:
    settings = NetFtSettings(silence=(0.0, 1e9))
    with NetFtDevice(RAMP, settings, begin=time.monotonic()) as device:
        deaf = sensor(device, timeout_seconds=0.1)
        with pytest.raises(DeviceError, match="127"), deaf.open():
            pass


@pytest.mark.parametrize(
    ("options", "given"),
    [
        ({"address": ""}, "''"),
        ({"address": "box:x"}, "x"),
        ({"address": "box:0"}, "0"),
        ({"http_port": 70000}, "70000"),
        ({"rate": -1.0}, "-1"),
        ({"timeout_seconds": 0.0}, "0"),
        ({"silence_seconds": float("inf")}, "inf"),
    ],
)
def test_options_that_make_no_sense_are_refused(options: dict[str, Any], given: str) -> None:
    with pytest.raises(InputError, match=given), NetFt(**options).open():
        pass
