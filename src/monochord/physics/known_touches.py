"""Known touches: which places to propose, and which labels are possible and what an impossible one suggests.

Importing a table, calibrating a model and the page's guided calibration all use `why_impossible`.
"""

from fractions import Fraction
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres, Newtons
from monochord.physics.theory import breaking_force

MAX_POSITION: Metres = 5.0
MAX_FORCE: Newtons = 50.0
"""Limits of any touch on any string; they detect millimetres and grams.

No instrument's string is longer, and a hand on the stiffest bass string presses with half this force.
"""
MIN_TOUCHES = 3
"""Smallest number of touches that can contradict a model, which may misread one or two."""
MAX_POSITION_ERROR: Metres = 0.01
MAX_DEVIATIONS = 5.0
"""Median position error, in m and in stated errors, beyond which labels contradict a model.

They must also fit no better than a single position for all touches. Sensors that the model has not learned
have a median error of 0.1 to 4 mm before calibration.
"""
MAX_RATIO = 4.5
"""Median ratio of force to estimate, either way, beyond which forces are in another unit.

For ten touches on each of 24 builds of the twin and on six strings by finite differences, read by the bundled
model before it learned from them, the ratio is 0.31 to 2.1 (farthest from 1 for light touches); in kilograms
it is 0.03 to 0.21.
"""
UNITS = {"grams": 1e3 / 9.80665, "kilograms": 1.0 / 9.80665, "pounds": 1.0 / 4.44822, "millinewtons": 1e3}
"""Number of other units in a newton."""

NODES = tuple(sorted({Fraction(k, n) for n in range(2, 6) for k in range(1, n)}))
"""Nodes of the string's modes 2 to 5, as shares of its length: 1/5, 1/4, 1/3, 2/5, 1/2 ..."""
NODE_SHARE = 0.015
"""Nearest distance of a proposed touch to a node, as a share of the length.

Drivers hold low modes, and a mode whose node is touched goes on as if nothing touched. On six builds of the
twin, pressed with 0.4 to 1.4 N, the bundled model answers 0 to 100 % of a touch's windows at 1/3, 2/5, 1/2,
3/5 and 2/3 of the 200 mm, 73 to 100 % at 2 to 3 mm beside, and all of them farther off.
"""

Unit: TypeAlias = Literal["N", "g"]
"""Units in which a person may give a force: newtons, or grams as a kitchen scale shows."""


def in_newtons(force: float, unit: Unit) -> Newtons:
    """Return a force given in newtons or grams; a gram weighs 9.80665 mN.

    >>> round(in_newtons(51.0, "g"), 3), in_newtons(0.5, "N")
    (0.5, 0.5)
    """
    return force / UNITS["grams"] if unit == "g" else force


def node_distance(position: Floats, length: Metres) -> Floats:
    """Return the distance of positions (n,) from the nearest of `NODES`, in m; negative before the node.

    >>> node_distance(np.array([0.083, 0.095]), 0.2).round(3).tolist()
    [0.003, -0.005]
    """
    from_nodes = position[:, None] - length * np.array([*map(float, NODES)])
    return np.take_along_axis(from_nodes, np.abs(from_nodes).argmin(axis=1)[:, None], axis=1)[:, 0]


def beside_nodes(position: Metres, length: Metres) -> Metres:
    """Return the position to propose for a touch: this one, or that beside the node that it is too near to.

    >>> round(beside_nodes(0.1, 0.2), 4), round(beside_nodes(0.079, 0.2), 4), beside_nodes(0.09, 0.2)
    (0.103, 0.077, 0.09)
    """
    off, clear = float(node_distance(np.array([position]), length)[0]), NODE_SHARE * length
    return position if abs(off) >= clear else position - off + (clear if off > -1e-9 else -clear)


class ImpossibleLabels(NamedTuple):
    """An impossible label: which touch (None for all), what was given, what is possible, what to do."""

    touch: int | None
    given: str
    expected: str
    remedy: str


class TouchEstimates(NamedTuple):
    """A model's estimates of touches (n,) before it learned from them; NaN where it abstained.

    `position_std` is the stated standard error.
    """

    position: Floats
    position_std: Floats
    force: Floats


def why_impossible(
    position: Floats,
    force: Floats,
    string: StringParams | None = None,
    estimated: TouchEstimates | None = None,
) -> ImpossibleLabels | None:
    """Return the first problem that makes labels of touches impossible; None where they are possible.

    - **On the string**: 0 <= x <= L. Without a string up to `MAX_POSITION`.
    - **Below breaking**: 0 < F <= the force that breaks the wire there, `physics.theory.breaking_force`, 40 N
      at the middle of the prototype; at most `MAX_FORCE`, also for an unknown wire.
    - **Consistent with a model**: where a model has read `MIN_TOUCHES` or more of them, the median error
      of position is at most `MAX_POSITION_ERROR` or `MAX_DEVIATIONS` stated errors, or less than with a
      single position for all touches; and the median ratio of force and estimate is within `MAX_RATIO`.
      Medians tolerate single misread touches, and the limits tolerate an unfamiliar sensor.

    `position` and `force` are (n,), in m from pickup 1 and N, NaN for a missing label; `estimated` is what a
    model made of the touches before it learns from them.

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


def _off_the_string(position: Floats, force: Floats, string: StringParams | None) -> ImpossibleLabels | None:
    longest = string.length if string else MAX_POSITION
    wrong = np.flatnonzero((position < 0.0) | (position > longest) | np.isinf(position))
    if not wrong.size:
        return None
    allowed = f"0 to {longest:g} m, the string's length" if string else f"0 to {longest:g} m, from pickup 1"
    pressing = force[np.isfinite(force)]
    if string is not None and pressing.size and pressing.min() > 0.0 and pressing.max() < longest:
        remedy = "are position and force swapped?"
    else:
        millimetres = 1.0 < np.nanmedian(position) < 1e3 * longest
        remedy = "give metres from pickup 1" + ("; are these millimetres?" if millimetres else "")
    return ImpossibleLabels(int(wrong[0]), f"position {position[wrong[0]]:g}", allowed, remedy)


def _not_borne(position: Floats, force: Floats, string: StringParams | None) -> ImpossibleLabels | None:
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
    return ImpossibleLabels(first, f"force {force[first]:g}", allowed, sign if force[first] <= 0.0 else unit)


def _contradicted(position: Floats, force: Floats, estimated: TouchEstimates) -> ImpossibleLabels | None:
    error = np.abs(position - estimated.position)
    known = np.isfinite(error)
    if known.sum() >= MIN_TOUCHES:
        off, stated = float(np.median(error[known])), float(np.median(estimated.position_std[known]))
        spread = float(np.median(np.abs(position[known] - np.median(position[known]))))
        if off > max(MAX_POSITION_ERROR, MAX_DEVIATIONS * stated, spread):
            given = f"positions {1e3 * off:.0f} mm from the model's, stated error {1e3 * stated:.1f} mm"
            remedy = "check that each position is in its touch's row, in metres from pickup 1"
            return ImpossibleLabels(None, given, "positions of these touches", remedy)
    ratio = force / np.maximum(estimated.force, 1e-2)
    known = np.isfinite(ratio)
    if known.sum() < MIN_TOUCHES:
        return None
    typical = float(np.median(ratio[known]))
    if 1.0 / MAX_RATIO <= typical <= MAX_RATIO:
        return None
    unit = min(UNITS, key=lambda name: abs(np.log(UNITS[name] / typical)))
    given = f"forces {typical:.2g} times the model's"
    return ImpossibleLabels(None, given, "newtons", f"are these {unit}? Give newtons: 1 kg weighs 9.81 N")
