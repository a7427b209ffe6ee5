"""Accuracy and stated errors of the far form on real strings, without noise and with music and speech.

Makes the tables of `docs/how-to/strings.md` from the recordings that MONOCHORD_REALSTRINGS names, in some ten
minutes: ``python -m studies.far_form``.

Fretted positions are known. Where only the pitch is known, the study assumes a string whose open note is a
number of frets lower: the recording is the same, the range of possible notes is wider, and the error comes
from the pitch alone.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray
from studies._command import measure
from studies._takes import (
    POSITION_TOLERANCE,
    SCALE,
    Interferer,
    KnownTouches,
    Mix,
    Protocol,
    calibrated_strings,
    located,
    period,
)

from monochord.benchmarks.base import Benchmark, Row, row
from monochord.core.types import Audio, Floats
from monochord.core.units import Metres, Seconds
from monochord.evaluation import RealTake, interference_recordings, takes
from monochord.metrics import bootstrap_interval

TWELFTH_FRET = 12
BOWED_STRINGS = (24, 31, 38, 45)
"""Open notes of the bowed bass, in semitones of MIDI: C G D A."""
GROSS_ERROR: Metres = 0.05
MANY_STDS = 5.0
LOUD = 4410
"""Length of the stretches from which `loud_half` keeps the louder ones, in frames."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A take of known position, with the open note given to the estimator."""

    group: str
    take: RealTake
    calibration: KnownTouches
    position: Metres


def fretted_cases(protocol: Protocol) -> Iterator[Case]:
    """Yield the takes of known fret on strings of known open note, grouped by instrument and fret."""
    half = fret_position(TWELFTH_FRET) + POSITION_TOLERANCE
    for _, calibration, fretted in calibrated_strings(protocol):
        for take in fretted:
            side = "to fret 12" if take.position < half else "above fret 12"
            yield Case(
                group=f"{take.instrument} {side}", take=take, calibration=calibration, position=take.position
            )


def assumed_cases(fret: int) -> Iterator[Case]:
    """Yield all plucked takes of known pitch, treated as stopped at a fret of an assumed lower string."""
    for take in takes(kind="plucked"):
        if np.isfinite(take.frequency):
            yield _assumed(f"{take.instrument} as fret {fret}", take, fret)


def bowed_cases() -> Iterator[Case]:
    """Yield the bowed takes, treated as stopped on the nearest lower string of their instrument."""
    for take in takes(kind="bowed"):
        note = int(re.findall(r"_m(\d+)_", take.path.stem)[0])
        frets = [note - string for string in BOWED_STRINGS if string < note]
        if frets:
            yield _assumed(take.instrument, take, min(frets))


def _assumed(group: str, take: RealTake, fret: int) -> Case:
    calibration = ((take.frequency / 2.0 ** (fret / 12.0), 0.0),)
    return Case(group=group, take=take, calibration=calibration, position=fret_position(fret))


