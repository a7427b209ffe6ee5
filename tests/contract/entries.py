"""Every public entry that takes sound, fed with sound of every shape: a process of its own, as it may crash.

Each line of its output is JSON: the entry, the sound, and "refused" or what came back, in a few numbers.
"""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import monochord as mc
from monochord.core.errors import InputError
from monochord.core.types import Signal, Window
from monochord.dsp.levels import measure_levels, tone_prominence
from monochord.dsp.pitch import PitchFinder
from monochord.dsp.spectrum import Analyser, power_spectrum
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.features import FEATURES
from monochord.perception.model import ModelState, load
from monochord.perception.spectrum import SpectrumAnalyser
from monochord.perception.tuning import Tuner, TunerState
from monochord.perception.usable import unusable_reason
from monochord.physics.sensors import load_sensor

RATE, SIZE = 44100, 4410
STRING = load_sensor("prototype").string
SIGNAL = Signal(sample_rate=RATE, channels=2, string=STRING)
Sound = NDArray[Any]
FEATURES_HERE = ("fft_harmonic", "reading", "log_mel", "one_microphone")
"""Features that need no weights of another's."""


def plain() -> NDArray[np.float32]:
    time = np.arange(SIZE) / RATE
    return (0.1 * np.sin(2.0 * np.pi * np.array([[2430.0], [1730.0]]) * time)).astype(np.float32)


def sounds() -> dict[str, Sound]:
    own = plain()
    return {
        "plain": own,
        "no channel": np.zeros((0, SIZE), np.float32),
        "one channel": own[:1],
        "three channels": np.concatenate((own, own[:1])),
        "empty": np.zeros((2, 0), np.float32),
        "one row": own[0],
        "short": own[:, :100],
        "huge": np.tile(own, (1, 200)),
        "huge numbers": 1e300 * own.astype(np.float64),
        "float64": own.astype(np.float64),
        "strided": np.repeat(own, 2, axis=1)[:, ::2],
        "Fortran order": np.asfortranarray(own),
        "words": np.full((2, SIZE), "loud"),
        "complex": own.astype(np.complex128),
    }


def of_window(take: Callable[[Window], Any]) -> Callable[[Sound], Any]:
    return lambda given: take(Window(samples=given, start=0, sample_rate=RATE))


def of_estimator(name: str, **options: Any) -> Callable[[Sound], Any]:
    estimate = ESTIMATORS.build(name, options).prepare(SIGNAL, SIZE)
    return of_window(lambda window: [each.value for each in estimate(window).values()])


def entries() -> dict[str, Callable[[Sound], Any]]:
    """Return the entries by name, which begins with the sound that one takes.

    ``two`` and ``one`` are channels of `SIZE` frames; ``size`` is any channels of so many; ``long`` is two of
    so many or more, and ``any`` is all that is sound.
    """
    model, tuner = load("demo"), Tuner.of(SIGNAL, SIZE)
    one_tuner = Tuner.of(Signal(sample_rate=RATE, channels=1, string=STRING), SIZE)
    analyser = SpectrumAnalyser.of(SIGNAL, SIZE)
    finder = PitchFinder(sample_rate=RATE, size=SIZE, lowest=80.0, highest=800.0)
    taper = np.hanning(SIZE)
    own: dict[str, Callable[[Sound], Any]] = {
        "two: model": of_window(
            lambda window: [each.value for each in model.step(ModelState(), window)[1].values()]
        ),
        "two: model's outputs": of_window(lambda window: len(model.outputs(ModelState(), window)[1])),
        "two: estimator model": of_estimator("model", path="demo"),
        "two: estimator closed_form": of_estimator("closed_form"),
        "two: estimator closed_form, either": of_estimator("closed_form", open_frequency=960.0),
        "two: estimator tuning": of_estimator("tuning"),
        "two: analyser": lambda given: analyser.analyse(given).power.sum(),
        "two: tuner": of_window(lambda window: len(tuner.step(TunerState(), window).lines)),
        "one: tuner": of_window(lambda window: len(one_tuner.step(TunerState(), window).lines)),
        "size: pitch": lambda given: [series.frequency for series in finder.find(given)],
        "size: power spectrum": lambda given: power_spectrum(given, taper, 8192).sum(),
        "size: powers": lambda given: Analyser(sample_rate=RATE, size=SIZE, top=6e3).powers(given).sum(),
        "any: levels": lambda given: measure_levels(given, RATE),
        "any: prominence": lambda given: tone_prominence(given, RATE),
        "any: usable": of_window(unusable_reason),
        "long: features": lambda given: mc.features(given).sum(axis=0)[:9],
    }
    for name in FEATURES_HERE:
        extract = FEATURES.build(name).prepare(SIGNAL, SIZE)
        own[f"two: feature {name}"] = lambda given, extract=extract: extract(np.asarray(given)[np.newaxis])
    return own


def main() -> None:
    given = sounds()
    for entry, take in entries().items():
        for sound, samples in given.items():
            print(json.dumps([entry, sound]), flush=True)  # noqa: T201  (the last one before a crash)
            try:
                with np.errstate(all="ignore"):
                    value = take(samples)
                numbers = (
                    np.ravel(np.nan_to_num(np.asarray(value, float))) if not isinstance(value, str) else value
                )
                back: Any = numbers if isinstance(numbers, str) else numbers[:40].tolist()
            except InputError:
                back = "refused"
            print(json.dumps([entry, sound, back]), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
