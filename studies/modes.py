"""Steady sounds of the untouched string: which one it settles into depends on its history.

Makes `docs/figures/twin_modes.png` in some ten seconds:
``python -m studies.modes --out docs/figures/twin_modes.png``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from msgspec import Meta
from studies._command import draw

from monochord.core.errors import InputError
from monochord.core.ranges import Whole
from monochord.core.types import Audio, Floats
from monochord.core.units import Newtons, Seconds
from monochord.figures import style
from monochord.figures.base import Measured
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import open_frequency
from monochord.physics.twin import Key, Pluck, Scene, Sensor, Touch, advance, begin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure as Canvas

RATE = 44100
PARTIALS = 8
"""Partials of the open string used to compare patterns."""
FLOOR = -30.0
"""Level relative to the total, in dB, below which a partial counts as absent."""
PATTERN_TOLERANCE = 6.0
"""Largest level difference of a partial between two sounds of one pattern, in dB."""
STEADY_TOLERANCE = 3.0
"""Largest level change of a partial between the halves of a steady sound, in dB."""
LISTEN: Seconds = 1.0
"""Length of the analysed end of each take, in s, split in two halves."""
PLUCK_SHARE = 0.25
"""Share of histories with a pluck; the others are touches."""
OBJECTS = ("plastic", "wood", "metal_tube")
FORCE_RANGE: tuple[Newtons, Newtons] = (0.1, 2.0)
LEAD, TAIL = 0.2, 0.8  # s shown before and after the string is left alone
MIN_LEVEL = -70.0  # dB
MAX_FREQUENCY = 8.6  # multiples of the open string's frequency shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Modes(Measured):
    """Steady sounds of the untouched string after different histories, with their frequencies of occurrence.

    This simulates the paper's figure of multi-stability. For each pattern it shows one history: spectrograms
    of both microphones around the moment when the string is left alone, after a touch or a pluck, and the
    spectrum of the last half second. Two steady sounds belong to one pattern if no partial's level, in either
    channel, differs by more than 6 dB, or if a chain of such sounds connects them; levels are relative to the
    total and count from -30 dB. A sound is steady if no level changes by more than 3 dB over the last second.

    Parameters
    ----------
    sensor
        Preset, or the path of a TOML file.
    histories
        Number of histories: touches of 0.1 to 2 N that press, move and release, and plucks.
    first
        Seed of the first history; each seed draws the history, the microphones' noise and the object's
        surface.
    after
        Time in s that the string is left alone; the last second of it is analysed.
    shown
        Largest number of patterns shown, the most frequent first.
    """

    sensor: str = "prototype"
    histories: Annotated[int, Meta(ge=1, le=5000)] = 200
    first: Whole = 0
    after: Annotated[Seconds, Meta(ge=1.0 + LISTEN, le=60.0)] = 2.5
    shown: Annotated[int, Meta(ge=1, le=6)] = 5

    def numbers(self) -> dict[str, Any]:
        """Return each pattern's count and levels, and the seed that shows it."""
        endings = self._study()
        return {
            "histories": self.histories,
            "seeds": [self.first, self.first + self.histories - 1],
            "rule": f"levels about partials 1 to {PARTIALS} within {PATTERN_TOLERANCE:g} dB in both channels",
            "steady_within_db": STEADY_TOLERANCE,
            "steady": int(endings.steady.sum()),
            "counts": endings.counts(),
            "patterns": [
                {
                    "count": count,
                    "seed": self.first + endings.typical(k),
                    "levels_db": endings.levels[endings.pattern == k].mean(axis=0).round(1).tolist(),
                }
                for k, count in enumerate(endings.counts())
            ],
        }

    def draw(self) -> Canvas:
        """Simulate the histories and draw one of each pattern, in a column each."""
        endings, f0 = self._study(), open_frequency(load_sensor(self.sensor).string)
        counts = endings.counts()
        if not counts:
            raise InputError(
                f"{self.histories} histories without a steady end", "a steady end", "raise after"
            )
        columns = min(len(counts), self.shown)
        page = style.canvas(138.0)
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
            fontsize=style.LABEL, color=style.INK,
        )  # fmt: skip
        image = None
        for k in range(columns):
            image = self._draw_pattern(panels[:, k], endings, k, f0)
            for row in panels[:, k]:
                row.tick_params(labelleft=k == 0)
        style.key(page, panels[2, 0])
        if image is not None:
            bar = page.colorbar(image, ax=panels[:2, :], pad=0.01, aspect=24)
            style.dress_bar(bar, "level (dB)")
        return page

    def _study(self) -> Study:
        return study(self.sensor, self.histories, self.first, self.after)

    def _draw_pattern(self, column: Any, endings: Study, pattern: int, f0: float) -> QuadMesh:
        count = endings.counts()[pattern]
        sound, released = sound_of(
            load_sensor(self.sensor), self.first + endings.typical(pattern), self.after
        )
        share = f"{count}/{self.histories} ({'touch' if released > 0.0 else 'pluck'})"
        image: Any = None
        for c in (0, 1):
            up = f"microphone {c + 1}\nfrequency (kHz)" if pattern == 0 else ""
            letter, title = ("ABCDEF"[pattern], share) if c == 0 else ("", "")
            style.dress(column[c], letter, title, "time since release (s)" if c else "", up)
            image = _draw_times(column[c], sound[c], released, 1e-3 * MAX_FREQUENCY * f0)
            column[c].tick_params(labelbottom=c == 1)
        style.dress(column[2], "", "", "frequency (kHz)", "steady level (dB)" if pattern == 0 else "")
        _draw_steady(column[2], sound[:, -round(0.5 * LISTEN * RATE) :], 1e-3 * MAX_FREQUENCY * f0)
        return image


