"""What LeRobot keeps of each feature to normalise it: over an episode, and over all of them."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from monochord.sessions.exports._lerobot_frames import Frames

Stats: TypeAlias = dict[str, dict[str, np.ndarray[Any, np.dtype[Any]]]]
"""``min``, ``max``, ``mean``, ``std`` (values,) and ``count`` (1,) by feature."""


def stats_of(frames: Frames) -> Stats:
    """Return the statistics of an episode; of a value that is nowhere known they are NaN and `count` is 0."""
    with np.errstate(invalid="ignore"):  # of what is infinite
        return {name: _of(column.reshape(len(column), -1).astype(float)) for name, column in frames.items()}


def _of(column: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, Any]:
    known = column[~np.isnan(column).any(axis=1)]
    width = np.full(column.shape[1], np.nan)
    if not len(known):
        return {"min": width, "max": width, "mean": width, "std": width, "count": np.array([0])}
    return {
        "min": known.min(axis=0),
        "max": known.max(axis=0),
        "mean": known.mean(axis=0),
        "std": known.std(axis=0),
        "count": np.array([len(known)]),
    }


def joined(episodes: Sequence[Stats]) -> Stats:
    """Return the statistics of all episodes together, from their own (Chan et al. 1979)."""
    found: Stats = {}
    for name in episodes[0]:
        parts = [each[name] for each in episodes if each[name]["count"][0]] or [episodes[0][name]]
        counts = np.array([part["count"][0] for part in parts], dtype=np.float64)
        weights = (counts / max(counts.sum(), 1.0))[:, None]
        means = np.stack([part["mean"] for part in parts])
        mean = (weights * means).sum(axis=0)
        spread = np.stack([part["std"] for part in parts]) ** 2 + (means - mean) ** 2
        found[name] = {
            "min": np.min([part["min"] for part in parts], axis=0),
            "max": np.max([part["max"] for part in parts], axis=0),
            "mean": mean,
            "std": np.sqrt((weights * spread).sum(axis=0)),
            "count": np.array([int(counts.sum())]),
        }
    return found
