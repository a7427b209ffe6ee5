"""Replays test sessions window by window through an estimator, as in live inference."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.config import to_tree
from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.types import Audio, Estimates, Floats, Indices, Progress, Signal, StringParams
from monochord.core.units import Metres
from monochord.core.workers import ONE_PROCESS, Spread
from monochord.datasets.hearing import heard
from monochord.datasets.manifest import DatasetSession
from monochord.datasets.store import Dataset
from monochord.evaluation.noise import Disturbance
from monochord.evaluation.results import Results, Trial
from monochord.perception.estimators.base import Estimator
from monochord.perception.tuning.sessions import string_of
from monochord.physics.sensors import RULER_STD, with_length

MANY = 4000
"""Number of windows from which starting several processes pays off."""
MUSIC, RECORDED = "music", "recorded"
AMBIENT_NOISE: Mapping[str, str] = {"music*": MUSIC}
"""Noise present during the recording, by session name pattern, for sessions that do not state it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """The windows to evaluate: the `rows` (k,) of a dataset, in rising order.

    Every session with a row is replayed from its beginning, so that an estimator with memory sees the same
    windows as it would live; estimates of other windows are discarded. `string` is the sensor's string, and
    `sensing_range` the part of it, in m, where the sensor can resolve positions, for estimators that use
    them. `ambient_noise` names the noise present during the recording by session name pattern, for sessions
    that do not state whether there was music. With `tuned`, a session's string is tuned to its untouched
    sound and has its measured length, as by ``monochord tune``; a session recorded with a tuned sensor always
    uses that tuning and length, as live. `length_std` is the standard error of its length in m, where
    it was measured.
    """

    dataset: Dataset
    rows: Indices
    string: StringParams | None = None
    sensing_range: tuple[Metres, Metres] | None = None
    length_std: Metres | None = None
    ambient_noise: Mapping[str, str] = field(default_factory=lambda: AMBIENT_NOISE)
    tuned: bool = False

    def __post_init__(self) -> None:
        if not len(self.rows):
            raise InputError("no windows to evaluate", "one or more", "use other shares for the split")

    @property
    def signal(self) -> Signal:
        """The signal that an estimator is prepared for."""
        manifest = self.dataset.manifest
        return Signal(
            sample_rate=manifest.sample_rate,
            channels=manifest.channels,
            string=self.string,
            length_std=self.length_std,
            sensing_range=self.sensing_range,
        )

    def signal_of(self, session: int) -> Signal:
        """Return a session's signal, with its string's tuning and length."""
        part = self.dataset.manifest.parts[session]
        if self.string is None or not (self.tuned or part.tuned == RECORDED):
            return self.signal
        string = string_of(part, self.string, measured=self.tuned)
        if self.length_std is not None and part.measured_length is None:
            string = with_length(string, self.string.length)
        is_measured = part.measured_length == string.length
        return replace(self.signal, string=string, length_std=RULER_STD if is_measured else self.length_std)

    @property
    def sessions(self) -> list[int]:
        """Numbers of the sessions with a row, in rising order."""
        return np.unique(self.dataset.session[self.rows]).tolist()

    def rows_of(self, session: int) -> Indices:
        """Return the rows of a session."""
        rows = self.dataset.rows_of(session)
        return self.rows[slice(*np.searchsorted(self.rows, (rows.start, rows.stop)).tolist())]

    @property
    def without_ambient_noise(self) -> "Selection | None":
        """The rows of sessions without ambient noise; None if there are none."""
        parts = self.dataset.manifest.parts
        quiet = np.array([not self.ambient(part) for part in parts])
        rows = self.rows[quiet[self.dataset.session[self.rows]]]
        return replace(self, rows=rows) if len(rows) else None

    def ambient(self, part: DatasetSession) -> str:
        """Return the ambient noise of a session's recording, empty for none."""
        if part.music is not None:
            return MUSIC if part.music else ""
        patterns = self.ambient_noise.items()
        return next((noise for pattern, noise in patterns if fnmatchcase(part.name, pattern)), "")


