"""Accuracy of position on real recorded strings, calibrated by the open note, and by one take more."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from monochord.benchmarks.base import Benchmark, Row
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.evaluation.autocorrelation import autocorrelation_errors
from monochord.evaluation.known_touches import (
    NEAR,
    Calibration,
    Protocol,
    calibrated_strings,
    located,
    position_errors,
)
from monochord.evaluation.realstrings import Take


@dataclass(frozen=True, slots=True, kw_only=True)
class Realstrings(Benchmark):
    """Position errors on plucked takes of known fret, beside plain autocorrelation on the same windows.

    Per instrument and over all: mean absolute error, share within 5 mm and share answered, with the string's
    open note as the only calibration; then with one further take, averaged over every choice of that take.

    Parameters
    ----------
    window
        Length of a window, in s.
    first, last
        Windows begin this long after the onset and end before that, in s.
    hop
        Distance of window starts, in s.
    """

    window: Seconds = 0.1
    first: Seconds = 0.15
    last: Seconds = 1.05
    hop: Seconds = 0.1

    def __post_init__(self) -> None:
        self._protocol()

    def _protocol(self) -> Protocol:
        return Protocol(length=self.window, first=self.first, last=self.last, hop=self.hop)

    def run(self) -> Iterator[Row]:
        """Yield the rows of each instrument, then those of all together."""
        protocol = self._protocol()
        ours: dict[str, list[Floats]] = {}
        plain: dict[str, list[Floats]] = {}
        helped: list[Floats] = []
        for _, calibration, fretted in calibrated_strings(protocol):
            for take in fretted:
                told = located(take, calibration, protocol)
                baseline = autocorrelation_errors(take, calibration[0][0], protocol)
                ours.setdefault(take.instrument, []).append(position_errors(take, told))
                plain.setdefault(take.instrument, []).append(baseline)
            helped += _with_one_more(fretted, calibration, protocol)
        for instrument, errors in ours.items():
            yield from _rows(instrument, np.concatenate(errors), np.concatenate(plain[instrument]))
        everything = np.concatenate([e for errors in ours.values() for e in errors])
        yield from _rows("all", everything, np.concatenate([e for errors in plain.values() for e in errors]))
        yield Row(
            name="all, one further take: mean absolute error",
            value=1e3 * float(np.nanmean(np.abs(np.concatenate(helped)))),
            unit="mm",
            baseline="open note only",
            baseline_value=1e3 * float(np.nanmean(np.abs(everything))),
        )


def _with_one_more(fretted: list[Take], calibration: Calibration, protocol: Protocol) -> list[Floats]:
    """Return the errors of all other takes of a string, for every choice of one further calibration take."""
    errors: list[Floats] = []
    for known in fretted:
        heard = [told["frequency"].value for told in located(known, calibration, protocol)]
        if not np.isfinite(heard).any():
            continue
        more = (*calibration, (float(np.nanmedian(heard)), known.position))
        others = [take for take in fretted if take is not known]
        errors += [position_errors(take, located(take, more, protocol)) for take in others]
    return errors


def _rows(name: str, errors: Floats, plain: Floats) -> Iterator[Row]:
    answered = np.isfinite(errors)
    miss, plain_miss = np.abs(errors[answered]), np.abs(plain)
    yield Row(name=f"{name}: windows", value=float(errors.size), unit="1")
    yield Row(name=f"{name}: answered", value=100.0 * float(answered.mean()), unit="%")
    yield Row(
        name=f"{name}: mean absolute error",
        value=1e3 * float(miss.mean()),
        unit="mm",
        baseline="plain autocorrelation",
        baseline_value=1e3 * float(plain_miss.mean()),
    )
    yield Row(
        name=f"{name}: within 5 mm",
        value=100.0 * float((miss <= NEAR).mean()),
        unit="%",
        baseline="plain autocorrelation",
        baseline_value=100.0 * float((plain_miss <= NEAR).mean()),
    )
    yield Row(name=f"{name}: largest error", value=1e3 * float(miss.max()), unit="mm")
