"""Many twins at once, on all cores: each is what it would be alone, bit for bit."""

import itertools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from monochord.core.units import Samples
from monochord.physics.twin.memory import Sensor, State
from monochord.physics.twin.rate import padded
from monochord.physics.twin.stream import FIXED, Take, Twin, refuse_negative, room, taken

KEYS = FIXED.index("keys")
SHARES = 4
"""Into how many parts each core's share of the twins is cut, so that none waits long for another."""


def advance_many(
    twins: Sequence[Twin], frames: Samples, *, cores: int | None = None
) -> list[tuple[Take, Twin]]:
    """Return the next `frames` frames of every twin, and the twins after them, in the order given.

    Twins of one shape, that is with as many modes and touches and an outside sound as long, run side by
    side, one a core; those of another shape wait for them. The kernel leaves Python's lock alone, so plain
    threads do.

    Parameters
    ----------
    twins
        At whatever instants; none is changed.
    frames
        How many frames each goes on.
    cores
        How many cores to use, all that this process may by default.

    Examples
    --------
    >>> from monochord.physics.sensors import load_sensor
    >>> from monochord.physics.twin import Pluck, Scene, begin
    >>> scene = Scene(pluck=Pluck(position=0.07, height=1e-4))
    >>> several = [begin(load_sensor("prototype"), scene, seed=seed) for seed in range(3)]
    >>> [take.microphones.shape for take, _ in advance_many(several, 10)]
    [(2, 10), (2, 10), (2, 10)]
    """
    refuse_negative(frames)
    shapes: dict[object, list[int]] = {}
    for i, twin in enumerate(twins):
        shapes.setdefault(_shape(twin), []).append(i)
    done: dict[int, tuple[Take, Twin]] = {}
    for group in shapes.values():
        done |= zip(group, _side_by_side([twins[i] for i in group], frames, cores), strict=True)
    return [done[i] for i in range(len(twins))]


def _shape(twin: Twin) -> object:
    """Return what must be alike for arrays to be stacked; not the keys, for they can be padded."""
    fixed = tuple(array.shape for name, array in zip(FIXED, twin.fixed, strict=True) if name != "keys")
    return padded(twin.plan.count), fixed


def _side_by_side(twins: Sequence[Twin], frames: Samples, cores: int | None) -> list[tuple[Take, Twin]]:
    from monochord.physics.twin.kernel import kernel  # noqa: PLC0415  (numba loads on use)

    fixed = [np.concatenate(arrays) for arrays in zip(*_padded(twins), strict=True)]
    moving = [np.concatenate(arrays) for arrays in zip(*(twin.moving for twin in twins), strict=True)]
    heard = room(len(twins), len(twins[0].scene.touches), frames)
    run = kernel(2 * padded(twins[0].plan.count))
    arrays = Sensor(*fixed), State(*moving), heard, np.array([twin.start for twin in twins])
    cores = cores or len(os.sched_getaffinity(0))
    edges = np.linspace(0, len(twins), min(len(twins), SHARES * cores) + 1).astype(int)
    with ThreadPoolExecutor(cores) as pool:
        list(pool.map(lambda pair: run(*arrays, *pair), itertools.pairwise(edges)))
    return [
        (
            taken(heard, i),
            replace(
                twin, start=twin.start + frames, moving=tuple(array[i : i + 1].copy() for array in moving)
            ),
        )
        for i, twin in enumerate(twins)
    ]


def _padded(twins: Sequence[Twin]) -> list[tuple[np.ndarray, ...]]:
    """Return the twins' fixed arrays with room for as many keys as the longest motion has."""
    most = max(twin.fixed[KEYS].shape[2] for twin in twins)
    padded_arrays: list[tuple[np.ndarray, ...]] = []
    for twin in twins:
        keys = twin.fixed[KEYS]
        wide = np.concatenate(
            [keys, np.zeros((*keys.shape[:2], most - keys.shape[2], keys.shape[3]))], axis=2
        )
        padded_arrays.append((*twin.fixed[:KEYS], wide, *twin.fixed[KEYS + 1 :]))
    return padded_arrays
