"""Accuracy of position on real recorded strings, calibrated by the open note, and by one further take.

Makes what `docs/how-to/strings.md` says of accuracy, in some two minutes, from the recordings that
MONOCHORD_REALSTRINGS
names: ``python -m studies.real_strings``.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from studies._command import measure
from studies._takes import (
    POSITION_TOLERANCE,
    KnownTouches,
    Protocol,
    autocorrelation_errors,
    calibrated_strings,
    located,
    position_errors,
)

from monochord.benchmarks.base import Benchmark, Row
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.evaluation import RealTake


@dataclass(frozen=True, slots=True, kw_only=True)
class Realstrings(Benchmark):
    """Position errors on plucked takes of known fret, beside autocorrelation on the same windows.

    Per instrument and over all: mean absolute error, share within 5 mm and share answered, with the string's
    open note as the only calibration; then with one further take, averaged over every choice of that take.

    Parameters
    ----------
    window
        Length of a window, in s.
    first, last
        Range of the windows after the onset, in s.
    hop
        Hop, in s.
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
        """Yield the rows of each instrument, then of all together."""
        protocol = self._protocol()
        errors_by_instrument: dict[str, list[Floats]] = {}
        plain: dict[str, list[Floats]] = {}
        with_more: list[Floats] = []
        for _, calibration, fretted in calibrated_strings(protocol):
            for take in fretted:
                estimates = located(take, calibration, protocol)
                baseline = autocorrelation_errors(take, calibration[0][0], protocol)
                errors_by_instrument.setdefault(take.instrument, []).append(position_errors(take, estimates))
                plain.setdefault(take.instrument, []).append(baseline)
            with_more += _with_one_more(fretted, calibration, protocol)
        for instrument, errors in errors_by_instrument.items():
            yield from _rows(instrument, np.concatenate(errors), np.concatenate(plain[instrument]))
        everything = np.concatenate([e for errors in errors_by_instrument.values() for e in errors])
        yield from _rows("all", everything, np.concatenate([e for errors in plain.values() for e in errors]))
        yield Row(
            name="all, one further take: mean absolute error",
            value=1e3 * float(np.nanmean(np.abs(np.concatenate(with_more)))),
            unit="mm",
            baseline="open note only",
            baseline_value=1e3 * float(np.nanmean(np.abs(everything))),
        )


def _with_one_more(fretted: list[RealTake], calibration: KnownTouches, protocol: Protocol) -> list[Floats]:
    """Return the errors of all other takes of a string, for every choice of one further calibration take."""
    errors: list[Floats] = []
    for known in fretted:
        estimates = located(known, calibration, protocol)
        frequencies = [estimate["frequency"].value for estimate in estimates]
        if not np.isfinite(frequencies).any():
            continue
        more = (*calibration, (float(np.nanmedian(frequencies)), known.position))
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
        value=100.0 * float((miss <= POSITION_TOLERANCE).mean()),
        unit="%",
        baseline="plain autocorrelation",
        baseline_value=100.0 * float((plain_miss <= POSITION_TOLERANCE).mean()),
    )
    yield Row(name=f"{name}: largest error", value=1e3 * float(miss.max()), unit="mm")


if __name__ == "__main__":
    measure(Realstrings)
