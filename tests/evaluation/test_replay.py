"""A session played again gives what live inference gives; nothing is heard but what was asked for."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from monochord.capture.sources.session import SessionSource
from monochord.core.errors import InputError
from monochord.core.types import Estimate, Estimates, Prepared, Signal, Window
from monochord.datasets.store import Dataset
from monochord.evaluation.noise import Disturbance
from monochord.evaluation.replay import Course, replay
from monochord.live import Session, run
from monochord.live.settings import WindowSettings
from monochord.live.sinks.base import Listener, Moment
from monochord.perception.estimators.base import Estimator
from monochord.perception.estimators.closed_form import ClosedForm
from monochord.physics.sensors import load_sensor

STRING = load_sensor("prototype").string
PHYSICS = ClosedForm(tension_law="geometric")


class Heard(Listener):
    def __init__(self) -> None:
        self.told: list[Estimates] = []

    def write(self, moment: Moment) -> None:
        self.told.append(moment.prediction.estimates)


@dataclass(frozen=True, slots=True, kw_only=True)
class Counting(Estimator):
    """Says how many windows it has heard since it was prepared, and keeps their samples."""

    seen: list[tuple[int, np.ndarray]] = field(default_factory=list[tuple[int, np.ndarray]])

    def prepare(self, signal: Signal, size: int) -> Prepared:
        heard = 0

        def estimate(window: Window) -> Mapping[str, Estimate]:
            nonlocal heard
            heard += 1
            assert window.samples.shape == (signal.channels, size)
            self.seen.append((window.start, window.samples))
            return {"count": Estimate(value=float(heard), std=0.0, unit="")}

        return estimate


def course(dataset: Dataset, rows: np.ndarray | None = None) -> Course:
    return Course(dataset=dataset, rows=np.arange(len(dataset)) if rows is None else rows, string=STRING)


def test_it_equals_live_inference_to_the_bit(dataset: Dataset, sessions: tuple[Path, ...]) -> None:
    results = replay(course(dataset), PHYSICS, name="closed_form")
    told: list[Estimates] = []
    for path in sessions:
        heard = Heard()
        hop = WindowSettings(length=0.1, hop=0.1)
        run(Session(source=SessionSource(path=path), estimator=PHYSICS, sinks=(heard,), window=hop))
        told += heard.told
    assert len(told) == len(results)
    for name in ("position", "force", "contact", "frequency_1"):
        live = np.array([each[name].value for each in told])
        np.testing.assert_array_equal(results.estimate(name), live)
        np.testing.assert_array_equal(results.std[name], [each[name].std for each in told])
        why = [results.reasons[number] for number in results.why[name].tolist()]
        assert why == [each[name].why_not for each in told]
    assert np.isfinite(results.estimate("position")).sum() > 100


def test_labels_are_the_datasets_own_and_never_change_an_estimate(dataset: Dataset) -> None:
    results = replay(course(dataset), PHYSICS, name="closed_form")
    np.testing.assert_array_equal(results.label("force"), dataset.label("force"))
    assert {trial.session for trial in results.trials} == {"hold_000", "slide_000"}
    assert results.simulated
    assert {trial.condition for trial in results.trials} == {"clean"}


def test_an_estimator_hears_each_session_from_its_begin_and_only_what_is_asked_for_is_kept(
    dataset: Dataset,
) -> None:
    first = dataset.manifest.parts[1].first
    rows = np.array([3, 7, first + 2])
    listener = Counting()
    results = replay(course(dataset, rows), listener, name="counting")
    assert results.estimate("count").tolist() == [4.0, 8.0, 3.0]
    assert results.start.tolist() == pytest.approx([0.3, 0.7, 0.2])
    assert [start for start, _ in listener.seen[:8]] == [4410 * each for each in range(8)]


def test_noise_is_heard_and_named_and_the_dataset_stays_as_it_is(dataset: Dataset) -> None:
    rows, listener, quiet = np.array([100]), Counting(), Counting()
    before = dataset.window(100).copy()
    noisy = replay(
        course(dataset, rows), listener, name="counting", disturbance=Disturbance(kind="white", ratio=10.0)
    )
    replay(course(dataset, rows), quiet, name="counting")
    assert noisy.trials[0].condition == "white 10 dB"
    noise = np.concatenate([a - b for (_, a), (_, b) in zip(listener.seen, quiet.seen, strict=True)], axis=1)
    touched = np.flatnonzero((dataset.label("contact") == 1.0) & (dataset.session == 0))
    power = np.mean([np.mean(dataset.window(row).astype(float) ** 2) for row in touched.tolist()])
    assert 10.0 * np.log10(power / np.mean(noise.astype(float) ** 2)) == pytest.approx(10.0, abs=0.1)
    np.testing.assert_array_equal(dataset.window(100), before)


def told_music(dataset: Dataset, music: str | None) -> Dataset:
    parts = tuple(replace(part, music=music) for part in dataset.manifest.parts)
    return replace(dataset, manifest=replace(dataset.manifest, parts=parts))


def test_a_session_tells_whether_there_was_music_in_the_room(dataset: Dataset) -> None:
    assert {part.music for part in dataset.manifest.parts} == {""}
    first = np.array([0])
    loud = course(told_music(dataset, "synthetic"), first)
    assert replay(loud, Counting(), name="counting").trials[0].condition == "music"
    assert loud.in_quiet is None
    quiet = replace(course(dataset, first), room={"hold*": "radio"})
    assert replay(quiet, Counting(), name="counting").trials[0].condition == "clean"


def test_of_sessions_that_do_not_tell_the_name_does(dataset: Dataset) -> None:
    told = replace(course(told_music(dataset, None), np.array([0])), room={"hold*": "radio"})
    assert replay(told, Counting(), name="counting").trials[0].condition == "radio"


def test_nothing_to_replay_is_refused(dataset: Dataset) -> None:
    with pytest.raises(InputError, match="no windows to evaluate"):
        course(dataset, np.zeros(0, np.int64))
