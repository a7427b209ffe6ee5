import struct
from typing import Any

import numpy as np
import pytest
from NetFT import Sensor  # pyright: ignore[reportMissingTypeStubs]

from monochord.capture.instruments import _rdt as rdt
from monochord.core.errors import DeviceError, InputError
from monochord.lab.net_ft_device import NetFtDevice, NetFtSettings, RecordStream

LOAD = np.array([[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]])
RAMP = np.outer(np.arange(7000), [0.0, 0.0, 1e-3, 0.0, 0.0, 0.0])


def numbers(records: list[bytes]) -> list[int]:
    return [struct.unpack(">I", record[:4])[0] for record in records]


def loads(records: list[bytes]) -> list[int]:
    return [struct.unpack(">IIIiiiiii", record)[5] for record in records]


def test_an_independent_client_reads_it() -> None:
    """The client is of PyPI's NetFT, written by others; it knows one port only."""
    with NetFtDevice(LOAD, NetFtSettings(rdt_port=rdt.RDT_PORT)):
        client: Any = Sensor("127.0.0.1")
        try:
            client.sock.settimeout(2.0)
            assert np.allclose(np.array(client.getMeasurement()) / 1e6, LOAD[0], atol=1e-6)
            client.tare(20)
            assert np.allclose(client.getMeasurement(), 0.0, atol=1.0)
            client.zero()
            client.startStreaming(handler=False)
            assert np.allclose(np.array(client.receive()) / 1e6, LOAD[0], atol=1e-6)
            client.stopStreaming()
        finally:
            client.sock.close()


def test_the_first_wrench_is_felt_at_the_begin_whatever_the_phase_of_the_sampling() -> None:
    stream = RecordStream(RAMP, NetFtSettings(), boot=0.0)
    stream.command(rdt.STREAM, 0, 0.1)
    stream.begin_at(0.50007)
    assert set(loads(stream.due(0.50005))) == {0}
    assert loads(stream.due(0.50007 + 3.5 / 7000)) == [0, 1000, 2000, 3000]
    assert loads(stream.due(5.0))[-1] == 6999 * 1000


def test_a_count_of_records_is_honoured_and_each_stream_restarts_its_numbers() -> None:
    stream = RecordStream(LOAD, NetFtSettings(), boot=0.0)
    stream.command(rdt.STREAM, 5, 0.1)
    assert numbers(stream.due(0.2)) == [1, 2, 3, 4, 5]
    assert not stream.streaming
    stream.command(rdt.STREAM, 0, 0.3)
    assert numbers(stream.due(0.3 + 2.5 / 7000)) == [1, 2]
    stream.command(rdt.STOP, 0, 0.4)
    assert stream.due(0.5) == []


def test_a_lower_rate_still_counts_the_samples_inside() -> None:
    stream = RecordStream(LOAD, NetFtSettings(rate=1000.0, first_sample=2**32 - 7), boot=0.0)
    stream.command(rdt.STREAM, 0, 0.0)
    inside = [struct.unpack(">I", record[4:8])[0] for record in stream.due(0.00301)]
    assert inside == [0, 7, 14]


def test_jitter_keeps_the_order_and_loses_nothing() -> None:
    stream = RecordStream(LOAD, NetFtSettings(jitter=0.01), boot=0.0)
    stream.command(rdt.STREAM, 700, 0.0)
    received: list[int] = []
    for now in np.arange(0.0, 1.0, 1e-3):
        received += numbers(stream.due(float(now)))
    assert received == list(range(1, 701))


def test_nothing_is_sent_or_received_while_the_cable_is_out() -> None:
    stream = RecordStream(LOAD, NetFtSettings(silence=(1.0, 2.0)), boot=0.0)
    stream.begin_at(0.0)
    stream.command(rdt.STREAM, 0, 0.9)
    assert len(stream.due(1.5)) == pytest.approx(700, abs=1)
    stream.command(rdt.STOP, 0, 1.6)
    assert len(stream.due(2.1)) == pytest.approx(700, abs=1)
    assert stream.lost == pytest.approx(7000, abs=1)


def test_without_power_its_counters_restart_and_it_waits_for_a_request() -> None:
    stream = RecordStream(LOAD, NetFtSettings(silence=(1.0, 2.0), restarts=True), boot=0.0)
    stream.begin_at(0.0)
    stream.command(rdt.STREAM, 0, 0.9)
    stream.due(1.5)
    assert stream.due(2.5) == []
    stream.command(rdt.STREAM, 0, 3.0)
    record, sample = struct.unpack(">II", stream.due(3.001)[0][:8])
    assert record == 1
    assert sample == pytest.approx(3500, abs=7000)


@pytest.mark.parametrize("wrenches", [np.zeros((0, 6)), np.zeros((5, 3)), np.full((1, 6), np.nan)])
def test_wrenches_of_another_shape_are_refused(wrenches: np.ndarray) -> None:
    with pytest.raises(InputError):
        NetFtDevice(wrenches)


@pytest.mark.parametrize(
    "options", [{"rate": 8000.0}, {"loss": 1.0}, {"delay": -1.0}, {"counts_per_force": 0.0}, {"wake": 1.0}]
)
def test_settings_that_make_no_sense_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        NetFtSettings(**options)


def test_a_port_that_is_taken_is_one_line() -> None:
    with NetFtDevice(LOAD) as device:
        taken = int(device.address.partition(":")[2])
        with pytest.raises(DeviceError, match=str(taken)):
            NetFtDevice(LOAD, NetFtSettings(rdt_port=taken))
