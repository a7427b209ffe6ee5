"""From a dataset and an estimator to results and a page, with the test kept apart from training."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from monochord.core.errors import InputError, did_you_mean
from monochord.core.types import Audio
from monochord.datasets.audit import audit
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset
from monochord.evaluation import realstrings
from monochord.evaluation.disturbance import Disturbance, disturbances
from monochord.evaluation.interference import RATE, recorded_interference
from monochord.evaluation.replay import Course, Progress, replay
from monochord.evaluation.report import page
from monochord.evaluation.results import Results, join
from monochord.evaluation.results_file import write_csv, write_results
from monochord.evaluation.scorecard import Scorecard
from monochord.perception.estimators.base import Estimator

Noises: TypeAlias = tuple[Disturbance, ...]
SUITE_RATIOS = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0)
"""In dB, of the noise suite."""
RESULTS, TABLE, SCORES, PAGE = "results.npz", "results.csv", "scores.json", "report.html"
"""Files of an evaluation in its folder."""
LABELS = ("contact", "position", "force", "slip")
"""By which an estimator is scored."""
RECORDED = {"music": "Kevin_MacLeod", "speech": "198_209"}
"""Recordings of interference, by the begin of their names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trained:
    """What an estimator learned from: checksums of `sessions` by name, and of the `dataset`'s manifest."""

    sessions: Mapping[str, str]
    dataset: str = ""


def evaluate(
    course: Course,
    estimator: Estimator,
    *,
    name: str,
    noises: Sequence[Disturbance] = (),
    notes: Sequence[str] = (),
    progress: Progress = lambda *_: None,
) -> Results:
    """Return what an estimator says of a course as it was recorded, then once more in each of the noises.

    Sessions that were recorded with something sounding in the room get no noise on top.

    Parameters
    ----------
    course
        What is played.
    estimator, name
        Who listens, and what it is called.
    noises
        What is added, each in a replay of its own.
    notes
        What a reader has to know.
    progress
        Told of every session.

    Raises
    ------
    InputError
        If the estimator refuses the signal, or there is nothing to score it by: no label of the windows is
        known, or one that is marked valid is no number.

    Examples
    --------
    ``examples/evaluate_an_estimator.py`` scores an estimator.
    """
    _refuse_labels(course)
    quiet = course.in_quiet
    heard = [replay(course, estimator, name=name, progress=progress)]
    heard += [
        replay(quiet, estimator, name=name, disturbance=noise, progress=progress) for noise in noises if quiet
    ]
    return replace(join(heard), notes=tuple(notes))


def _refuse_labels(course: Course) -> None:
    dataset, rows, known = course.dataset, course.rows, 0
    for name in LABELS:
        if name not in dataset.manifest.columns:
            continue
        values, valid = dataset.labels[name][rows], np.asarray(dataset.valid[name][rows])
        strange = int((~np.isfinite(values[valid])).sum())
        if strange:
            given = f"label '{name}' that is no number in {strange} windows where it is marked valid"
            raise InputError(given, "numbers", "build the dataset again")
        known += int(valid.sum())
    if rows.size and not known:
        given = f"{rows.size} windows to evaluate without a known label"
        raise InputError(given, f"some with {', '.join(LABELS)}", "take sessions that have labels")


def refuse_trained_on(course: Course, trained: Trained, split: Split | None) -> tuple[str, ...]:
    """Return what has to be noted of a test; refuse one that holds anything which was trained on.

    A session that was trained on is refused, by its checksum and whatever its name is now. Only with a split
    by time of the very dataset that was trained on may it be there, since its other stretches were; then a
    note says so.

    Raises
    ------
    InputError
        If a tested session was trained on.
    """
    parts = course.dataset.manifest.parts
    tested = {parts[at].checksum: parts[at].name for at in course.dataset.session[course.rows].tolist()}
    both = [name for checksum, name in tested.items() if checksum in set(trained.sessions.values())]
    if not both:
        return ()
    if split is not None and split.by == "time" and split.dataset == trained.dataset:
        return (f"{len(both)} of the tested sessions were trained on too, other stretches of them",)
    more = f" and {len(both) - 1} more" if len(both) > 1 else ""
    given = f"a test on session {both[0]}{more}, which it was trained on"
    raise InputError(given, "sessions that it has not heard", "take the split that it was trained with")


