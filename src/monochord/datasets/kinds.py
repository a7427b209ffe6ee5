"""The kind of each window, for counting and weighting."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Flags, Floats
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset

KINDS = ("static", "slip", "touched", "no contact", "transition", "masked")
"""Touched at rest; sliding; touched, slip unknown; untouched; onset or end of a touch; uncertain."""


def kinds(dataset: Dataset) -> NDArray[np.int8]:
    """Return the kind (n,) of every window, as an index into `KINDS`."""
    return kinds_of(dataset.labels, dataset.usable)


def kinds_of(labels: Mapping[str, Floats], usable: Flags) -> NDArray[np.int8]:
    """Return the kind (n,) of windows from their labels; unusable windows are masked.

    >>> nan = float("nan")
    >>> labels = {
    ...     "contact": np.array([1.0, 1.0, 0.0, nan, nan, 1.0]),
    ...     "slip": np.array([0.0, 1.0, nan, nan, nan, nan]),
    ...     "transition": np.array([0.0, 0.0, 0.0, 1.0, nan, 0.0]),
    ... }
    >>> [KINDS[kind] for kind in kinds_of(labels, np.ones(6, dtype=bool))]
    ['static', 'slip', 'no contact', 'transition', 'masked', 'touched']
    """
    contact, slip, transition = (labels[name] for name in ("contact", "slip", "transition"))
    is_kind = [
        (contact == 1.0) & (slip == 0.0),
        (contact == 1.0) & (slip == 1.0),
        contact == 1.0,
        contact == 0.0,
        transition == 1.0,
    ]
    return np.select([each & usable for each in is_kind], range(5), 5).astype(np.int8)


def counts_of(kind: NDArray[np.int8]) -> dict[str, int]:
    """Return the number of windows of each kind.

    >>> counts_of(np.array([0, 0, 5], np.int8))
    {'static': 2, 'slip': 0, 'touched': 0, 'no contact': 0, 'transition': 0, 'masked': 1}
    """
    counts = np.bincount(kind, minlength=len(KINDS)).tolist()
    return dict(zip(KINDS, counts, strict=True))


def table_of(dataset: Dataset, split: Split) -> dict[str, dict[str, dict[str, int]]]:
    """Return the number of windows by part, object and kind."""
    kind, body = kinds(dataset), np.array([part.body for part in dataset.manifest.parts])
    return {
        name: {
            str(each): counts_of(kind[rows[body[dataset.session[rows]] == each]])
            for each in np.unique(body[dataset.session[rows]])
        }
        for name, rows in split.parts.items()
    }
