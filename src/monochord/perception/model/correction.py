"""Corrections: adapt a head to a sensor and an object with a few known touches.

On a build or an object outside the training data, the errors of a head are systematic: they are similar in
all windows. They are modelled as

    error = w . phi(z) + forest(z, columns) + noise,

where z are a few variables, including the head's own estimate, and phi are their polynomials up to the second
degree. The weights w are constant for one build and object, and differ between builds and objects. Their
prior is normal with mean 0. Its covariance is estimated from sessions outside the training data (empirical
Bayes). Known touches condition the prior (Bayesian linear regression). Without known touches, estimates do
not change, and the prior covariance is the uncertainty that an unknown build adds.

Where nothing was learned at training, the prior is physics: a position is off by the tool's offset and by the
length of the string, a force by a gain, its curvature and an offset (`physical`). What these terms leave is
learned by regression trees on the columns of the feature (`monochord.perception.model.forest`).

Windows of one touch have nearly the same error, so all windows of a touch count as one observation. Noise has
the tails of Student's t, because a misread mode gives a large error.

References
----------
Dempster, Laird and Rubin (1977), Maximum likelihood from incomplete data via the EM algorithm, J. R. Stat.
Soc. B 39, 1; Lange, Little and Taylor (1989), Robust statistical modeling using the t distribution, J. Am.
Stat. Assoc. 84, 881; Bishop (2006), Pattern Recognition and Machine Learning, section 3.3.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from monochord.core.kernels import kernel
from monochord.core.types import Audio, Floats, Indices
from monochord.metrics import normal_coverage
from monochord.perception.model.forest import NO_FOREST, forest_sums

MAX_VARIABLE = 4.0
"""Largest magnitude of a scaled variable; beyond it, a polynomial would extrapolate."""
FIRST_VARIANCE = 0.05
"""Prior variance of each weight at the start of its estimation, in units of the scale squared."""
ROUNDS = 60
"""Iterations of the estimation; more change the prior by less than its own uncertainty."""
MIN_VARIANCE = 1e-8
DEGREES = 10.0
"""Degrees of freedom of the errors' Student t distribution."""
ROBUST_ROUNDS = 4
"""Iterations that reduce the weight of large errors."""
BUILD_SHARE = 0.3
"""Share of the covariance that all sessions of one build share; the rest varies with the object and the day.

Measured on force: 0.30 of the variance of the mean error over 40 validation sessions, with seven plausible
builds and random objects, is common to a build (0.05 to 0.54 in a bootstrap over builds). See
docs/design/tuning-and-calibration.md.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """The distribution of the weights of a head's error, and the trees that learned what it leaves.

    Errors are label minus estimate, in units of the head's scale. `centre` (v,) and `scale` (v,) scale the
    variables. `mean` (k,) and `covariance` (k, k) describe the weights. `noise` is the residual variance, as
    a multiple of the head's own variance; it is fitted to the shares of errors within one and two sigma.
    `forest` (n, 3) are the nodes of the trees, see
    `monochord.perception.model.forest`; none by default. Variables are the v ones of
    the weights, and behind them the columns that trees need.

    Examples
    --------
    >>> flat, wide = np.zeros(3), np.eye(3)
    >>> unknown = Correction(centre=flat[:1], scale=wide[0, :1], mean=flat, covariance=wide, noise=1.0)
    >>> variables = np.array([[0.0], [1.0]])
    >>> unknown.terms(variables).tolist()
    [[1.0, 0.0, 0.0], [1.0, 1.0, 1.0]]
    >>> known = unknown.given(variables, np.array([0.3, 0.3]), np.array([0.1, 0.1]), np.array([0, 1]))
    >>> [round(float(x), 2) for each in (unknown, known) for x in each.error(variables[0])]
    [0.0, 1.0, 0.3, 0.1]
    """

    centre: Floats
    scale: Floats
    mean: Floats
    covariance: Floats
    noise: float
    forest: Audio = field(default_factory=lambda: NO_FOREST)

    def terms(self, variables: Floats) -> Floats:
        """Return the terms (..., k) of variables (..., v or more): their polynomials."""
        rows = variables.reshape(-1, variables.shape[-1])
        return _terms(rows, self.centre, self.scale).reshape(*variables.shape[:-1], self.mean.size)

    def error(self, variables: Floats) -> tuple[Floats, Floats]:
        """Return the expected error (...,) for variables (..., v), and its standard error without noise."""
        rows, shape = variables.reshape(-1, variables.shape[-1]), variables.shape[:-1]
        expected, std = _errors(rows, self.centre, self.scale, self.mean, self.covariance, self.forest)
        return expected.reshape(shape), std.reshape(shape)

    def residual(self, variables: Floats) -> Floats:
        """Return what the trees add to the expected error (...,) for variables (..., v)."""
        rows = variables.reshape(-1, variables.shape[-1])
        return forest_sums(rows, self.forest).reshape(variables.shape[:-1])

    def stated(self, variables: Floats, std: Floats) -> tuple[Floats, Floats]:
        """Return the expected error (...,), and the standard error (...,) where the head states `std`."""
        expected, uncertain = self.error(variables)
        return expected, np.sqrt(self.noise * std**2 + uncertain**2)

    def given(self, variables: Floats, error: Floats, std: Floats, touch: Indices) -> "Correction":
        """Return the correction conditioned on the errors in some windows.

        `variables` (n, v), `error` (n,) and the `std` (n,) that the head states are of the windows; `touch`
        (n,) numbers their touches.
        """
        terms, trust, estimate = self.terms(variables), np.ones(len(error)), self
        inverse = _inverse(self.covariance)
        error = error - self.residual(variables)
        for _ in range(ROBUST_ROUNDS):
            weight = trust * touch_weights(touch) / (self.noise * std**2)
            covariance = _inverse(inverse + (terms * weight[:, None]).T @ terms)
            mean = covariance @ (inverse @ self.mean + terms.T @ (weight * error))
            estimate = replace(self, mean=mean, covariance=covariance)
            expected, uncertain = replace(estimate, forest=NO_FOREST).error(variables)
            off = ((error - expected) ** 2 + uncertain**2) / (self.noise * std**2)
            trust = (DEGREES + 1.0) / (DEGREES + off)
        return estimate

    def with_forest(self, nodes: Audio, share: float = 1.0) -> "Correction":
        """Return the correction with further trees (n, 3), of whose sum a share counts."""
        further = nodes.copy()
        further[nodes[:, 0] < 0.0, 1] *= share
        further[:, 2] += len(self.forest)
        return replace(self, forest=np.concatenate([self.forest, further]))

    def scaled(self, factor: float) -> "Correction":
        """Return the correction that states `factor` times the standard error."""
        return replace(self, covariance=factor**2 * self.covariance, noise=factor**2 * self.noise)

    def of_the_build(
        self,
        variables: Floats,
        error: Floats,
        std: Floats,
        touch: Indices,
        group: Indices,
        share: float = BUILD_SHARE,
    ) -> "Correction":
        """Return the correction for an unknown object on a build that is known from other objects.

        The weights are the sum of a build's part, with a `share` of the covariance, and an object's part,
        with the rest. Every object gives information on the build's part; its own part does not carry over to
        the next object. `group` (n,) numbers the sessions, each with one object; all else is as in `given`.
        """
        mean, build, of_object = self.mean, share * self.covariance, (1.0 - share) * self.covariance
        for each in np.unique(group):
            rows = group == each
            before = replace(self, mean=mean, covariance=build + of_object)
            after = before.given(variables[rows], error[rows], std[rows], touch[rows])
            gain = build @ _inverse(before.covariance)
            mean = mean + gain @ (after.mean - before.mean)
            build = _symmetric(build - gain @ (before.covariance - after.covariance) @ gain.T)
        return replace(self, mean=mean, covariance=build + of_object)


def physical(offset: float, scale: float, stds: tuple[float, float, float]) -> Correction:
    """Return the prior correction by physics of a head that learned none; its one variable is the estimate.

    The head's quantity is ``offset + scale * estimate``. `stds` are the standard deviations of its error:
    constant, by unit of the quantity, and by its square.

    Examples
    --------
    >>> longer = physical(0.1, 0.04, (4e-4, 0.006, 0.0))
    >>> [round(0.04 * float(longer.error(np.array([z]))[1]), 5) for z in (0.0, 1.0)]
    [0.00072, 0.00093]
    """
    powers = np.array([[1.0, offset, offset**2], [0.0, scale, 2.0 * offset * scale], [0.0, 0.0, scale**2]])
    weights = powers * np.array(stds) / scale
    covariance = weights @ weights.T + MIN_VARIANCE * np.eye(3)
    return Correction(
        centre=np.zeros(1), scale=np.ones(1), mean=np.zeros(3), covariance=covariance, noise=1.0
    )


def prior(variables: Floats, error: Floats, std: Floats, group: Indices, touch: Indices) -> Correction:
    """Return the prior correction, for an unknown build and object; it changes no estimate.

    `variables` (n, v), `error` (n,) and the `std` (n,) that the head states are of windows that the model was
    not trained on. `group` (n,) numbers their sessions, within which weights are constant, and `touch` (n,)
    their touches.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> group = np.repeat(np.arange(60), 10)
    >>> error = np.repeat(rng.normal(size=60), 10) + 0.1 * rng.normal(size=600)
    >>> zeros, each = np.zeros((600, 1)), np.arange(600)
    >>> unknown = prior(zeros, error, np.full(600, 0.1), group, each)
    >>> round(float(unknown.covariance[0, 0]), 1), round(unknown.noise, 1)
    (0.8, 1.0)
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
    size = (1 + len(centre)) * (2 + len(centre)) // 2
    weight = touch_weights(touch)
    noise = max(float(np.median(np.abs(error) / std)) ** 2, MIN_VARIANCE)
    estimate = replace(start, mean=np.zeros(size), covariance=FIRST_VARIANCE * np.eye(size), noise=noise)
    groups = [np.flatnonzero(group == each) for each in np.unique(group)]
    left = np.empty(len(error))
    for _ in range(ROUNDS):
        known = [estimate.given(variables[rows], error[rows], std[rows], touch[rows]) for rows in groups]
        means = np.array([each.mean for each in known])
        covariance = np.mean([each.covariance for each in known], axis=0) + means.T @ means / len(known)
        for rows, each in zip(groups, known, strict=True):
            expected, uncertain = each.error(variables[rows])
            left[rows] = ((error[rows] - expected) ** 2 + uncertain**2) / std[rows] ** 2
        covariance = _symmetric(covariance + MIN_VARIANCE * np.eye(size))
        noise = max(_quantile(left, weight, normal_coverage(1.0)), MIN_VARIANCE)
        estimate = replace(estimate, covariance=covariance, noise=noise)
    # One factor for both: with one for each, noise may grow until known touches have no weight to teach.
    expected, stated = estimate.stated(variables, std)
    left = ((error - expected) / stated) ** 2
    sizes = [_quantile(left, weight, normal_coverage(sigmas)) / sigmas**2 for sigmas in (1.0, 2.0)]
    factor = max(float(np.sqrt(np.prod(sizes))), MIN_VARIANCE)
    estimate = replace(estimate, covariance=factor * estimate.covariance, noise=factor * estimate.noise)
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


@kernel()
def _errors(
    variables: Floats, centre: Floats, scale: Floats, mean: Floats, covariance: Floats, forest: Audio
) -> tuple[Floats, Floats]:
    """Return the expected error (rows,) for variables (rows, v), and its standard error without noise."""
    terms, expected = _terms(variables, centre, scale), forest_sums(variables, forest)
    std = np.empty(expected.size)
    for row in range(expected.size):
        variance = 0.0
        for i in range(mean.size):
            expected[row] += terms[row, i] * mean[i]
            weighted = 0.0
            for j in range(mean.size):
                weighted += covariance[i, j] * terms[row, j]
            variance += terms[row, i] * weighted
        std[row] = np.sqrt(max(variance, 0.0))
    return expected, std


def touch_weights(touch: Indices) -> Floats:
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
