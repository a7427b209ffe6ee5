"""From a setup to a recording and its peaks; what is refused."""

import math
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.physics.split_string import (
    Drive,
    PluckShape,
    Route,
    SimulatedSound,
    SplitString,
    peaks,
    simulate,
)
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
    measured = peaks(simulate(SplitString(string=APPENDIX.string, contact=contact), 0.4, route="modal"))
    assert measured == pytest.approx(segment_frequencies(APPENDIX.string, contact), rel=1e-3)


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


def recording(own: float, loud: float = 1.0, seconds: float = 0.4) -> SimulatedSound:
    times = np.arange(round(seconds * 44100)) / 44100
    tones = (np.sin(2.0 * np.pi * 695.0 * times), loud * np.sin(2.0 * np.pi * 374.2 * times))
    mixing = mixing_matrix(own, own)
    return SimulatedSound(
        segments=np.stack(tones),
        microphones=mixing @ np.stack(tones),
        sample_rate=44100,
        mixing=mixing,
        drive_frequencies=np.zeros((2, 1)),
        drive_interval=0.02,
    )


@pytest.mark.parametrize("loud", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("own", [1.0, 0.8, 0.55])
def test_each_segment_gives_its_own_peak_however_loud_the_other(own: float, loud: float) -> None:
    assert peaks(recording(own, loud)) == pytest.approx((695.0, 374.2), rel=1e-5)


def test_the_transient_is_left_out() -> None:
    take = recording(0.9)
    take.microphones[:, :6000] = np.sin(2.0 * np.pi * 3000.0 * np.arange(6000) / 44100)
    assert peaks(take) == pytest.approx((695.0, 374.2), rel=1e-5)


def test_a_silent_segment_has_no_peak() -> None:
    first, second = peaks(recording(1.0, 0.0))
    assert first == pytest.approx(695.0, rel=1e-5)
    assert math.isnan(second)


def test_what_cannot_be_told_apart_is_refused() -> None:
    with pytest.raises(InputError, match="mixing"):
        peaks(recording(0.5))
    with pytest.raises(InputError, match=r"recording of 0.00498866 s: allowed is 0.01 s or more"):
        peaks(recording(0.9, seconds=0.005))
    assert recording(0.9).duration == 0.4


STRING = load_string("appendix").string


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (
            {"contact": Contact(position=0.65, force=1.0)},
            r"position 0.65 m: allowed is strictly between 0 and",
        ),
        ({"contact": Contact(position=-0.1, force=1.0)}, r"position -0.1 m"),
        ({"contact": Contact(position=float("nan"), force=1.0)}, r"position nan m"),
        ({"contact": Contact(position=0.3, force=-1.0)}, r"force -1 N: allowed is 0 N or more"),
        ({"mixing": (0.9, 1.1)}, r"mixing\[1\] 1.1: allowed is a number from 0 to 1"),
        ({"pickup_place": 1.0}, r"pickup_place 1"),
        ({"nodes": 3}, r"nodes 3: allowed is a whole number from 8"),
        ({"time_step": 0.0}, r"time_step 0 s"),
        ({"alpha": 1.5}, r"alpha 1.5"),
        ({"initial": "rest"}, r"without start frequencies.*set drive.start_frequencies"),
    ],
)
def test_a_setup_that_cannot_be_is_refused_in_one_line(options: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line) as refusal:
        SplitString(string=STRING, **options)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"amplitude": float("inf")}, "Drive amplitude inf N"),
        ({"place": 0.0}, "Drive place 0"),
        ({"width": 0.0}, "Drive width 0 m"),
        ({"window": 0.01, "hop": 0.02}, "drive window 0.01 s, hop 0.02 s"),
        ({"pull": 1.1}, "Drive pull 1.1"),
        ({"start_frequencies": (0.0, 1.0)}, "start_frequencies.* 0 Hz"),
    ],
)
def test_a_drive_that_cannot_be_is_refused(options: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line):
        Drive(**options)


@pytest.mark.parametrize("options", [{"place": 1.0}, {"width": -1.0}, {"height": float("nan")}])
def test_a_pluck_that_cannot_be_is_refused(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match="Pluck"):
        PluckShape(**options)
