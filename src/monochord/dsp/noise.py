"""Noise generators of unit level, and mixing at a signal-to-noise ratio.

Every generator takes a random generator, a shape (..., n) and the sample rate in Hz, and returns float64
noise with root mean square one over the last axis. Two stretches do not join seamlessly; `noise_loop` makes a
loop from several.
"""

from collections.abc import Callable

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds

Shape = tuple[int, ...]
Noise = Callable[[np.random.Generator, Shape, float], Floats]
"""A noise generator: random generator, shape (..., n), sample rate in Hz."""
AUDIBLE: Hertz = 30.0
"""Lowest frequency of pink noise, in Hz."""
MAINS: Hertz = 60.0
HARMONICS = 10
HISS: tuple[Hertz, Hertz] = (2000.0, 8000.0)
TONES: tuple[Hertz, Hertz] = (50.0, 1000.0)
PARTIALS = 12
GEAR_TEETH = 17
"""The gear mesh of a motor sounds at this multiple of its speed, and at the first harmonics of that."""
MOTOR_SPEEDS = (5.0, 60.0)
"""Revolutions per second of a motor at constant speed."""
DECAY: tuple[Seconds, Seconds] = (0.05, 2.0)
"""Range of decay times of a chord's tones, in s."""


def white(stream: np.random.Generator, shape: Shape, sample_rate: float) -> Floats:  # noqa: ARG001
    """Return Gaussian white noise, independent in every channel.

    Examples
    --------
    >>> white(np.random.default_rng(0), (2, 4410), 44100.0).shape
    (2, 4410)
    """
    return _unit(stream.normal(size=shape))


def pink(stream: np.random.Generator, shape: Shape, sample_rate: float, *, lowest: Hertz = AUDIBLE) -> Floats:
    """Return pink (1/f) noise: equal power in every octave from `lowest` up, independent in every channel.

    Raises
    ------
    InputError
        If the stretch is too short for any frequency above `lowest`.

    Examples
    --------
    >>> round(float(np.mean(pink(np.random.default_rng(0), (4410,), 44100.0) ** 2)), 6)
    1.0
    """
    frequencies = _frequencies(shape, sample_rate)
    gains = np.where(frequencies >= lowest, 1.0 / np.sqrt(np.maximum(frequencies, lowest)), 0.0)
    return _shaped(stream, shape, gains, f"pink noise from {lowest:g} Hz")


def band(
    stream: np.random.Generator,
    shape: Shape,
    sample_rate: float,
    *,
    low: Hertz = HISS[0],
    high: Hertz = HISS[1],
) -> Floats:
    """Return noise that is white between `low` and `high` and zero outside, independent in every channel.

    Raises
    ------
    InputError
        If the stretch is too short for any frequency in the band.

    Examples
    --------
    >>> noise = band(np.random.default_rng(0), (4410,), 44100.0)
    >>> spectrum = np.abs(np.fft.rfft(noise))
    >>> bool(spectrum[:195].max() < 1e-9 * spectrum[400])
    True
    """
    frequencies = _frequencies(shape, sample_rate)
    gains = ((frequencies >= low) & (frequencies <= high)).astype(np.float64)
    return _shaped(stream, shape, gains, f"noise from {low:g} to {high:g} Hz")


