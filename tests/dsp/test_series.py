"""The fit of a stiff series to peaks, and the evidence for it."""

import numpy as np
import pytest

from monochord.dsp.series import fit_series, partial_count, series_evidence
from monochord.types import Floats

PRIOR = (1e-4, 2e-4)


def stiff(f0: float, stiffness: float, count: int) -> Floats:
    n = np.arange(1.0, count + 1.0)
    return f0 * n * np.sqrt(1.0 + stiffness * n * n)


@pytest.mark.parametrize(("f0", "stiffness"), [(82.4, 2e-4), (110.0, 0.0), (330.0, 5e-5), (146.8, 8e-4)])
def test_exact_peaks_give_back_their_series(f0: float, stiffness: float) -> None:
    peaks = stiff(f0, stiffness, 20)
    found, bend, std, used = fit_series(
        f0 * 1.004, 0.8 * stiffness, PRIOR, peaks, np.full(20, 12.0), 6000.0, 40
    )
    assert found == pytest.approx(f0, rel=2e-5)
    assert bend == pytest.approx(stiffness, abs=1e-5)
    assert 0.0 < std < 0.1
    assert used >= 18


def test_standard_error_covers_the_error() -> None:
    rng = np.random.default_rng(7)
    pulls = []
    for _ in range(200):
        peaks = stiff(150.0, 1e-4, 15) + rng.normal(0.0, 0.1, 15)
        found, _, std, _ = fit_series(150.0, 1e-4, PRIOR, peaks, np.full(15, 14.0), 6000.0, 40)
        pulls.append((found - 150.0) / std)
    assert 0.6 < np.std(pulls) < 1.5


def test_a_stray_peak_hardly_moves_the_fit() -> None:
    peaks = stiff(100.0, 1e-4, 12)
    stray = np.sort(np.append(np.delete(peaks, 7), peaks[7] - 5.0))
    found, _, _, _ = fit_series(100.0, 1e-4, PRIOR, stray, np.full(12, 10.0), 6000.0, 40)
    assert found == pytest.approx(100.0, abs=0.05)


def test_no_peak_near_means_no_fit() -> None:
    _, _, std, used = fit_series(100.0, 0.0, PRIOR, np.array([155.0, 160.0]), np.full(2, 9.0), 300.0, 40)
    assert used == 0
    assert std == np.inf


def evidence(f0: float, peaks: Floats, power: Floats) -> float:
    spacing = 2.7
    spectrum = np.zeros(2400)
    spectrum[np.rint(peaks / spacing).astype(int)] = np.log1p(power)
    spectrum[np.rint(peaks / spacing).astype(int) + 1] = np.log1p(power)
    rank = np.empty(peaks.size)
    rank[np.argsort(-power)] = np.arange(1.0, peaks.size + 1.0)
    return series_evidence(
        f0, 0.0, peaks, power, rank, np.log1p(power), spectrum, spacing, 50.0, 6000.0, 40, 8.0
    )  # fmt: skip


@pytest.mark.parametrize("wrong", [0.5, 1 / 3, 2.0, 3.0, 1.5, 2 / 3])
def test_the_true_series_beats_its_relatives(wrong: float) -> None:
    peaks = stiff(220.0, 0.0, 10)
    power = 1e5 / np.arange(1.0, 11.0) ** 2
    assert evidence(220.0, peaks, power) > evidence(220.0 * wrong, peaks, power) + 6.0


def test_a_missing_fundamental_is_no_octave_error() -> None:
    peaks = stiff(220.0, 0.0, 10)[1:]
    power = 1e5 / np.arange(2.0, 11.0) ** 2
    assert (
        evidence(220.0, peaks, power)
        > max(evidence(440.0, peaks, power), evidence(110.0, peaks, power)) + 6.0
    )


def test_partial_count_stays_in_its_bounds() -> None:
    assert partial_count(100.0, 6000.0, 40) == 40
    assert partial_count(1000.0, 6000.0, 40) == 6
    assert partial_count(9000.0, 6000.0, 40) == 1
