"""The rule for labels of known touches: what a position and a force can be, and what they look like else.

Importing a table, calibrating a model and the page's guided calibration ask the same: `why_impossible`.
"""

from typing import NamedTuple

import numpy as np

from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres, Newtons
from monochord.physics.theory import breaking_force

MAX_POSITION: Metres = 5.0
MAX_FORCE: Newtons = 50.0
"""What no touch of any string exceeds: no instrument's string is so long, and a hand that frets the stiffest
bass string presses with half of that. They detect millimetres and grams."""
MIN_TOUCHES = 3
"""Fewest touches that can contradict a model: it may misread one or two."""
MAX_POSITION_ERROR: Metres = 0.01
MAX_DEVIATIONS = 5.0
"""Median error of position, in m and in stated errors, beyond which labels contradict a model, if they also
fit no better than one place for all touches. Of foreign sensors it is 0.1 to 4 mm before calibration."""
MAX_RATIO = 4.5
"""Median ratio of forces and their estimates, either way, beyond which they are in another unit.

Of ten touches of each of 24 builds of the twin and of six strings by finite differences, read by the bundled
model before it learned from them, it is 0.31 to 2.1 (of light touches farthest from 1), in kilograms 0.03 to
0.21."""
UNITS = {"grams": 1e3 / 9.80665, "kilograms": 1.0 / 9.80665, "pounds": 1.0 / 4.44822, "millinewtons": 1e3}
"""Numbers of other units in a newton."""


class Impossible(NamedTuple):
    """Why labels are impossible: which touch (None for all), what was given, what is possible, what to do."""

    touch: int | None
    given: str
    expected: str
    remedy: str


class Estimated(NamedTuple):
    """What a model that has not learned from touches (n,) makes of them; NaN where it makes nothing.

    `position_std` is the standard error that it states.
    """

    position: Floats
    position_std: Floats
    force: Floats


def why_impossible(
    position: Floats, force: Floats, string: StringParams | None = None, estimated: Estimated | None = None
) -> Impossible | None:
    """Return why labels of touches cannot be; None where they can.

    - **On the string**: 0 <= x <= L. Without a string up to `MAX_POSITION`.
    - **Borne by it**: 0 < F <= the force that breaks the wire there, `physics.theory.breaking_force`, 40 N at
      the middle of the prototype; at most `MAX_FORCE`, also where no wire is known.
    - **Not contradicted by the set**: where a model has read `MIN_TOUCHES` or more of them, the median error
      of position is at most `MAX_POSITION_ERROR` or `MAX_DEVIATIONS` stated errors, or less than that of one
      place for all touches; and the median ratio of force and estimate is within `MAX_RATIO`. Medians allow
      for single touches that the model misreads, and the limits for a sensor that it has not learned.

    Parameters
    ----------
    position, force
        Labels of touches (n,), x in m from pickup 1 and F in N; NaN where there is none.
    string
        The string that is touched, if it is known.
    estimated
        What the model makes of the touches before it learns from them.

    Examples
    --------
    >>> why_impossible(np.array([0.05, 0.1]), np.array([0.5, 1.5])) is None
    True
    >>> why_impossible(np.array([0.05, 0.1]), np.array([51.0, 153.0])).remedy
    'give newtons; are these grams or millinewtons?'
    """
    return (
        _off_the_string(position, force, string)
        or _not_borne(position, force, string)
        or (_contradicted(position, force, estimated) if estimated else None)
    )


def _off_the_string(position: Floats, force: Floats, string: StringParams | None) -> Impossible | None:
    longest = string.length if string else MAX_POSITION
    wrong = np.flatnonzero((position < 0.0) | (position > longest) | np.isinf(position))
    if not wrong.size:
        return None
    allowed = f"0 to {longest:g} m, the string's length" if string else f"0 to {longest:g} m, from pickup 1"
    pressing = force[np.isfinite(force)]
    if string is not None and pressing.size and pressing.min() > 0.0 and pressing.max() < longest:
        remedy = "are position and force exchanged?"
    else:
        millimetres = 1.0 < np.nanmedian(position) < 1e3 * longest
        remedy = "give metres from pickup 1" + ("; are these millimetres?" if millimetres else "")
    return Impossible(int(wrong[0]), f"position {position[wrong[0]]:g}", allowed, remedy)


def _not_borne(position: Floats, force: Floats, string: StringParams | None) -> Impossible | None:
    most = np.full(force.shape, MAX_FORCE)
    if string is not None and string.core_diameter > 0.0:
        place = np.where(np.isfinite(position), position, 0.5 * string.length)
        most = np.minimum(most, breaking_force(string, place))
    wrong = np.flatnonzero(~((force > 0.0) & (force <= most)) & ~np.isnan(force))
    if not wrong.size:
        return None
    first = int(wrong[0])
    unit, sign = "give newtons; are these grams or millinewtons?", "a touch presses; give how hard"
    allowed = f"above 0 and up to {most[first]:.0f} N"
    return Impossible(first, f"force {force[first]:g}", allowed, sign if force[first] <= 0.0 else unit)


def _contradicted(position: Floats, force: Floats, estimated: Estimated) -> Impossible | None:
    error = np.abs(position - estimated.position)
    known = np.isfinite(error)
    if known.sum() >= MIN_TOUCHES:
        off, stated = float(np.median(error[known])), float(np.median(estimated.position_std[known]))
        spread = float(np.median(np.abs(position[known] - np.median(position[known]))))
        if off > max(MAX_POSITION_ERROR, MAX_DEVIATIONS * stated, spread):
            given = f"positions {1e3 * off:.0f} mm off the model's, which states +-{1e3 * stated:.1f} mm"
            remedy = "check that each stands in the row of its own touch, in metres from pickup 1"
            return Impossible(None, given, "positions of these touches", remedy)
    ratio = force / np.maximum(estimated.force, 1e-2)
    known = np.isfinite(ratio)
    if known.sum() < MIN_TOUCHES:
        return None
    typical = float(np.median(ratio[known]))
    if 1.0 / MAX_RATIO <= typical <= MAX_RATIO:
        return None
    unit = min(UNITS, key=lambda name: abs(np.log(UNITS[name] / typical)))
    given = f"forces {typical:.2g} times what the model reads"
    return Impossible(None, given, "newtons", f"are these {unit}? Give newtons: 1 kg weighs 9.81 N")
