"""Estimators on sensors that nothing learned from, beside the twin's: the closed form, models, and baselines.

Two simulators of the tests share no line with the twin or with each other, finite differences and beam
elements. Each draws its sensor by seed. Of every sensor the estimators know the length, as by a ruler, and
the design; the pitch they find for themselves. Ridge regression and extra trees are fitted to other builds of
the twin. In some four minutes on one core: ``python -m studies.foreign``.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import takewhile
from time import process_time
from typing import Any, Literal, TypeAlias

import click
import numpy as np
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from studies._command import lines_of, main, progress_bar
from tests import beam_elements, finite_differences
from tests.finite_differences import Take

import monochord as mc
from monochord.capture.sources import SOURCES
from monochord.core.types import Audio, Floats, Signal, StringParams, Window
from monochord.core.units import Samples, Seconds
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.features import FEATURES
from monochord.perception.tuning import Tuner, TunerState
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import open_frequency

RATE, SIZE, HOP = 44100, 4410, 1103
TWIN_SECONDS: Seconds = 14.0
"""Sound of one build of the twin."""
SETTLING: Samples = 1500
"""Frames before a window in which nothing may change."""
NEAR = 5.0e-3
"""Error of a position in m up to which it counts as right."""
TRAINING_SEED, SEED = 100_000, 40_000
"""First seeds of the builds that baselines are fitted to, and of those that are scored."""

Values: TypeAlias = tuple[Floats, Floats, Floats]
"""Of each window contact as a probability, position in m and force in N; NaN for no answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Sound (2, n) of one sensor, its string's length, and the windows that are steady or not (k,).

    `contact`, `position` and `force` are the truth of each window, and `steady` says whether it counts.
    """

    sound: Audio
    length: float
    starts: list[int]
    contact: Floats
    position: Floats
    force: Floats
    steady: Floats

    @property
    def string(self) -> StringParams:
        """The design's string at this length, and at the design's pitch."""
        string = load_sensor("prototype").string
        tension = string.linear_density * (2.0 * self.length * open_frequency(string)) ** 2
        return replace(string, length=self.length, tension=tension)

    def windows(self) -> Iterator[Window]:
        """Yield the windows, steady or not."""
        for start in self.starts:
            samples = np.ascontiguousarray(self.sound[:, start : start + SIZE])
            yield Window(samples=samples, start=start, sample_rate=RATE)


def of_take(take: Take) -> Recording:
    """Return the recording of a foreign sensor."""
    starts = list(range(0, take.sound.shape[1] - SIZE, HOP))
    rows: list[tuple[float, float, float, float]] = []
    for start in starts:
        before = slice(max(start - SETTLING, 0), start + SIZE)
        steady = np.ptp(take.contact[before]) == 0.0 and np.ptp(take.force[before]) < 1e-9
        rows.append((take.contact[start], take.position[start], take.force[start], float(steady)))
    return _recording(take.sound, take.length, starts, rows)


def of_twin(seed: int, world: Literal["ideal", "plausible"]) -> Recording:
    """Return the recording of a build of the twin, of touches at random."""
    options = {
        "world": world,
        "build": seed,
        "day": seed,
        "seed": seed,
        "speed": 0.0,
        "hold": 0.8,
        "slips": 0.2,
    }
    with SOURCES.build("twin", options).open() as stream:
        frames = round(TWIN_SECONDS * RATE)
        blocks = [block.samples for block in takewhile(lambda block: block.start < frames, stream)]
        starts, rows = list(range(0, frames - SIZE, HOP)), list[tuple[float, float, float, float]]()
        for start in starts:
            truth = stream.truth(start, start + SIZE)
            touched = truth.get("contact", np.nan)
            steady = truth.get("transition") == 0.0 and (touched == 0.0 or truth["settled"] > 0.9)
            values = (truth.get(name, np.nan) for name in ("position", "force"))
            rows.append((touched, *values, float(steady)))  # pyright: ignore[reportArgumentType]
    built = mc.VirtualSensor("prototype", world=world, build=seed, day=seed, seed=seed).sensor
    return _recording(np.concatenate(blocks, axis=1)[:, :frames], built.string.length, starts, rows)


def _recording(
    sound: Audio, length: float, starts: list[int], rows: list[tuple[float, float, float, float]]
) -> Recording:
    contact, position, force, steady = np.array(rows).T
    return Recording(
        sound=sound,
        length=length,
        starts=starts,
        contact=contact,
        position=position,
        force=force,
        steady=steady,
    )


SENSORS: Mapping[str, Callable[[int, int], Recording]] = {
    "twin, ideal": lambda seed, _: of_twin(seed, "ideal"),
    "twin, plausible": lambda seed, _: of_twin(seed, "plausible"),
    "finite differences": lambda seed, touches: of_take(finite_differences.take(seed, touches)),
    "beam elements": lambda seed, touches: of_take(beam_elements.take(seed, touches)),
}


def estimated(name: str, options: Mapping[str, Any], recording: Recording) -> tuple[Values, Values]:
    """Return what an estimator says of each window of a recording, and the standard errors."""
    signal = Signal(sample_rate=RATE, channels=2, string=recording.string)
    estimate = ESTIMATORS.build(name, options).prepare(signal, SIZE)
    rows = [estimate(window) for window in recording.windows()]
    columns = [[row[key] for row in rows] for key in ("contact", "position", "force")]
    values, stds = (
        tuple(np.array([getattr(each, part) for each in column]) for column in columns)
        for part in ("value", "std")
    )
    return values, stds  # pyright: ignore[reportReturnType]


class Baseline:
    """A regression on the paper's feature, relative to the string's own pitch."""

    def __init__(self, kind: str) -> None:
        trees = ExtraTreesRegressor(50, max_features=0.1, min_samples_leaf=2, random_state=0)
        ridge = make_pipeline(StandardScaler(), RidgeCV(np.logspace(-3.0, 3.0, 7)))
        self._model: Any = trees if kind == "extra trees" else ridge

    def fit(self, recordings: list[Recording]) -> "Baseline":
        """Fit it to the steady touched windows."""
        rows, truth = list[Floats](), list[Floats]()
        for each in recordings:
            counts = (each.steady == 1.0) & (each.contact == 1.0)
            rows.append(_features(each)[counts])
            truth.append(np.stack((each.position / each.length, each.force), axis=1)[counts])
        self._model.fit(np.concatenate(rows), np.concatenate(truth))
        return self

    def __call__(self, recording: Recording) -> tuple[Values, Values]:
        """Return what it says of each window; of contact nothing, and no standard error."""
        place, force = self._model.predict(_features(recording)).T
        nothing = np.full(len(place), np.nan)
        return (nothing, place * recording.length, force), (nothing, nothing, nothing)


def _features(recording: Recording) -> Floats:
    signal = Signal(sample_rate=RATE, channels=2, string=recording.string)
    tuner, state = Tuner.of(signal, SIZE), TunerState()
    windows = list(recording.windows())
    for window in windows:
        state = tuner.step(state, window)
    own = state.tuning.tuned(recording.string) if state.tuning else recording.string
    extract = FEATURES.build("fft_harmonic").prepare(
        replace(signal, string=own, design=recording.string), SIZE
    )
    return extract(np.stack([window.samples for window in windows])).astype(np.float64)


def scores(recordings: list[Recording], said: list[tuple[Values, Values]]) -> tuple[str, ...]:
    """Return the figures of a row of the table, over all steady windows."""
    truth = np.concatenate([(each.contact, each.position, each.force, each.steady) for each in recordings], 1)
    value, std = (np.concatenate([np.stack(each[part]) for each in said], axis=1) for part in (0, 1))
    steady = truth[3] == 1.0
    touched = steady & (truth[0] == 1.0)
    miss = np.abs(value[1] - truth[1])[touched]
    answered = np.isfinite(miss)
    press = np.abs(value[2] - truth[2])[touched]
    told = steady & np.isfinite(value[0])
    right = (value[0] > 0.5) == (truth[0] == 1.0)
    sigmas = miss[answered] / std[1][touched][answered]
    return (
        f"{100.0 * answered.mean():.1f} %",
        f"{1e3 * np.median(miss[answered]):.2f} mm",
        f"{1e3 * miss[answered].mean():.2f} mm",
        f"{100.0 * (miss[answered] < NEAR).mean():.1f} %",
        f"{100.0 * (sigmas < 1.0).mean():.0f} %" if np.isfinite(sigmas).any() else "-",
        f"{np.nanmean(press):.2f} N",
        f"{100.0 * told.sum() / steady.sum():.1f} %" if told.any() else "-",
        f"{100.0 * right[told].mean():.1f} %" if told.any() else "-",
    )


HEADS = (
    "sensor",
    "estimator",
    "answered",
    "median",
    "mean",
    "< 5 mm",
    "< 1 se",
    "force",
    "told",
    "contact",
    "ms",
)


@click.command(help=__doc__)
@click.option("--builds", type=click.IntRange(1), default=12, help="Builds of each simulator.")
@click.option("--touches", type=click.IntRange(1), default=10, help="Touches of each foreign build.")
@click.option("--seed", type=int, default=SEED, help="First seed of the builds.")
@click.option("--estimator", "names", multiple=True, default=("closed_form", "model"), help="By name.")
@click.option("--training", type=click.IntRange(0), default=24, help="Builds that baselines are fitted to.")
def foreign(builds: int, touches: int, seed: int, names: tuple[str, ...], training: int) -> None:
    """Render the sensors, run the estimators and print the table."""
    table: list[tuple[str, ...]] = []
    with progress_bar("foreign") as progress:
        others = [of_twin(TRAINING_SEED + k, "plausible") for k in range(training)]
        kinds = ("ridge", "extra trees") if others else ()
        baselines = {kind: Baseline(kind).fit(others) for kind in kinds}
        for number, (sensor, record) in enumerate(SENSORS.items()):
            recordings = [record(seed + k, touches) for k in range(builds)]
            count = sum(len(each.starts) for each in recordings)
            for name in (*names, *baselines):
                progress(f"{sensor}: {name}", number, len(SENSORS))
                options = {"path": "demo"} if name == "model" else {}
                begin = process_time()
                said = [
                    baselines[name](each) if name in baselines else estimated(name, options, each)
                    for each in recordings
                ]
                cost = 1e3 * (process_time() - begin) / count
                table.append((sensor, name, *scores(recordings, said), f"{cost:.2f}"))
    print("\n".join(lines_of(HEADS, table)))


if __name__ == "__main__":
    main(foreign)
