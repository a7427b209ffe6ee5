"""How a simulated touch settles: the paper's convergence example.

Makes its figure in some three seconds: ``python -m studies.convergence --out convergence.png``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta
from studies._command import draw

from monochord.core.ranges import InnerShare
from monochord.core.types import Contact, Floats
from monochord.core.units import Hertz, Newtons, Seconds
from monochord.figures import style
from monochord.figures.base import Figure
from monochord.physics.split_string import SplitString, simulate
from monochord.physics.strings import load_string
from monochord.physics.theory import open_frequency, segment_frequencies

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure as Canvas

TRANSIENT, STEADY = (0.010, 0.050), (0.300, 0.350)  # s, the paper's two windows
CLOSE = (0.330, 0.345)  # s, the stretch that panels A and B show wave by wave
MIN_LEVEL = -70.0  # dB


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentSound:
    """One simulated segment: velocity (n,) in m/s, its sample rate, and the theoretical fundamental."""

    velocity: Floats
    rate: Hertz
    expected: Hertz


@dataclass(frozen=True, slots=True, kw_only=True)
class Convergence(Figure):
    """Velocity, spectrogram and spectra of both segments of one simulated touch, from its start.

    The paper's appendix figure: A and B show the velocities with their envelopes, C and D the spectrograms
    and E and F the spectra of a transient and of a steady window, with the frequencies of Eq. 14 dashed.

    Parameters
    ----------
    string
        Preset, or the path of a TOML file.
    position
        Position of the touch, as a share of the length.
    force
        Normal force in N; at zero the touch splits the string without changing its tension.
    seconds
        Simulated time in s; at least 0.35 s, the end of the steady window.
    model
        Only the split string has two segments that can be recorded separately.
    route
        How to simulate: the finite-difference scheme, or the exact modal route, which is faster.
    nodes, time_step
        Grid of the finite-difference scheme: nodes per segment, and time step in s; None uses 1 us, or its
        largest stable integer fraction.
    highest
        Highest frequency shown, in multiples of the open string's.
    """

    string: str = "appendix"
    position: InnerShare = 0.35
    force: Newtons = 0.0
    seconds: Annotated[Seconds, Meta(ge=STEADY[1], le=60.0)] = 0.4
    model: Literal["split_string"] = "split_string"
    route: Literal["fdtd", "modal"] = "fdtd"
    nodes: int = 256
    time_step: Seconds | None = None
    highest: Annotated[float, Meta(gt=1.0)] = 12.0

    def draw(self) -> Canvas:
        """Simulate the touch and draw both segments side by side."""
        string = load_string(self.string).string
        contact = Contact(position=self.position * string.length, force=self.force)
        setup = SplitString(string=string, contact=contact, nodes=self.nodes, time_step=self.time_step)
        recording = simulate(setup, self.seconds, route=self.route)
        expected = segment_frequencies(string, contact)
        top = self.highest * open_frequency(string)
        page = style.canvas(155.0)
        panels = page.subplots(3, 2, gridspec_kw={"height_ratios": [1.0, 1.1, 1.1]})
        for side in (0, 1):
            signal = SegmentSound(
                velocity=recording.segments[side], rate=float(recording.sample_rate), expected=expected[side]
            )
            waves, times, spectra = panels[:, side]
            title = f"simulated, segment {side + 1}, {signal.expected:.1f} Hz in theory"
            up = ("velocity (mm/s)", "frequency (Hz)", "level (dB)") if side == 0 else ("", "", "")
            style.dress(waves, "AB"[side], title, "", up[0])
            style.dress(times, "CD"[side], "", "time (ms)", up[1])
            style.dress(spectra, "EF"[side], "", "frequency (Hz)", up[2])
            waves.sharex(times)
            waves.tick_params(labelbottom=False)
            for panel in (times, spectra):
                panel.tick_params(labelleft=side == 0)
            _draw_waves(waves, signal, style.SEGMENTS[side])
            image = _draw_times(times, signal, top, style.SEGMENTS[side])
            _draw_spectra(spectra, signal, top, style.SEGMENTS[side])
        style.key(page, *panels[2])
        style.dress_bar(page.colorbar(image, ax=panels[1, :], pad=0.01, aspect=14), "level (dB)")
        return page


def envelope(segment: SegmentSound) -> Floats:
    """Return a segment's velocity amplitude: its largest magnitude within half a period on either side.

    Same shape and unit as the velocity; at both ends, the available half window is used.
    """
    from scipy.ndimage import maximum_filter1d  # noqa: PLC0415

    reach = max(round(segment.rate / segment.expected), 1)
    return maximum_filter1d(np.abs(segment.velocity), reach, mode="nearest")


def spectrum(segment: SegmentSound, span: tuple[Seconds, Seconds]) -> tuple[Floats, Floats]:
    """Return the spectrum of a segment's velocity in a time span, with a Hann window.

    Returns
    -------
    frequencies (bins,)
        In Hz, finely spaced by zero padding.
    levels (bins,)
        In dB, zero at the strongest bin.
    """
    cut = segment.velocity[round(span[0] * segment.rate) : round(span[1] * segment.rate)]
    size = 1 << 16
    level = np.abs(np.fft.rfft(cut * np.hanning(cut.size), size))
    return np.asarray(np.arange(level.size) * (segment.rate / size), float), _decibels(level)


def spectrogram(segment: SegmentSound, highest: Hertz) -> tuple[Floats, Floats, Floats]:
    """Return a segment's spectrogram: Hann windows of 30 ms, or ten periods if longer, every 2 ms.

    Returns
    -------
    times (columns,), frequencies (rows,)
        In s and Hz, up to `highest`.
    levels (rows, columns)
        In dB, zero at the strongest bin of all.
    """
    size = round(max(0.030, 10.0 / segment.expected) * segment.rate)
    hop = round(0.002 * segment.rate)
    cuts = np.lib.stride_tricks.sliding_window_view(segment.velocity, size)[::hop]
    level = np.abs(np.fft.rfft(cuts * np.hanning(size), 4 * size, axis=1))
    frequencies = np.arange(level.shape[1]) * (segment.rate / (4 * size))
    shown = frequencies <= highest
    times = (np.arange(level.shape[0]) * hop + size / 2.0) / segment.rate
    return times, frequencies[shown], _decibels(level)[:, shown].T


def _decibels(level: Floats) -> Floats:
    return 20.0 * np.log10(level / level.max() + 1e-12)


def _draw_waves(axes: Axes, segment: SegmentSound, colour: str) -> None:
    # A band from the lowest to the highest value of each period: hundreds of periods drawn as a line would
    # interfere with the dots of a screen or a printer.
    columns = np.arange(0.0, segment.velocity.size, segment.rate / segment.expected).astype(int)
    time = 1e3 * columns / segment.rate
    low, high = (1e3 * edge.reduceat(segment.velocity, columns) for edge in (np.minimum, np.maximum))
    outline = 1e3 * envelope(segment)[columns]
    axes.fill_between(time, low, high, color=colour, lw=0.0, alpha=0.45)
    for sign in (1.0, -1.0):
        axes.plot(time, sign * outline, color=style.INK, lw=0.8)
    axes.set_ylim(-1.15 * outline.max(), 1.15 * outline.max())
    start, stop = (round(t * segment.rate) for t in CLOSE)
    close = axes.inset_axes((0.62, 0.33, 0.35, 0.34))
    close.plot(
        1e3 * np.arange(start, stop) / segment.rate, segment.velocity[start:stop], color=colour, lw=0.9
    )
    close.set(xticks=[], yticks=[], xlim=(1e3 * CLOSE[0], 1e3 * CLOSE[1]))
    close.set_title(f"{1e3 * CLOSE[0]:.0f} to {1e3 * CLOSE[1]:.0f} ms", fontsize=style.TICK, pad=2)
    for spine in close.spines.values():
        spine.set(linewidth=0.5, color=style.INK)


def _draw_times(axes: Axes, segment: SegmentSound, highest: Hertz, colour: str) -> QuadMesh:
    times, frequencies, levels = spectrogram(segment, highest)
    image = axes.pcolormesh(
        1e3 * times, frequencies, levels, cmap=style.LOUDNESS, vmin=MIN_LEVEL, vmax=0.0,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    axes.axhline(segment.expected, color=colour, lw=1.0, ls=style.THEORY)
    axes.set_xlim(0.0, 1e3 * segment.velocity.size / segment.rate)
    axes.set_ylim(0.0, highest)
    return image


def _draw_spectra(axes: Axes, segment: SegmentSound, highest: Hertz, colour: str) -> None:
    for span, name, look in ((TRANSIENT, "transient", style.PALE), (STEADY, "steady", style.INK)):
        frequencies, levels = spectrum(segment, span)
        label = f"{name}, {1e3 * span[0]:.0f} to {1e3 * span[1]:.0f} ms"
        axes.plot(frequencies, levels, color=look, lw=0.9, label=label)
    axes.axvline(
        segment.expected, color=colour, lw=1.0, ls=style.THEORY, label=f"theory, {segment.expected:.1f} Hz"
    )
    axes.set_xlim(0.0, highest)
    axes.set_ylim(MIN_LEVEL, 5.0)


if __name__ == "__main__":
    draw(Convergence)
