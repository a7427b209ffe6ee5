"""Spectra of short windows: power, noise floor, and the peaks above it."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.kernels import kernel, part
from monochord.core.shapes import alike, sound
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Samples, Seconds

FLOOR_WIDTH: Hertz = 500.0
"""Block width of the noise floor in Hz; several partials wide."""
FLOOR_SHARE, MIN_FLOOR = 0.15, 1e-7
"""Quantile of a block that its noise floor is taken from; least floor over the largest power."""
BEAT = 0.01
"""Standard deviation of a strong peak's frequency, relative to the resolution: partials beat and glide."""
BLUR = 0.55
"""Standard deviation of the frequency of a peak at the noise floor, relative to the resolution."""


class Peaks(NamedTuple):
    """Spectral peaks by ascending frequency, each array (peaks,).

    `frequency` is in Hz and its `variance` in Hz^2. `rank` orders the peaks by `power`, from 1. `salience` is
    the logarithmic height over the noise floor in nepers of power.
    """

    frequency: Floats
    variance: Floats
    power: Floats
    rank: Floats
    salience: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Analyser:
    """Spectra of windows of one size, up to a highest frequency; not thread-safe, since it reuses its memory.

    Parameters
    ----------
    sample_rate, size
        Sample rate in Hz, and window length in frames.
    top
        Highest analysed frequency in Hz, limited to nine tenths of half the sample rate.
    floor_width
        Block width of the noise floor in Hz.
    """

    sample_rate: int
    size: Samples
    top: Hertz
    floor_width: Hertz = FLOOR_WIDTH
    taper: Floats = field(init=False, repr=False, compare=False)
    padded: Samples = field(init=False, repr=False)
    bins: int = field(init=False, repr=False)
    _buffer: NDArray[np.complex128] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "top", min(self.top, 0.45 * self.sample_rate))
        object.__setattr__(self, "taper", np.hanning(self.size + 1)[:-1])
        object.__setattr__(self, "padded", 1 << int(np.ceil(np.log2(3.0 * self.size))))
        object.__setattr__(self, "bins", int(1.05 * self.top / self.spacing))
        object.__setattr__(self, "_buffer", np.empty(self.padded // 2 + 1, np.complex128))

    @property
    def spacing(self) -> Hertz:
        """Bin spacing in Hz."""
        return self.sample_rate / self.padded

    @property
    def resolution(self) -> Hertz:
        """One over the window's duration: the smallest resolved frequency difference, in Hz."""
        return self.sample_rate / self.size

    def powers(self, samples: Floats | Audio) -> Floats:
        """Return the power spectrum of every channel, (channels, bins), each channel scaled to unit power."""
        return power_spectrum(samples, self.taper, self.padded, self.bins, self._buffer)

    def salience(self, power: Floats) -> Floats:
        """Return the logarithmic height of a power spectrum (bins,) over its noise floor."""
        block = max(int(self.floor_width / self.spacing), 8)
        return np.log1p(power / noise_floor(power, block))

    def peaks(self, power: Floats, salience: Floats, least: float) -> Peaks:
        """Return the peaks with a salience of at least `least`, without side lobes of stronger peaks."""
        frequency, height, stands = find_peaks(power, salience, self.spacing, 1.0 / self.resolution, least)
        rank = np.empty(frequency.size)
        rank[np.argsort(-height)] = np.arange(1.0, frequency.size + 1.0)
        variance = self.resolution**2 * (BEAT**2 + BLUR**2 * np.exp(-stands))
        return Peaks(frequency, variance, height, rank, stands)


def power_spectrum(
    samples: Floats | Audio,
    taper: Floats,
    size: Samples,
    bins: int | None = None,
    buffer: NDArray[np.complex128] | None = None,
) -> Floats:
    """Return the power spectrum of each channel, scaled to unit power.

    Scaling gives a quiet channel the same weight as a loud one, so that two transducers of different gain can
    be analysed together.

    Parameters
    ----------
    samples
        Audio (channels, n).
    taper
        Window function (n,).
    size
        Length of the zero-padded transform, at least n.
    bins
        Number of bins from 0 Hz on; all size // 2 + 1 if None.
    buffer
        Memory for one transform, (size // 2 + 1,). In a live loop, fresh memory would cost more than the
        transform, since the system clears every page for each window.

    Returns
    -------
    Power (channels, bins), dimensionless; zero for a silent channel.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 1000 * np.arange(4410) / 44100)[np.newaxis]
    >>> power = power_spectrum(tone, np.hanning(4410), 44100)
    >>> int(power.argmax())
    1000
    """
    is_audio = getattr(samples, "dtype", None) == np.float32
    samples = (
        sound(samples, size=taper.size) if is_audio else sound(samples, size=taper.size, dtype=np.float64)
    )
    if size < taper.size or (buffer is not None and buffer.shape != (size // 2 + 1,)):
        given = f"a transform of {size} for {taper.size} frames"
        raise InputError(given, f"{taper.size} or more, and memory for its {size // 2 + 1} bins")
    power = np.empty((samples.shape[0], size // 2 + 1 if bins is None else bins))
    for channel, row in zip(_levelled(samples, taper), power, strict=True):
        half = np.fft.rfft(channel, size, out=buffer)[: row.size]
        row[:] = half.real**2 + half.imag**2
    return power


@kernel(fastmath={"reassoc"})
def _levelled(samples: Floats | Audio, taper: Floats) -> Floats:
    """Return each channel without its mean, scaled to unit power and tapered; silence stays silence."""
    levelled = np.empty(samples.shape)
    for channel, row in zip(samples, levelled):  # noqa: B905  (numba knows no strict)
        total = square = 0.0
        for sample in channel:
            total += sample
        mean = total / channel.size
        for sample in channel:
            square += (sample - mean) ** 2
        rms = np.sqrt(square / channel.size)
        scale = rms if rms > 0.0 else 1.0
        for i in range(channel.size):
            row[i] = (channel[i] - mean) / scale * taper[i]
    return levelled


def noise_floor(power: Floats, block: int, share: float = FLOOR_SHARE) -> Floats:
    """Return a smooth estimate of the mean noise power at every bin, insensitive to peaks.

    In each block of bins it takes the `share` quantile, which partials do not affect as long as they fill
    less than the remaining share, and scales it to the mean of exponentially distributed noise power with
    that quantile. Between block centres the logarithm is interpolated linearly.

    Parameters
    ----------
    power
        Power spectrum (bins,).
    block
        Bins per block; must be a few times the spacing of the partials.
    share
        Quantile, 0 to 1.

    Returns
    -------
    Floor (bins,), never below 1e-7 of the largest power, which is where a Hann window leaks to.

    Examples
    --------
    >>> noise = np.random.default_rng(1).exponential(2.0, 20000)
    >>> bool(1.8 < noise_floor(noise, 500).mean() < 2.2)
    True
    """
    if power.ndim != 1 or not power.size or block < 1:
        raise InputError(f"a power spectrum of shape {power.shape} in blocks of {block}", "one bin or more")
    mean = block_floors(power[np.newaxis], block, share)[0]
    centres = (np.arange(mean.size) + 0.5) * min(block, power.size)
    smooth = np.exp(np.interp(np.arange(power.size), centres, np.log(mean)))
    return np.maximum(smooth, MIN_FLOOR * power.max())


def block_floors(power: Floats, block: int, share: float = FLOOR_SHARE) -> Floats:
    """Return the mean noise power in each block of bins, (channels, blocks), as `noise_floor` takes it.

    The quantile of a block is interpolated linearly between ranks.

    Parameters
    ----------
    power
        Power spectra (channels, bins).
    block, share
        As in `noise_floor`.
    """
    return _block_floors(np.ascontiguousarray(power, np.float64), block, share)


@kernel()
def _block_floors(power: Floats, block: int, share: float) -> Floats:
    channels, bins = power.shape
    blocks, block = max(bins // block, 1), min(block, bins)
    rank = share * (block - 1)
    below, above = int(np.floor(rank)), int(np.ceil(rank))
    floors = np.empty((channels, blocks))
    least = np.empty(above + 1)  # the least powers of a block, ascending
    for c in range(channels):
        for b in range(blocks):
            least[:] = np.inf
            for k in range(b * block, (b + 1) * block):
                at = above
                if not power[c, k] < least[at]:
                    continue
                while at > 0 and power[c, k] < least[at - 1]:
                    least[at] = least[at - 1]
                    at -= 1
                least[at] = power[c, k]
            low = least[above] - (least[above] - least[below]) * (above - rank)
            floors[c, b] = low / -np.log1p(-share) + 1e-30
    return floors


def find_peaks(
    power: Floats, salience: Floats, spacing: Hertz, duration: Seconds, least: float
) -> tuple[Floats, Floats, Floats]:
    """Return frequency, power and salience of the spectral peaks, without side lobes of stronger peaks.

    A peak is a local maximum of `power` with a salience of at least `least`; its frequency is the vertex of
    the parabola through the logarithms of three bins (Smith & Serra 1987). A peak below a stronger
    neighbour's Hann side-lobe envelope is left out; the envelope falls as the cube of the distance.

    Parameters
    ----------
    power, salience
        Spectrum and its logarithmic height over the noise floor, (bins,).
    spacing
        Bin spacing in Hz.
    duration
        Length of the window in seconds.
    least
        Smallest salience.

    Returns
    -------
    Frequencies in Hz, ascending, powers and saliences, each (peaks,).
    """
    alike("power and salience", power, salience)
    return _peaks(power, salience, spacing, duration, least)


@part()
def vertex(below: float, peak: float, above: float) -> float:
    """Return where the parabola through the logarithms of a peak and of both bins beside it has its vertex.

    It is in bins from the peak; 0 where the three lie on a straight line.
    """
    bend = below - 2.0 * peak + above
    return 0.5 * (below - above) / bend if bend < 0.0 else 0.0


@kernel()
def _peaks(
    power: Floats, salience: Floats, spacing: Hertz, duration: Seconds, least: float
) -> tuple[Floats, Floats, Floats]:
    frequency, height, stands = [0.0], [0.0], [0.0]
    for k in range(2, power.size - 1):
        if power[k] > power[k - 1] and power[k] >= power[k + 1] and salience[k] >= least:
            y0, y1, y2 = np.log(power[k - 1]), np.log(power[k]), np.log(power[k + 1])
            shift = vertex(y0, y1, y2)
            frequency.append((k + shift) * spacing)
            height.append(np.exp(y1 - 0.25 * (y0 - y2) * shift))
            stands.append(salience[k])
    f, p, s = np.array(frequency[1:]), np.array(height[1:]), np.array(stands[1:])
    keep = np.ones(f.size, np.bool_)
    reach = 40.0 / duration
    for i in range(f.size):
        for step in (-1, 1):
            j = i + step
            while keep[i] and 0 <= j < f.size and abs(f[j] - f[i]) < reach:
                bins = abs(f[j] - f[i]) * duration
                if p[j] > p[i] and bins > 1.5 and p[i] < p[j] * (1.05 / bins**3) ** 2:
                    keep[i] = False
                j += step
    return f[keep], p[keep], s[keep]
