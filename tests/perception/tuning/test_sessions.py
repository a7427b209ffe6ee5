"""What a model makes of sessions on other strings."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import StringParams
from monochord.core.units import Newtons
from monochord.datasets.manifest import DatasetSession
from monochord.perception.tuning.sessions import at_length_of, string_of, tension_estimator
from monochord.physics.sensors import load_sensor, with_length
from monochord.physics.strings import load_string
from monochord.physics.theory import open_frequency, stiff_partials

DESIGN, SOUND = load_string("prototype").string, np.zeros((2, 44100), np.float32)


def test_a_session_on_a_longer_string_is_refused() -> None:
    listen = tension_estimator(DESIGN)
    with pytest.raises(InputError, match=r"0\.65 m.*0\.2 m"):
        listen(SOUND, 44100, replace(DESIGN, length=0.65), None)


def test_one_of_nearly_the_same_length_or_that_names_none_is_listened_to() -> None:
    for design, string in ((DESIGN, replace(DESIGN, length=0.203)), (DESIGN, None), (None, DESIGN)):
        assert tension_estimator(design)(SOUND, 44100, string, None) is None  # silence tells no tension


def test_a_session_keeps_its_pitch_on_the_designs_wire_and_its_own_length() -> None:
    other = replace(load_sensor("gauge_012").string, length=0.203, tension=70.0)
    tension = tension_estimator(DESIGN)(SOUND, 44100, other, 70.0)
    blank = dict.fromkeys(("name", "source", "checksum", "audio", "audio_checksum", "labels"), "")
    part = DatasetSession(
        **blank, frames=0, first=0, windows=0, tension=tension, tuned="recorded", length=0.203
    )
    own = string_of(part, DESIGN, measured=True)
    assert own.length == 0.203
    assert open_frequency(own) == pytest.approx(open_frequency(other))
    ruled = string_of(replace(part, measured_length=0.2021), DESIGN, measured=True)
    assert (ruled.length, ruled.linear_density) == (0.2021, DESIGN.linear_density)
    assert open_frequency(ruled) == pytest.approx(open_frequency(other))
    assert string_of(replace(part, measured_length=0.2021), DESIGN, measured=False) == own
    assert open_frequency(at_length_of(own, DESIGN)) == pytest.approx(open_frequency(other))
    assert at_length_of(with_length(DESIGN, 0.203), DESIGN) is DESIGN


def at_the_same_pitch(other: StringParams) -> Newtons:
    """Return the tension at which the design's wire sounds as another one."""
    return DESIGN.tension * (open_frequency(other) / open_frequency(DESIGN)) ** 2


def test_the_tension_of_another_wire_is_that_of_the_designs_at_the_same_pitch() -> None:
    other = load_sensor("gauge_012").string
    time = np.arange(3 * 44100) / 44100.0
    numbers = np.arange(1.0, 5.0)
    partials = stiff_partials(open_frequency(other), 1.6e-4, numbers)
    tone = (1.0 / numbers) @ np.sin(2.0 * np.pi * np.outer(partials, time))
    hiss = 1e-4 * np.random.default_rng(0).standard_normal((2, time.size))
    estimated = tension_estimator(DESIGN)((0.1 * tone + hiss).astype(np.float32), 44100, other, None)
    assert estimated == pytest.approx(at_the_same_pitch(other), rel=4e-3)


def test_so_is_one_that_was_recorded_as_tuned() -> None:
    other = replace(load_sensor("gauge_012").string, tension=70.0)
    assert tension_estimator(DESIGN)(SOUND, 44100, other, 70.0) == pytest.approx(at_the_same_pitch(other))
    with pytest.raises(InputError, match=r"0\.65 m"):
        tension_estimator(DESIGN)(SOUND, 44100, replace(other, length=0.65), 70.0)
