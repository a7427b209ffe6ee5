"""What a simulation returns, and the two features that the paper takes from it."""

from dataclasses import dataclass
from math import nan

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds
from monochord.physics.split_string.feedback import lines


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Two segments as they sounded, and as the microphones heard them.

    Parameters
    ----------
    segments
        Velocities A (2, n) in m/s at the pickups.
    microphones
        B = mixing A, (2, n), in m/s.
    sample_rate
        Frames a second.
    mixing
        (2, 2), Eq. 5.
    drive_frequencies
        (2, intervals) in Hz: what each driver played during each interval; NaN while silent.
    drive_interval
        Length of an interval in s.
    """

    segments: Floats
    microphones: Floats
    sample_rate: int
    mixing: Floats
    drive_frequencies: Floats
    drive_interval: Seconds

    @property
    def duration(self) -> Seconds:
        """Length of the recording."""
        return self.segments.shape[1] / self.sample_rate


def peaks(recording: Recording, *, settle: Seconds = 0.15) -> tuple[Hertz, Hertz]:
    """Return the dominant frequency of each segment as the microphones tell it, after the transient.

    The mixing of Eq. 5 is undone, since the louder segment would otherwise be the maximum of both
    microphones; then each channel's strongest line under a Hann window is read between bins.

    A driver that closes its phase sustains a segment slightly above its own frequency f, since its other
    modes answer the drive too: by about f / (2 Q^2), with Q = 2 pi f mu / d. That is 0.01 % on the appendix's
    string, and 0.3 % on the longer side of a bass string whose Q is 13; no length of recording takes it away.

    Parameters
    ----------
    recording
        From `simulate`.
    settle
        How much of the beginning to leave out, in s; of a short recording at most its first half.

    Returns
    -------
    f1, f2
        In Hz; NaN for a segment that is silent.

    Raises
    ------
    InputError
        If the mixing cannot be undone (l1 + l2 = 1), or the recording is shorter than 10 ms.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, "Predicted frequency trends and feature
    extraction".

    Examples
    --------
    >>> from monochord.physics.split_string import SplitString, simulate
    >>> from monochord.physics.strings import load_string
    >>> appendix = load_string("appendix")
    >>> setup = SplitString(string=appendix.string, contact=appendix.contact)
    >>> f1, f2 = peaks(simulate(setup, 0.4, route="modal"))
    >>> round(f1), round(f2)
    (695, 374)
    """
    if abs(np.linalg.det(recording.mixing)) < 1e-6:
        raise InputError("mixing l1 + l2 = 1", "two microphones that hear the segments differently")
    if recording.duration < 0.01:
        raise InputError(f"recording of {recording.duration:g} s", "0.01 s or more")
    skip = round(min(settle, recording.duration / 2.0) * recording.sample_rate)
    unmixing: Floats = np.linalg.inv(recording.mixing).astype(np.float64)
    frequency, _ = lines(unmixing @ recording.microphones[:, skip:], recording.sample_rate)
    return float(frequency[0]) or nan, float(frequency[1]) or nan
