"""Test sessions played again, window by window, through an estimator, as live inference would hear them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.config import to_tree
from monochord.core.errors import InputError
from monochord.core.types import Audio, Estimates, Floats, Signal, StringParams, Window
from monochord.datasets.manifest import Part
from monochord.datasets.store import Dataset, Indices
from monochord.evaluation.disturbance import Disturbance
from monochord.evaluation.results import Results, Trial
from monochord.perception.estimators.base import Estimator

Progress: TypeAlias = Callable[[str, int, int], None]
"""Is told what is played, how many sessions are done, and how many there are."""
MUSIC = "music"
IN_THE_ROOM: Mapping[str, str] = {"music*": MUSIC}
"""What was sounding in the room, by the pattern of names, of sessions that do not tell themselves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What is replayed: the `rows` (k,) of a dataset that are to be judged, in rising order.

    Every session that has one is played from its begin, so that an estimator that remembers has heard what it
    would have heard; windows that are no rows are estimated, but not kept. `string` is the one of the sensor,
    where an estimator wants to know. `room` tells what was sounding in the room by pattern of session name,
    for sessions that do not tell whether there was music.
    """

    dataset: Dataset
    rows: Indices
    string: StringParams | None = None
    room: Mapping[str, str] = field(default_factory=lambda: IN_THE_ROOM)

    def __post_init__(self) -> None:
        if not len(self.rows):
            raise InputError("no windows to evaluate", "one or more", "split by other shares")

    @property
    def signal(self) -> Signal:
        """What an estimator is prepared for."""
        told = self.dataset.manifest
        return Signal(sample_rate=told.sample_rate, channels=told.channels, string=self.string)

    @property
    def in_quiet(self) -> "Course | None":
        """The part of it in which nothing was sounding in the room; None where there is none."""
        parts = self.dataset.manifest.parts
        quiet = np.array([not self.heard_in(part) for part in parts])
        rows = self.rows[quiet[self.dataset.session[self.rows]]]
        return replace(self, rows=rows) if len(rows) else None

    def heard_in(self, part: Part) -> str:
        """Return what was sounding in the room in a session, empty for nothing."""
        if part.music is not None:
            return MUSIC if part.music else ""
        return next((noise for pattern, noise in self.room.items() if fnmatchcase(part.name, pattern)), "")


def replay(
    course: Course,
    estimator: Estimator,
    *,
    name: str,
    disturbance: Disturbance | None = None,
    progress: Progress = lambda *_: None,
) -> Results:
    """Return what an estimator says of every window that is asked for, beside the truth.

    The estimator is prepared anew for each session, and shown its windows one by one, in order: the same
    calls in the same order as `monochord.live.run` with the dataset's window and hop makes them, so the same
    numbers to the bit. It never sees a label.

    Parameters
    ----------
    course
        What is played.
    estimator
        Who listens.
    name
        What the estimator is called.
    disturbance
        What is added to the sound of each session; nothing by default.
    progress
        Told of every session.

    Raises
    ------
    InputError
        If the estimator refuses the signal.

    Examples
    --------
    ``examples/evaluate_an_estimator.py`` does so with two simulated sessions.
    """
    dataset, size = course.dataset, course.dataset.manifest.window
    sessions = np.unique(dataset.session[course.rows]).tolist()
    told: list[Estimates] = []
    for done, session in enumerate(sessions):
        progress(dataset.manifest.parts[session].name, done, len(sessions))
        estimate = estimator.prepare(course.signal, size)
        asked = set(course.rows[dataset.session[course.rows] == session].tolist())
        audio = _audio(dataset, session, disturbance)
        for row, window in _windows(dataset, session, audio, max(asked)):
            estimates = estimate(window)
            if row in asked:
                told.append(estimates)
    progress("", len(sessions), len(sessions))
    number = np.searchsorted(sessions, dataset.session[course.rows]).astype(np.int32)
    rate = dataset.manifest.sample_rate
    return Results(
        estimator=name,
        window=size / rate,
        hop=dataset.manifest.hop / rate,
        trials=tuple(_trial(course, session, disturbance) for session in sessions),
        trial=number,
        start=dataset.start[course.rows] / rate,
        usable=dataset.usable[course.rows],
        truth={key: np.array(dataset.labels[key][course.rows]) for key in dataset.manifest.columns},
        options=to_tree(estimator),
        **columns(told),
    )


def columns(told: list[Estimates]) -> dict[str, Any]:
    """Return estimates of n windows as the columns ``value``, ``std`` and ``why``, and the ``reasons``.

    Examples
    --------
    >>> from monochord.core.types import Estimate
    >>> told = columns([{"force": Estimate(value=1.0, std=0.5, unit="N")}, {}])
    >>> told["value"]["force"].tolist(), [told["reasons"][at] for at in told["why"]["force"].tolist()]
    ([1.0, nan], ['', 'not estimated'])
    """
    names = dict.fromkeys(name for each in told for name in each)
    reasons: dict[str, int] = {"": 0}
    value, std, why = dict[str, Floats](), dict[str, Floats](), dict[str, NDArray[np.int16]]()
    for name in names:
        value[name], std[name] = np.full(len(told), np.nan), np.full(len(told), np.nan)
        why[name] = np.zeros(len(told), np.int16)
        for row, each in enumerate(told):
            estimate = each.get(name)
            if estimate is not None and estimate.valid:
                value[name][row], std[name][row] = estimate.value, estimate.std
                continue
            reason = (estimate.why_not or "no reason given") if estimate is not None else "not estimated"
            why[name][row] = reasons.setdefault(reason, len(reasons))
    return {"value": value, "std": std, "why": why, "reasons": tuple(reasons)}


def _audio(dataset: Dataset, session: int, disturbance: Disturbance | None) -> Audio:
    """Return a session's sound, with what disturbs it at its ratio to the touched windows' mean power."""
    audio = dataset.audio(session)
    if disturbance is None:
        return audio
    rows = np.flatnonzero(dataset.session == session)
    touched = rows[(dataset.labels["contact"][rows] == 1.0) & dataset.usable[rows]]
    heard = touched if touched.size else rows[dataset.usable[rows]]
    power = float(
        np.mean([np.mean(np.square(dataset.window(row), dtype=np.float64)) for row in heard.tolist()])
    )
    return disturbance.added(audio, power, dataset.manifest.sample_rate, dataset.manifest.parts[session].name)


def _windows(dataset: Dataset, session: int, audio: Audio, last: int) -> Iterator[tuple[int, Window]]:
    """Yield the rows and windows of a session, from its first to row `last`."""
    told = dataset.manifest
    first = told.parts[session].first
    for row in range(first, last + 1):
        start = int(dataset.start[row])
        samples = np.array(audio[:, start : start + told.window], np.float32)
        gap = bool(dataset.has_gap[row])
        yield row, Window(samples=samples, start=start, sample_rate=told.sample_rate, has_gap=gap)


def _trial(course: Course, session: int, disturbance: Disturbance | None) -> Trial:
    part = course.dataset.manifest.parts[session]
    return Trial(
        session=part.name,
        object=part.body,
        noise=course.heard_in(part) if disturbance is None else disturbance.kind,
        ratio=None if disturbance is None else disturbance.ratio,
        radius=part.radius,
        day=part.day,
        build=part.build,
        simulated=part.simulated,
        checksum=part.checksum,
    )
