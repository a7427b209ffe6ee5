"""Plain autocorrelation: the baseline that every estimator of pitch is compared with."""

import numpy as np

from monochord.core.types import Floats, Window
from monochord.core.units import Hertz
from monochord.evaluation.known_touches import Mix, Protocol
from monochord.evaluation.realstrings import SCALE, Take


def autocorrelation_errors(
    take: Take, open_frequency: Hertz, protocol: Protocol, mix: Mix | None = None
) -> Floats:
    """Return the position errors in m of plain autocorrelation on a take's windows; it never abstains.

    The lag of the first peak that reaches nine tenths of the greatest, refined by a parabola, is the period.
    """
    samples, rate = take.read()
    heard = samples if mix is None else mix(samples)
    least, most = rate / (5.0 * open_frequency), rate / (0.977 * open_frequency)
    periods = [period(window, least, most) for window in protocol.windows(samples, heard, rate)]
    return np.array([SCALE * (1.0 - open_frequency * p / rate) - take.position for p in periods])


def period(window: Window, least: float, most: float) -> float:
    """Return the period in frames of a window's first channel, between two bounds in frames."""
    samples = window.samples[0].astype(np.float64)
    size = samples.size
    power = np.abs(np.fft.rfft(samples - samples.mean(), 4 * size)) ** 2
    curve = np.fft.irfft(power)[:size] / (size - np.arange(size))
    lags = np.arange(int(least), min(int(most) + 2, size - 2))
    peaks = lags[(curve[lags] > curve[lags - 1]) & (curve[lags] >= curve[lags + 1])]
    if peaks.size == 0:
        return float(lags[np.argmax(curve[lags])])
    lag = int(peaks[np.argmax(curve[peaks] >= 0.9 * curve[peaks].max())])
    before, at, after = curve[lag - 1 : lag + 2]
    return lag + 0.5 * (before - after) / (before - 2.0 * at + after)