def fret_position(fret: int) -> Metres:
    """Return a fret's distance from the nut on a string of `SCALE`.

    >>> fret_position(12)
    0.325
    """
    return SCALE * (1.0 - 2.0 ** (-fret / 12.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Results of windows, each array (n,).

    `error` is in m, NaN for an abstention; `std` is the stated error in m, and `noise` its part from the
    pitch in m; `plain` is the error of autocorrelation in m; `take` is the number of the take.
    """

    error: Floats
    std: Floats
    noise: Floats
    plain: Floats
    take: Floats

    def rows(self, chosen: NDArray[np.int64]) -> "Outcome":
        """Return the windows of the given indices."""
        each = {name: getattr(self, name)[chosen] for name in self.__dataclass_fields__}
        return Outcome(**each)


def outcome(
    cases: Iterable[Case], protocol: Protocol, interferer: Interferer | None = None, seed: int = 0
) -> Outcome:
    """Return the errors of the closed form and of autocorrelation on the windows of takes.

    Parameters
    ----------
    cases
        The takes.
    protocol
        The windows to use.
    interferer
        The interference to add.
    seed
        Random seed of where in its recording each take's interference begins.
    """
    rng = np.random.default_rng(seed)
    columns: list[list[float]] = []
    for number, case in enumerate(cases):
        offset = float(rng.uniform())
        mix = None if interferer is None else interferer.mixer(offset, protocol)
        open_frequency = case.calibration[0][0]
        estimates = located(case.take, case.calibration, protocol, mix)
        for each, plain in zip(estimates, _plain(case, protocol, mix), strict=True):
            position, frequency = each["position"], each["frequency"]
            noise = SCALE * open_frequency * frequency.std / frequency.value**2
            columns.append([position.value - case.position, position.std, noise, plain, number])
    return _outcome(np.array(columns).reshape(-1, 5).T)


def _outcome(columns: Floats) -> Outcome:
    return Outcome(**dict(zip(Outcome.__dataclass_fields__, columns, strict=True)))


def _plain(case: Case, protocol: Protocol, mix: Mix | None) -> Iterator[float]:
    samples, rate = case.take.read()
    mixed = samples if mix is None else mix(samples)
    open_frequency = case.calibration[0][0]
    shortest, longest = rate / (5.0 * open_frequency), rate / (0.977 * open_frequency)
    for window in protocol.windows(samples, mixed, rate):
        lag = period(window, shortest, longest)
        yield SCALE * (1.0 - open_frequency * lag / rate) - case.position


def answered(result: Outcome) -> float:
    """Return the share of windows with a position."""
    return float(np.isfinite(result.error).mean())


def right(result: Outcome) -> float:
    """Return the share of all windows with an estimate within `POSITION_TOLERANCE`."""
    return float((np.abs(result.error) <= POSITION_TOLERANCE).mean())


def plain_right(result: Outcome) -> float:
    """Return that share for autocorrelation, which answers every window."""
    return float((np.abs(result.plain) <= POSITION_TOLERANCE).mean())


def beyond(result: Outcome, stds: float) -> float:
    """Return the share of the estimates off by more than this many stated errors."""
    known = np.isfinite(result.error)
    return float((np.abs(result.error) > stds * result.std)[known].mean()) if known.any() else np.nan


def gross(result: Outcome) -> float:
    """Return the share of the estimates off by more than `GROSS_ERROR`."""
    known = np.isfinite(result.error)
    return float((np.abs(result.error[known]) > GROSS_ERROR).mean()) if known.any() else np.nan


def right_interval(result: Outcome, seed: int = 0) -> tuple[float, float]:
    """Return the 95 % interval of `right`, resampling takes."""
    return bootstrap_interval(lambda rows: right(result.rows(rows)), result.take, seed=seed)


def loud_half(sound: Audio) -> Audio:
    """Return the louder half of a recording (n,), in stretches of 0.1 s: speech without its pauses.

    >>> loud_half(np.repeat(np.array([0.1, 1.0], np.float32), 4410)).size
    4410
    """
    stretches = sound[: sound.size // LOUD * LOUD].reshape(-1, LOUD)
    power = np.square(stretches, dtype=np.float64).mean(axis=1)
    return np.ascontiguousarray(stretches[power > np.median(power)].ravel())


@dataclass(frozen=True, slots=True, kw_only=True)
class FarForm(Benchmark):
    """Position of stopped strings, without noise and with the louder halves of music and speech added.

    For each instrument and part of the fretboard, and for all together, for each interference and ratio:
    answered share; share of all windows within 5 mm with its 95 % interval over takes, beside
    autocorrelation, which answers every window; shares of the estimates beyond five stated errors, beyond
    50 mm and within one stated error; and the median stated error with its share from pitch noise.

    Parameters
    ----------
    ratios
        Signal-to-noise ratios in dB, of every single window.
    fret
        Fret at which takes of known pitch alone are assumed to be stopped.
    hop
        Hop, in s.
    seed
        Random seed of where in its recording each take's interference begins.
    """

    ratios: tuple[float, ...] = (10.0, 5.0, 0.0)
    fret: int = 19
    hop: Seconds = 0.1
    seed: int = 0

    def run(self) -> Iterator[Row]:
        """Yield the rows of each group without noise, then with each interference at each ratio."""
        protocol = Protocol(hop=self.hop)
        sounds = {name: loud_half(sound) for name, sound in interference_recordings().items()}
        cases = [
            *fretted_cases(protocol),
            *bowed_cases(),
            *assumed_cases(self.fret),
        ]
        cases.sort(key=lambda case: case.group)
        groups = [(name, list(each)) for name, each in groupby(cases, lambda case: case.group)]
        mixes: list[tuple[str, Interferer | None]] = [("quiet", None)]
        for name, sound in sounds.items():
            mixes += [(f"{name} {ratio:g} dB", Interferer(sound=sound, ratio=ratio)) for ratio in self.ratios]
        for mix, interferer in mixes:
            results = [outcome(each, protocol, interferer, self.seed) for _, each in groups]
            for (group, _), result in zip(groups, results, strict=True):
                yield from _rows(f"{group}, {mix}", result)
            yield from _rows(f"all, {mix}", joined(results))


def joined(results: Sequence[Outcome]) -> Outcome:
    """Return several results as one."""
    takes_before = np.cumsum([0, *(1 + int(result.take.max(initial=-1.0)) for result in results)])
    columns = [
        np.concatenate([getattr(result, name) for result in results])
        for name in Outcome.__dataclass_fields__
        if name != "take"
    ]
    take = [result.take + first for result, first in zip(results, takes_before[:-1], strict=True)]
    return Outcome(**dict(zip(Outcome.__dataclass_fields__, [*columns, np.concatenate(take)], strict=True)))


def _rows(name: str, result: Outcome) -> Iterator[Row]:
    low, high = right_interval(result)
    plain, known = plain_right(result), np.isfinite(result.error)
    yield row(f"{name}: answered", 100.0 * answered(result), "%")
    yield row(f"{name}: within 5 mm", 100.0 * right(result), "%", "autocorrelation", 100.0 * plain)
    yield row(f"{name}: within 5 mm, low", 100.0 * low, "%")
    yield row(f"{name}: within 5 mm, high", 100.0 * high, "%")
    if not known.any():
        return
    yield row(f"{name}: beyond 5 stated errors", 100.0 * beyond(result, MANY_STDS), "%")
    yield row(f"{name}: beyond 50 mm", 100.0 * gross(result), "%")
    yield row(f"{name}: one stated error covers", 100.0 * (1.0 - beyond(result, 1.0)), "%")
    yield row(f"{name}: median stated error", 1e3 * float(np.median(result.std[known])), "mm")
    yield row(f"{name}: of that pitch noise", 1e3 * float(np.median(result.noise[known])), "mm")


if __name__ == "__main__":
    measure(FarForm)
