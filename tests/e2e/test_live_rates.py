"""The twin through a real JACK server at 48 kHz answers as at 44.1 kHz, and as without a server."""

import numpy as np
import pytest
from tests.conftest import own_name

import monochord as mc
from monochord.capture.jack.server import JackServer
from monochord.capture.sources import SOURCES
from monochord.core.units import Metres
from monochord.lab.jack_twin import JackTwin

pytestmark = pytest.mark.jack
PLACE, SETTLED = 0.08, 4.2
TWIN = {"seed": 1, "script": [{"start": 4.0, "position": PLACE, "force": 1.0, "seconds": 30.0}]}


@pytest.fixture(scope="module")
def place() -> Metres:
    """Where the touch is said to be without a server, as a median."""
    source = SOURCES.build("twin", {**TWIN, "speed": 0.0})
    updates = mc.listen(source, sensor="prototype", seconds=10.0)
    return float(np.nanmedian([each.position.value for each in updates if each.time > SETTLED]))


@pytest.mark.slow
@pytest.mark.parametrize("rate", [44100, 48000])
def test_the_chain_answers_alike_at_both_rates(rate: int, place: Metres) -> None:
    touched, places, starts, origins = 0, list[float](), list[int](), list[float]()
    with own_name() as name, JackServer(name, period=256, rate=rate):
        for update in mc.listen(JackTwin(server=name, twin=TWIN), sensor="prototype", seconds=10.0):
            assert update.window.sample_rate == 44100
            starts.append(update.prediction.start)
            if update.adc_time is not None:
                origins.append(update.adc_time - update.time)
            if update.truth.get("position") and update.time > SETTLED and not update.window.has_gap:
                touched += 1
                places.append(update.position.value)
    assert not np.any(np.array(starts) % 441)
    assert touched > 3  # a busy machine skips windows
    assert np.isfinite(places).mean() > 0.8  # a late player puts silence between its frames
    assert np.nanmedian(places) == pytest.approx(place, abs=3e-4)
    assert place == pytest.approx(PLACE, abs=1e-3)
    # The converter's clock is this machine's, but for the jitter of JACK's periods.
    assert len(origins) > 3
    assert np.median(np.abs(np.array(origins) - np.median(origins))) < 2e-3