def hum(
    stream: np.random.Generator,
    shape: Shape,
    sample_rate: float,
    *,
    mains: Hertz = MAINS,
    harmonics: int = HARMONICS,
) -> Floats:
    """Return mains hum: `mains` and its first harmonics, the k-th of amplitude 1/k, with random phases.

    All channels have the same hum, since they share the mains; harmonics at or above half the sample rate are
    left out.

    Raises
    ------
    InputError
        If `mains` is not below half the sample rate.

    Examples
    --------
    >>> noise = hum(np.random.default_rng(0), (2, 44100), 44100.0)
    >>> int(np.abs(np.fft.rfft(noise[0])).argmax()), bool((noise[0] == noise[1]).all())
    (60, True)
    """
    number = np.arange(1, harmonics + 1)
    number = number[number * mains < 0.5 * sample_rate]
    if not number.size:
        raise InputError(f"hum of {mains:g} Hz at a rate of {sample_rate:g} Hz", "mains below half the rate")
    phases = stream.uniform(0.0, 2.0 * np.pi, number.size)
    turn = np.exp(2j * np.pi * mains / sample_rate * np.arange(shape[-1]))
    waves = np.zeros(shape[-1], np.complex128)
    for weight in (np.exp(1j * phases) / number)[::-1].tolist():  # Horner's rule: one sine costs ten products
        waves = (waves + weight) * turn
    return np.broadcast_to(_unit(waves.imag), shape).copy()


def chord(stream: np.random.Generator, shape: Shape, sample_rate: float) -> Floats:
    """Return music-like noise: tones of random pitch with random onsets and decays, and a drum stroke.

    It has two to six tones from 50 to 1000 Hz, each of twelve partials whose amplitude falls as their number
    to the power 1 to 2, and a decaying burst of white noise of up to the same level. All channels are equal.

    Examples
    --------
    >>> noise = chord(np.random.default_rng(0), (2, 4410), 44100.0)
    >>> bool((noise[0] == noise[1]).all()), round(float(np.mean(noise**2)), 6)
    (True, 1.0)
    """
    size = shape[-1]
    time = np.arange(size) / sample_rate
    begin, end = -0.2, float(time[-1])
    waves = np.zeros(size)
    for pitch in np.exp(stream.uniform(*np.log(TONES), size=int(stream.integers(2, 7)))).tolist():
        number = np.arange(1, PARTIALS + 1)
        number = number[number * pitch < 0.5 * sample_rate]
        level = stream.uniform(0.1, 1.0) * number ** -stream.uniform(1.0, 2.0)
        phase = stream.uniform(0.0, 2.0 * np.pi, number.size)
        since = time - stream.uniform(begin, end)
        fades = np.exp(-np.maximum(since, 0.0) / stream.uniform(*DECAY)) * (since >= 0.0)
        waves += fades * (level @ np.sin(2.0 * np.pi * pitch * np.outer(number, time) + phase[:, None]))
    waves /= max(float(np.sqrt(np.mean(waves**2))), 1e-30)
    since = time - stream.uniform(begin, end)
    stroke = stream.normal(size=size) * np.exp(-np.maximum(since, 0.0) / stream.uniform(0.01, 0.1))
    waves += stream.uniform() * stroke * (since >= 0.0)
    if not waves.any():  # every tone begins at the very last frame
        return hum(stream, shape, sample_rate)
    return np.broadcast_to(_unit(waves), shape).copy()


def geared_motor(stream: np.random.Generator, speed: Floats, sample_rate: float) -> Floats:
    """Return the sound (n,) of a motor at a speed (n,) in revolutions per second; its level is about two.

    It consists of harmonics of the speed, the gear mesh frequency, and noise from 1 to 6 kHz modulated by the
    mesh. Their levels are assumed.

    Examples
    --------
    >>> geared_motor(np.random.default_rng(0), np.full(4410, 30.0), 44100.0).shape
    (4410,)
    """
    phase = 2 * np.pi * np.cumsum(speed) / sample_rate
    lines = {**{k: 1.0 / k for k in range(1, 9)}, GEAR_TEETH: 0.8, 2 * GEAR_TEETH: 0.4, 3 * GEAR_TEETH: 0.2}
    waves = sum(
        (weight * np.sin(k * phase + stream.uniform(0.0, 2 * np.pi)) for k, weight in lines.items()),
        np.zeros(speed.size),
    )
    hiss = band(stream, (speed.size,), sample_rate, low=1000.0, high=6000.0)
    return waves + 0.4 * hiss * (1.0 + 0.5 * np.sin(GEAR_TEETH * phase))


