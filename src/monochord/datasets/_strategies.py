"""How each strategy assigns a dataset's windows to parts; see `monochord.datasets.split`."""

from collections.abc import Sequence
from fnmatch import fnmatchcase
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError, did_you_mean
from monochord.core.types import Flags, Floats, Indices
from monochord.core.units import Samples
from monochord.datasets.store import Dataset

PARTS = ("train", "validation", "test")
MAX_SHOWN = 12
"""Most patterns named in an error."""
MAX_CUT_SHIFT = 0.45
"""How far a cut in time may move to an untouched window, as a share of the shorter stretch beside it."""


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
        part[rest] = assign_groups(counts[rest], [strata[at] for at in rest], fractions, rng)
        return [each.name for each in sessions], part
    if by in ("day", "build"):
        numbers = [getattr(each, by) for each in sessions]
        if None in numbers:
            given = f"session {sessions[numbers.index(None)].name} without a {by} in a split by {by}"
            raise InputError(given, f"sessions that state their {by}", "split by session")
        return _by_number(dataset, [str(number) for number in numbers], counts, fractions, held_out, rng)
    return _by_object(dataset, counts, fractions, held_out, rng)


def _by_number(
    dataset: Dataset,
    names: list[str],
    counts: Indices,
    fractions: tuple[float, float, float],
    held_out: Sequence[str],
    rng: np.random.Generator,
) -> tuple[list[str], Indices]:
    """Assign whole days or builds; those of the held-out sessions form the test."""
    if not held_out:
        return names, _assigned(names, counts, fractions, rng)
    test = np.isin(names, np.array(names)[_held_out(dataset, held_out)])
    part = np.full(len(names), PARTS.index("test"))
    rest = np.flatnonzero(~test)
    known = fractions[0] + fractions[1]
    shares = (fractions[0] / known, fractions[1] / known, 0.0)
    part[rest] = _assigned([names[at] for at in rest], counts[rest], shares, rng)
    return names, part


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
        test = _assigned(names, counts, known, rng) == PARTS.index("test")
    part = np.where(test, PARTS.index("test"), -1)
    left = fractions[0] + fractions[1]
    rest = np.flatnonzero(~test)
    strata = _strata(dataset)
    shares = (fractions[0] / left, fractions[1] / left, 0.0)
    part[rest] = assign_groups(counts[rest], [strata[at] for at in rest], shares, rng)
    return names, part


def _held_out(dataset: Dataset, held_out: Sequence[str]) -> Flags:
    """Return which sessions are held out, by object or name; raises `InputError` for an unknown one."""
    objects = [each.body for each in dataset.manifest.parts]
    names = [each.name for each in dataset.manifest.parts]
    refuse_strange(objects, held_out, names)
    return np.array(
        [is_held_out(body, name, held_out) for body, name in zip(objects, names, strict=True)], bool
    )


def is_pattern(name: str) -> bool:
    """Return whether a held-out entry is a pattern of session names, rather than an object.

    >>> is_pattern("music*"), is_pattern("wood")
    (True, False)
    """
    return any(sign in name for sign in "*?[")


def is_held_out(body: str, session: str, held_out: Sequence[str]) -> bool:
    """Return whether a session of an object is held out; a folder before its name is optional.

    >>> is_held_out("plastic", "monday/music_000", ["wood", "music*"])
    True
    """
    names = (session, session.rpartition("/")[2])
    return body in held_out or any(
        fnmatchcase(name, pattern) for pattern in held_out if is_pattern(pattern) for name in names
    )


def refuse_strange(objects: Sequence[str], held_out: Sequence[str], sessions: Sequence[str] = ()) -> None:
    """Raise `InputError` for a held-out entry that is neither an object nor a session name pattern."""
    there, groups = sorted(set(objects)), sorted({name.rstrip("0123456789_") for name in sessions})
    for name in held_out:
        if not is_pattern(name):
            if name not in there:
                allowed = f"{', '.join(filter(None, there)) or 'none'}, or a pattern of session names"
                raise InputError(f"held-out object '{name}'", allowed, _meant(name, there, groups))
        elif not any(is_held_out("", session, [name]) for session in sessions):
            stem = name.translate({ord(sign): None for sign in "*?[]"})
            given = f"held-out sessions '{name}', which match no session"
            raise InputError(given, _few(groups), _meant(stem, there, groups))


def _meant(name: str, objects: Sequence[str], groups: Sequence[str]) -> str:
    """Return likely corrections: an object, or a pattern of names with the same beginning."""
    return did_you_mean(name, objects) or did_you_mean(name, groups).replace("'?", "*'?")


