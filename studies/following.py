"""Detection delays of touch and slip, window by window and over time.

Makes `docs/figures/following.png` and `docs/results/following.json` in some ten minutes on two cores:
``python -m studies.following --out docs/figures/following.png --json docs/results/following.json``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from studies._command import draw
from studies._onsets import Onsets, Recorded, WithNoise, errors, onsets, record

from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source
from monochord.core.config import to_tree
from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Seconds
from monochord.dsp import loop
from monochord.evaluation import motor
from monochord.figures import style
from monochord.figures.base import Measured
from monochord.live import MODEL, FilterSettings, LiveRun
from monochord.perception.estimators import ESTIMATORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

RATE = 44100
QUIET, MUSIC, MOTORS = "quiet", "music", "motors"
COLOURS = {QUIET: "#0072B2", MUSIC: "#D55E00", MOTORS: "#009E73"}
"""Okabe and Ito's blue, vermilion and green."""
BLOCKS = 800
"""Number of blocks whose median power gives a source's level: the first eight seconds."""
NAMES = ("contact", "slip")


@dataclass(frozen=True, slots=True, kw_only=True)
class Following(Measured):
    """Delay of the onset of contact (A) and slip (B), and false alarms (C, D), against the threshold.

    Solid lines: over time, as live. Dashed lines: each window separately. Thick lines are the median delay,
    thin lines the 95th percentile, from the true onset to the end of the deciding window; without noise, with
    music, and with a geared motor. The JSON output also holds the errors of position and force with and
    without the filter, held and moving. Simulated, unless sessions are given.

    Parameters
    ----------
    model
        The folder of a model, or the name of a bundled one.
    builds
        Seeds of the virtual sensors, of the world `plausible`, that are touched at random.
    seconds
        Duration of each, or largest duration of each session, in s.
    seed
        Random seed of the touches.
    sessions
        Sessions with labels in place of the twin.
    ratio
        Ratio of the sensor's sound to the noise in dB.
    noises
        Conditions to measure: ``quiet``, ``music``, ``motors``.
    thresholds
        Probabilities for switching contact or slip on.
    filter
        Settings of the filter.
    """

    model: str = "demo"
    builds: tuple[int, ...] = (301, 302, 303, 304, 305, 306)
    seconds: Seconds = 30.0
    seed: int = 0
    sessions: tuple[str, ...] = ()
    ratio: float = 10.0
    noises: tuple[str, ...] = (QUIET, MUSIC, MOTORS)
    thresholds: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    filter: FilterSettings = field(default_factory=FilterSettings)

    def __post_init__(self) -> None:
        if not self.noises or not set(self.noises) <= COLOURS.keys():
            raise InputError(f"noises {', '.join(self.noises) or 'none'}", ", ".join(COLOURS))
        if not (self.builds or self.sessions):
            raise InputError("no builds and no sessions", "one or more")
        if not self.thresholds or not all(0.0 < each < 1.0 for each in self.thresholds):
            raise InputError(f"thresholds {list(self.thresholds)}", "one or more, between 0 and 1")
        if not 1.0 <= self.seconds < math.inf:
            raise InputError(f"seconds {self.seconds:g}", "1 s or more")

    def numbers(self) -> dict[str, Any]:
        """Return curves by noise, name and method, and errors by noise and quantity."""
        return {
            "simulated": not self.sessions,
            "curves": {
                noise: {
                    name: {
                        way: [to_tree(each) for each in _curve(self, noise, name, way)]
                        for way in ("windows", "followed")
                    }
                    for name in NAMES
                }
                for noise in self.noises
            },
            "errors": {
                noise: {
                    name: to_tree(errors(_recorded(self, noise), name, self.filter))
                    for name in ("position", "force")
                }
                for noise in self.noises
            },
        }

    def draw(self) -> Canvas:
        """Run all sources through the model and draw the curves."""
        page = style.canvas(110.0)
        panels = page.subplot_mosaic([["A", "B"], ["C", "D"]])
        where = "sessions" if self.sessions else "simulated, world plausible"
        for letters, name in (("AC", NAMES[0]), ("BD", NAMES[1])):
            delay, alarms = (panels[letter] for letter in letters)
            style.dress(delay, letters[0], f"onset of {name} ({where})", "", "delay (ms)")
            style.dress(alarms, letters[1], "", "threshold", "false alarms / minute")
            for noise in self.noises:
                for way, line in (("followed", "-"), ("windows", "--")):
                    self._draw_curve(delay, alarms, noise, name, way, line)
            for panel in (delay, alarms):
                panel.set_xlim(0.0, 1.0)
                panel.set_ylim(bottom=0.0)
        style.key(page, panels["A"])
        return page

    def _draw_curve(self, delay: Axes, alarms: Axes, noise: str, name: str, way: str, line: str) -> None:
        curve = _curve(self, noise, name, way)
        label = noise if way == "followed" else f"{noise}, single windows"
        at, colour = [each.threshold for each in curve], COLOURS[noise]
        median, p95 = (
            [1e3 * value for value in values]
            for values in zip(*((c.median, c.p95) for c in curve), strict=True)
        )
        delay.plot(at, median, line, color=colour, lw=1.6, label=label)
        delay.plot(at, p95, line, color=colour, lw=0.6)
        alarms.plot(at, [each.false_alarms for each in curve], line, color=colour, lw=1.2)

    def sources(self) -> list[Source]:
        """Return the sources, without noise."""
        if self.sessions:
            return [SOURCES.build("session", {"path": path}) for path in self.sessions]
        return [
            SOURCES.build(
                "twin",
                {
                    "world": "plausible",
                    "build": build,
                    "seed": self.seed + build,
                    "speed": 0.0,
                    "duration": self.seconds,
                },
            )
            for build in self.builds
        ]


@cache
def _curve(figure: Following, noise: str, name: str, way: str) -> list[Onsets]:
    settings = figure.filter if way == "followed" else None
    return [onsets(_recorded(figure, noise), name, each, settings) for each in figure.thresholds]


@cache
def _recorded(figure: Following, noise: str) -> tuple[Recorded, ...]:
    """Return the predictions of all sources with a noise."""
    estimator = ESTIMATORS.build(MODEL, {"path": str(figure.model)})
    sources = [
        source if noise == QUIET else _in_noise(source, noise, figure.ratio) for source in figure.sources()
    ]
    return tuple(
        record(LiveRun(source=each, estimator=estimator, seconds=figure.seconds)) for each in sources
    )


def _in_noise(source: Source, noise: str, ratio: float) -> Source:
    """Return a source with music, or with a motor, at a ratio in dB to its usual level."""
    with source.open() as stream:
        powers = [np.mean(np.square(block.samples, dtype=float)) for block in islice(stream, BLOCKS)]
    sound: Audio = (
        loop(1) if noise == MUSIC else motor(np.random.default_rng(0), 10 * RATE, RATE).astype(np.float32)
    )
    level = math.sqrt(float(np.median(powers)) / float(np.mean(np.square(sound, dtype=float))))
    return WithNoise(source=source, sound=sound, gain=level * 10.0 ** (-ratio / 20.0))


if __name__ == "__main__":
    draw(Following)
