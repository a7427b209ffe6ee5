"""What every sink promises: it takes any update, quickly, and leaves nothing behind."""

import dataclasses
import itertools
import math
import threading
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from tests.live.sinks.made import window_update

from monochord.core.errors import InputError
from monochord.core.types import Audio, Estimate, Signal, StreamHealth, StringParams
from monochord.live.delivery import Delivery
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Run, Update

STRING = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)
TONE = (0.3 * np.sin(np.arange(4410) * 0.1)).astype(np.float32)
SAMPLES = {
    "tone": TONE,
    "silence": np.zeros(4410, np.float32),
    "full scale": np.sign(TONE),
    "NaN": np.full(4410, np.nan, np.float32),
    "infinite": np.full(4410, np.inf, np.float32),
    "huge": np.full(4410, 1e30, np.float32),
}
ESTIMATES: dict[str, Mapping[str, Estimate]] = {
    "none": {},
    "both sides": {
        "frequency": Estimate(value=695.0, std=0.1, unit="Hz"),
        "position": Estimate(value=0.2275, std=2e-4, unit="m"),
        "force": Estimate(value=0.8, std=0.05, unit="N"),
        "frequency_1": Estimate(value=695.0, std=0.1, unit="Hz"),
    },
    "abstaining": {
        "frequency": Estimate.abstain("Hz", "two candidates"),
        "position": Estimate.abstain("m", "two candidates"),
    },
    "outside the string": {"position": Estimate(value=-0.3, std=2.0, unit="m")},
    "no spread": {"position": Estimate(value=0.1, std=math.nan, unit="m")},
    "never heard of": {"hardness_of_the_object": Estimate(value=1e9, std=1e8, unit="Pa")},
}

TRUTHS = [{}, {"contact": 0.0}, {"contact": 1.0, "position": 0.228, "force": 0.8, "colour": 3.0}]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Be where a sink may put the file that its options name by default."""
    monkeypatch.chdir(tmp_path)


def update(
    number: int, samples: Audio, estimates: Mapping[str, Estimate], truth: Mapping[str, float]
) -> Update:
    health = StreamHealth(frames=441 * number, dropped=3, gaps=1, xruns=2)
    return window_update(number, estimates, samples, health=health, truth=truth, skipped=4)


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("string", [None, STRING], ids=["unknown string", "known string"])
@pytest.mark.parametrize("name", SINKS.names())
def test_it_takes_every_moment(
    name: str, string: StringParams | None, channels: int, capsys: pytest.CaptureFixture[str]
) -> None:
    signal = Signal(sample_rate=44100, channels=channels, string=string)
    with SINKS.build(name).open(Run(signal=signal)) as writer:
        cases = itertools.product(SAMPLES.values(), ESTIMATES.values(), TRUTHS)
        for k, (samples, estimates, truth) in enumerate(cases):
            writer.write(update(k, np.tile(samples, (channels, 1)), estimates, truth))
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("name", SINKS.names())
def test_it_takes_the_moments_of_several_strings(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    signal = Signal(sample_rate=44100, channels=2, string=STRING)
    strings = {"left": signal, "right": signal}
    run = Run(signal=dataclasses.replace(signal, channels=4), strings=strings)
    with Delivery([SINKS.build(name)], run, paced=False) as delivery:
        for k in range(4):
            for string in strings:
                own = update(k, np.tile(TONE, (2, 1)), ESTIMATES["both sides"], {})
                delivery.hand_over(dataclasses.replace(own, string=string))
    assert sum(each.written for each in delivery.delivered) == 8
    assert not any(each.left_out or each.failure for each in delivery.delivered)
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("name", SINKS.names())
def test_writing_is_quick(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The median write takes less than a tenth of a hop of 10 ms: the loop has an estimate to make."""
    spans: list[float] = []
    with SINKS.build(name).open(Run(signal=Signal(sample_rate=44100, channels=2))) as writer:
        for k in range(200):
            given = update(k, np.stack([TONE, TONE]), ESTIMATES["both sides"], TRUTHS[2])
            begin = time.perf_counter()
            writer.write(given)
            spans.append(time.perf_counter() - begin)
    assert np.median(spans) < 1e-3


@pytest.mark.parametrize("name", SINKS.names())
def test_it_opens_again_and_leaves_no_thread(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = threading.active_count()
    sink = SINKS.build(name)
    for _ in range(3):
        with sink.open(Run(signal=Signal(sample_rate=44100, channels=1))) as writer:
            writer.write(update(0, TONE[None], ESTIMATES["both sides"], {}))
    assert threading.active_count() == before


@pytest.mark.parametrize("name", SINKS.names())
def test_it_does_not_change_what_it_is_handed(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    given = update(0, TONE[None].copy(), dict(ESTIMATES["both sides"]), dict(TRUTHS[2]))
    with SINKS.build(name).open(Run(signal=Signal(sample_rate=44100, channels=1))) as writer:
        writer.write(given)
    np.testing.assert_array_equal(given.window.samples, TONE[None])
    assert given.prediction.estimates == ESTIMATES["both sides"]
    assert given.truth == TRUTHS[2]


def test_a_file_sink_that_cannot_write_says_so() -> None:
    path_sinks = [n for n in SINKS.names() if "path" in {f.name for f in dataclasses.fields(SINKS.load(n))}]  # pyright: ignore[reportArgumentType]
    assert path_sinks
    for name in path_sinks:
        sink = SINKS.build(name, {"path": "/no/such/folder/file"})
        signal = Signal(sample_rate=44100, channels=1)
        with pytest.raises(InputError, match="/no/such/folder/file"), sink.open(Run(signal=signal)):
            pass
