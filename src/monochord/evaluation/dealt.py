"""A split dealt out again, for other windows of the same sessions or for fewer to train on."""

from dataclasses import replace

import numpy as np

from monochord.core.errors import InputError
from monochord.datasets.manifest import FILE, checksum
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset


def as_dealt(dataset: Dataset, base: Dataset, split: Split, share: float = 1.0, seed: int = 0) -> Split:
    """Return the split of a dataset that deals sessions as another's does, to a share of those trained on.

    Parameters
    ----------
    dataset
        Of the same sessions, by name.
    base, split
        The other dataset, and its split by whole sessions.
    share
        Of the training sessions that stay, one at least, drawn by `seed`.

    Raises
    ------
    InputError
        If the split cuts sessions, or there is one that the other dataset has not.
    """
    if split.by == "time":
        raise InputError(
            "a split by time for other windows or fewer sessions", "one by session, object or day"
        )
    held = {
        name: sorted({base.manifest.parts[at].name for at in base.session[rows].tolist()})
        for name, rows in split.parts.items()
    }
    names = np.array([part.name for part in dataset.manifest.parts])
    for name in (each for some in held.values() for each in some):
        if name not in names:
            raise InputError(f"sessions without {name}", "all that the split deals out")
    count = max(1, round(share * len(held["train"])))
    held["train"] = sorted(np.random.default_rng(seed).permutation(held["train"])[:count].tolist())
    parts = {name: np.flatnonzero(np.isin(names[dataset.session], some)) for name, some in held.items()}
    left = len(dataset) - sum(len(rows) for rows in parts.values())
    own = checksum(dataset.path / FILE)
    groups = {name: tuple(some) for name, some in held.items()}
    return replace(split, parts=parts, dataset=own, left_out=left, groups=groups)
