"""What every instrument promises: silence is no error, readings have one shape, leaving lets all go."""

import dataclasses
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.ports import free_ports

from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.instruments.base import Instrument
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Feed, InstrumentHealth
from monochord.lab.net_ft_device import NetFtDevice

Options = dict[str, Any]
each_instrument = pytest.mark.parametrize("name", INSTRUMENTS.names())


@pytest.fixture
def silent(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[str], Options]:
    """Return the options of an instrument whose device is there and says nothing, or next to nothing."""

    def net_ft() -> Options:
        device = NetFtDevice(np.zeros((1, 6)))
        request.addfinalizer(device.close)
        return {"address": device.address, "http_port": device.http_port}

    def pose_csv() -> Options:
        (tmp_path / "pose.csv").write_text("time,x,y,z\n")
        return {"path": str(tmp_path / "pose.csv")}

    special: dict[str, Callable[[], Options]] = {
        "net_ft": net_ft,
        "pose_csv": pose_csv,
        "pose_dds": lambda: {"domain": 1 + os.getpid() % 99},
    }
    return lambda name: special[name]() if name in special else {"address": f"127.0.0.1:{free_ports(1)[0]}"}


def build(name: str, options: Options) -> Instrument:
    return INSTRUMENTS.build(name, options)


@each_instrument
def test_its_feed_says_what_a_reading_is(name: str, silent: Callable[[str], Options]) -> None:
    with build(name, silent(name)).open() as connection:
        feed = connection.feed
        assert isinstance(feed, Feed)
        assert len(feed.columns) == len(feed.units) > 0
        assert feed.rate >= 0.0
        assert feed.details
        assert all(isinstance(value, str) for value in feed.details.values())


@each_instrument
def test_polling_never_waits_and_fits_the_feed(name: str, silent: Callable[[str], Options]) -> None:
    with build(name, silent(name)).open() as connection:
        last = -np.inf
        for _ in range(20):
            began = time.monotonic()
            parts = connection.poll()
            assert time.monotonic() - began < 0.2
            for part in parts:
                n = part.time.size
                assert n > 0
                assert part.stream == connection.feed.stream
                assert part.values.shape == (n, len(connection.feed.columns))
                assert part.values.dtype == part.time.dtype == np.float64
                assert part.sequence.shape == part.device_time.shape == part.status.shape == (n,)
                assert part.sequence.dtype == part.device_time.dtype == np.int64
                assert part.status.dtype == np.uint32
                assert part.time[0] >= last
                last = part.time[-1]
            time.sleep(0.005)


@each_instrument
def test_silence_is_no_error(name: str, silent: Callable[[str], Options]) -> None:
    options = silent(name)
    with build(name, options).open() as connection:
        if name == "net_ft":
            connection._send(0)  # pyright: ignore[reportAttributeAccessIssue]
            time.sleep(0.1)
            connection.poll()
        assert connection.poll() == []
        if name != "net_ft":
            assert connection.health == InstrumentHealth()


@each_instrument
def test_it_can_be_opened_again_once_it_is_left(name: str, silent: Callable[[str], Options]) -> None:
    options = silent(name)
    before = threading.active_count()
    for _ in range(2):
        with build(name, options).open() as connection:
            connection.poll()
    assert threading.active_count() == before


@each_instrument
def test_it_is_left_when_what_uses_it_fails(name: str, silent: Callable[[str], Options]) -> None:
    instrument = build(name, silent(name))
    with pytest.raises(OSError, match="disk full"), instrument.open():
        raise OSError("disk full")
    with instrument.open():
        pass


@each_instrument
def test_what_cannot_be_opened_is_one_line(name: str) -> None:
    first = dataclasses.fields(INSTRUMENTS.load(name))[0].name  # pyright: ignore[reportArgumentType]
    with pytest.raises((InputError, DeviceError)) as caught, build(name, {first: "no such thing"}).open():
        pass
    assert "\n" not in str(caught.value)
    assert "no such thing" in str(caught.value)


@each_instrument
def test_a_rate_that_makes_no_sense_is_refused(name: str, silent: Callable[[str], Options]) -> None:
    with (
        pytest.raises(InputError, match=r"rate.* -1\.0"),
        build(name, {**silent(name), "rate": -1.0}).open(),
    ):
        pass


def test_options_are_known_without_the_libraries_that_need_a_device() -> None:
    code = (
        "import sys; from monochord.capture.instruments import INSTRUMENTS as i\n"
        "for n in i.names(): i.load(n)\n"
        "heavy = {'cyclonedds', 'monochord.capture.dds.participant', 'numba', 'scipy'}\n"
        "print(heavy & set(sys.modules) or 'none')"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "none\n"