def _few(names: Sequence[str]) -> str:
    """Return the beginnings of names as patterns, at most `MAX_SHOWN`."""
    more = " and others" if len(names) > MAX_SHOWN else ""
    return "a pattern such as " + ", ".join(f"{name}*" for name in names[:MAX_SHOWN]) + more


def _assigned(
    names: list[str], counts: Indices, fractions: tuple[float, float, float], rng: np.random.Generator
) -> Indices:
    """Assign whole groups of sessions and return the part of every session."""
    groups, member = np.unique(names, return_inverse=True)
    sizes = np.bincount(member, weights=counts, minlength=len(groups)).astype(np.int64)
    return assign_groups(sizes, [""] * len(groups), fractions, rng)[member]


def _strata(dataset: Dataset) -> list[str]:
    """Return each session's main content: its object, and untouched, static or sliding."""
    strata: list[str] = []
    contact, slip = dataset.label("contact"), dataset.label("slip")
    for number, part in enumerate(dataset.manifest.parts):
        rows = dataset.rows_of(number)
        slides, touches = np.sum(slip[rows] == 1.0), np.sum(contact[rows] == 1.0)
        kind = "sliding" if slides > 0.2 * max(touches, 1) else "static" if touches else "untouched"
        strata.append(f"{part.body}/{kind}")
    return strata


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
            chosen = rows[first:last][begin[first:last] >= free]
            part_of[chosen] = number
            if chosen.size:
                free = int(dataset.start[chosen[-1]]) + dataset.manifest.window + guard
    return part_of


def _calm(contact: np.ndarray, cuts: list[int], at: int) -> int:
    """Return the cut moved to the nearest untouched window, if one is within reach."""
    reach = int(MAX_CUT_SHIFT * min(cuts[at] - cuts[at - 1], cuts[at + 1] - cuts[at]))
    near = np.arange(cuts[at] - reach, cuts[at] + reach + 1)
    near = near[(near > 0) & (near < len(contact))]
    near = near[contact[near] == 0.0]
    return int(near[np.abs(near - cuts[at]).argmin()]) if near.size else cuts[at]


def assign_groups(
    sizes: Sequence[int] | NDArray[np.int64],
    strata: Sequence[str],
    fractions: Sequence[float],
    stream: np.random.Generator,
) -> NDArray[np.int64]:
    """Return the part (n,) of every group so that the parts approach their shares, within each stratum too.

    The groups of each stratum are taken in random order, the largest strata first. Each goes to the part with
    the largest deficit in this stratum plus, at half weight, overall, relative to the sizes assigned
    including it. Each part with a positive share gets at least one group, if there are enough.

    >>> part = assign_groups([5] * 20, ["a", "b"] * 10, (0.8, 0.2), np.random.default_rng(0))
    >>> [int(((part == 1) & (np.arange(20) % 2 == kind)).sum()) for kind in (0, 1)]
    [2, 2]
    """
    weight, share = np.asarray(sizes, np.float64), np.asarray(fractions, np.float64)
    part = np.full(len(weight), -1, np.int64)
    total = np.zeros(len(share))
    names = np.asarray(strata)
    strata_present, counts = np.unique(names, return_counts=True) if len(names) else (names, np.zeros(0, int))
    for stratum in strata_present[np.argsort(-counts, kind="stable")]:
        here = np.zeros(len(share))
        for group in stream.permutation(np.flatnonzero(names == stratum)).tolist():
            coming = float(weight[group])
            lacks = _lack(here, share, coming) + 0.5 * _lack(total, share, coming)
            chosen = int(np.where(share > 0.0, lacks, -np.inf).argmax())
            part[group] = chosen
            here[chosen] += coming
            total[chosen] += coming
    _fill_empty(part, share, weight)
    return part


def _lack(sizes: Floats, share: Floats, coming: float) -> Floats:
    """Return each part's deficit from its share of the assigned sizes, including the next group."""
    due = share * (sizes.sum() + coming)
    return (due - sizes) / max(sizes.sum() + coming, 1.0)


def _fill_empty(part: NDArray[np.int64], share: Floats, weight: Floats) -> None:
    """Give each empty part the smallest group of the largest part, while that part has two or more."""
    for empty in np.flatnonzero(share > 0.0).tolist():
        counts = np.bincount(part, minlength=len(share))
        if counts[empty] or counts.max(initial=0) < 2:
            continue
        donors = np.flatnonzero(part == counts.argmax())
        part[donors[weight[donors].argmin()]] = empty
