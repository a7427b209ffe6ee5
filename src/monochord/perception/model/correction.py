"""Corrections: how a sensor or an object differs from those of the training, from a few known touches.

On a build or an object that was not in training, the errors of a head are no noise: they are alike from
window to window. They are written as

    error = w . phi(z) + noise,

where z are a few variables, the head's own estimate among them, and phi their polynomials up to the second
degree. The weights w are constant for one build and object, and differ from one to the next. Their prior,
normal with the mean 0 and a covariance, is estimated from sessions that the model was not trained on
(empirical Bayes). Known touches condition it, as in any Bayesian linear regression; without one, no estimate
changes, and the covariance is what an unknown build adds to the uncertainty.

Windows of one touch have much the same error, so all windows of a touch count as one. Noise has the tails of
Student's t, since a misread mode is far off.

References
----------
Dempster, Laird and Rubin (1977), Maximum likelihood from incomplete data via the EM algorithm, J. R. Stat.
Soc. B 39, 1; Lange, Little and Taylor (1989), Robust statistical modeling using the t distribution, J. Am.
Stat. Assoc. 84, 881; Bishop (2006), Pattern Recognition and Machine Learning, section 3.3.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from monochord.core.kernels import kernel
from monochord.core.types import Floats, Indices
from monochord.metrics import normal_coverage

MAX_VARIABLE = 4.0
"""Largest size of a scaled variable; further out a polynomial would be a guess."""
FIRST_VARIANCE = 0.05
"""Prior variance of each weight at the start of its estimation, in units of the scale squared."""
ROUNDS = 60
"""Rounds of the estimation; more change the prior by less than its own uncertainty."""
MIN_VARIANCE = 1e-8
DEGREES = 10.0
"""Degrees of freedom of Student's t, as which errors are distributed: a misread mode is far off."""
CALIBRATION_ROUNDS = 5
"""Rounds in which covariance and noise are scaled until errors are covered without and with known touches."""
MIN_SHARE = 0.01
"""Smallest factor of the covariance in such a round."""
ROBUST_ROUNDS = 4
"""Rounds in which errors that are far off lose weight."""
COVARIANCE_FACTORS = (1.0, 4.0, 16.0, 64.0)
"""Factors of the covariance for a sensor whose errors are larger than any build's of the training."""
NOISE_FACTORS = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Factors of the noise for one whose touches scatter more."""
FACTOR_PENALTY = 0.75
"""A factor a of these is a^-0.75 times as probable beforehand as 1."""


BUILD_SHARE = 0.3
"""Share of the covariance that sessions of one build have in common; the rest is the object's and the day's.

