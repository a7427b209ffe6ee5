"""What the partials of an untouched string say about a build: its pitch, stiffness, magnets and ends.

A partial of a stiff string with two drivers' magnets and yielding ends lies at

    f_n = n f0 sqrt(1 + B n^2) (1 - sum_d k_d sin^2(n pi x_d / L) / (mu L w_n^2) - e),   w_n = 2 pi n f0,

where f0 = sqrt(T / mu) / (2 L) belongs to the string between rigid ends, k_d is the negative stiffness of the
magnet at x_d, and e = T C / L the share by which ends of compliance C lengthen the string. Of a plain wire
B = pi E mu / (16 rho^2 L^4 f0^2), so that stiffness, density and length are tied together.

The fit is Gauss-Newton with Gaussian priors. Of the magnets, any pull in the range of the world `plausible`
is as likely; the ends' compliance is as that world draws it. The covariance is joint: what the partials
cannot separate, as density from Young's modulus, stays correlated and uncertain.
"""

from dataclasses import dataclass
from math import exp, inf, log, pi, sqrt

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Hertz, KilogramsPerMetre, Metres, Newtons
from monochord.physics.theory.stiffness import STEEL_DENSITY
from monochord.physics.twin import Sensor
from monochord.physics.twin.world import END_STIFFNESS, PULL

NAMES = ("open_frequency", "inharmonicity", "length", "linear_density", "tension", "pull_1", "pull_2")
"""Quantities of a `StringFit`, in the order of its arrays."""
MODULUS_STD = 0.03
"""Relative standard error of a steel wire's Young's modulus: handbooks give 195 to 210 GPa."""
UNKNOWN_STD = 0.5
"""Relative standard error of a quantity that nobody measured."""
FREE_STD, DRIVEN_STD, HELD_STD = 1.0e-4, 6.0e-4, 2.0e-3
"""Relative deviation of a partial from this model: after a pluck, dying away beside running drivers, and held
by a driver, which pulls it to where the phase of its loop closes. Measured on 8 builds of the twin."""
OUTLIER = 4.0
"""Standard errors beyond which a line is no partial; it is left out."""
_FREQUENCY, _PULL_1, _PULL_2, _ENDS, _LENGTH, _DENSITY, _MODULUS = range(7)


@dataclass(frozen=True, slots=True, kw_only=True)
class StringFit:
    """A fitted string: `values` (7,) and their `covariance` (7, 7), in the order of `NAMES` and in SI units.

    `ends` is the share by which yielding ends lengthen the string, `used` says which partials (n,) count.
    """

    values: Floats
    covariance: Floats
    ends: float
    used: tuple[bool, ...]

    @property
    def correlation(self) -> Floats:
        """Correlation matrix (7, 7)."""
        std = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(std, std)

    def relative_std(self, name: str) -> float:
        """Return the standard error of a quantity over its value."""
        at = NAMES.index(name)
        return float(np.sqrt(self.covariance[at, at]) / abs(self.values[at]))


