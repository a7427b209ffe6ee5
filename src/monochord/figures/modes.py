"""The untouched string's several steady sounds: which one it settles into depends on what was before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.core.units import Seconds
from monochord.figures import _style
from monochord.figures._patterns import (
    ALIKE,
    LISTEN,
    PARTIALS,
    RATE,
    STILL,
    Study,
    sound_of,
    study,
)
from monochord.figures.base import Measured
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import open_frequency

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure as Canvas

BEFORE, BEYOND = 0.2, 0.8  # s shown before and after the string is left alone
QUIETEST = -70.0  # dB
TALL = 8.6  # multiples of the open string's frequency shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Modes(Measured):
    """Steady sounds of the untouched string after different histories, and how often each came.

    The paper's figure of multi-stability, simulated: of each pattern one history that ends in it, as
    spectrograms of both microphones about the moment when the string is left alone, after a touch or a
    pluck, and the spectrum of its last half second. Two steady sounds are of one pattern if no level about
    a partial of the open string, in either channel, differs by more than 6 dB, or if others lie between
    them that are; levels are of the whole and count from -30 dB. A sound is steady if none changes by more
    than 3 dB over the last second.

    Parameters
    ----------
    sensor
        Preset, or the path of a TOML file.
    histories
        How many: touches of 0.1 to 2 N that press, move and let go, and plucks.
    first
        Seed of the first; each seeds its history, the microphones' noise and the object's surface.
    after
        How long the string is left alone before its sound counts, in s, the last second of it listened to.
    shown
        How many patterns at most, the most frequent first.
    """

    sensor: str = "prototype"
    histories: int = 200
    first: int = 0
    after: Seconds = 2.5
    shown: int = 5

    def __post_init__(self) -> None:
        if not 1 <= self.histories <= 5000:
            raise InputError(f"histories {self.histories}", "1 to 5000")
        if not self.first >= 0:
            raise InputError(f"first {self.first}", "0 or more")
        if not 1.0 + LISTEN <= self.after <= 60.0:
            raise InputError(f"after {self.after:g} s", f"{1.0 + LISTEN:g} to 60 s")
        if not 1 <= self.shown <= 6:
            raise InputError(f"shown {self.shown}", "1 to 6")

    def numbers(self) -> dict[str, Any]:
        """Return how often each pattern came, with its levels, and the seed that shows it."""
        found = self._study()
        return {
            "histories": self.histories,
            "seeds": [self.first, self.first + self.histories - 1],
            "rule": f"levels about partials 1 to {PARTIALS} within {ALIKE:g} dB in both channels",
            "steady_within_db": STILL,
            "steady": int(found.steady.sum()),
            "counts": found.counts(),
            "patterns": [
                {
                    "count": count,
                    "seed": self.first + found.spoken_for(k),
                    "levels_db": found.levels[found.pattern == k].mean(axis=0).round(1).tolist(),
                }
                for k, count in enumerate(found.counts())
            ],
        }

    def draw(self) -> Canvas:
        """Simulate the histories and draw one of each pattern, a column each."""
        found, f0 = self._study(), open_frequency(load_sensor(self.sensor).string)
        counts = found.counts()
        if not counts:
            raise InputError(
                f"{self.histories} histories without a steady end", "a steady one", "raise after"
            )
        columns = min(len(counts), self.shown)
        page = _style.canvas(138.0)
        panels = page.subplots(
            3,
            columns,
            squeeze=False,
            sharex="row",
            sharey="row",
            gridspec_kw={"height_ratios": [1.0, 1.0, 0.9]},
        )
        page.suptitle(
            f"Simulated: steady sounds of the untouched string after {self.histories} histories, "
            f"{len(counts)} patterns",
            fontsize=_style.LABEL, color=_style.INK,
        )  # fmt: skip
        image = None
        for k in range(columns):
            image = self._draw_pattern(panels[:, k], found, k, f0)
            for row in panels[:, k]:
                row.tick_params(labelleft=k == 0)
        _style.key(page, panels[2, 0])
        if image is not None:
            bar = page.colorbar(image, ax=panels[:2, :], pad=0.01, aspect=24)
            _style.dress_bar(bar, "level (dB)")
        return page

    def _study(self) -> Study:
        return study(self.sensor, self.histories, self.first, self.after)

    def _draw_pattern(self, column: Any, found: Study, pattern: int, f0: float) -> QuadMesh:
        count = found.counts()[pattern]
        heard, released = sound_of(
            load_sensor(self.sensor), self.first + found.spoken_for(pattern), self.after
        )
        share = f"{count}/{self.histories} ({'touch' if released > 0.0 else 'pluck'})"
        image: Any = None
        for c in (0, 1):
            up = f"microphone {c + 1}\nfrequency (kHz)" if pattern == 0 else ""
            letter, title = ("ABCDEF"[pattern], share) if c == 0 else ("", "")
            _style.dress(column[c], letter, title, "time since release (s)" if c else "", up)
            image = _draw_times(column[c], heard[c], released, 1e-3 * TALL * f0)
            column[c].tick_params(labelbottom=c == 1)
        _style.dress(column[2], "", "", "frequency (kHz)", "steady level (dB)" if pattern == 0 else "")
        _draw_steady(column[2], heard[:, -round(0.5 * LISTEN * RATE) :], 1e-3 * TALL * f0)
        return image


def spectrogram(sound: Audio, released: Seconds) -> tuple[Floats, Floats, Floats]:
    """Return a spectrogram about the release: Hann windows of 23 ms every 5 ms.

    Returns
    -------
    times (columns,), frequencies (rows,)
        In s since the release, and in Hz.
    levels (rows, columns)
        In dB of full scale, that of a sine's amplitude.
    """
    size, hop = 1024, round(0.005 * RATE)
    start = max(0, round((released - BEFORE) * RATE))
    cuts = np.lib.stride_tricks.sliding_window_view(
        sound[start : round((released + BEYOND) * RATE) + size], size
    )
    window = np.hanning(size)
    level = np.abs(np.fft.rfft(cuts[::hop] * window, 2 * size, axis=1)) / (0.5 * window.sum())
    times = (start + size / 2.0 + hop * np.arange(level.shape[0])) / RATE - released
    frequencies = np.asarray(np.fft.rfftfreq(2 * size, 1.0 / RATE), dtype=np.float64)
    return times, frequencies, 20.0 * np.log10(level + 1e-12).T


def _draw_times(axes: Axes, sound: Audio, released: Seconds, top: float) -> QuadMesh:
    times, frequencies, levels = spectrogram(sound, released)
    shown = frequencies <= 1e3 * top
    image = axes.pcolormesh(
        times, 1e-3 * frequencies[shown], levels[shown], cmap=_style.LOUDNESS, vmin=QUIETEST, vmax=-10.0,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    if released > 0.0:
        axes.axvline(0.0, color=_style.SEGMENTS[1], lw=0.8, ls=_style.THEORY)
    axes.set_xlim(-BEFORE, BEYOND)
    axes.set_ylim(0.0, top)
    return image


def _draw_steady(axes: Axes, heard: Audio, top: float) -> None:
    window = np.hanning(heard.shape[1])
    frequencies = np.fft.rfftfreq(heard.shape[1], 1.0 / RATE)
    frequencies = frequencies[frequencies <= 1e3 * top]
    level = np.abs(np.fft.rfft(heard * window, axis=1))[:, : frequencies.size] / (0.5 * window.sum())
    # The strongest bin of each 20 Hz, so that no line falls between two dots.
    rows = np.searchsorted(frequencies, np.arange(0.0, frequencies[-1], 20.0))
    for c, (colour, look) in enumerate(zip(_style.SEGMENTS, ("-", "--"), strict=True)):
        height = np.maximum.reduceat(20.0 * np.log10(level[c] + 1e-12), rows)
        axes.plot(
            1e-3 * frequencies[rows], height, color=colour, lw=0.8, ls=look, label=f"microphone {c + 1}"
        )
    axes.set_xlim(0.0, top)
    axes.locator_params(axis="x", nbins=5, steps=[1, 2, 10])
    axes.set_ylim(QUIETEST - 20.0, 0.0)
