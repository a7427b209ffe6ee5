"""How position on real recorded strings holds up when music and speech are mixed in."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from monochord.benchmarks.base import Benchmark, Row
from monochord.core.types import Floats
from monochord.evaluation.realstrings import (
    POSITION_TOLERANCE,
    Interferer,
    Protocol,
    Reference,
    errors_under,
    interference_recordings,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Interference(Benchmark):
    """Position errors on plucked takes of known fret with real music and speech added.

    For each recording of interference and each signal-to-noise ratio: share answered, and share of the
    answers within 5 mm, beside plain autocorrelation, which answers always. The open note is clean.

    Parameters
    ----------
    ratios
        Signal-to-noise ratios in dB.
    per
        What the ratio holds over: every "window" by itself, or the whole "take" from its onset, so that
        a plucked string's later windows, which have decayed, have less.
    seed
        Of where in the recording each take's interference begins.
    """

    ratios: tuple[float, ...] = (20.0, 10.0, 5.0, 0.0)
    per: Reference = "window"
    seed: int = 0

    def run(self) -> Iterator[Row]:
        """Yield, for each interference and ratio, the share answered and the share within 5 mm."""
        protocol = Protocol()
        for name, sound in interference_recordings().items():
            for ratio in self.ratios:
                interferer = Interferer(sound=sound, ratio=ratio, per=self.per)
                yield from _rows(f"{name} {ratio:g} dB", *errors_under(interferer, protocol, self.seed))


def _rows(name: str, errors: Floats, plain: Floats) -> Iterator[Row]:
    answered = np.isfinite(errors)
    yield Row(name=f"{name}: answered", value=100.0 * float(answered.mean()), unit="%")
    yield Row(
        name=f"{name}: within 5 mm",
        value=100.0 * float((np.abs(errors[answered]) <= POSITION_TOLERANCE).mean()),
        unit="%",
        baseline="plain autocorrelation",
        baseline_value=100.0 * float((np.abs(plain) <= POSITION_TOLERANCE).mean()),
    )
