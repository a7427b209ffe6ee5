"""How position on real recorded strings holds up when music and speech are mixed in."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from monochord import realstrings
from monochord.benchmarks._known_touches import (
    NEAR,
    Mix,
    Protocol,
    autocorrelation_errors,
    located,
    open_note,
    position_errors,
    recorded_strings,
)
from monochord.benchmarks.base import Benchmark, Row
from monochord.realstrings import Take
from monochord.types import Audio, Floats


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
    per: Literal["window", "take"] = "window"
    seed: int = 0

    def run(self) -> Iterator[Row]:  # noqa: D102
        strings = recorded_strings()
        protocol = Protocol()
        notes = {name: open_note(take, protocol) for name, take in strings.open_notes.items()}
        for noise in realstrings.takes(kind="interference"):
            sound = _at_rate(noise, 44100)
            for ratio in self.ratios:
                rng = np.random.default_rng(self.seed)
                ours: list[Floats] = []
                plain: list[Floats] = []
                for name, (frequency, stiffness) in notes.items():
                    calibration = ((frequency, 0.0, stiffness),)
                    for take in strings.fretted[name]:
                        mix = self._mixer(sound, ratio, rng, protocol)
                        ours.append(position_errors(take, located(take, calibration, protocol, mix)))
                        plain.append(autocorrelation_errors(take, frequency, protocol, mix))
                yield from _rows(
                    f"{noise.path.stem} {ratio:g} dB", np.concatenate(ours), np.concatenate(plain)
                )

    def _mixer(self, sound: Audio, ratio: float, rng: np.random.Generator, protocol: Protocol) -> Mix:
        """Return a function that adds a stretch of the interference at the wanted ratio."""
        offset = float(rng.uniform())

        def mix(samples: Audio) -> Audio:
            frames = samples.shape[1]
            begin = int(offset * max(sound.size - frames, 0))
            noise = np.resize(sound[begin:], frames).astype(np.float64)
            signal = samples.astype(np.float64)
            if self.per == "take":
                after = realstrings.onset(samples)
                gain = np.sqrt(np.mean(signal[:, after:] ** 2, axis=1) / np.mean(noise[after:] ** 2))
                scaled = gain[:, np.newaxis] * noise
            else:
                scaled = _level(signal, protocol) / (_level(noise[np.newaxis], protocol) + 1e-9) * noise
            return (signal + 10.0 ** (-ratio / 20.0) * scaled).astype(np.float32)

        return mix


def _level(samples: Floats, protocol: Protocol) -> Floats:
    """Return the root mean square over the window around every frame."""
    size = round(protocol.length * 44100)
    power = np.cumsum(np.pad(samples**2, ((0, 0), (size // 2 + 1, size - size // 2 - 1)), "edge"), axis=1)
    return np.sqrt(np.maximum(power[:, size:] - power[:, :-size], 0.0) / size)


def _at_rate(take: Take, rate: int) -> Audio:
    import soxr  # noqa: PLC0415

    samples, own = take.read()
    return np.asarray(soxr.resample(samples.mean(axis=0), own, rate), np.float32)


def _rows(name: str, errors: Floats, plain: Floats) -> Iterator[Row]:
    answered = np.isfinite(errors)
    yield Row(name=f"{name}: answered", value=100.0 * float(answered.mean()), unit="%")
    yield Row(
        name=f"{name}: within 5 mm",
        value=100.0 * float((np.abs(errors[answered]) <= NEAR).mean()),
        unit="%",
        baseline="plain autocorrelation",
        baseline_value=100.0 * float((np.abs(plain) <= NEAR).mean()),
    )
