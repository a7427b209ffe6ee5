"""How accurately a touch can be located: sensitivities of the frequencies, and Cramer-Rao bounds.

A bound is the smallest standard error of any unbiased estimator from a window of given length, for white
Gaussian noise of known level and stationary partials that the window resolves. The signal-to-noise ratio is a
power ratio (not in decibels): half the squared amplitude of a partial over the noise's variance. Noise seldom
limits a sensor: `contact_bound` also includes uncertainty of its tuning, its ends and the contact.
"""

from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from monochord.core.ranges import Finite, NonNegative, Positive, checked
from monochord.core.types import Contact, Floats, StringParams
from monochord.core.units import Hertz, Metres, Newtons, Seconds
from monochord.physics.theory._checks import Number, refuse_not_positive, representable
from monochord.physics.theory.segments import open_frequency, split_frequencies
from monochord.physics.theory.stiffness import inharmonicity, partial_numbers, stiff_partials
from monochord.physics.theory.tension import TensionLaw, stretch_stiffness, tension_from_force


def frequency_sensitivities(string: StringParams, contact: Contact, law: TensionLaw = "linear") -> Floats:
    """Return the derivatives of both segment frequencies with respect to position and force.

    With f1 = v / (2 x), f2 = v / (2 (L - x)) and v = sqrt(T / mu):

        df1/dx = -f1 / x + f1 T_x / (2 T),        df1/dF = f1 T_F / (2 T),
        df2/dx = f2 / (L - x) + f2 T_x / (2 T),   df2/dF = f2 T_F / (2 T),

    where T_x and T_F are the slopes of the tension law: (0, k_T) for the linear one.

    Parameters
    ----------
    string
        The string.
    contact
        Position and force of the touch.
    law
        Tension law.

    Returns
    -------
    array (2, 2)
        Rows f1 and f2; columns by position in Hz/m and by force in Hz/N.

    Raises
    ------
    InputError
        If the position is not on the string, the force is negative, or the law is unknown.

    Examples
    --------
    A touch in the middle moves f1 and f2 oppositely with position, alike with force:

    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0, tension_per_force=6.0)
    >>> frequency_sensitivities(string, Contact(position=0.325, force=0.0)).round(1)
    array([[-1496.9,    22.5],
           [ 1496.9,    22.5]])
    """
    x, length = contact.position, string.length
    f1, f2 = split_frequencies(string, x, contact.force, law)
    tension = tension_from_force(string, contact.force, x, law)
    linear = (0.0, string.tension_per_force)
    slopes = linear if law == "linear" else _geometric_slopes(string, contact, tension)
    stretch = np.array(slopes) / (2.0 * tension)
    moved = np.array([[-1.0 / x, 0.0], [1.0 / (length - x), 0.0]])
    return np.array([[f1], [f2]]) * (stretch + moved)


def far_segment_sensitivity(frequency: Number, open_frequency: Hertz, length: Metres) -> Number:
    """Return the derivative of the position with respect to the far segment's fundamental.

    dx/df = L f_open / f^2, from x = L (1 - f_open / f).

    Parameters
    ----------
    frequency, open_frequency, length
        As in `position_from_far_segment`.

    Returns
    -------
    float or array
        In m/Hz.

    Raises
    ------
    InputError
        If a quantity is not above zero.

    Examples
    --------
    At the twelfth fret of a low E string one hertz is two millimetres:

    >>> round(1e3 * far_segment_sensitivity(164.8, 82.4, 0.65), 2)
    1.97
    """
    refuse_not_positive(frequency=frequency, open_frequency=open_frequency, length=length)
    return length * open_frequency / frequency**2


def _geometric_slopes(string: StringParams, contact: Contact, tension: float) -> tuple[float, float]:
    # From T^2 (T - T0) = E A F^2 x (L - x) / (2 L^2), differentiated by x and by F.
    x, length, force = contact.position, string.length, contact.force
    cubic = tension * (3.0 * tension - 2.0 * string.tension)
    scale = stretch_stiffness(string) / (length**2 * cubic)
    return scale * force**2 * (length - 2.0 * x) / 2.0, scale * force * x * (length - x)


