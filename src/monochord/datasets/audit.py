"""Finds leaks from training into the test.

An audit checks a dataset and its split for every way in which training data may reappear in the test or
validation part, whoever made the split.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Literal, TypeAlias

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Flags, Indices
from monochord.core.units import Samples
from monochord.datasets._strategies import is_held_out
from monochord.datasets.duplicates import COMPARED, crossing, find_duplicates
from monochord.datasets.manifest import DatasetSession
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset

Kind: TypeAlias = Literal[
    "other dataset",
    "shared window",
    "repeated window",
    "shared samples",
    "guard gap",
    "shared session",
    "shared day",
    "shared build",
    "shared object",
    "held out",
    "same checksum",
    "near duplicate",
]
"""Kinds of leaks; see `audit`."""
CLAIMS: dict[str, tuple[Kind, ...]] = {
    "session": ("shared session",),
    "day": ("shared session", "shared day"),
    "build": ("shared session", "shared build"),
    "object": ("shared session", "shared object"),
    "time": (),
}
"""What the parts of a split must not share, by split strategy."""
SESSION_STRIDE: Samples = 1 << 40
"""More frames than between any two windows of a session."""
MAX_SHOWN = 3
"""Most places named for a leak."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Leak:
    """A leak between two parts: its `kind`, the `parts`, `where`, and `many`, the number of windows.

    >>> print(Leak(kind="shared session", parts=("train", "test"), where="monday", many=12))
    shared session: train and test, 12 windows (monday)
    """

    kind: Kind
    parts: tuple[str, ...]
    where: str
    many: int

    def __str__(self) -> str:
        counted = f"{self.many} window{'' if self.many == 1 else 's'}"
        return f"{self.kind}: {' and '.join(self.parts)}, {counted} ({self.where})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """The result of an audit: `leaks`, and `notes` on other observations."""

    leaks: Sequence[Leak]
    notes: Sequence[str] = ()

    @property
    def clean(self) -> bool:
        """Whether there is no leak."""
        return not self.leaks

    def refuse_leaks(self) -> None:
        """Raise `InputError`, in one line, if there is a leak."""
        if not self.clean:
            more = f", and {len(self.leaks) - 1} more" if len(self.leaks) > 1 else ""
            raise InputError(
                f"split with a leak: {self.leaks[0]}{more}",
                "no leak",
                "split by session, and remove copies",
            )


def audit(dataset: Dataset, split: Split, *, duplicates: bool = True) -> Audit:
    """Return every leak between the parts of a split.

    - **other dataset**: the split was made for another dataset, or names rows missing from this one.
    - **shared window**: a window is in two parts; **repeated window**: twice in one.
    - **shared samples**: windows of two parts overlap.
    - **guard gap**: windows of two parts are closer than a window and a hop, or than the split's guard.
    - **shared session**, **shared day**, **shared build**, **shared object**: where the split should separate
      them. A split by session, day or build separates sessions; a split by object separates the test's
      objects and all sessions.
    - **held out**: a session held out by its object or name is also in another part than the test.
    - **same checksum**: two sessions with the same bytes, or the same samples, in different parts.
    - **near duplicate**: two sessions with the same sound, cut or with other channels; see
      `monochord.datasets.duplicates` for the limits of detection.

    A touch on both sides of a cut in time is noted, not a leak. Every byte of the dataset is first compared
    with its checksum.

    Parameters
    ----------
    dataset, split
        The dataset and split to check.
    duplicates
        Whether to compare sounds, which takes most of the time: some 0.15 s for each minute of sound.

    Returns
    -------
    Audit
        The result; its `refuse_leaks` raises on a leak.

    Raises
    ------
    InputError
        If the dataset is damaged.

    Examples
    --------
    ``examples/build_a_dataset.py`` does so with two simulated sessions.
    """
    dataset.verify()
    strange = tuple(_strange_rows(dataset, split))
    if strange:
        return Audit(leaks=strange)
    counts = _session_counts(dataset, split)
    leaks = [*_windows(split), *_close(dataset, split), *_claims(dataset, split, counts)]
    leaks += _held_out(dataset, split)
    masks = np.sum([(count > 0) << at for at, count in enumerate(counts.values())], axis=0)
    same = dict.fromkeys(_same_checksum(dataset, masks))
    leaks += [_copies("same checksum", dataset, counts, pair) for pair in same]
    if duplicates:
        for copy in find_duplicates(partial(_between_taps, dataset), masks):
            pair = copy.first, copy.second
            if pair not in same:
                leaks.append(_copies("near duplicate", dataset, counts, pair, copy.lag))
    return Audit(leaks=tuple(leaks), notes=tuple(_notes(dataset, split)))


def _strange_rows(dataset: Dataset, split: Split) -> Iterator[Leak]:
    if split.dataset and split.dataset != dataset.checksum:
        yield Leak(kind="other dataset", parts=tuple(split.parts), where="its checksum differs", many=0)
    for name, rows in split.parts.items():
        outside = int(((rows < 0) | (rows >= len(dataset))).sum())
        if outside:
            where = f"rows beyond the dataset's {len(dataset)}"
            yield Leak(kind="other dataset", parts=(name,), where=where, many=outside)


def _session_counts(dataset: Dataset, split: Split) -> Mapping[str, Indices]:
    """Return the number of windows of every session in each part, (sessions,) each."""
    count = len(dataset.manifest.parts)
    return {name: np.bincount(dataset.session[rows], minlength=count) for name, rows in split.parts.items()}


def _windows(split: Split) -> Iterator[Leak]:
    for name, rows in split.parts.items():
        unique, times = np.unique(rows, return_counts=True)
        if len(unique) < len(rows):
            where = _some("row", unique[times > 1].tolist())
            yield Leak(kind="repeated window", parts=(name,), where=where, many=int((times - 1).sum()))
    for (one, rows), (other, others) in combinations(split.parts.items(), 2):
        both = np.intersect1d(rows, others)
        if both.size:
            yield Leak(
                kind="shared window", parts=(one, other), where=_some("row", both.tolist()), many=both.size
            )


def _close(dataset: Dataset, split: Split) -> Iterator[Leak]:
    """Yield windows of two parts that overlap or are too close, except those in both parts."""
    size = dataset.manifest.window
    guard = max(split.guard, size + dataset.manifest.hop) if split.by == "time" else 0
    for (one, rows), (other, others) in combinations(split.parts.items(), 2):
        mine, theirs = np.setdiff1d(rows, others), np.setdiff1d(others, rows)
        distance = _distances(dataset, mine, theirs)
        overlap, near = distance < size, (distance >= size) & (distance < size + guard)
        kinds: tuple[tuple[Kind, Flags], ...] = (("shared samples", overlap), ("guard gap", near))
        for kind, which in kinds:
            if which.any():
                sessions = np.unique(dataset.session[mine[which]]).tolist()
                where = _some("session", [dataset.manifest.parts[each].name for each in sessions])
                yield Leak(kind=kind, parts=(one, other), where=where, many=int(which.sum()))


def _distances(dataset: Dataset, mine: Indices, theirs: Indices) -> Indices:
    """Return the distance in frames from each of `mine` to the nearest of `theirs`."""
    place = (
        dataset.session.astype(np.int64) * SESSION_STRIDE + dataset.start
    )  # sessions one after another, far apart
    there = np.sort(place[theirs])
    if not there.size:
        return np.full(mine.shape, SESSION_STRIDE)
    at = np.searchsorted(there, place[mine])
    after = np.abs(there[np.minimum(at, there.size - 1)] - place[mine])
    before = np.abs(there[np.maximum(at - 1, 0)] - place[mine])
    return np.minimum(after, before)


def _claims(dataset: Dataset, split: Split, counts: Mapping[str, Indices]) -> Iterator[Leak]:
    """Yield sessions, days and objects in two parts that the split should separate."""
    for what in CLAIMS[split.by]:
        names = np.array([_named(part, what) for part in dataset.manifest.parts])
        for one, other in combinations(split.parts, 2):
            if what == "shared object" and "test" not in (one, other):
                continue
            shared = np.intersect1d(names[counts[one] > 0], names[counts[other] > 0])
            shared = shared[shared != ""]
            if shared.size:
                many = min(int(counts[each][np.isin(names, shared)].sum()) for each in (one, other))
                where = _some(what.removeprefix("shared "), shared.tolist())
                yield Leak(kind=what, parts=(one, other), where=where, many=many)


def _held_out(dataset: Dataset, split: Split) -> Iterator[Leak]:
    """Yield held-out sessions that are in a part other than the test."""
    parts = dataset.manifest.parts
    apart = np.array([is_held_out(part.body, part.name, split.held_out) for part in parts], bool)
    for name, rows in split.parts.items():
        sessions = dataset.session[rows][apart[dataset.session[rows]]]
        if name != "test" and sessions.size:
            where = _some("session", [parts[number].name for number in np.unique(sessions).tolist()])
            yield Leak(kind="held out", parts=(name,), where=where, many=sessions.size)


def _named(part: DatasetSession, what: Kind) -> str:
    match what:
        case "shared session":
            return part.name
        case "shared object":
            return part.body
        case "shared build":
            return "" if part.build is None else str(part.build)
        case _:
            return "" if part.day is None else str(part.day)


def _same_checksum(dataset: Dataset, masks: Indices) -> list[tuple[int, int]]:
    """Return the pairs of sessions in different parts with the same file or the same samples."""
    parts = dataset.manifest.parts
    keys = np.array([(hash(part.checksum), hash(part.audio_checksum)) for part in parts], np.int64)
    order = np.argsort(keys.ravel(), kind="stable")
    sums, sessions = keys.ravel()[order], order // 2
    pairs: set[tuple[int, int]] = set()
    for apart in range(1, COMPARED + 1):
        at = np.flatnonzero((sums[:-apart] == sums[apart:]) & (sessions[:-apart] < sessions[apart:]))
        one, other = sessions[at], sessions[at + apart]
        crosses = crossing(masks, one, other)
        pairs |= set(zip(one[crosses].tolist(), other[crosses].tolist(), strict=True))
    return sorted(pair for pair in pairs if _sums(parts, pair[0]) & _sums(parts, pair[1]))


def _sums(parts: Sequence[DatasetSession], session: int) -> set[str]:
    return {parts[session].checksum, parts[session].audio_checksum}


def _between_taps(dataset: Dataset, session: int) -> Audio:
    """Return the samples of a session, silent during the taps.

    Taps sound the same in all sessions, at every frequency: they would make almost every pair a candidate.
    """
    rows = dataset.rows_of(session)
    taps = dataset.start[rows][dataset.label("calibrating")[rows] == 1.0]
    samples = dataset.mapped(session)
    if not taps.size:
        return samples
    samples = np.array(samples)
    for start in taps.tolist():
        samples[:, start : start + dataset.manifest.window] = 0.0
    return samples


def _copies(
    kind: Kind,
    dataset: Dataset,
    session_counts: Mapping[str, Indices],
    pair: tuple[int, int],
    lag: Samples = 0,
) -> Leak:
    parts = tuple(name for name, counts in session_counts.items() if counts[list(pair)].any())
    many = min(int(sum(counts[number] for counts in session_counts.values())) for number in pair)
    late = f", {abs(lag) / dataset.manifest.sample_rate:.3f} s apart" if lag else ""
    return Leak(kind=kind, parts=parts, where=_names(dataset, pair) + late, many=many)


def _names(dataset: Dataset, pair: tuple[int, int]) -> str:
    return " and ".join(dataset.manifest.parts[number].name for number in pair)


def _notes(dataset: Dataset, split: Split) -> Iterator[str]:
    """Yield the number of touches (runs of windows without a pause) that are in more than one part."""
    untouched = dataset.label("contact") == 0.0
    changes = np.diff(dataset.session, prepend=-1) != 0
    touch = np.cumsum(untouched | changes)
    touches = [np.unique(touch[rows[~untouched[rows]]]) for rows in split.parts.values()]
    _, times = np.unique(np.concatenate(touches), return_counts=True)
    torn = int((times > 1).sum())
    if torn:
        yield f"{torn} touch{'' if torn == 1 else 'es'} on both sides of a cut"


def _some(what: str, names: list[str] | list[int]) -> str:
    shown = ", ".join(str(name) for name in names[:MAX_SHOWN])
    more = f" and {len(names) - MAX_SHOWN} more" if len(names) > MAX_SHOWN else ""
    return f"{what}{'' if len(names) == 1 else 's'} {shown}{more}"
