"""The ways to deal the windows of a dataset out to parts; `monochord.datasets.split` tells of each."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from monochord.datasets.deal import deal
from monochord.datasets.store import Dataset, Flags, Indices
from monochord.errors import InputError, did_you_mean
from monochord.units import Samples

PARTS = ("train", "validation", "test")
REACH = 0.45
"""How far a cut in time may be moved to an untouched window, as a share of the shorter stretch beside it."""


def by_group(
    dataset: Dataset,
    by: str,
    fractions: tuple[float, float, float],
    held_out: Sequence[str],
    rng: np.random.Generator,
) -> tuple[list[str], Indices]:
    """Return the group's name and the part of every session."""
    sessions = dataset.manifest.parts
    counts = np.bincount(dataset.session, minlength=len(sessions))
    if by == "session":
        known = _held_out(dataset, held_out)
        part = np.full(len(sessions), PARTS.index("test"))
        rest, strata = np.flatnonzero(~known), _strata(dataset)
        part[rest] = deal(counts[rest], [strata[at] for at in rest], fractions, rng)
        return [each.name for each in sessions], part
    if by == "day":
        names = ["" if each.day is None else str(each.day) for each in sessions]
        if "" in names:
            given = f"session {sessions[names.index('')].name} without a day in a split by day"
            raise InputError(given, "sessions that tell their day", "split by session")
        return names, _dealt(names, counts, fractions, rng)
    return _by_object(dataset, counts, fractions, held_out, rng)


def _by_object(
    dataset: Dataset,
    counts: Indices,
    fractions: tuple[float, float, float],
    held_out: Sequence[str],
    rng: np.random.Generator,
) -> tuple[list[str], Indices]:
    names = [each.body for each in dataset.manifest.parts]
    if held_out:
        test = _held_out(dataset, held_out)
    else:
        known = (fractions[0] + fractions[1], 0.0, fractions[2])
        test = _dealt(names, counts, known, rng) == PARTS.index("test")
    part = np.where(test, PARTS.index("test"), -1)
    left = fractions[0] + fractions[1]
    rest = np.flatnonzero(~test)
    strata = _strata(dataset)
    shares = (fractions[0] / left, fractions[1] / left, 0.0)
    part[rest] = deal(counts[rest], [strata[at] for at in rest], shares, rng)
    return names, part


def _held_out(dataset: Dataset, objects: Sequence[str]) -> Flags:
    """Return which sessions are of objects that are held out; refuse a name that none has."""
    names = [each.body for each in dataset.manifest.parts]
    refuse_strange(names, objects)
    return np.isin(names, list(objects))


def refuse_strange(names: Sequence[str], objects: Sequence[str]) -> None:
    """Raise `InputError` for an object that is held out and not among the names."""
    there = sorted(set(names))
    for name in objects:
        if name not in there:
            raise InputError(f"held-out object '{name}'", ", ".join(there), did_you_mean(name, there))


def _dealt(
    names: list[str], counts: Indices, fractions: tuple[float, float, float], rng: np.random.Generator
) -> Indices:
    """Deal whole groups of sessions out and return the part of every session."""
    groups, member = np.unique(names, return_inverse=True)
    sizes = np.bincount(member, weights=counts, minlength=len(groups)).astype(np.int64)
    return deal(sizes, [""] * len(groups), fractions, rng)[member]


def _strata(dataset: Dataset) -> list[str]:
    """Return what each session holds mostly: its object, and whether it is untouched, static or sliding."""
    found: list[str] = []
    contact, slip = dataset.label("contact"), dataset.label("slip")
    for number, part in enumerate(dataset.manifest.parts):
        rows = slice(part.first, part.first + part.windows)
        assert (dataset.session[rows] == number).all()
        slides, touches = np.sum(slip[rows] == 1.0), np.sum(contact[rows] == 1.0)
        kind = "sliding" if slides > 0.2 * max(touches, 1) else "static" if touches else "untouched"
        found.append(f"{part.body}/{kind}")
    return found


def by_time(
    dataset: Dataset, fractions: tuple[float, float, float], guard: Samples, rng: np.random.Generator
) -> Indices:
    """Return the part of every window, -1 in the guard gaps."""
    part_of = np.full(len(dataset), -1, np.int64)
    contact, calibrating = dataset.label("contact"), dataset.label("calibrating")
    used = [number for number, share in enumerate(fractions) if share > 0.0]
    for part in dataset.manifest.parts:
        rows = np.arange(part.first, part.first + part.windows)
        if not rows.size:
            continue
        order = rng.permutation(used).tolist()
        shares = [fractions[number] for number in order]
        counted = np.cumsum(calibrating[rows] != 1.0)
        cuts = np.searchsorted(counted, np.cumsum([0.0, *shares]) * counted[-1]).tolist()
        cuts = [0, *(_calm(contact[rows], cuts, at) for at in range(1, len(cuts) - 1)), len(rows)]
        begin = dataset.start[rows]
        free = 0  # the first frame that the next stretch may begin at
        for number, (first, last) in zip(order, pairwise(cuts), strict=True):
            kept = rows[first:last][begin[first:last] >= free]
            part_of[kept] = number
            if kept.size:
                free = int(dataset.start[kept[-1]]) + dataset.manifest.window + guard
    return part_of


def _calm(contact: np.ndarray, cuts: list[int], at: int) -> int:
    """Return the cut moved to the nearest window in which nothing touches, if one is within reach."""
    reach = int(REACH * min(cuts[at] - cuts[at - 1], cuts[at + 1] - cuts[at]))
    near = np.arange(cuts[at] - reach, cuts[at] + reach + 1)
    near = near[(near > 0) & (near < len(contact))]
    near = near[contact[near] == 0.0]
    return int(near[np.abs(near - cuts[at]).argmin()]) if near.size else cuts[at]