def replay(
    selection: Selection,
    estimator: Estimator,
    *,
    name: str,
    disturbance: Disturbance | None = None,
    progress: Progress = lambda *_: None,
) -> Results:
    """Return the estimates of every selected window, beside the truth.

    The estimator is prepared anew for each session and receives its windows one by one, in order: the same
    calls as in the live loop with the dataset's window and hop, so the same numbers to the bit. One with a
    memory hears as many as its memory learned with, `Estimator.tick`: the same numbers as live at that hop.
    It never sees a label.

    Parameters
    ----------
    selection
        The windows to replay.
    estimator, name
        The estimator, and its name in the results.
    disturbance
        Noise to add to each session's sound; none by default.
    progress
        Called for every session.

    Raises
    ------
    InputError
        If the estimator rejects the signal.

    Examples
    --------
    ``examples/evaluate_an_estimator.py`` does so with two simulated sessions.
    """
    (results,) = replay_estimators(
        (selection,), (estimator,), name=name, disturbance=disturbance, progress=progress
    )
    return results


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """The windows of one condition: a selection for each estimator, and the added noise."""

    selections: tuple[Selection, ...]
    disturbance: Disturbance | None = None

    @property
    def sessions(self) -> list[int]:
        """Numbers of the sessions with a row in any selection, in rising order."""
        return np.unique(np.concatenate([each.sessions for each in self.selections])).tolist()


def conditions_of(selection: Selection, noises: Sequence[Disturbance]) -> list[Condition]:
    """Return the selection as recorded, then with each noise, without sessions that had ambient noise."""
    quiet = selection.without_ambient_noise
    noisy = [Condition(selections=(quiet,), disturbance=noise) for noise in noises if quiet]
    return [Condition(selections=(selection,)), *noisy]


def jobs_of(conditions: Sequence[Condition]) -> dict[tuple[int, int], str]:
    """Return the jobs of conditions, one per session: session name by job key."""
    return {
        (number, session): condition.selections[0].dataset.manifest.parts[session].name
        for number, condition in enumerate(conditions)
        for session in condition.sessions
    }


def has_few_windows(conditions: Sequence[Condition]) -> bool:
    """Return whether starting several processes does not pay off."""
    return sum(len(each.rows) for condition in conditions for each in condition.selections) < MANY


def replay_estimators(
    selections: Sequence[Selection],
    estimators: Sequence[Estimator],
    *,
    name: str,
    disturbance: Disturbance | None = None,
    progress: Progress = lambda *_: None,
) -> list[Results]:
    """Return the results of several estimators, each on its selection from one dataset and string.

    Each equals the result of `replay`. The estimators receive each window in turn, so that shared analysis is
    computed once.

    Raises
    ------
    InputError
        If an estimator rejects the signal.
    """
    condition = Condition(selections=tuple(selections), disturbance=disturbance)
    spread = Spread(workers=1, progress=progress)
    (results,) = replay_all([condition], estimators, name=name, spread=spread)
    return results


def replay_all(
    conditions: Sequence[Condition],
    estimators: Sequence[Estimator],
    *,
    name: str,
    spread: Spread = ONE_PROCESS,
) -> list[list[Results]]:
    """Return the results of several conditions, each as in `replay_estimators`.

    They are the same to the bit wherever `spread` runs the sessions.
    """
    jobs, work = jobs_of(conditions), partial(_replayed, tuple(conditions), tuple(estimators))
    estimates = dict(spread(jobs, work, few=has_few_windows(conditions)))
    return [
        [
            results_of(
                selection,
                columns(
                    [each for session in condition.sessions for each in estimates[number, session][place]]
                ),
                name=name,
                disturbance=condition.disturbance,
                options=to_tree(estimator),
            )
            for place, (selection, estimator) in enumerate(zip(condition.selections, estimators, strict=True))
        ]
        for number, condition in enumerate(conditions)
    ]


def _replayed(
    conditions: tuple[Condition, ...], estimators: tuple[Estimator, ...], job: tuple[int, int]
) -> list[list[Estimates]]:
    """Return each estimator's estimates of the selected windows of one session in one condition."""
    number, session = job
    selections, disturbance = conditions[number].selections, conditions[number].disturbance
    first, dataset = selections[0], selections[0].dataset
    prepared = [each.prepare(first.signal_of(session), dataset.manifest.window) for each in estimators]
    wanted = [set(each.rows_of(session).tolist()) for each in selections]
    audio = disturbed_audio(dataset, session, disturbance)
    estimates: list[list[Estimates]] = [[] for _ in selections]
    rows = range(dataset.manifest.parts[session].first, max(set().union(*wanted)) + 1)
    ticks = [each.tick for each in estimators]
    tick = min((each for each in ticks if each is not None), default=None)
    for row, window in heard(dataset, rows, tick, audio):
        is_own = window.start == dataset.start[row]
        for chosen, estimate, hears_all, kept in zip(wanted, prepared, ticks, estimates, strict=True):
            if is_own or hears_all:
                each = estimate(window)
                if is_own and row in chosen:
                    kept.append(each)
    return estimates


