"""The twin through a real JACK server at 48 kHz answers as at 44.1 kHz."""

import numpy as np
import pytest
from tests.conftest import own_name

import monochord as mc
from monochord.capture.jack.server import JackServer
from monochord.capture.sources import SOURCES
from monochord.core.clock import SampleClock
from monochord.lab.jack_twin import JackTwin

pytestmark = pytest.mark.jack
PLACE = 0.08
TWIN = {"seed": 1, "script": [{"start": 4.0, "position": PLACE, "force": 1.0, "seconds": 30.0}]}


@pytest.mark.parametrize("rate", [44100, 48000])
def test_the_chain_answers_alike_at_both_rates(rate: int) -> None:
    touched, errors, starts = 0, list[float](), list[int]()
    with own_name() as name, JackServer(name, period=256, rate=rate):
        for update in mc.listen(JackTwin(server=name, twin=TWIN), sensor="prototype", seconds=8.0):
            assert update.window.sample_rate == 44100
            starts.append(update.prediction.start)
            if update.truth.get("position") and update.time > 4.2 and not update.window.has_gap:
                touched += 1
                errors.append(update.position.value - update.truth["position"])
    assert not np.any(np.array(starts) % 441)
    assert touched > 20  # a busy machine skips windows
    assert np.isfinite(errors).mean() > 0.95
    assert np.nanmedian(np.abs(errors)) < 3e-4


def test_the_converter_s_time_is_that_of_the_window() -> None:
    seen = list[float]()
    with own_name() as name, JackServer(name, period=256, rate=48000):
        source = SOURCES.build("jack", {"server": name, "ports": "none"})
        for update in mc.listen(source, sensor="prototype", seconds=2.0):
            assert update.adc_time is not None
            seen.append(update.adc_time - SampleClock(sample_rate=44100).time(update.prediction.start))
    # The dummy driver's clock and JACK's are both this machine's, but for its periods' jitter.
    assert len(seen) > 10
    assert np.ptp(seen) < 0.02