def tone_bound(duration: Seconds, sample_rate: Hertz, snr: ArrayLike) -> Floats:
    """Return the smallest standard error of the frequency of a real tone.

    var(f) >= 12 fs^2 / (4 pi^2 snr N (N^2 - 1)), with N samples, amplitude and phase unknown. Holds where the
    tone is away from zero frequency and the Nyquist frequency by more than 1 / duration.

    Parameters
    ----------
    duration
        Length of the window in s; at least two samples.
    sample_rate
        fs in Hz.
    snr
        Power ratio, any shape.

    Returns
    -------
    array
        Standard error in Hz, of the shape of `snr`.

    Raises
    ------
    InputError
        If a quantity is not above zero.

    References
    ----------
    Rife and Boorstyn (1974), Single-tone parameter estimation from discrete-time observations, IEEE Trans.
    Inf. Theory 20, 591 (complex tone); Kay (1993), Estimation Theory, Example 3.14 (real tone, used here).

    Examples
    --------
    Eight millihertz from a tenth of a second at 20 dB, in the full band of 44.1 kHz:

    >>> round(float(tone_bound(0.1, 44100.0, 100.0)), 3)
    0.008
    """
    ratio = np.asarray(snr, float)
    refuse_not_positive(duration=duration, sample_rate=sample_rate, snr=ratio)
    n = max(duration * sample_rate, 2.0)
    return sample_rate / (2.0 * np.pi) * np.sqrt(12.0 / (ratio * n * (n**2 - 1.0)))


def series_bound(
    f0: Hertz,
    numbers: ArrayLike,
    snr: ArrayLike,
    *,
    duration: Seconds,
    sample_rate: Hertz,
    inharmonicity: float = 0.0,
    known_inharmonicity: bool = True,
) -> Hertz:
    """Return the smallest standard error of the fundamental of a stiff harmonic series.

    Each partial f_n = n f0 sqrt(1 + B n^2) is a tone with variance var(f_n) and contributes (df_n/df0)^2 /
    var(f_n) to the information on f0. An unknown B is estimated too, which raises the error of f0.

    Parameters
    ----------
    f0
        Fundamental in Hz.
    numbers
        Numbers n of the partials used, shape (k,).
    snr
        Power ratio of each partial, shape (k,) or one for all.
    duration, sample_rate
        Length of the window in s, and sample rate in Hz.
    inharmonicity
        B.
    known_inharmonicity
        False where B is estimated from the same window, which needs two partials.

    Returns
    -------
    float
        Standard error in Hz; infinite where the partials do not determine f0.

    Raises
    ------
    InputError
        If a quantity is not above zero.

    Examples
    --------
    Ten harmonics determine the fundamental twenty times better than the first alone:

    >>> one = series_bound(100.0, [1], 100.0, duration=0.1, sample_rate=44100.0)
    >>> ten = series_bound(100.0, range(1, 11), 100.0, duration=0.1, sample_rate=44100.0)
    >>> round(one / ten, 1)
    19.6
    """
    n = np.asarray(numbers, float)
    variance = np.broadcast_to(tone_bound(duration, sample_rate, snr) ** 2, n.shape)
    by_f0 = stiff_partials(f0, inharmonicity, n) / f0
    by_b = f0 * n**3 / (2.0 * np.sqrt(1.0 + inharmonicity * n**2))
    information = float(np.sum(by_f0**2 / variance))
    if not known_inharmonicity:
        of_b, cross = np.sum(by_b**2 / variance), np.sum(by_f0 * by_b / variance)
        # A single partial cannot separate stiffness from pitch: what remains of the information is rounding.
        information = float(information - cross**2 / of_b) if n.size > 1 else 0.0
    return information**-0.5 if information > 0.0 else np.inf


