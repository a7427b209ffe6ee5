"""What the heads are trained on: rows of features, the reference beside each, labels and masks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.datasets.store import Dataset, Flags, Indices
from monochord.perception.heads.base import CONTACT, Task
from monochord.perception.model.context import Memory, context_row, step
from monochord.perception.model.definition import Reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Examples:
    """Windows of one part of a split, clean first and then with noise.

    `rows` (n,) are their numbers in the dataset. `base` (copies, n, d) is the feature and `context`
    (copies, n, c) the reference, neither scaled. `labels` and `masks` hold (n,) by head: its label, 0 where
    not valid, and whether the window counts for it.
    """

    rows: Indices
    base: Audio
    context: Audio
    labels: Mapping[str, Floats]
    masks: Mapping[str, Flags]


def masks_of(dataset: Dataset, tasks: Mapping[str, Task]) -> dict[str, Flags]:
    """Return by head which windows (n,) of a dataset count for it.

    A window counts where all its samples are there, its label is valid and, for what means something only
    while something touches, contact is 1.

    Raises
    ------
    InputError
        If there is no such label, or one that is marked valid is no number.
    """
    found: dict[str, Flags] = {}
    touched = dataset.label(CONTACT) == 1.0
    for name, task in tasks.items():
        values, valid = dataset.label(task.label), dataset.valid[task.label]
        if not np.isfinite(values[valid]).all():
            count = int((~np.isfinite(values[valid])).sum())
            given = f"label '{task.label}' that is no number in {count} windows where it is marked valid"
            raise InputError(given, "numbers", "build the dataset again")
        found[name] = dataset.usable & valid & (touched | (not task.touched))
    return found


def chosen(dataset: Dataset, rows: Indices, tasks: Mapping[str, Task], part: str) -> Indices:
    """Return the windows of a part that count for any head, in the order of their sessions and of time.

    Raises
    ------
    InputError
        If there is a head for which none counts, or a chance that is always or never true.
    """
    masks = masks_of(dataset, tasks)
    if not rows.size:
        raise InputError(f"a split that leaves nothing to {part}", "one window or more", "split it otherwise")
    for name, task in tasks.items():
        values = dataset.label(task.label)[rows[masks[name][rows]]]
        if not values.size or (task.is_chance and values.min() == values.max()):
            kind = "windows of yes and of no" if task.is_chance else "windows"
            given = f"part '{part}' without {kind} for the head '{name}'"
            raise InputError(given, "some of each", "collect more, or leave the head out")
    counts: Flags = np.logical_or.reduce(list(masks.values()))
    return np.sort(rows[counts[rows]])


def believed(dataset: Dataset, rows: Indices) -> Floats:
    """Return what is taken for the probability of contact (n,) by the fold in training: the truth.

    Where that is not known, something may touch, and 1 is taken.
    """
    contact = dataset.label(CONTACT)[rows]
    return np.where(np.isfinite(contact), contact, 1.0)


def folded(
    dataset: Dataset, rows: Indices, contact: Floats, rule: Reference, kept: Mapping[int, Audio]
) -> Audio:
    """Return the reference (n, c) that each window is read against.

    Parameters
    ----------
    dataset
        What the windows are of.
    rows
        All windows (n,) that the fold sees, in order; a new session begins with nothing.
    contact
        Probability that something touches (n,).
    rule
        How the reference is kept.
    kept
        What is kept of each window that may be taken, by its row in the dataset.
    """
    width = len(rule.feature.columns) + 1
    found = np.zeros((len(rows), width), np.float32)
    memory, session, rate = Memory(), -1, dataset.manifest.sample_rate
    for number, row in enumerate(rows.tolist()):
        if dataset.session[row] != session:
            memory, session = Memory(), int(dataset.session[row])
        found[number] = context_row(memory, width)
        time = int(dataset.start[row]) / rate
        memory = step(memory, rule, time, float(contact[number]), lambda row=row: kept[row])
    return found


def assembled(
    dataset: Dataset,
    rows: Indices,
    tasks: Mapping[str, Task],
    base: Sequence[Audio],
    context: Sequence[Audio],
) -> Examples:
    """Return the examples of windows `rows` (n,), from their features and references, copy by copy."""
    masks = masks_of(dataset, tasks)
    return Examples(
        rows=rows,
        base=np.stack(base),
        context=np.stack(context),
        labels={
            name: np.where(masks[name][rows], dataset.label(task.label)[rows], 0.0)
            for name, task in tasks.items()
        },
        masks={name: masks[name][rows] for name in tasks},
    )
