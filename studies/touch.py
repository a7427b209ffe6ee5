"""The simulated sound of a touch from beginning to end, above its labels.

Makes `docs/figures/twin_touch.png` in some three seconds:
``python -m studies.touch --out docs/figures/twin_touch.png``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from msgspec import Meta
from studies._command import draw

from monochord.core.ranges import Share
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, MetresPerSecond, Newtons, Seconds
from monochord.figures import style
from monochord.figures.base import Figure
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import split_frequencies
from monochord.physics.twin import Key, Pluck, Scene, Take, advance, begin
from monochord.physics.twin import Touch as Object

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure as Canvas

RATE = 44100
LEAD: Seconds = 0.6
"""Time that the untouched string sounds before the figure begins, in s."""
SIZE, HOP = 0.030, 0.004
"""Window and step of the spectrogram, in s."""
MIN_LEVEL = -70.0  # dB
RAMP: Seconds = 0.03
"""Time for the object to reach its full sideways speed, in s."""
PHASES = (
    ("untouched", 0.25), ("approach", 0.20), ("press", 0.15), ("hold", 0.40), ("slide across", 0.35),
    ("hold", 0.25), ("slide along", 0.40), ("release", 0.15), ("untouched", 0.35),
)  # fmt: skip
"""Phases of the touch, with their lengths in s."""
PLUCK_POSITION = 0.37
"""Position of the first pluck, as a share of the string."""
WAIT_CLEARANCE = 3e-3
"""Clearance at which the object waits, in m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch(Figure):
    """Spectrograms of both channels during approach, press, hold, slide and release, above the labels.

    Below the sound, on the same time axis, are the twin's labels: contact c, position x, force F, slip s with
    its speed, and whether the sound has settled.

    Parameters
    ----------
    sensor, material
        Presets, or paths of TOML files.
    force
        Force of the press, in N.
    start, end
        Positions of the press and of the end of the slide, as shares of the sensing range.
    speed
        Speed of the slide across the string, in m/s.
    highest
        Highest frequency shown, in Hz.
    seed
        Random seed of surface and noise.
    """

    sensor: str = "prototype"
    material: str = "plastic"
    force: Annotated[Newtons, Meta(gt=0.0, le=10.0)] = 1.0
    start: Share = 0.3
    end: Share = 0.7
    speed: Annotated[MetresPerSecond, Meta(ge=-0.5, le=0.5)] = 0.03
    highest: Annotated[Hertz, Meta(ge=500.0, le=0.5 * RATE)] = 12000.0
    seed: int = 0

    def play(self) -> Take:
        """Return sound and labels, from half a window before the figure to half a window after it."""
        sensor = load_sensor(self.sensor)
        low, high = sensor.range
        here, there = low + self.start * (high - low), low + self.end * (high - low)
        touch = Object(material=load_material(self.material), motion=self._motion(here, there), rolls=False)
        pluck = Pluck(position=PLUCK_POSITION * sensor.string.length, height=1e-4)
        twin = begin(sensor, Scene(touches=(touch,), pluck=pluck), seed=self.seed)
        _, twin = advance(twin, round((LEAD - 0.5 * SIZE) * RATE))
        take, _ = advance(twin, round((sum(seconds for _, seconds in PHASES) + SIZE) * RATE))
        return take

    def draw(self) -> Canvas:
        """Play the touch and draw it."""
        take = self.play()
        page = style.canvas(150.0)
        panels = page.subplot_mosaic(
            [[name] for name in "ABCDEFG"], sharex=True, height_ratios=[4.2, 4.2, 0.45, 1.1, 1.1, 1.1, 0.45]
        )
        picture = [spectrogram(channel, self.highest) for channel in take.microphones]
        loudest = max(levels.max() for _, _, levels in picture)
        images: list[QuadMesh] = []
        for channel, (times, frequencies, levels) in enumerate(picture):
            axes = panels["AB"[channel]]
            style.dress(axes, "AB"[channel], "", "", f"microphone {channel + 1} (kHz)")
            images.append(_draw_sound(axes, times, frequencies, levels - loudest))
            self._draw_theory(axes, take)
        bar = page.colorbar(images[0], ax=[panels["A"], panels["B"]], pad=0.01, aspect=22)
        style.dress_bar(bar, "level (dB)")
        self._draw_labels({name: panels[name] for name in "CDEFG"}, take)
        _draw_phases(panels["A"], [panels[name] for name in "BCDEFG"])
        material = self.material.replace("_", " ")
        panels["A"].set_title(
            f"simulated: {material}, {self.force:g} N, {1e3 * abs(self.speed):g} mm/s across",
            fontsize=style.LABEL, color=style.INK, pad=14,
        )  # fmt: skip
        page.align_ylabels(list(panels.values()))
        return page

    def _motion(self, here: float, there: float) -> tuple[Key, ...]:
        far, pressed = {"clearance": WAIT_CLEARANCE}, {"force": self.force}
        # The object comes to touch, presses, holds, goes across, holds, goes along and leaves.
        stops = [
            (here, far, 0.0), (here, far, 0.0), (here, {}, 0.0), (here, pressed, 0.0), (here, pressed, 0.0),
            (here, pressed, 0.0), (here, pressed, 0.0), (there, pressed, 0.0), (there, far, 0.0),
        ]  # fmt: skip
        times = LEAD + np.concatenate([[0.0], np.cumsum([seconds for _, seconds in PHASES[:-1]])])
        keys = [
            Key(time=float(time), position=place, across=across, **kind)
            for time, (place, kind, across) in zip(times, stops, strict=True)
        ]
        begins, ends = float(times[4]), float(times[5])
        keys[5:5] = [
            Key(time=begins + RAMP, position=here, force=self.force, across=self.speed),
            Key(time=ends - RAMP, position=here, force=self.force, across=self.speed),
        ]
        return tuple(keys)

    def _draw_theory(self, axes: Axes, take: Take) -> None:
        string, labels = load_sensor(self.sensor).string, take.labels
        pressed = np.flatnonzero(labels.force[0] > 0.2 * self.force)[:: round(HOP * RATE)]
        both = split_frequencies(string, labels.position[0, pressed], labels.force[0, pressed], "geometric")
        for side, (frequency, colour) in enumerate(zip(both, style.SEGMENTS, strict=True)):
            axes.plot(
                pressed / RATE - 0.5 * SIZE, 1e-3 * frequency, color=colour, lw=1.0, ls=style.THEORY,
                label=f"$f_{side + 1}$ in theory",
            )  # fmt: skip
        if axes.get_title(loc="left") == "B":
            axes.legend(
                fontsize=style.TICK, frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.98),
                labelcolor=style.INK, handlelength=1.8, borderaxespad=0.0,
            )  # fmt: skip

    def _draw_labels(self, panels: dict[str, Axes], take: Take) -> None:
        labels = take.labels
        time = np.arange(labels.settled.size) / RATE - 0.5 * SIZE
        touched = labels.contact[0] > 0
        _draw_flag(panels["C"], time, touched, "c")
        _draw_flag(panels["G"], time, labels.settled > 0, "settled")
        position = np.where(touched, 1e3 * labels.position[0], np.nan)
        across, along = 1e3 * labels.across[0], 1e3 * labels.along[0]
        panels["D"].plot(time, position, color=style.INK, lw=1.1)
        panels["E"].plot(time, labels.force[0], color=style.INK, lw=1.1)
        panels["F"].fill_between(
            time, 0.0, 1.0, where=labels.slip[0] > 0, transform=panels["F"].get_xaxis_transform(),
            color="#E6E6E6", lw=0.0, label="s = 1",
        )  # fmt: skip
        panels["F"].plot(time, across, color=style.SEGMENTS[0], lw=1.1, label="across")
        panels["F"].plot(time, along, color=style.SEGMENTS[1], lw=1.1, label="along")
        for name, label in (("D", "x (mm)"), ("E", "F (N)"), ("F", "slip\n(mm/s)")):
            style.dress(panels[name], "", "", "", label)
        panels["E"].set_ylim(bottom=0.0)
        panels["F"].margins(y=0.15)
        panels["F"].legend(
            fontsize=style.TICK, frameon=False, ncols=3, loc="upper left", labelcolor=style.INK,
            handlelength=1.2, columnspacing=1.0, borderaxespad=0.1,
        )  # fmt: skip
        panels["G"].set_xlabel("time (s)", fontsize=style.LABEL, color=style.INK)
        panels["G"].set_xlim(0.0, float(time[-1]) - 0.5 * SIZE)


