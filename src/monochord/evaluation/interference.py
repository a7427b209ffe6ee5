"""Recorded music and speech, mixed into takes at a wanted signal-to-noise ratio."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.evaluation import realstrings
from monochord.evaluation.autocorrelation import autocorrelation_errors
from monochord.evaluation.known_touches import (
    Mix,
    Protocol,
    calibrated_strings,
    located,
    position_errors,
)
from monochord.evaluation.realstrings import Take

Per: TypeAlias = Literal["window", "take"]
RATE = 44100  # of the takes that interference is added to


@dataclass(frozen=True, slots=True, kw_only=True)
class Interferer:
    """A recording that is added to takes.

    Parameters
    ----------
    sound
        The recording (n,) at `RATE`.
    ratio
        Signal-to-noise ratio in dB.
    per
        What the ratio holds over: every "window" by itself, or the whole "take" from its onset, so that a
        plucked string's later windows, which have decayed, have less.
    """

    sound: Audio
    ratio: float
    per: Per = "window"

    def mixer(self, offset: float, protocol: Protocol) -> Mix:
        """Return a function that adds the stretch of the recording beginning at a share `offset` of it."""

        def mix(samples: Audio) -> Audio:
            frames = samples.shape[1]
            begin = int(offset * max(self.sound.size - frames, 0))
            noise = np.resize(self.sound[begin:], frames).astype(np.float64)[np.newaxis]
            signal = samples.astype(np.float64)
            if self.per == "take":
                after = realstrings.onset(samples)
                levels = [np.sqrt(np.mean(x[:, after:] ** 2, axis=1)) for x in (signal, noise)]
                gain = (levels[0] / levels[1])[:, np.newaxis]
            else:
                gain = _level(signal, protocol) / (_level(noise, protocol) + 1e-9)
            return (signal + 10.0 ** (-self.ratio / 20.0) * gain * noise).astype(np.float32)

        return mix


def recorded_interference() -> dict[str, Audio]:
    """Return the recordings of interference by name, one channel (n,), resampled to `RATE`.

    Raises
    ------
    InputError
        If there are none on this machine.
    """
    found = {take.path.stem: _resampled(take) for take in realstrings.takes(kind="interference")}
    if not found:
        remedy = "name it in the environment as MONOCHORD_REALSTRINGS"
        raise InputError("no recordings of interference", "a folder with manifest.csv", remedy)
    return found


def errors_under(interferer: Interferer, protocol: Protocol, seed: int) -> tuple[Floats, Floats]:
    """Return the position errors in m on all fretted takes, of our estimator and of plain autocorrelation.

    The open notes that calibrate both are clean; ours are NaN where the estimator abstained. `seed` draws
    where in the recording each take's interference begins.
    """
    rng = np.random.default_rng(seed)
    ours: list[Floats] = []
    plain: list[Floats] = []
    for _, calibration, fretted in calibrated_strings(protocol):
        for take in fretted:
            mix = interferer.mixer(float(rng.uniform()), protocol)
            ours.append(position_errors(take, located(take, calibration, protocol, mix)))
            plain.append(autocorrelation_errors(take, calibration[0][0], protocol, mix))
    return np.concatenate(ours), np.concatenate(plain)


def _level(samples: Floats, protocol: Protocol) -> Floats:
    """Return the root mean square over the window around every frame."""
    size = round(protocol.length * RATE)
    power = np.cumsum(np.pad(samples**2, ((0, 0), (size // 2 + 1, size - size // 2 - 1)), "edge"), axis=1)
    return np.sqrt(np.maximum(power[:, size:] - power[:, :-size], 0.0) / size)


def _resampled(take: Take) -> Audio:
    import soxr  # noqa: PLC0415

    samples, own = take.read()
    return np.asarray(soxr.resample(samples.mean(axis=0), own, RATE), np.float32)
