"""A replayed session gives what live inference gives."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from tests.evaluation.conftest import selection

from monochord.capture.sources.session import SessionSource
from monochord.core.errors import InputError
from monochord.core.types import Estimate, Estimates, Prepared, Signal, Window
from monochord.datasets.store import Dataset
from monochord.evaluation.noise import Disturbance
from monochord.evaluation.replay import replay, replay_estimators
from monochord.live import LiveRun
from monochord.live.loop import opened
from monochord.live.settings import WindowSettings
from monochord.perception.estimators._loaded import LoadedModel
from monochord.perception.estimators.base import Estimator
from monochord.perception.estimators.closed_form import ClosedForm
from monochord.perception.estimators.model import ModelEstimator
from monochord.perception.model import load

PHYSICS = ClosedForm(tension_law="geometric")


@dataclass(frozen=True, slots=True, kw_only=True)
class Counting(Estimator):
    """Counts the windows since it was prepared, and stores their samples."""

    seen: list[tuple[int, np.ndarray]] = field(default_factory=list[tuple[int, np.ndarray]])

    def prepare(self, signal: Signal, size: int) -> Prepared:
        count = 0

        def estimate(window: Window) -> Mapping[str, Estimate]:
            nonlocal count
            count += 1
            assert window.samples.shape == (signal.channels, size)
            self.seen.append((window.start, window.samples))
            return {"count": Estimate(value=float(count), std=0.0, unit="")}

        return estimate


def test_it_equals_live_inference_to_the_bit(dataset: Dataset, sessions: tuple[Path, ...]) -> None:
    results = replay(selection(dataset), PHYSICS, name="closed_form")
    live_estimates: list[Estimates] = []
    for path in sessions:
        window = WindowSettings(length=0.1, hop=0.1)
        with opened(LiveRun(source=SessionSource(path=path), estimator=PHYSICS, window=window)) as live_run:
            live_estimates += [update.prediction.estimates for update in live_run]
    assert len(live_estimates) == len(results)
    for name in ("position", "force", "contact", "frequency_1"):
        live = np.array([each[name].value for each in live_estimates])
        np.testing.assert_array_equal(results.estimate(name), live)
        np.testing.assert_array_equal(results.std[name], [each[name].std for each in live_estimates])
        why = [results.reasons[number] for number in results.reason_index[name].tolist()]
        assert why == [each[name].reason for each in live_estimates]
    assert np.isfinite(results.estimate("position")).sum() > 100


def test_what_remembers_hears_between_the_rows_as_live(dataset: Dataset, sessions: tuple[Path, ...]) -> None:
    demo = ModelEstimator(path=Path("demo"))
    assert demo.tick == LoadedModel(loaded=load("demo")).tick == 0.02
    results = replay(selection(dataset, np.flatnonzero(dataset.session == 0)), demo, name="demo")
    window = WindowSettings(length=0.1, hop=0.02)
    run = LiveRun(source=SessionSource(path=sessions[0]), estimator=demo, window=window)
    with opened(run) as live_run:
        live = [update.prediction.estimates for number, update in enumerate(live_run) if number % 5 == 0]
    assert len(live) == len(results)
    for name in ("contact", "position", "force", "slip"):
        estimates = [each[name].value for each in live]
        np.testing.assert_array_equal(results.estimate(name), estimates)
        assert np.isfinite(estimates).sum() > 100


def test_each_estimator_hears_what_it_would_alone(dataset: Dataset) -> None:
    whole, demo, counting = selection(dataset, np.arange(20)), ModelEstimator(path=Path("demo")), Counting()
    alone = replay(whole, demo, name="demo")
    counted, together = replay_estimators((whole, whole), (counting, demo), name="both")
    assert counted.estimate("count").tolist() == [*range(1, 21)]
    np.testing.assert_array_equal(together.estimate("force"), alone.estimate("force"))


def test_labels_and_trials_are_those_of_the_dataset(dataset: Dataset) -> None:
    results = replay(selection(dataset), Counting(), name="counting")
    np.testing.assert_array_equal(results.label("force"), dataset.label("force"))
    assert {trial.session for trial in results.trials} == {"hold_000", "slide_000"}
    assert results.simulated
    assert {trial.condition for trial in results.trials} == {"clean"}


def test_sessions_are_replayed_from_their_beginning_and_only_selected_windows_kept(
    dataset: Dataset,
) -> None:
    first = dataset.manifest.parts[1].first
    rows = np.array([3, 7, first + 2])
    counting = Counting()
    results = replay(selection(dataset, rows), counting, name="counting")
    assert results.estimate("count").tolist() == [4.0, 8.0, 3.0]
    assert results.start.tolist() == pytest.approx([0.3, 0.7, 0.2])
    assert [start for start, _ in counting.seen[:8]] == [4410 * each for each in range(8)]


def test_noise_is_added_and_named_and_the_dataset_unchanged(dataset: Dataset) -> None:
    rows, counting, quiet = np.array([100]), Counting(), Counting()
    before = dataset.window(100).copy()
    noisy = replay(
        selection(dataset, rows), counting, name="counting", disturbance=Disturbance(kind="white", ratio=10.0)
    )
    replay(selection(dataset, rows), quiet, name="counting")
    assert noisy.trials[0].condition == "white 10 dB"
    noise = np.concatenate([a - b for (_, a), (_, b) in zip(counting.seen, quiet.seen, strict=True)], axis=1)
    touched = np.flatnonzero((dataset.label("contact") == 1.0) & (dataset.session == 0))
    power = np.mean([np.mean(dataset.window(row).astype(float) ** 2) for row in touched.tolist()])
    assert 10.0 * np.log10(power / np.mean(noise.astype(float) ** 2)) == pytest.approx(10.0, abs=0.1)
    np.testing.assert_array_equal(dataset.window(100), before)


def test_lost_sound_does_not_count_for_the_level_of_the_noise(dataset: Dataset) -> None:
    rows, noise = np.array([0]), Disturbance(kind="white", ratio=10.0)
    touched = np.flatnonzero((dataset.label("contact") == 1.0) & (dataset.session == 0))
    has_gap = dataset.has_gap.copy()
    powers = [np.mean(dataset.window(row).astype(float) ** 2) for row in touched.tolist()]
    loud = touched[np.array(powers) > np.median(powers)]
    has_gap[loud] = True
    counting, quiet = Counting(), Counting()
    part = replace(dataset, has_gap=has_gap)
    replay(selection(part, rows), counting, name="counting", disturbance=noise)
    replay(selection(part, rows), quiet, name="counting")
    added = counting.seen[0][1].astype(float) - quiet.seen[0][1]
    power = np.mean([each for row, each in zip(touched, powers, strict=True) if row not in loud])
    assert np.mean(added**2) == pytest.approx(0.1 * power, rel=0.05)
    assert np.mean(powers) > 1.2 * power


def with_music(dataset: Dataset, music: str | None) -> Dataset:
    parts = tuple(replace(part, music=music) for part in dataset.manifest.parts)
    return replace(dataset, manifest=replace(dataset.manifest, parts=parts))


def test_a_session_states_whether_there_was_music(dataset: Dataset) -> None:
    assert {part.music for part in dataset.manifest.parts} == {""}
    first = np.array([0])
    loud = selection(with_music(dataset, "synthetic"), first)
    assert replay(loud, Counting(), name="counting").trials[0].condition == "music"
    assert loud.without_ambient_noise is None
    quiet = replace(selection(dataset, first), ambient_noise={"hold*": "radio"})
    assert replay(quiet, Counting(), name="counting").trials[0].condition == "clean"


def test_otherwise_its_name_does(dataset: Dataset) -> None:
    unknown = replace(selection(with_music(dataset, None), np.array([0])), ambient_noise={"hold*": "radio"})
    assert replay(unknown, Counting(), name="counting").trials[0].condition == "radio"


def test_an_empty_selection_is_refused(dataset: Dataset) -> None:
    with pytest.raises(InputError, match="windows"):
        selection(dataset, np.zeros(0, np.int64))
