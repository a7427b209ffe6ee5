"""Stated errors and gross errors of the far form on real strings, beside autocorrelation that may abstain."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from monochord.benchmarks.base import Benchmark, Row, row
from monochord.core.units import Seconds
from monochord.evaluation import far_form
from monochord.evaluation.realstrings import Interferer, Protocol, interference_recordings


@dataclass(frozen=True, slots=True, kw_only=True)
class FarForm(Benchmark):
    """Position of stopped strings, in quiet and with the louder halves of music and speech mixed in.

    For each instrument, part of the fretboard, interference and ratio: share answered; share of all windows
    within 5 mm with its 95 % interval over takes, beside autocorrelation that answers as many windows; shares
    of the answers beyond five stated errors, beyond 50 mm and within one stated error; and the median stated
    error with its share of pitch noise.

    Parameters
    ----------
    ratios
        Signal-to-noise ratios in dB, of every window by itself.
    fret
        Fret at which takes of known pitch alone are assumed to be stopped.
    hop
        Distance of window starts, in s.
    seed
        Of where in the recordings each take's interference begins.
    """

    ratios: tuple[float, ...] = (10.0, 5.0, 0.0)
    fret: int = 19
    hop: Seconds = 0.3
    seed: int = 0

    def run(self) -> Iterator[Row]:
        """Yield the rows of each group in quiet, then with each interference at each ratio."""
        protocol = Protocol(hop=self.hop)
        sounds = {name: far_form.loud_half(sound) for name, sound in interference_recordings().items()}
        cases = [
            *far_form.fretted_cases(protocol),
            *far_form.bowed_cases(),
            *far_form.assumed_cases(self.fret),
        ]
        for group, each in groupby(sorted(cases, key=lambda case: case.group), lambda case: case.group):
            chosen = list(each)
            yield from _rows(f"{group}, quiet", far_form.outcome(chosen, protocol))
            for name, sound in sounds.items():
                for ratio in self.ratios:
                    interferer = Interferer(sound=sound, ratio=ratio)
                    result = far_form.outcome(chosen, protocol, interferer, self.seed)
                    yield from _rows(f"{group}, {name} {ratio:g} dB", result)


def _rows(name: str, result: far_form.Outcome) -> Iterator[Row]:
    low, high = far_form.right_interval(result)
    plain, known = far_form.plain_right(result), np.isfinite(result.error)
    yield row(f"{name}: answered", 100.0 * far_form.answered(result), "%")
    right = 100.0 * far_form.right(result)
    yield row(f"{name}: within 5 mm", right, "%", "autocorrelation", 100.0 * plain)
    yield row(f"{name}: within 5 mm, low", 100.0 * low, "%")
    yield row(f"{name}: within 5 mm, high", 100.0 * high, "%")
    if not known.any():
        return
    yield row(f"{name}: beyond 5 stated errors", 100.0 * far_form.beyond(result, far_form.MANY_STDS), "%")
    yield row(f"{name}: beyond 50 mm", 100.0 * far_form.gross(result), "%")
    yield row(f"{name}: one stated error covers", 100.0 * (1.0 - far_form.beyond(result, 1.0)), "%")
    yield row(f"{name}: median stated error", 1e3 * float(np.median(result.std[known])), "mm")
    yield row(f"{name}: of that pitch noise", 1e3 * float(np.median(result.noise[known])), "mm")