Of the variance of force's mean error over 40 sessions of seven plausible builds of validation, drawn objects,
0.30 is common to a build (0.05 to 0.54 by drawing builds again): docs/design/tuning-and-calibration.md.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """Weights of a head's error, as far as they are known.

    Errors are the label less the estimate, in units of the head's scale. `centre` and `scale` (v,) are those
    of the variables, `mean` (k,) and `covariance` (k, k) of the weights; `noise` is the variance of what the
    weights leave over, as a multiple of the head's own, by how many errors lie within one sigma and two.

    Examples
    --------
    >>> flat, wide = np.zeros(3), np.eye(3)
    >>> unknown = Correction(centre=flat[:1], scale=wide[0, :1], mean=flat, covariance=wide, noise=1.0)
    >>> terms = unknown.terms(np.array([[0.0], [1.0]]))
    >>> terms.tolist()
    [[1.0, 0.0, 0.0], [1.0, 1.0, 1.0]]
    >>> known = unknown.given(terms, np.array([0.3, 0.3]), np.array([0.1, 0.1]), np.array([0, 1]))
    >>> [round(float(x), 2) for each in (unknown, known) for x in each.error(terms[0])]
    [0.0, 1.0, 0.3, 0.1]
    """

    centre: Floats
    scale: Floats
    mean: Floats
    covariance: Floats
    noise: float

    def terms(self, variables: Floats) -> Floats:
        """Return the polynomials (..., k) of variables (..., v)."""
        terms = _terms(variables.reshape(-1, self.centre.size), self.centre, self.scale)
        return terms.reshape(*variables.shape[:-1], terms.shape[1])

    def error(self, terms: Floats) -> tuple[Floats, Floats]:
        """Return the expected error (...,) at terms (..., k), and its standard error without noise."""
        variance = np.einsum("...i,...i", terms @ self.covariance, terms)
        return terms @ self.mean, np.sqrt(np.maximum(variance, 0.0))

    def given(self, terms: Floats, error: Floats, std: Floats, touch: Indices) -> "Correction":
        """Return the correction once the errors of some windows are known.

        Parameters
        ----------
        terms, error, std
            Terms (n, k), errors (n,), and the standard errors (n,) that the head itself states.
        touch
            The touch (n,) of each window.
        """
        trust, estimate = np.ones(len(error)), self
        inverse = _inverse(self.covariance)
        for _ in range(ROBUST_ROUNDS):
            weight = trust * _touch_weights(touch) / (self.noise * std**2)
            covariance = _inverse(inverse + (terms * weight[:, None]).T @ terms)
            mean = covariance @ (inverse @ self.mean + terms.T @ (weight * error))
            estimate = replace(self, mean=mean, covariance=covariance)
            trust = estimate.trust(terms, error, std)
        return estimate

    def fitted(
        self, terms: Floats, error: Floats, std: Floats, touch: Indices, group: Indices | None = None
    ) -> "Correction":
        """Return the correction with covariance and noise as the known errors of a sensor have them.

        The prior is of the builds of the training. On a sensor of another design errors are larger than on
        any of these, and too little of them would be learned from a few touches. So covariance and noise are
        multiplied by the factors, of `COVARIANCE_FACTORS` and `NOISE_FACTORS`, that are most probable given
        these errors (MacKay 1992, Bayesian interpolation); beforehand one of 4 is a third as probable as 1
        (`FACTOR_PENALTY`), which it takes evidence to outweigh.

        Parameters
        ----------
        terms, error, std, touch
            As of `given`.
        group
            The group (n,) of each window, of one object; all of one by default.
        """
        group = np.zeros(len(error), np.int64) if group is None else group
        objects = [
            self._touches(terms[rows], error[rows], std[rows], touch[rows])
            for rows in (group == each for each in np.unique(group))
        ]

        def scaled(by: tuple[float, float]) -> "Correction":
            return replace(self, covariance=by[0] * self.covariance, noise=by[1] * self.noise)

        def probability(by: tuple[float, float]) -> float:
            here = scaled(by)
            return sum(here.evidence(*each) for each in objects) - FACTOR_PENALTY * float(np.log(by).sum())

        return scaled(max(product(COVARIANCE_FACTORS, NOISE_FACTORS), key=probability))

    def _touches(
        self, terms: Floats, error: Floats, std: Floats, touch: Indices
    ) -> tuple[Floats, Floats, Floats, Indices]:
        """Return these of each touch of one object, windows that are far off counting less."""
        trust = self.given(terms, error, std, touch).trust(terms, error, std)
        numbers = np.unique(touch)
        average = trust * (numbers[:, np.newaxis] == touch)
        average /= average.sum(axis=1, keepdims=True)
        return average @ terms, average @ error, (average @ std**-2) ** -0.5, numbers

    def of_the_build(
        self, terms: Floats, error: Floats, std: Floats, touch: Indices, group: Indices
    ) -> "Correction":
        """Return the correction for an object that is not known, of a build whose errors with others are.

        Weights are those of the build and those of the object, with `BUILD_SHARE` of the covariance and the
        rest. Each object tells something of the build; what it tells of itself is of no use for the next.

        Parameters
        ----------
        terms, error, std, touch
            As of `given`.
        group
            The group (n,) of each window, of one object: a session.
        """
        mean, build, own = self.mean, BUILD_SHARE * self.covariance, (1.0 - BUILD_SHARE) * self.covariance
        for each in np.unique(group):
            rows = group == each
            before = replace(self, mean=mean, covariance=build + own)
            after = before.given(terms[rows], error[rows], std[rows], touch[rows])
            gain = build @ _inverse(before.covariance)
            mean = mean + gain @ (after.mean - before.mean)
            build = _symmetric(build - gain @ (before.covariance - after.covariance) @ gain.T)
        return replace(self, mean=mean, covariance=build + own)

    def evidence(self, terms: Floats, error: Floats, std: Floats, touch: Indices) -> float:
        """Return the log probability of errors, arguments as of `given`, up to a constant."""
        trust = self.given(terms, error, std, touch).trust(terms, error, std)
        trust = np.minimum(trust / np.median(trust), 1.0)  # of one that is further off than most
        covariance = np.diag(self.noise * std**2 / trust) + terms @ self.covariance @ terms.T
        off = error - terms @ self.mean
        return float(-0.5 * (off @ np.linalg.solve(covariance, off) + np.linalg.slogdet(covariance)[1]))

    def trust(self, terms: Floats, error: Floats, std: Floats) -> Floats:
        """Return the weight (n,) that Student's t gives each error: little to one that is far off."""
        expected, uncertain = self.error(terms)
        off = ((error - expected) ** 2 + uncertain**2) / (self.noise * std**2)
        return (DEGREES + 1.0) / (DEGREES + off)