def motor(stream: np.random.Generator, shape: Shape, sample_rate: float) -> Floats:
    """Return the sound of a geared motor at constant speed, the same in all channels.

    Examples
    --------
    >>> noise = motor(np.random.default_rng(0), (2, 4410), 44100.0)
    >>> bool((noise[0] == noise[1]).all()), round(float(np.mean(noise**2)), 6)
    (True, 1.0)
    """
    speed = np.full(shape[-1], stream.uniform(*MOTOR_SPEEDS))
    return np.broadcast_to(_unit(geared_motor(stream, speed, sample_rate)), shape).copy()


NOISES: dict[str, Noise] = {
    "white": white, "pink": pink, "hum": hum, "band": band, "chord": chord, "motor": motor,
}  # fmt: skip
"""All noise generators by name."""
STEADY = ("white", "pink", "hum", "band")
"""Names of the stationary noises."""


def noise_loop(
    noise: Noise,
    stream: np.random.Generator,
    shape: Shape,
    sample_rate: float,
    *,
    stretches: int = 8,
    fade: Seconds = 0.02,
) -> Floats:
    """Return noise that loops without a jump, made of `stretches`, each of the given `shape`.

    Each stretch crossfades into the next, and the last into the first, with powers that sum to one: the level
    stays constant.

    Examples
    --------
    >>> loop = noise_loop(motor, np.random.default_rng(0), (2, 4410), 44100.0, stretches=3)
    >>> loop.shape, round(float(np.mean(loop**2)), 1)
    ((2, 13230), 1.0)
    """
    size, overlap = shape[-1], round(fade * sample_rate)
    parts = [noise(stream, (*shape[:-1], size + overlap), sample_rate) for _ in range(stretches)]
    angle = 0.5 * np.pi * np.arange(overlap) / overlap
    loop = np.concatenate([part[..., :size] for part in parts], axis=-1)
    for k, before in enumerate(parts):
        begin = (k + 1) % stretches * size
        joint = loop[..., begin : begin + overlap]
        joint *= np.sin(angle)
        joint += before[..., size:] * np.cos(angle)
    return loop


def mixed(signal: Floats, noise: Floats, ratio: float) -> Floats:
    """Return a signal with noise added at a signal-to-noise ratio in dB.

    The result is signal + g noise, where g makes 10 log10(<signal^2> / <(g noise)^2>) equal to `ratio`, with
    means over all channels and samples; level differences between channels stay. Silence stays silence.

    Parameters
    ----------
    signal, noise
        Signal and noise (..., n), of one shape.
    ratio
        Signal-to-noise ratio in dB.

    Raises
    ------
    InputError
        If the noise is silent.

    Examples
    --------
    >>> tone = np.sin(np.arange(4410.0))
    >>> noise = white(np.random.default_rng(0), (4410,), 44100.0)
    >>> added = mixed(tone, noise, 20.0) - tone
    >>> round(10.0 * float(np.log10(np.mean(tone**2) / np.mean(added**2))), 6)
    20.0
    """
    power = np.vdot(noise, noise) / noise.size
    if power == 0.0:
        raise InputError("silent noise", "a level above zero")
    gain = float(np.sqrt(np.vdot(signal, signal) / signal.size / power)) * 10.0 ** (-ratio / 20.0)
    return signal + gain * noise


def _frequencies(shape: Shape, sample_rate: float) -> Floats:
    return np.arange(shape[-1] // 2 + 1, dtype=np.float64) * (sample_rate / shape[-1])


def _shaped(stream: np.random.Generator, shape: Shape, gains: Floats, what: str) -> Floats:
    if not gains.any():
        raise InputError(f"{what} in {shape[-1]} samples", "a longer stretch")
    return _unit(np.fft.irfft(np.fft.rfft(stream.normal(size=shape)) * gains, shape[-1]))


def _unit(noise: Floats) -> Floats:
    return noise / np.sqrt(np.mean(noise**2, axis=-1, keepdims=True))
