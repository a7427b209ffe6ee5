"""The twin through a real JACK server at 48 kHz answers as at 44.1 kHz, and as without a server."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from tests.conftest import own_name

import monochord as mc
from monochord.capture.jack.server import JackServer
from monochord.capture.sources import SOURCES
from monochord.core.units import Metres, Samples, Seconds
from monochord.lab.jack_twin import JackTwin

pytestmark = [pytest.mark.jack, pytest.mark.slow]
PLACE, SETTLED = 0.08, 4.2
TWIN = {"seed": 1, "script": [{"start": 4.0, "position": PLACE, "force": 1.0, "seconds": 30.0}]}
RATES = (44100, 48000)


class Heard(NamedTuple):
    """What came through a server: windows' beginnings, the converter's time less theirs, and places."""

    starts: list[Samples]
    origins: list[Seconds]
    places: list[Metres]
    truths: list[Metres]


@pytest.fixture(scope="module")
def heard() -> Callable[[int], Heard]:
    """Return what is heard through a server at a rate, once a rate."""

    @cache
    def at(rate: int) -> Heard:
        heard = Heard([], [], [], [])
        with own_name() as name, JackServer(name, period=256, rate=rate):
            for update in mc.listen(JackTwin(server=name, twin=TWIN), sensor="prototype", seconds=10.0):
                assert update.window.sample_rate == 44100
                heard.starts.append(update.prediction.start)
                if update.adc_time is not None:
                    heard.origins.append(update.adc_time - update.time)
                if update.truth.get("position") and update.time > SETTLED and not update.window.has_gap:
                    heard.places.append(update.position.value)
                    heard.truths.append(update.truth["position"])
        return heard

    return at


@pytest.fixture(scope="module")
def without_a_server() -> Metres:
    """Where the touch is said to be without a server, as a median."""
    source = SOURCES.build("twin", {**TWIN, "speed": 0.0})
    updates = mc.listen(source, sensor="prototype", seconds=10.0)
    return float(np.nanmedian([each.position.value for each in updates if each.time > SETTLED]))


@pytest.mark.parametrize("rate", RATES)
def test_the_chain_answers_alike_at_both_rates(
    rate: int, heard: Callable[[int], Heard], without_a_server: Metres
) -> None:
    starts, origins, places, _ = heard(rate)
    assert not np.any(np.array(starts) % 441)
    assert len(places) > 3  # a busy machine skips windows
    assert np.isfinite(places).mean() > 0.8  # a late player puts silence between its frames
    assert np.nanmedian(places) == pytest.approx(without_a_server, abs=3e-4)
    # The converter's clock is this machine's, but for the jitter of JACK's periods.
    assert len(origins) > 3
    assert np.median(np.abs(np.array(origins) - np.median(origins))) < 2e-3


@pytest.mark.parametrize("rate", [44100, 48000])
def test_its_place_is_right(rate: int, heard: Callable[[int], Heard]) -> None:
    _, _, places, truths = heard(rate)
    assert np.nanmedian(np.abs(np.array(places) - truths)) < 3e-4
