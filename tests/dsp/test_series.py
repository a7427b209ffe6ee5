"""The fit of a stiff series to peaks, and the evidence for it."""

import numpy as np
import pytest

from monochord.core.types import Floats
from monochord.dsp.series import View, partial_count, weigh
from monochord.dsp.spectrum import Peaks

PRIOR = (1e-4, 2e-4)


def peaks_at(frequency: Floats, power: Floats) -> Peaks:
    rank = np.empty(frequency.size)
    rank[np.argsort(-power)] = np.arange(1.0, frequency.size + 1.0)
    variance = 0.1**2 + 5.5**2 / (1.0 + power)
    return Peaks(frequency, variance, power, rank, np.log1p(power))


def view(peaks: Peaks, top: float = 6000.0) -> View:
    spacing = 2.7
    salience = np.zeros(2600)
    for offset in (0, 1):
        salience[np.rint(peaks.frequency / spacing).astype(int) + offset] = peaks.salience
    return View(salience, spacing, 10.0, 50.0, top, 40, 8.0)


def fit(f0: float, inharmonicity: float, frequency: Floats, height: float) -> list[list[float]]:
    """Frequency, its standard error, B, its standard error and evidence of what is found near a guess."""
    peaks = peaks_at(frequency, np.full(frequency.size, np.exp(height)))
    return weigh(np.array([[f0, inharmonicity]]), (f0, *PRIOR), peaks, view(peaks)).tolist()


def stiff(f0: float, inharmonicity: float, count: int) -> Floats:
    n = np.arange(1.0, count + 1.0)
    return f0 * n * np.sqrt(1.0 + inharmonicity * n * n)


@pytest.mark.parametrize(("f0", "inharmonicity"), [(82.4, 2e-4), (110.0, 0.0), (146.8, 8e-4)])
def test_exact_peaks_give_back_their_series(f0: float, inharmonicity: float) -> None:
    peaks = stiff(f0, inharmonicity, 20)
    ((estimate, std, bend, _, _),) = fit(f0 * 1.004, 0.8 * inharmonicity, peaks, 12.0)
    assert estimate == pytest.approx(f0, rel=2e-5)
    assert bend == pytest.approx(inharmonicity, abs=1e-5)
    assert 0.0 < std < 0.1


def test_standard_error_covers_the_error() -> None:
    rng = np.random.default_rng(7)
    pulls = []
    for _ in range(200):
        peaks = stiff(150.0, 1e-4, 15) + rng.normal(0.0, 0.1, 15)
        ((estimate, std, *_),) = fit(150.0, 1e-4, peaks, 14.0)
        pulls.append((estimate - 150.0) / std)
    assert 0.6 < np.std(pulls) < 1.5


def test_a_stray_peak_hardly_moves_the_fit() -> None:
    peaks = stiff(100.0, 1e-4, 12)
    stray = np.sort(np.append(np.delete(peaks, 7), peaks[7] - 5.0))
    ((estimate, *_),) = fit(100.0, 1e-4, stray, 10.0)
    assert estimate == pytest.approx(100.0, abs=0.05)


def test_no_peak_near_means_no_fit() -> None:
    assert not fit(90.0, 0.0, np.array([140.0, 142.0]), 9.0)


def evidence(f0: float, frequency: Floats, power: Floats) -> float:
    peaks = peaks_at(frequency, power)
    ((*_, told),) = weigh(np.array([[f0, 0.0]]), (f0, 0.0, 1e-9), peaks, view(peaks)).tolist()
    return told


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
