"""What becomes of the vibration when the touch changes: shape and velocity on the new segments' modes."""

from math import pi

import numpy as np

from monochord.core.types import Floats
from monochord.physics.split_string.modes import ModalString
from monochord.physics.split_string.segments import Segment


def carry_over(old: ModalString, q: Floats, v: Floats, new: ModalString) -> tuple[Floats, Floats]:
    """Return the modal motion of a string whose segments have just changed.

    The shape and velocity of the whole string are laid out and projected onto the new modes. Where a touch
    newly clamps the string, it first brings it to zero there along the static triangle (a straight ramp to
    either support), as a finger does that presses slowly against the vibration; the rest of the shape and the
    whole velocity remain. A release puts nothing in. What lies above the audible modes is lost.

    Parameters
    ----------
    old, new
        The string before and after, of equal length.
    q, v
        (old modes,) displacement in m and velocity in m/s.

    Returns
    -------
    q, v
        (new modes,).
    """
    parts: list[tuple[Floats, Floats]] = []
    for segment, count in zip(new.segments, new.counts, strict=True):
        # At midpoints the sine sum is an exact quadrature for all that the modes can hold.
        size = max(8 * count, 1)
        local = (np.arange(size, dtype=np.float64) + 0.5) * (segment.length / size)
        shape, velocity = _laid_out(old, q, v, segment.origin + segment.direction * local)
        tip, _ = _laid_out(old, q, v, np.array([segment.origin + segment.direction * segment.length]))
        waves = _waves(segment, count, local) * (2.0 / size)
        parts.append(((shape - tip * local / segment.length) @ waves, velocity @ waves))
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _laid_out(string: ModalString, q: Floats, v: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Displacement and velocity at places along the whole string."""
    shape, velocity = np.zeros(places.size), np.zeros(places.size)
    first = 0
    for segment, count in zip(string.segments, string.counts, strict=True):
        local = (places - segment.origin) * segment.direction
        inside = (local >= 0.0) & (local <= segment.length)
        waves = _waves(segment, count, local[inside])
        shape[inside] = waves @ q[first : first + count]
        velocity[inside] = waves @ v[first : first + count]
        first += count
    return shape, velocity


def _waves(segment: Segment, count: int, local: Floats) -> Floats:
    return np.sin(np.outer(local, np.arange(1, count + 1)) * (pi / segment.length))