def spectrogram(sound: Audio, released: Seconds) -> tuple[Floats, Floats, Floats]:
    """Return a spectrogram around the release: Hann windows of 23 ms every 5 ms.

    Returns
    -------
    times (columns,), frequencies (rows,)
        In s since the release, and in Hz.
    levels (rows, columns)
        In dB of full scale, for a sine's amplitude.
    """
    size, hop = 1024, round(0.005 * RATE)
    start = max(0, round((released - LEAD) * RATE))
    cuts = np.lib.stride_tricks.sliding_window_view(
        sound[start : round((released + TAIL) * RATE) + size], size
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
        times, 1e-3 * frequencies[shown], levels[shown], cmap=style.LOUDNESS, vmin=MIN_LEVEL, vmax=-10.0,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    if released > 0.0:
        axes.axvline(0.0, color=style.SEGMENTS[1], lw=0.8, ls=style.THEORY)
    axes.set_xlim(-LEAD, TAIL)
    axes.set_ylim(0.0, top)
    return image


def _draw_steady(axes: Axes, sound: Audio, top: float) -> None:
    window = np.hanning(sound.shape[1])
    frequencies = np.fft.rfftfreq(sound.shape[1], 1.0 / RATE)
    frequencies = frequencies[frequencies <= 1e3 * top]
    level = np.abs(np.fft.rfft(sound * window, axis=1))[:, : frequencies.size] / (0.5 * window.sum())
    # The strongest bin of each 20 Hz, so that no line falls between two dots.
    rows = np.searchsorted(frequencies, np.arange(0.0, frequencies[-1], 20.0))
    for c, (colour, look) in enumerate(zip(style.SEGMENTS, ("-", "--"), strict=True)):
        height = np.maximum.reduceat(20.0 * np.log10(level[c] + 1e-12), rows)
        axes.plot(
            1e-3 * frequencies[rows], height, color=colour, lw=0.8, ls=look, label=f"microphone {c + 1}"
        )
    axes.set_xlim(0.0, top)
    axes.locator_params(axis="x", nbins=5, steps=[1, 2, 10])
    axes.set_ylim(MIN_LEVEL - 20.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """The string's history before it is left alone at `released`."""

    scene: Scene
    released: Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """Results of simulated histories.

    `levels` (n, 2, partials) are in dB of the total; `steady` and `pattern` are (n,). Patterns are numbered
    by frequency of occurrence, 0 first; a sound that is not steady has -1.
    """

    levels: Floats
    steady: np.ndarray
    pattern: np.ndarray

    def counts(self) -> list[int]:
        """Return each pattern's count, the most frequent first."""
        return np.bincount(self.pattern[self.pattern >= 0]).tolist()

    def typical(self, pattern: int) -> int:
        """Return the history whose sound is closest to its pattern's mean."""
        own = np.flatnonzero(self.pattern == pattern)
        off = np.abs(self.levels[own] - self.levels[own].mean(axis=0)).max(axis=(1, 2))
        return int(own[np.argmin(off)])


def history(sensor: Sensor, seed: int) -> History:
    """Return the history of a seed: a touch that presses, moves and releases, or a pluck."""
    chance = np.random.default_rng([seed, 1])
    if chance.random() < PLUCK_SHARE:
        place, height = chance.uniform(0.1, 0.9), chance.uniform(2e-4, 2e-3)
        length = sensor.string.length
        return History(
            scene=Scene(pluck=Pluck(position=place * length, height=height * length)), released=0.0
        )
    here, there = (float(place) for place in chance.uniform(*sensor.range, 2))
    force = float(np.exp(chance.uniform(*np.log(FORCE_RANGE))))
    harder = float(np.clip(force * chance.uniform(0.5, 1.5), *FORCE_RANGE))
    down, rest, travel, up = (
        float(chance.uniform(low, high)) for low, high in ((0.02, 0.1), (0.1, 0.5), (0.05, 0.3), (0.01, 0.1))
    )
    travel += 2.0 * abs(there - here)  # 0.5 m/s at most
    times = np.cumsum([0.05, down, rest, travel, up]).tolist()
    keys = (
        Key(time=times[0], position=here, clearance=1e-3),
        Key(time=times[1], position=here, force=force),
        Key(time=times[2], position=here, force=force),
        Key(time=times[3], position=there, force=harder),
        Key(time=times[4], position=there, clearance=1e-3),
    )
    material = load_material(OBJECTS[int(chance.integers(len(OBJECTS)))])
    touch = Touch(material=material, motion=keys, rolls=bool(chance.integers(2)))
    return History(scene=Scene(touches=(touch,)), released=times[4])


def sound_of(sensor: Sensor, seed: int, after: Seconds, noise: int | None = None) -> tuple[Audio, Seconds]:
    """Return both microphones until `after` the release, (2, n), and the time of the release.

    `noise` seeds the converter's noise and the object's surface; by default `seed` does.
    """
    past = history(sensor, seed)
    twin = begin(sensor, past.scene, sample_rate=RATE, seed=seed if noise is None else noise)
    take, _ = advance(twin, round((past.released + after) * RATE))
    return take.microphones, past.released


def partial_levels(microphones: Audio, sensor: Sensor) -> Floats:
    """Return the power around each partial of the open string, (2, partials), in dB of the total."""
    count = microphones.shape[1]
    power = np.abs(np.fft.rfft(microphones * np.hanning(count), axis=1)) ** 2
    nearest = np.rint(np.fft.rfftfreq(count, 1.0 / RATE) / open_frequency(sensor.string)).astype(int)
    around = np.array([power[:, nearest == n].sum(axis=1) for n in range(1, PARTIALS + 1)]).T
    return np.maximum(10.0 * np.log10(around / around.sum() + 1e-30), FLOOR)


def patterns(levels: Floats) -> np.ndarray:
    """Return each sound's pattern (n,): connected components of similar sounds."""
    count = levels.shape[0]
    flat = levels.reshape(count, -1)
    alike = np.abs(flat[:, None] - flat[None]).max(axis=2) <= PATTERN_TOLERANCE
    label = np.arange(count)
    while True:
        spread = np.where(alike, label, count).min(axis=1)
        if (spread == label).all():
            break
        label = spread
    _, index, sizes = np.unique(label, return_inverse=True, return_counts=True)
    place = np.empty_like(sizes)
    place[np.argsort(-sizes, kind="stable")] = np.arange(sizes.size)
    return place[index]


@lru_cache(maxsize=8)
def study(name: str, histories: int, first: int, after: Seconds) -> Study:
    """Simulate a sensor through the histories of the seeds from `first` on, and classify the results."""
    sensor, half = load_sensor(name), round(0.5 * LISTEN * RATE)
    levels, before = np.empty((2, histories, 2, PARTIALS))
    for i in range(histories):
        sound, _ = sound_of(sensor, first + i, after)
        levels[i] = partial_levels(sound[:, -half:], sensor)
        before[i] = partial_levels(sound[:, -2 * half : -half], sensor)
    steady = np.abs(levels - before).max(axis=(1, 2)) <= STEADY_TOLERANCE
    pattern = np.full(histories, -1)
    if steady.any():
        pattern[steady] = patterns(levels[steady])
    return Study(levels=levels, steady=steady, pattern=pattern)


if __name__ == "__main__":
    draw(Modes)
