"""How fast the lines of both segments glide within a window, and what that says of the touch.

A touch that slides along the string lengthens one segment and shortens the other, so that their lines glide
apart; a force or a tension that changes moves both the same way. Neither happens under a touch at rest, and
unlike the sound of friction a glide does not drown in other sound, since it is measured on the loudest lines.

Five narrower views of the window, each a Hann taper of half its length, are 1/8 of the window apart. Of a
line whose frequency changes by r in 1 / s^2, the second difference of its phase is 2 pi r h^2 at distance h.
Neighbours tell it up to r h^2 = 1/2; those twice as far apart tell it four times as well. A view is a sum
over the bins around the line, since a taper's transform is narrow. A line that glides so fast that it leaves
these bins is told too slow: 30 mm/s on the prototype as 18 to 25. Where harmonics of both segments coincide,
the glide is one between both.
"""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.types import Floats
from monochord.core.units import Hertz, Metres, Seconds

VIEWS, APART = 5, 0.125
"""Views, and their distance as a share of the window."""
REACH_BINS = 6
"""Bins on either side of a line that a view is made of."""
SEGMENT_SCALE, PLACE_SCALE, PITCH_SCALE = 5.0e-3, 2.0e-4, 3.0e-3
"""Glide of a segment and of the pitch in 1/s, and of the place in m/s, up to which columns are linear."""
SPREAD_SCALE = 1.0e-2
"""Spread of a segment's glides in 1/s up to which the column is linear."""
LEAST = 1.0e-30
"""Added to a sum of weights that is divided by."""
COLUMNS = tuple(
    f"glide {what}" for what in ("segment 1", "segment 2", "spread 1", "spread 2", "place", "pitch")
)
"""Names of the measures in the order of `measure_glides`."""


def _views() -> NDArray[np.complex128]:
    """Return the weights of the bins in each view, (`VIEWS`, 2 `REACH_BINS` + 1)."""
    bins = np.arange(-REACH_BINS, REACH_BINS + 1)
    # The transform of 1/2 + 1/2 cos over half a window, by its three sincs.
    taper = 0.5 * np.sinc(bins / 2.0) + 0.25 * (np.sinc(bins / 2.0 - 1.0) + np.sinc(bins / 2.0 + 1.0))
    centres = 0.5 + APART * (np.arange(VIEWS) - VIEWS // 2)
    turns = np.exp(2.0j * np.pi * centres[:, np.newaxis] * bins)
    return (taper * turns).astype(np.complex128)


_VIEWS = _views()


@kernel()
def measure_glides(
    transform: NDArray[np.complex128],
    lines: Floats,
    partials: Floats,
    spacing: Hertz,
    sides: tuple[Metres, Metres],
) -> Floats:
    """Return how fast the lines glide, (6,), all as asinh of a magnitude over its scale; zeros of no touch.

    Of each segment the glide, which is the change of a frequency over the frequency, in 1/s: the mean over
    its harmonics at both microphones, weighted by power and by frequency, and the spread about it. Then the
    speed of the place in m/s at which both glides differ, v = (g2 - g1) x1 x2 / (x1 + x2), and the glide that
    both share, (g1 x1 + g2 x2) / (x1 + x2).

    Parameters
    ----------
    transform
        Transform without a taper of both microphones, (2, bins).
    lines
        Bin, power and sidebands' power of each harmonic there, (2, 2, harmonics, 3); bin 0 is left out.
    partials
        Expected frequencies of both segments' harmonics, (2, harmonics) in Hz.
    spacing
        Distance of two bins in Hz.
    sides
        Lengths of both segments.
    """
    measured = np.zeros(6)
    if sides[0] <= 0.0 or sides[1] <= 0.0:
        return measured
    glides = np.zeros(2)
    for s in range(2):
        total, first, second = LEAST, 0.0, 0.0
        for c in range(lines.shape[0]):
            for n in range(partials.shape[1]):
                peak, line, side = int(lines[c, s, n, 0]), lines[c, s, n, 1], lines[c, s, n, 2]
                if peak == 0 or line <= 0.0:
                    continue
                glide, square = _glide(transform[c], peak, 1.0 / spacing)
                glide /= partials[s, n]
                weight = square * partials[s, n] * line / (line + 3.0 * side)
                total += weight
                first += weight * glide
                second += weight * glide * glide
        glides[s] = first / total
        measured[s] = np.arcsinh(abs(glides[s]) / SEGMENT_SCALE)
        measured[2 + s] = np.arcsinh(np.sqrt(max(second / total - glides[s] ** 2, 0.0)) / SPREAD_SCALE)
    length = sides[0] + sides[1]
    place = (glides[1] - glides[0]) * sides[0] * sides[1] / length
    pitch = (glides[0] * sides[0] + glides[1] * sides[1]) / length
    measured[4] = np.arcsinh(abs(place) / PLACE_SCALE)
    measured[5] = np.arcsinh(abs(pitch) / PITCH_SCALE)
    return measured


@part()
def _glide(transform: NDArray[np.complex128], peak: int, window: Seconds) -> tuple[float, float]:
    """Return the change of a line's frequency in 1/s^2, and its mean square in the views."""
    seen = np.zeros(VIEWS, np.complex128)
    square = 0.0
    for v in range(VIEWS):
        for b in range(2 * REACH_BINS + 1):
            seen[v] += _VIEWS[v, b] * transform[peak - REACH_BINS + b]
        square += seen[v].real ** 2 + seen[v].imag ** 2
    near = np.angle(seen[1] * seen[3] * (seen[2] * seen[2]).conjugate())
    far = np.angle(seen[0] * seen[4] * (seen[2] * seen[2]).conjugate())
    turns = np.round((4.0 * near - far) / (2.0 * np.pi))
    distance = 2.0 * APART * window
    return (far + 2.0 * np.pi * turns) / (2.0 * np.pi * distance**2), square / VIEWS