def results_of(
    selection: Selection,
    estimates: Mapping[str, Any],
    *,
    name: str,
    disturbance: Disturbance | None = None,
    options: Mapping[str, Any] | None = None,
) -> Results:
    """Return `columns` of the selected windows' estimates beside their truth."""
    dataset, rows, sessions = selection.dataset, selection.rows, selection.sessions
    rate = dataset.manifest.sample_rate
    return Results(
        estimator=name,
        window=dataset.manifest.window / rate,
        hop=dataset.manifest.hop / rate,
        trials=tuple(_trial(selection, session, disturbance) for session in sessions),
        trial=np.searchsorted(sessions, dataset.session[rows]).astype(np.int32),
        start=dataset.start[rows] / rate,
        usable=dataset.usable[rows],
        truth={key: np.array(dataset.labels[key][rows]) for key in dataset.manifest.columns},
        options=options or {},
        **estimates,
    )


def columns(estimates: Sequence[Estimates]) -> dict[str, Any]:
    """Return n windows' estimates as columns ``value``, ``std``, ``reason_index``, and the ``reasons``.

    >>> from monochord.core.types import Estimate
    >>> table = columns([{"force": Estimate(value=1.0, std=0.5, unit="N")}, {}])
    >>> reasons = [table["reasons"][at] for at in table["reason_index"]["force"].tolist()]
    >>> table["value"]["force"].tolist(), reasons
    ([1.0, nan], ['', 'not estimated'])
    """
    names = dict.fromkeys(name for each in estimates for name in each)
    reasons: dict[str, int] = {"": 0}
    value, std, reason_index = dict[str, Floats](), dict[str, Floats](), dict[str, NDArray[np.int16]]()
    for name in names:
        value[name], std[name] = np.full(len(estimates), np.nan), np.full(len(estimates), np.nan)
        reason_index[name] = np.zeros(len(estimates), np.int16)
        for row, each in enumerate(estimates):
            estimate = each.get(name)
            if estimate is not None and estimate.valid:
                value[name][row], std[name][row] = estimate.value, estimate.std
                continue
            reason = (estimate.reason or Reason.NOT_GIVEN) if estimate is not None else Reason.NOT_ESTIMATED
            reason_index[name][row] = reasons.setdefault(reason, len(reasons))
    return {"value": value, "std": std, "reason_index": reason_index, "reasons": tuple(reasons)}


def disturbed_audio(dataset: Dataset, session: int, disturbance: Disturbance | None) -> Audio:
    """Return a session's sound (2, n), with noise at a ratio to the mean power of the touched windows."""
    audio = dataset.audio(session)
    if disturbance is None:
        return audio
    part = dataset.rows_of(session)
    rows = np.arange(part.start, part.stop)
    touched = rows[(dataset.labels["contact"][rows] == 1.0) & dataset.usable[rows]]
    measured = touched if touched.size else rows[dataset.usable[rows]]
    powers = [np.mean(np.square(dataset.window(row), dtype=np.float64)) for row in measured.tolist()]
    manifest = dataset.manifest
    return disturbance.apply(
        audio, float(np.mean(powers)), manifest.sample_rate, manifest.parts[session].name
    )


def _trial(selection: Selection, session: int, disturbance: Disturbance | None) -> Trial:
    part = selection.dataset.manifest.parts[session]
    return Trial(
        session=part.name,
        object=part.body,
        noise=selection.ambient(part) if disturbance is None else disturbance.kind,
        ratio=None if disturbance is None else disturbance.ratio,
        radius=part.radius,
        day=part.day,
        build=part.build,
        simulated=part.simulated,
        checksum=part.checksum,
        mount=part.mount,
    )
