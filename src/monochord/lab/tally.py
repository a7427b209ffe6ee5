"""How many windows of each kind a session holds, by its labels: what a collection is planned by."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Seconds

WINDOW: Seconds = 0.1
STEADY = 0.1
"""How far the force of a static window may go from its mean, as a share of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Windows that do not overlap, by kind; only those in which both drivers were on.

    `static`: in contact throughout, sliding nowhere, the force steady to a tenth. `settled`: those of them
    in which the sound had come to rest throughout. `slip`: in contact and sliding throughout. `clear`: no
    contact at all. `transition`: contact for a part. `other`: what is left, such as a press or a turn.
    """

    static: int = 0
    settled: int = 0
    slip: int = 0
    clear: int = 0
    transition: int = 0
    other: int = 0

    def __add__(self, more: "Tally") -> "Tally":
        return Tally(**{f.name: getattr(self, f.name) + getattr(more, f.name) for f in fields(self)})


def tally(time: Floats, labels: Mapping[str, Floats], on: Seconds, off: Seconds) -> Tally:
    """Count the windows of a session from its labels.

    Parameters
    ----------
    time
        Of the labels, (n,) in s, evenly spaced and rising.
    labels
        Columns (n,): contact, force, slip, settled.
    on, off
        When the drivers went on and off; windows begin at `on`.

    Returns
    -------
    Tally
        Windows of `WINDOW` s, edge to edge.

    Raises
    ------
    InputError
        If there are fewer than two labels, or they are further apart than half a window.

    Examples
    --------
    >>> time = np.arange(1000) * 1e-3
    >>> touched = (time > 0.449).astype(float)
    >>> told = {"contact": touched, "force": touched, "slip": 0.0 * time, "settled": touched}
    >>> tally(time, told, 0.0, 1.0)
    Tally(static=5, settled=5, slip=0, clear=4, transition=1, other=0)
    """
    each = round(WINDOW / (time[1] - time[0])) if len(time) > 1 and time[1] > time[0] else 0
    if each < 2:
        raise InputError(f"labels of {len(time)} times", f"two or more in {WINDOW:g} s")
    inside = (time >= on) & (time < off)
    count = int(inside.sum()) // each
    contact, force, slip, settled = (
        np.nan_to_num(labels[name][inside][: count * each]).reshape(count, each)
        for name in ("contact", "force", "slip", "settled")
    )
    whole, never = contact.all(axis=1), ~contact.any(axis=1)
    off_mean = np.abs(force - force.mean(axis=1, keepdims=True)).max(axis=1)
    static = whole & ~slip.any(axis=1) & (off_mean <= STEADY * force.mean(axis=1))
    sliding = whole & slip.all(axis=1)
    return Tally(
        static=int(static.sum()),
        settled=int((static & settled.all(axis=1)).sum()),
        slip=int(sliding.sum()),
        clear=int(never.sum()),
        transition=int((~whole & ~never).sum()),
        other=int((whole & ~static & ~sliding).sum()),
    )
