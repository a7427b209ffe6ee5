"""The bundled model on touches all along the string, at nodes, near drivers, led there by a hand, and held.

Nowhere may it be sure and wrong. The builds are in no plan that anything was trained on.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import soundfile

import monochord as mc
from monochord.core.types import Prediction
from monochord.core.units import Metres, Newtons, Seconds
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.physics.twin.world import World

RATE = 44100
INSIDE = (0.055, 0.0667, 0.08, 0.095, 0.0995, 0.1, 0.101, 0.12, 0.1333, 0.145)
OUTSIDE = (0.02, 0.03, 0.045, 0.155, 0.17, 0.185)
MAX_DEVIATIONS, MIN_ERROR = 5.0, 1e-3
"""An answer is far off where its error is above so many of its standard errors, and above so much in m."""
SETTLING, HOLD, PAUSE = 0.3, 2.0, 0.4


@dataclass
class Recording:
    """A twin's sound, and the touches in it: place, and from when to when it was held."""

    twin: VirtualSensor
    parts: list[np.ndarray] = field(default_factory=list[np.ndarray])
    touches: list[tuple[Metres, Seconds, Seconds]] = field(
        default_factory=list[tuple[Metres, Seconds, Seconds]]
    )

    @property
    def now(self) -> Seconds:
        return sum(part.shape[1] for part in self.parts) / RATE

    def advance(self, seconds: Seconds) -> None:
        self.parts.append(self.twin.advance(seconds)[0])

    def hold(self, place: Metres) -> None:
        begin = self.now
        self.advance(HOLD)
        self.touches.append((place, begin + SETTLING, self.now - 0.1))
        self.twin.release()
        self.advance(PAUSE)


def straight_down(recording: Recording, place: Metres, force: Newtons) -> None:
    recording.twin.press(place, force)


def led_up(recording: Recording, place: Metres, force: Newtons) -> None:
    recording.twin.press(place, 0.1 * force)
    recording.advance(0.06)
    for share in (0.3, 0.6, 0.8, 1.0):
        recording.twin.change(share * force)
        recording.advance(0.03)


def led_along(recording: Recording, place: Metres, force: Newtons) -> None:
    beside = place + (3e-3 if place < 0.1 else -3e-3)
    recording.twin.press(beside, force)
    recording.advance(0.1)
    recording.twin.slide(0.1, along=(place - beside) / 0.1)
    recording.advance(0.1)


def judged(recording: Recording, file: Path) -> Iterator[tuple[Metres, Prediction]]:
    """Yield each window of a held touch: its place, and what the model says."""
    soundfile.write(file, np.concatenate(recording.parts, axis=1).T, RATE, subtype="FLOAT")
    predictions = list(mc.listen(file, model="demo"))
    for place, begin, end in recording.touches:
        for prediction in predictions:
            if begin <= prediction.time <= end:
                yield place, prediction


def is_far_off(place: Metres, prediction: Prediction) -> bool:
    position = prediction["position"]
    return position.valid and abs(position.value - place) > max(MAX_DEVIATIONS * position.std, MIN_ERROR)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("build", "day", "seed", "world"),
    [(131, 51, 0, "plausible"), (131, 51, 0, "ideal"), (77, 5, 2, "plausible"), (300, 3, 1, "plausible")],
)
def test_held_touches_are_right_or_withheld(
    build: int, day: int, seed: int, world: World, tmp_path: Path
) -> None:
    recording = Recording(VirtualSensor("prototype", seed=seed, build=build, day=day, world=world))
    recording.advance(2.0)
    for place in (*INSIDE, *OUTSIDE):
        for press, force in ((straight_down, 0.6), (led_up, 1.0), (led_along, 1.4)):
            press(recording, place, force)
            recording.hold(place)
    windows = list(judged(recording, tmp_path / "touches.wav"))
    for places, min_answered in ((INSIDE, 0.9), (OUTSIDE, 0.0)):
        zone = [(place, each) for place, each in windows if place in places]
        share = len(zone) / 100.0
        assert sum(is_far_off(*each) for each in zone) <= 0.5 * share
        assert sum(each["position"].valid for _, each in zone) >= 100.0 * min_answered * share
        denied = [each for _, each in zone if each["contact"].valid and each["contact"].value < 0.5]
        assert len(denied) <= share
        doubled = [each for _, each in zone if each["position"].why_not == "two things seem to touch"]
        assert len(doubled) <= share
