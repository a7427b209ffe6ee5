"""The line under a cloud of points: what is left of delays when the least of them is taken."""

import numpy as np

from monochord.core.types import Floats

BINS = 4000
"""Points are thinned to the lowest in each of so many bins before the hull is walked."""


def line_under(x: Floats, y: Floats) -> tuple[float, float]:
    """Return the line under all points whose mean distance to them is least.

    Of the lines y = a + b x with a + b x_i <= y_i for all i, the highest at the mean of x: the
    edge of the lower convex hull that lies there (Moon, Skelly and Towsley 1999). It is found in the
    time that sorting takes. Among more than some thousand points only the lowest of each bin of x count,
    which is exact where the line is all but level: take the nominal slope out of y first.

    Parameters
    ----------
    x, y
        Points (n,), at least one, in any order.

    Returns
    -------
    a in the unit of y, and b in units of y per unit of x; b is 0 where all x are equal.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> x = np.linspace(-1.0, 1.0, 500)
    >>> a, b = line_under(x, 0.5 + 1e-3 * x + rng.exponential(1e-3, 500))
    >>> abs(a - 0.5) < 3e-5, abs(b - 1e-3) < 1e-4
    (True, True)
    """
    low, high = float(x.min()), float(x.max())
    if not high > low:
        return float(y.min()), 0.0
    mean = float(x.mean())
    x, y = _lowest_of_bins(x, y, low, high)
    hull = _lower_hull(x, y)
    right = int(np.clip(np.searchsorted(x[hull], mean), 1, len(hull) - 1))
    i, j = hull[right - 1], hull[right]
    slope = float((y[j] - y[i]) / (x[j] - x[i]))
    return float(y[i] - slope * x[i]), slope


def _lowest_of_bins(x: Floats, y: Floats, low: float, high: float) -> tuple[Floats, Floats]:
    """Return the points, by rising x, with one for each x or bin of x: its lowest."""
    place = x if x.size <= BINS else np.floor((x - low) * (BINS / (high - low)))
    order = np.lexsort((y, place))
    place = place[order]
    kept = order[np.concatenate([[True], place[1:] > place[:-1]])]
    return x[kept], y[kept]


def _lower_hull(x: Floats, y: Floats) -> list[int]:
    """Return which points are corners of the lower convex hull; x must rise (Andrew 1979)."""
    px, py = x.tolist(), y.tolist()
    hull: list[int] = []
    for k in range(len(px)):
        while len(hull) > 1:
            i, j = hull[-2], hull[-1]
            if (py[j] - py[i]) * (px[k] - px[i]) < (py[k] - py[i]) * (px[j] - px[i]):
                break
            hull.pop()
        hull.append(k)
    return hull