def audited(dataset: Dataset, split: Split, *, learned: bool = True) -> tuple[str, ...]:
    """Return the notes of a split's audit; refuse a split that leaks, or that is another dataset's.

    Of an estimator that has learned nothing the sounds are not compared, since nothing can leak.

    Raises
    ------
    InputError
        Naming the leak.
    """
    found = audit(dataset, split, duplicates=learned)
    strange = [leak for leak in found.leaks if leak.kind == "other dataset"]
    if learned or strange:
        found.refuse_leaks()
    return tuple(found.notes) if learned else ()


def wants_recordings(texts: Sequence[str]) -> bool:
    """Return whether any of the noises that texts tell is recorded, where recordings are at hand.

    >>> wants_recordings(["white:10", "music:5"])
    True
    """
    return any(text.partition(":")[0] in RECORDED for text in texts)


def room_recordings(sample_rate: int = RATE, music: Audio | None = None) -> dict[str, Audio]:
    """Return recordings of music and of speech by name, as far as they are at hand.

    Parameters
    ----------
    sample_rate
        In Hz, that they are wanted at.
    music
        Sound (n,) at 44100 Hz that stands in for a recording of music where there is none.

    Examples
    --------
    >>> set(room_recordings()) <= {"music", "speech"}
    True
    """
    held = recorded_interference() if realstrings.takes(kind="interference") else {}
    found = {} if music is None else {"music": music}
    found |= {
        kind: sound
        for kind, stem in RECORDED.items()
        for name, sound in held.items()
        if name.startswith(stem)
    }
    return {kind: _resampled(sound, sample_rate) for kind, sound in found.items()}


def _resampled(sound: Audio, sample_rate: int) -> Audio:
    import soxr  # noqa: PLC0415

    return sound if sample_rate == RATE else np.asarray(soxr.resample(sound, RATE, sample_rate), np.float32)


def noise(text: str, recordings: Mapping[str, Audio], seed: int = 0) -> Disturbance:
    """Return the noise that a text such as ``white:10`` tells: a kind, and a ratio in dB.

    Raises
    ------
    InputError
        If the text tells none.

    Examples
    --------
    >>> noise("white:10", {}).ratio
    10.0
    """
    kind, _, ratio = text.partition(":")
    known = dict.fromkeys([*disturbances(recordings), *RECORDED])
    if kind not in known:
        raise InputError(f"noise '{text}'", ", ".join(known), did_you_mean(kind, known))
    try:
        number = float(ratio)
    except ValueError as error:
        raise InputError(f"noise '{text}'", "KIND:DB", f"write {kind}:10") from error
    return Disturbance(kind=kind, ratio=number, seed=seed, recordings=recordings)


def suite(recordings: Mapping[str, Audio], ratios: Sequence[float] = SUITE_RATIOS, seed: int = 0) -> Noises:
    """Return every kind of noise at every ratio in dB.

    Examples
    --------
    >>> len(suite({}, ratios=(10.0,)))
    6
    """
    return tuple(
        Disturbance(kind=kind, ratio=ratio, seed=seed, recordings=recordings)
        for kind in disturbances(recordings)
        for ratio in ratios
    )


def refuse_unwritable(folder: Path) -> None:
    """Refuse a folder that cannot be made, before anything is played in vain; nothing is left of the trial.

    Raises
    ------
    InputError
        If it cannot be made, or is a file.
    """
    made: list[Path] = []
    try:
        for each in (*reversed(folder.parents), folder):
            if not each.is_dir():
                each.mkdir()
                made.append(each)
    except OSError as error:
        raise InputError(f"folder {folder} ({error.strerror})", "one that can be made") from error
    finally:
        for each in reversed(made):
            each.rmdir()


def write_folder(
    folder: Path, results: Results, card: Scorecard, draw: Callable[[Path], Mapping[str, str]] = lambda _: {}
) -> None:
    """Write the results, the table of them, the scores and the page into a folder, which is made.

    `draw` gives from the file of results the pictures of the page, SVG by what they show.

    Raises
    ------
    InputError
        If the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"folder {folder} ({error.strerror})", "one that can be made") from error
    write_results(results, folder / RESULTS)
    write_csv(results, folder / TABLE)
    scores = json.dumps(card.tree(), indent=1, allow_nan=False)
    (folder / SCORES).write_text(scores + "\n", encoding="utf-8")
    (folder / PAGE).write_text(page(card, draw(folder / RESULTS)), encoding="utf-8")