def spectrogram(channel: Audio, highest: Hertz) -> tuple[Floats, Floats, Floats]:
    """Return times in s, frequencies in Hz and levels in dB (rows, columns) of a channel, up to a frequency.

    Times count from the middle of the first window.
    """
    size, hop = round(SIZE * RATE), round(HOP * RATE)
    cuts = np.lib.stride_tricks.sliding_window_view(channel.astype(np.float64), size)[::hop]
    power = np.abs(np.fft.rfft(cuts * np.hanning(size), 2 * size, axis=1)) ** 2
    frequencies = np.arange(power.shape[1]) * (RATE / (2 * size))
    shown = frequencies <= highest
    return (
        np.arange(power.shape[0]) * (hop / RATE),
        frequencies[shown],
        10.0 * np.log10(power[:, shown].T + 1e-20),
    )


def _draw_sound(axes: Axes, times: Floats, frequencies: Floats, levels: Floats) -> QuadMesh:
    image = axes.pcolormesh(
        times, 1e-3 * frequencies, levels, cmap=style.LOUDNESS, vmin=MIN_LEVEL, vmax=0.0, shading="nearest",
        rasterized=True,
    )  # fmt: skip
    axes.tick_params(labelbottom=False)
    return image


def _draw_flag(axes: Axes, time: Floats, on: np.ndarray, label: str) -> None:
    style.dress(axes, "", "", "", "")
    axes.fill_between(time, 0.0, 1.0, where=on, color=style.INK, lw=0.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_yticks([0.5], [label])
    axes.tick_params(axis="y", length=0.0)


def _draw_phases(top: Axes, others: list[Axes]) -> None:
    edge = 0.0
    for name, seconds in PHASES:
        top.text(
            edge + 0.5 * seconds, 1.02, name, transform=top.get_xaxis_transform(), ha="center", va="bottom",
            fontsize=style.TICK, color=style.INK,
        )  # fmt: skip
        edge += seconds
        for axes in (top, *others):
            axes.axvline(edge, color=style.PALE, lw=0.5, ls=":")


if __name__ == "__main__":
    draw(Touch)