def fit_string(
    sensor: Sensor,
    numbers: Floats,
    frequencies: Floats,
    stds: Floats,
    *,
    length: tuple[Metres, Metres],
    linear_density: tuple[KilogramsPerMetre, KilogramsPerMetre] | None = None,
) -> StringFit:
    """Fit pitch, stiffness, density, tension and magnets to the partials of an untouched string.

    The partials' `numbers`, `frequencies` and standard errors `stds` are (n,), the last two in Hz; `length`
    in m and `linear_density` in kg/m come with their standard errors, the latter None where nobody measured
    it. The design `sensor` gives the coils' places; a wound string, whose core is thinner than a solid steel
    wire of its weight, has a stiffness that does not follow from its density. Raises `InputError` if there is
    no partial, or the fit does not converge.

    >>> from monochord.physics.sensors import load_sensor
    >>> n = np.arange(1.0, 7.0)
    >>> measured = 1000.0 * n * np.sqrt(1.0 + 1.5e-4 * n**2)
    >>> weighed = (3.978e-4, 1e-6)
    >>> fit = fit_string(
    ...     load_sensor("prototype"), n, measured, 0.1 * n, length=(0.2, 1e-4), linear_density=weighed
    ... )
    >>> round(float(fit.values[NAMES.index("tension")]), 1)
    63.7
    """
    if not numbers.size:
        raise InputError("no partial", "a partial of the untouched string")
    model = _Model.of(sensor, numbers, length, linear_density, first=float(frequencies[0] / numbers[0]))
    measured, weight = np.log(frequencies / numbers), (frequencies / stds) ** 2
    used = np.ones(numbers.size, np.bool_)
    point, covariance = model.mean.copy(), np.zeros((7, 7))
    for step in range(12):
        slope = model.slope(point)[used]
        off = measured[used] - model.partials(point)[used]
        information = model.precision + slope.T @ (weight[used, None] * slope)
        covariance = np.linalg.inv(information)
        pull = slope.T @ (weight[used] * off) + model.precision @ (model.mean - point)
        point = point + covariance @ pull
        if step > 3:
            away = np.abs(measured - model.partials(point)) * np.sqrt(weight)
            used = away < max(OUTLIER, float(np.sort(away)[0]) + 1e-9)
    if not np.isfinite(point).all():
        raise InputError("partials that fit no string", "partials of one untouched string")
    jacobian = np.array([(model.named(point + h) - model.named(point - h)) / 2e-5 for h in 1e-5 * np.eye(7)])
    return StringFit(
        values=model.named(point),
        covariance=jacobian.T @ covariance @ jacobian,
        ends=float(point[_ENDS]),
        used=tuple(used.tolist()),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Model:
    """Partials as a function of (ln f0, k_1, k_2, e, ln L, ln mu, ln E); k_1 and k_2 in units of `pull`."""

    mean: Floats
    precision: Floats
    numbers: Floats
    places: tuple[Metres, Metres]
    pull: float

    @classmethod
    def of(
        cls,
        sensor: Sensor,
        numbers: Floats,
        length: tuple[Metres, Metres],
        density: tuple[float, float] | None,
        first: Hertz,
    ) -> "_Model":
        string = sensor.string
        measured = density or (string.linear_density, UNKNOWN_STD * string.linear_density)
        pull, pull_std = 0.5 * (PULL[0] + PULL[1]), even_std(0.5 * (PULL[1] - PULL[0]))
        give, give_std = (string.tension / length[0] * each for each in compliance_moments())
        # A wound string bends by its core: as if the wire's modulus were lower, by an unknown amount.
        solid = 4.0 * string.linear_density / (pi * STEEL_DENSITY)
        core = string.core_diameter**2 / solid
        modulus_std = MODULUS_STD if is_plain(sensor) else UNKNOWN_STD
        mean = [
            log(first),
            1.0,
            1.0,
            2.0 * give,
            log(length[0]),
            log(measured[0]),
            log(string.young_modulus * core**2),
        ]
        stds = [
            0.2,
            pull_std / pull,
            pull_std / pull,
            sqrt(2.0) * give_std,
            length[1] / length[0],
            measured[1] / measured[0],
            modulus_std,
        ]
        near, far = (each.drive for each in sensor.drivers)
        return cls(
            mean=np.array(mean),
            precision=np.diag(1.0 / np.array(stds) ** 2),
            numbers=numbers,
            places=(near, far - string.length),
            pull=pull,
        )

    def partials(self, point: Floats) -> Floats:
        """Return ln(f_n / n), (n,)."""
        n, named = self.numbers, self.named(point)
        frequency, bend, length, density = named[:4]
        moved = point[_ENDS] * np.ones(n.size)
        for place, pull in zip(self.places, named[5:], strict=True):
            shape = np.sin(n * pi * place / length) ** 2  # the far coil keeps its place from the far end
            moved += pull * shape / (density * length * (2.0 * pi * n * frequency) ** 2)
        return point[_FREQUENCY] + 0.5 * np.log1p(bend * n**2) - moved

    def slope(self, point: Floats) -> Floats:
        """Return the derivatives (n, 7) of `partials`."""
        steps = 1e-6 * np.eye(7)
        return np.array([(self.partials(point + h) - self.partials(point - h)) / 2e-6 for h in steps]).T

    def named(self, point: Floats) -> Floats:
        """Return the quantities (7,) of `NAMES` at a point."""
        frequency, length, density, modulus = (
            exp(point[i]) for i in (_FREQUENCY, _LENGTH, _DENSITY, _MODULUS)
        )
        bend = pi * modulus * density / (16.0 * STEEL_DENSITY**2 * length**4 * frequency**2)
        tension: Newtons = density * (2.0 * length * frequency) ** 2
        pulls = self.pull * point[_PULL_1], self.pull * point[_PULL_2]
        return np.array([frequency, bend, length, density, tension, *pulls])


def is_plain(sensor: Sensor) -> bool:
    """Return whether a string is a plain steel wire, whose density follows from its diameter."""
    string = sensor.string
    solid = steel_density_of(string.core_diameter)
    return solid > 0.0 and abs(string.linear_density / solid - 1.0) < 0.03


def steel_density_of(diameter: Metres) -> KilogramsPerMetre:
    """Return the linear density of a steel wire, rho pi d^2 / 4.

    >>> round(steel_density_of(0.254e-3), 7)
    0.0003978
    """
    return STEEL_DENSITY * pi * diameter**2 / 4.0


def log_uniform_moments(range_: tuple[float, float]) -> tuple[float, float]:
    """Return mean and standard deviation of a quantity that is even over its logarithm.

    >>> mean, std = log_uniform_moments((2.0, 40.0))
    >>> round(mean, 1), round(std, 1)
    (12.7, 10.3)
    """
    low, high = range_
    decades = log(high / low)
    mean = (high - low) / decades
    return mean, sqrt((high**2 - low**2) / (2.0 * decades) - mean**2)


def compliance_moments() -> tuple[float, float]:
    """Return mean and standard deviation of an end's compliance in m/N, as the world `plausible` draws it."""
    low, high = END_STIFFNESS
    return log_uniform_moments((1.0 / high, 1.0 / low))


def even_std(half_width: float) -> float:
    """Return the standard deviation of an error that is even within plus or minus `half_width`.

    >>> round(even_std(5e-4), 6)
    0.000289
    """
    return half_width / sqrt(3.0) if half_width < inf else inf