def prior(variables: Floats, error: Floats, std: Floats, group: Indices, touch: Indices) -> Correction:
    """Return the correction of a build and object of which nothing is known yet: it changes no estimate.

    Parameters
    ----------
    variables, error, std
        Variables (n, v), errors (n,), and standard errors (n,) that the head itself states, of windows that
        the model was not trained on.
    group
        The group (n,) of each window, within which weights are constant: a session.
    touch
        The touch (n,) of each window.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> group = np.repeat(np.arange(60), 10)
    >>> error = np.repeat(rng.normal(size=60), 10) + 0.1 * rng.normal(size=600)
    >>> zeros, each = np.zeros((600, 1)), np.arange(600)
    >>> unknown = prior(zeros, error, np.full(600, 0.1), group, each)
    >>> round(float(unknown.covariance[0, 0]), 1), round(unknown.noise, 1)
    (0.9, 1.0)
    """
    centre = np.median(variables, axis=0)
    spread = np.quantile(variables, 0.84, axis=0) - np.quantile(variables, 0.16, axis=0)
    start = Correction(
        centre=centre,
        scale=np.where(spread > 0.0, 0.5 * spread, 1.0),
        mean=np.zeros(1),
        covariance=np.zeros((1, 1)),
        noise=1.0,
    )
    terms = start.terms(variables)
    size = terms.shape[1]
    weight = _touch_weights(touch)
    noise = max(float(np.median(np.abs(error) / std)) ** 2, MIN_VARIANCE)
    estimate = replace(start, mean=np.zeros(size), covariance=FIRST_VARIANCE * np.eye(size), noise=noise)
    groups = [np.flatnonzero(group == each) for each in np.unique(group)]
    left = np.empty(len(error))
    for _ in range(ROUNDS):
        known = [estimate.given(terms[rows], error[rows], std[rows], touch[rows]) for rows in groups]
        means = np.array([each.mean for each in known])
        covariance = np.mean([each.covariance for each in known], axis=0) + means.T @ means / len(known)
        for rows, each in zip(groups, known, strict=True):
            expected, uncertain = each.error(terms[rows])
            left[rows] = ((error[rows] - expected) ** 2 + uncertain**2) / std[rows] ** 2
        covariance = _symmetric(covariance + MIN_VARIANCE * np.eye(size))
        noise = max(_quantile(left, weight, normal_coverage(1.0)), MIN_VARIANCE)
        estimate = replace(estimate, covariance=covariance, noise=noise)
    for _ in range(CALIBRATION_ROUNDS):
        _, uncertain = estimate.error(terms)
        beyond = (error**2 - estimate.noise * std**2) / np.maximum(uncertain**2, MIN_VARIANCE)
        share = max(_quantile(beyond, weight, normal_coverage(1.0)), MIN_SHARE)
        estimate = replace(estimate, covariance=share * estimate.covariance)
        for rows in groups:
            left[rows] = _by_others(estimate, terms[rows], error[rows], std[rows], touch[rows])
        sizes = [_quantile(left, weight, normal_coverage(sigmas)) / sigmas**2 for sigmas in (1.0, 2.0)]
        estimate = replace(estimate, noise=estimate.noise * max(float(np.sqrt(np.prod(sizes))), MIN_VARIANCE))
    return estimate


@kernel()
def _terms(variables: Floats, centre: Floats, scale: Floats) -> Floats:
    count = 1 + centre.size
    terms = np.empty((variables.shape[0], count * (count + 1) // 2))
    factors = np.ones(count)
    for row in range(variables.shape[0]):
        for v in range(centre.size):
            scaled = (variables[row, v] - centre[v]) / scale[v]
            factors[1 + v] = min(max(scaled, -MAX_VARIABLE), MAX_VARIABLE)
        at = 0
        for one in range(count):
            for other in range(one, count):
                terms[row, at] = factors[one] * factors[other]
                at += 1
    return terms


def _by_others(unknown: Correction, terms: Floats, error: Floats, std: Floats, touch: Indices) -> Floats:
    """Return the squared error (n,) of each window by the half of its group's touches that it is not in.

    It is in units of the variance stated. Half of them, since a calibration has few, not all but one.
    """
    odd = np.unique(touch, return_inverse=True)[1].reshape(-1) % 2 == 1
    left = np.empty(len(error))
    for out in (odd, ~odd):
        known = unknown.given(terms[~out], error[~out], std[~out], touch[~out])
        expected, uncertain = known.error(terms[out])
        left[out] = (error[out] - expected) ** 2 / (unknown.noise * std[out] ** 2 + uncertain**2)
    return left


def _touch_weights(touch: Indices) -> Floats:
    """Return the weight (n,) of each window, such that all windows of a touch together count as one."""
    _, at, counts = np.unique(touch, return_inverse=True, return_counts=True)
    return 1.0 / counts[at.reshape(-1)]


def _quantile(values: Floats, weight: Floats, share: float) -> float:
    """Return the value below which a share of the weight lies: as one sigma of squares."""
    order = np.argsort(values)
    below = np.cumsum(weight[order]) / weight.sum()
    return float(values[order][min(int(np.searchsorted(below, share)), len(values) - 1)])


def _inverse(matrix: Floats) -> Floats:
    """Return the inverse of a symmetric matrix, symmetric to the last bit."""
    return _symmetric(np.linalg.inv(matrix).astype(np.float64))


def _symmetric(matrix: Floats) -> Floats:
    return 0.5 * (matrix + matrix.T)
