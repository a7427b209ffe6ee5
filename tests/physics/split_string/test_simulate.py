"""The paper's appendix, the routes, and what is refused."""

from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.physics.split_string import Route, SplitString, peaks, simulate
from monochord.physics.split_string.simulate import _resample
from monochord.physics.strings import load_string
from monochord.physics.theory import mixing_matrix, segment_frequencies

APPENDIX = load_string("appendix")
SETUP = SplitString(string=APPENDIX.string, contact=APPENDIX.contact)


@pytest.mark.parametrize("route", ["fdtd", "modal"])
def test_the_appendix_case_peaks_where_theory_says(route: Route) -> None:
    recording = simulate(SETUP, 0.4, route=route)
    assert recording.microphones.shape == (2, 17640)
    assert peaks(recording) == pytest.approx((695.0, 374.2), rel=1e-3)
    steady = np.abs(recording.segments[:, 13230:15435])  # 300-350 ms
    assert (steady.max(axis=1) > 0.05).all()
    assert steady[:, :1100].max(axis=1) == pytest.approx(steady[:, 1100:].max(axis=1), rel=0.03)
    assert np.isnan(recording.drive_frequencies[:, :2]).all()  # a whole window must be heard first
    assert recording.drive_frequencies[:, -1] == pytest.approx((695.0, 374.2), rel=1e-3)
    assert recording.drive_frequencies.shape == (2, 20)


@pytest.mark.parametrize("force", [0.5, 2.0])
@pytest.mark.parametrize("place", [0.3, 0.5, 0.7])
def test_the_peaks_follow_the_touch(place: float, force: float) -> None:
    contact = Contact(position=place * APPENDIX.string.length, force=force)
    found = peaks(simulate(SplitString(string=APPENDIX.string, contact=contact), 0.4, route="modal"))
    assert found == pytest.approx(segment_frequencies(APPENDIX.string, contact), rel=1e-3)


def test_the_microphones_mix_the_segments() -> None:
    setup = SplitString(string=APPENDIX.string, contact=APPENDIX.contact, mixing=(0.7, 0.9))
    recording = simulate(setup, 0.05, route="modal")
    assert recording.microphones == pytest.approx(mixing_matrix(0.7, 0.9) @ recording.segments)


@pytest.mark.parametrize("sample_rate", [16000, 48000])
def test_other_sample_rates_tell_the_same(sample_rate: int) -> None:
    assert peaks(simulate(SETUP, 0.4, route="modal", sample_rate=sample_rate)) == pytest.approx(
        (695.0, 374.2), rel=1e-3
    )


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"route": "modl"}, "route 'modl'.*did you mean 'modal'"),
        ({"seconds": 0.0}, "0 seconds: allowed is above 0"),
        ({"seconds": float("nan")}, "nan seconds"),
        ({"sample_rate": 100}, "sample rate 100 Hz"),
    ],
)
def test_what_cannot_be_simulated_is_refused(options: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line):
        simulate(SETUP, options.pop("seconds", 0.1), **options)


def test_a_step_too_long_for_the_shorter_segment_is_refused_before_anything_runs() -> None:
    near = Contact(position=0.05, force=0.0)
    short = SplitString(string=APPENDIX.string, contact=near, time_step=1e-6)
    with pytest.raises(InputError, match=r"time step 1e-06 s: allowed is below 5.891e-07 s"):
        simulate(short, 0.1)
    assert peaks(simulate(short, 0.4, route="modal")) == pytest.approx((3162.3, 263.5), rel=1e-3)


def test_nothing_folds_back_from_the_grid_s_rate_and_what_passes_keeps_its_time() -> None:
    times = np.arange(200_000) * 1e-6
    fade = np.sin(np.pi * times / 0.2) ** 2
    tones = np.stack((np.sin(2.0 * np.pi * 19_000.0 * times), np.sin(2.0 * np.pi * 30_000.0 * times))) * fade
    passed, stopped = _resample(iter([tones[:, :70_001], tones[:, 70_001:]]), 1e6, 44100)
    kept = np.arange(passed.size) / 44100
    expected = np.sin(2.0 * np.pi * 19_000.0 * kept) * np.sin(np.pi * kept / 0.2) ** 2
    assert np.abs(passed - expected).max() < 1e-3  # 0.01 dB
    assert np.abs(stopped).max() < 1e-6
