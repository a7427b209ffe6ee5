"""The free motion of many modes, sample by sample, compiled."""

from numba import njit

from monochord.core.types import Floats


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def ring(carry: Floats, shape: Floats, q: Floats, v: Floats, heard: Floats) -> None:
    """Add the velocity of freely moving modes at the pickups to `heard`, and carry `q` and `v` on, in place.

    Parameters
    ----------
    carry
        (4, modes) from `free_motion` over one sample.
    shape
        (pickups, modes) value of each mode at each pickup.
    q, v
        (modes,) displacement in m and velocity in m/s; changed.
    heard
        (pickups, samples) in m/s; the first sample is the velocity as it comes in. Sums over modes are
        reassociated, which changes them by rounding only, and alike however the samples are cut into blocks.
    """
    for sample in range(heard.shape[1]):
        for p in range(shape.shape[0]):
            total = 0.0
            for m in range(q.size):
                total += shape[p, m] * v[m]
            heard[p, sample] += total
        for m in range(q.size):
            old = q[m]
            q[m] = carry[0, m] * old + carry[1, m] * v[m]
            v[m] = carry[2, m] * old + carry[3, m] * v[m]