@checked
@representable
def contact_bound(
    string: StringParams,
    contact: Contact,
    snr: Positive[float],
    *,
    duration: Positive[Seconds],
    sample_rate: Positive[Hertz],
    highest: Annotated[Hertz, Meta(gt=0.0, le=1e6)] = 8000.0,
    law: TensionLaw = "linear",
    tension_std: NonNegative[Newtons] = 0.0,
    end_std: NonNegative[Metres] = 0.0,
    open_frequency_std: Annotated[Hertz, Meta(gt=0.0)] = np.inf,
    lengthening_std: NonNegative[Metres] = 0.0,
    lengthening_correlation: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.0,
    lengthening_slope: Finite[float] = 0.0,
    line_std: NonNegative[float] = 0.0,
    force_prior_std: Annotated[Newtons, Meta(gt=0.0)] = np.inf,
) -> tuple[Metres, Newtons]:
    """Return the smallest standard errors of position and force, from both segments and the untouched pitch.

    Both fundamentals are estimated from their partials up to `highest`, each partial at the same ratio to the
    noise, its amplitude and phase unknown. By default everything else is known exactly, so that only noise
    counts. Uncertainties enter as normal errors: of the untouched tension T0, of where each end is (e1, e2),
    and of how much the contact and its mount lengthen each segment (d1, d2):

        f1 = v / (2 (x + e1 + d1)),  f2 = v / (2 (L - x + e2 + d2)),  f0 = v0 / (2 (L + e1 + e2)).

    With N the derivatives of the frequencies by these five and P their covariance, the frequencies have the
    covariance C = R + N P N^T, R being that of the noise, and (x, F) has the covariance (A^T C^-1 A)^-1, A
    being `frequency_sensitivities` with zeros for f0, less f_i / l_i times `lengthening_slope` for the force:
    a surface stiffens under a press, which shortens both segments as the press raises the tension.

    To first order f1 f2 / (f1 + f2) over f0 is sqrt(T / T0) (1 - (d1 + d2) / L), whatever the ends: where the
    untouched pitch is measured, they leave the force an error of 2 (e1 + e2) / L of itself, and what limits
    it is the lengthening. The bound ignores other evidence, such as further partials on a resonating mount,
    combination tones and levels: an estimator that uses them can be better.

    Parameters
    ----------
    string, contact, law
        The touched string, as for `segment_frequencies`.
    snr
        Power ratio of each partial to the noise.
    duration, sample_rate
        Length of the window in s, and sample rate in Hz.
    highest
        Highest partial used, in Hz.
    tension_std
        Standard error of the untouched string's tension, in N.
    end_std
        Standard error of each end's effective position, in m.
    open_frequency_std
        Standard error of the untouched string's pitch, in Hz; infinite where not measured.
    lengthening_std
        Standard error of each segment's lengthening by contact and mount, in m: a spring of K in N/m
        lengthens it by T / K, a mass above its resonance shortens it.
    lengthening_correlation
        Correlation of the lengthening of both segments, -1 to 1: 1 for one spring under both, 0 where
        resonances of the mount shift each line by itself.
    lengthening_slope
        Derivative of each segment's lengthening by force, in m/N: -T C / (3 F) of a smooth, round surface of
        compliance C, whose contact is Hertz's.
    line_std
        Relative standard error of each fundamental beside the noise's: drivers, losses and stiffness move
        lines off the formula by as much as they are not modelled.
    force_prior_std
        Standard deviation of the force that is expected anyway, in N: its range over sqrt(12), say.

    Returns
    -------
    position, force
        Standard errors in m and N; without a prior the force's is infinite where the tension does not depend
        on it.

    Raises
    ------
    InputError
        If the contact is not on the string, a segment has no partial below `highest`, the untouched pitch is
        known without error, or the correlation is outside its range.

    References
    ----------
    Kay (1993), Estimation Theory, section 4.5 (linear model, coloured noise); Van Trees (1968), Detection,
    Estimation and Modulation Theory I, section 2.4 (nuisance parameters with a prior).

    Examples
    --------
    A tenth of a micrometre: noise is not what limits such a sensor.

    >>> string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0, tension_per_force=6.0)
    >>> touch = Contact(position=0.2275, force=0.5)
    >>> window = {"duration": 0.1, "sample_rate": 44100.0}
    >>> x, force = contact_bound(string, touch, 100.0, **window)
    >>> round(1e6 * x, 2), round(1e3 * force, 2)
    (0.1, 0.01)

    Its tuning and its ends count for more, where they are known to a thousandth and to 0.1 mm:

    >>> built = {"tension_std": 0.065, "end_std": 1e-4}
    >>> x, force = contact_bound(string, touch, 100.0, **window, **built)
    >>> round(1e6 * x), round(1e3 * force)
    (74, 12)

    The untouched pitch, measured to 0.01 Hz, leaves a thirteenth of the force's error. An unknown lengthening
    of 0.1 mm by contact and mount then outweighs all else:

    >>> built["open_frequency_std"] = 0.01
    >>> round(1e3 * contact_bound(string, touch, 100.0, **window, **built)[1])
    1
    >>> round(1e3 * contact_bound(string, touch, 100.0, **window, **built, lengthening_std=1e-4)[1])
    5
    """
    lengths = np.array([contact.position, string.length - contact.position])
    f = np.array(split_frequencies(string, contact.position, contact.force, law))
    variances = np.empty(2)
    for side in (0, 1):
        b = inharmonicity(string, lengths[side])
        numbers = partial_numbers(highest, f[side], b)
        refuse_not_positive(**{f"partials_of_segment_{side + 1}_below_{highest:g}_Hz": numbers.size})
        variances[side] = (
            series_bound(f[side], numbers, snr, duration=duration, sample_rate=sample_rate, inharmonicity=b)
            ** 2
        )
    variances += (line_std * f) ** 2
    slopes = frequency_sensitivities(string, contact, law)
    slopes[:, 1] -= f / lengths * lengthening_slope
    tension = tension_from_force(string, contact.force, contact.position, law)
    # A string that is tighter from the beginning stretches less: from T^2 (T - T0) = const, differentiated.
    gain = 1.0 if law == "linear" else tension / (3.0 * tension - 2.0 * string.tension)
    longer = np.diag(-f / lengths)
    by_unknown = np.column_stack([gain * f / (2.0 * tension), longer, longer])
    prior = np.diag([tension_std, end_std, end_std, lengthening_std, lengthening_std]) ** 2
    prior[3, 4] = prior[4, 3] = lengthening_correlation * lengthening_std**2
    if np.isfinite(open_frequency_std):
        in_relation = [0.5 / string.tension, -1.0 / string.length, -1.0 / string.length, 0.0, 0.0]
        by_unknown = np.vstack([by_unknown, open_frequency(string) * np.array(in_relation)])
        variances = np.append(variances, open_frequency_std**2)
        slopes = np.vstack([slopes, np.zeros(2)])
    covariance = np.diag(variances) + by_unknown @ prior @ by_unknown.T
    if slopes[0, 1] == 0.0:
        # The position still follows, from the ratio of the two frequencies.
        by_ratio = string.length * np.array([-f[1], f[0]]) / f.sum() ** 2
        return float(np.sqrt(by_ratio @ covariance[:2, :2] @ by_ratio)), force_prior_std
    information = slopes.T @ np.linalg.solve(covariance, slopes)
    information[1, 1] += force_prior_std**-2
    errors = np.sqrt(np.diag(np.linalg.inv(information)))
    return float(errors[0]), float(errors[1])


def far_segment_bound(
    frequency: Hertz, open_frequency: Hertz, length: Metres, frequency_error: Hertz
) -> Metres:
    """Return the standard error of the position estimated from the far segment's fundamental.

    std(x) = L f_open / f^2 std(f), for a known open frequency.

    Parameters
    ----------
    frequency, open_frequency
        Fundamentals of the sounding segment and of the open string, in Hz.
    length
        L in m.
    frequency_error
        Standard error of `frequency` in Hz, for instance from `series_bound`.

    Returns
    -------
    float
        In m.

    Examples
    --------
    >>> round(1e6 * far_segment_bound(164.8, 82.4, 0.65, 0.01), 1)
    19.7
    """
    return far_segment_sensitivity(frequency, open_frequency, length) * frequency_error
