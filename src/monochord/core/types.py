"""The basic types of Monochord: frozen, keyword-only, in SI units.

Sample arrays are channel-first, ``(channel, sample)``, as the paper's A in R^{2xT}.
"""

import copyreg
import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.identity import SensorIdentity
from monochord.core.ranges import (
    Checked,
    Count,
    Finite,
    NonNegative,
    Pair,
    Positive,
    SampleRate,
    Whole,
    checked,
)
from monochord.core.reasons import DetailedReason, Reason
from monochord.core.shapes import frames, is_sound, sound
from monochord.core.units import (
    Hertz,
    KilogramsPerMetre,
    Metres,
    MetresPerSecond,
    Newtons,
    NewtonSecondsPerSquareMetre,
    OrNaN,
    Pascals,
    Samples,
    Seconds,
)


def _read_only(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(values)


# So that what holds one crosses to another process, and is copied.
copyreg.pickle(MappingProxyType, lambda proxy: (_read_only, (dict(proxy),)))

Floats: TypeAlias = NDArray[np.float64]
Audio: TypeAlias = NDArray[np.float32]
Flags: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]
Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with the name of the current work, the amount done, and the total."""
_TEXTS = (str, Reason, DetailedReason)


@dataclass(frozen=True, slots=True, kw_only=True)
class StringParams(Checked):
    """A string as built: the parameters of its vibration when untouched.

    `tension_per_force` is the paper's k_T (Eq. 6), `damping` its d_0 and `damping_per_force` its k_d (Eq. 7).
    `core_diameter` is that of the load-bearing wire, which sets stiffness and stretch; zero means an ideally
    flexible string. `InputError` refuses a number that no string has.

    Examples
    --------
    >>> string = StringParams(length=0.2, linear_density=4e-4, tension=65.0)
    >>> from monochord import open_frequency
    >>> round(open_frequency(string))
    1008
    """

    length: Positive[Metres]
    linear_density: Positive[KilogramsPerMetre]
    tension: Positive[Newtons]
    core_diameter: NonNegative[Metres] = 0.0
    young_modulus: Positive[Pascals] = 2.0e11
    damping: NonNegative[NewtonSecondsPerSquareMetre] = 0.02
    damping_per_force: NonNegative[float] = 0.0
    tension_per_force: NonNegative[float] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact(Checked):
    """One touch. `position` is from pickup 1, in m; no contact is ``None``, not a force of zero.

    Examples
    --------
    >>> Contact(position=0.08, force=1.0).slip_velocity
    0.0
    """

    position: Finite[Metres]
    force: NonNegative[Newtons]
    slip_velocity: Finite[MetresPerSecond] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block(Checked):
    """Consecutive sample frames from a source.

    `samples` is (channels, n) float32; `start` is the sample index of the first frame. `dropped` frames were
    lost just before it (`start` already skips them): a gap is data. `adc_time` is the monotonic time of the
    first frame at the converter, where the source knows it, and `frame_time` the device's frame count there
    (JACK's frame time, modulo 2^32).

    Examples
    --------
    >>> block = Block(samples=np.zeros((2, 512), np.float32), start=1024, dropped=512)
    >>> block.samples.shape[1], block.start - block.dropped
    (512, 512)
    """

    samples: Audio
    start: Samples
    dropped: Whole = 0
    adc_time: Finite[Seconds] | None = None
    frame_time: Samples | None = None

    def __post_init__(self) -> None:
        if not is_sound(self.samples):  # quick: the usual samples pass at once
            object.__setattr__(self, "samples", frames(self.samples))
        Checked.__post_init__(self)

    def __repr__(self) -> str:
        lost = f", {self.dropped} frames lost before" if self.dropped else ""
        return f"Block: samples {np.shape(self.samples)} from frame {self.start}{lost}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Window(Checked):
    """A window of audio to analyse; `samples` is (channels, n) float32 from index `start` on.

    Floats of another type are converted. Raises `InputError` for a wrong shape, integers, or no samples.

    Examples
    --------
    >>> window = Window(samples=np.zeros((2, 4410), np.float32), start=0, sample_rate=44100)
    >>> window.duration
    0.1
    """

    samples: Audio
    start: Samples
    sample_rate: SampleRate
    has_gap: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "samples", sound(self.samples))
        Checked.__post_init__(self)

    def __repr__(self) -> str:
        channels, frames = self.samples.shape
        gap = ", with a gap" if self.has_gap else ""
        begin = self.start / self.sample_rate
        return (
            f"Window: {frames} frames of {channels} channels at {self.sample_rate} Hz from {begin:.3f} s{gap}"
        )

    @property
    def duration(self) -> Seconds:
        """Length of the window in s."""
        return self.samples.shape[-1] / self.sample_rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate(Checked):
    """One estimated quantity with its standard error, or an abstention with its reason.

    `std` is one standard deviation in the unit of `value`. Where `valid` is false, `value` and `std` are NaN
    and `reason` gives the reason in a few words; `Reason.of` names it for code. ``float(estimate)`` is
    `value`, and ``str(estimate)`` is for display: a length in mm, any other quantity in its unit.

    Examples
    --------
    >>> place = Estimate(value=0.08241, std=3e-4, unit="m")
    >>> print(place, float(place))
    82.4 +- 0.3 mm 0.08241
    >>> print(Estimate.abstain("m", "two candidates"))
    no answer: two candidates
    """

    value: OrNaN[float]
    std: OrNaN[float]
    unit: str
    valid: bool = True
    reason: str = ""

    def __post_init__(self) -> None:
        if not (
            type(self.value) is float is type(self.std)
            and type(self.unit) is str
            and type(self.reason) in _TEXTS
            and type(self.valid) is bool
        ):  # quick: a window has dozens
            Checked.__post_init__(self)

    @classmethod
    def abstain(cls, unit: str, reason: str) -> "Estimate":
        """Return an abstention, for a `Reason` or one in own words.

        >>> Estimate.abstain("m", Reason.SILENCE).reason, Estimate.abstain("m", "a moth").reason
        ('silence', 'a moth')
        """
        return cls(value=float("nan"), std=float("nan"), unit=unit, valid=False, reason=reason)

    @property
    def why_not(self) -> str:
        """Deprecated name of `reason`, from version 0.1."""
        warnings.warn("Estimate.why_not is deprecated: use Estimate.reason", DeprecationWarning, stacklevel=2)
        return self.reason

    def __float__(self) -> float:
        """Return the value, NaN for an abstention."""
        return float(self.value)

    def __str__(self) -> str:
        """Return the value with its standard error for display, or the abstention's reason."""
        if not self.valid:
            return f"no answer: {self.reason}" if self.reason else "no answer"
        scale, unit = (1e3, "mm") if self.unit == "m" else (1.0, self.unit.removeprefix("1"))
        return f"{_with_error(scale * self.value, scale * self.std)} {unit}".rstrip()

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:  # noqa: FBT001, ARG002  (of IPython)
        """Display `str` in a notebook."""
        printer.text(str(self))


def _with_error(value: float, std: float) -> str:
    """Return a value and its standard error, rounded to one significant digit of the error.

    >>> _with_error(0.5238, 0.0312), _with_error(1009.8, 25.0), _with_error(0.5, float("nan"))
    ('0.52 +- 0.03', '1010 +- 25', '0.5 +- ?')
    """
    if not 0.0 < std < math.inf:
        return f"{value:.4g} +- {'0' if std == 0.0 else '?'}"
    digits = max(-math.floor(math.log10(float(f"{std:.0e}"))), 0)
    return f"{value:.{digits}f} +- {std:.{digits}f}"


Estimates: TypeAlias = Mapping[str, Estimate]
"""An estimator's estimates by name; further names may occur."""
NO_ESTIMATES: Estimates = MappingProxyType({})
Prepared: TypeAlias = Callable[[Window], Estimates]
"""An estimator prepared for a signal."""
Truth: TypeAlias = Mapping[str, OrNaN[float]]
"""Truth from a simulated source: ``contact`` 0 or 1, ``position``, ``force`` ...; further names may occur."""


class NamedEstimates(ABC):
    """Access to estimates by name: ``update.position``, ``update.tracked.force``.

    The four quantities of a touch are always available: one that is not estimated is an abstention. Any other
    name is an attribute if the estimator provides it.
    """

    __slots__ = ()

    @abstractmethod
    def _named(self) -> Estimates:
        """Return the estimates by name; further names may occur."""

    @checked
    def estimate(self, name: str) -> Estimate:
        """Return an estimate by name, or an abstention for a missing one.

        >>> Prediction(start=0, time=0.0, estimates={}).estimate("force").reason
        'not estimated'
        """
        return self._estimate(name)

    def _estimate(self, name: str) -> Estimate:
        return self._named().get(name) or Estimate.abstain("", Reason.NOT_ESTIMATED)

    @property
    def contact(self) -> Estimate:
        """Probability of contact."""
        return self._estimate("contact")

    @property
    def position(self) -> Estimate:
        """Position of the touch from pickup 1, in m."""
        return self._estimate("position")

    @property
    def force(self) -> Estimate:
        """Normal force, in N."""
        return self._estimate("force")

    @property
    def slip(self) -> Estimate:
        """Probability of slip."""
        return self._estimate("slip")

    def __dir__(self) -> list[str]:
        """Return the attribute names, estimates included."""
        return [*super().__dir__(), *self._named()]

    def __getattr__(self, name: str) -> Estimate:
        """Return an estimate by name; raises `AttributeError` for an unknown name."""
        if name.startswith("_") or name in _fields_of(type(self)):  # not set yet, while it is copied
            raise AttributeError(name)
        if name in (named := self._named()):
            return named[name]
        raise AttributeError(f"no attribute or estimate '{name}'; estimates: {', '.join(named) or 'none'}")


def _fields_of(kind: type) -> Mapping[str, Any]:
    return getattr(kind, "__dataclass_fields__", {})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracked(NamedEstimates, Mapping[str, Estimate]):
    """Estimates over time, as a mapping by name and by attribute.

    >>> place = Estimate(value=0.0824, std=3e-4, unit="m")
    >>> tracked = Tracked(estimates={"position": place})
    >>> print(tracked.position, "|", tracked.force, "|", *tracked)
    82.4 +- 0.3 mm | no answer: not estimated | position
    """

    estimates: Estimates = field(default_factory=lambda: NO_ESTIMATES)

    def _named(self) -> Estimates:
        return self.estimates

    def __getitem__(self, name: str) -> Estimate:
        """Return an estimate by name; raises `KeyError` for an unknown name."""
        return self.estimates[name]

    def __iter__(self) -> Iterator[str]:
        """Yield the estimates' names."""
        return iter(self.estimates)

    def __len__(self) -> int:
        """Return the number of estimates."""
        return len(self.estimates)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction(Checked, NamedEstimates):
    """The estimates of one window by name, on the sample clock; further names may occur.

    `time` is the start of the window in seconds since the stream began; `latency` is the time from the
    window's last sample being available to this prediction.

    Examples
    --------
    >>> place = Estimate(value=0.08, std=1e-4, unit="m")
    >>> prediction = Prediction(start=0, time=0.0, estimates={"position": place})
    >>> print(prediction.position, "|", prediction.force)
    80.0 +- 0.1 mm | no answer: not estimated
    """

    start: Samples
    time: Finite[Seconds]
    estimates: Mapping[str, Estimate]
    latency: Finite[Seconds] = 0.0

    def __getitem__(self, name: str) -> Estimate:
        """Return an estimate by name; raises `KeyError` for an unknown name.

        >>> place = Estimate(value=0.08, std=1e-4, unit="m")
        >>> Prediction(start=0, time=0.0, estimates={"position": place})["position"].value
        0.08
        """
        if name not in self.estimates:
            raise KeyError(f"'{name}' is not estimated; there is {', '.join(self.estimates) or 'nothing'}")
        return self.estimates[name]

    def _named(self) -> Estimates:
        return self.estimates


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal(Checked):
    """An open source's audio format: rate, channels, and the string if known.

    `string` is the tuned string. `design` is the same wire as in training, where the tuning differs: features
    in hertz or newtons are then stated relative to it. `length_std` is the standard error of the string's
    length in m, where it was measured; None for a length that is the design's. `sensing_range` is the part of
    the string where the sensor can resolve position, None for an unknown sensor. `drivers` holds the coil
    positions (sense and drive) of each driver that is on; empty if unknown. `sensor` is which sensor it is,
    None if unknown.

    Examples
    --------
    >>> signal = Signal(sample_rate=44100, channels=2)
    >>> signal.string is None, signal.drivers
    (True, ())
    """

    sample_rate: SampleRate
    channels: Count
    string: StringParams | None = None
    design: StringParams | None = None
    length_std: NonNegative[Metres] | None = None
    sensing_range: Pair[Finite[Metres]] | None = None
    drivers: tuple[Pair[Finite[Metres]], ...] = ()
    sensor: SensorIdentity | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamHealth:
    """Counters of a running stream; `xruns` is the server's count, the rest follows from frame times.

    `away` says what the stream waits for while no sound arrives, and is empty otherwise.
    """

    frames: Samples = 0
    dropped: Samples = 0
    gaps: int = 0
    xruns: int = 0
    reconnects: int = 0
    clock_offsets: Mapping[str, Seconds] = field(default_factory=lambda: MappingProxyType({}))
    away: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed(Checked):
    """An open instrument's description of its readings.

    `stream` is the kind of reading, and its topic in a session: ``wrench``, ``pose``, or a custom name.
    `columns` names the values of a reading and `units` their units, one each. `rate` is the expected number
    of readings per second, and `ticks` the rate of the device's clock in ticks per second; 0 where unknown.
    `details` holds other metadata: calibration, serial number, address.

    Examples
    --------
    >>> feed = Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=1000.0)
    >>> feed.columns.index("fz")
    2
    """

    stream: str
    columns: tuple[str, ...]
    units: tuple[str, ...]
    rate: NonNegative[Hertz] = 0.0
    ticks: NonNegative[Hertz] = 0.0
    details: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
"""Columns of the stream ``wrench``: force in N, then torque in N m."""
POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
"""Columns of the stream ``pose``: position in m, then orientation as a unit quaternion."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings(Checked):
    """Consecutive readings of one instrument, n of them, in order of arrival.

    `time` (n,) is the time of arrival at this machine, in seconds of the monotonic clock, taken as close to
    the wire as possible; `values` (n, columns) are in the units of the `Feed`. `sequence` (n,) is the
    sender's count and `device_time` (n,) the sender's clock in ticks, both -1 where it sends none; `status`
    (n,) is its status word, 0 for no fault. Lost readings leave a gap in `sequence` and are never filled in.

    Examples
    --------
    >>> none, fine = np.full(2, -1), np.zeros(2, np.uint32)
    >>> values = np.array([[20.1], [20.3]])
    >>> time = np.array([0.0, 0.5])
    >>> readings = Readings(
    ...     stream="room", time=time, values=values, sequence=none, device_time=none, status=fine
    ... )
    >>> readings.values.shape
    (2, 1)
    """

    stream: str
    time: Floats
    values: Floats
    sequence: NDArray[np.int64]
    device_time: NDArray[np.int64]
    status: NDArray[np.uint32]

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        each = (self.time, self.values, self.sequence, self.device_time, self.status)
        if [array.ndim for array in each] != [1, 2, 1, 1, 1] or len({len(array) for array in each}) > 1:
            given = f"readings of shapes {', '.join(str(array.shape) for array in each)}"
            raise InputError(given, "(n,) each, and values (n, columns)")


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentHealth:
    """Counters of an open instrument: `missing` never arrived, `faulty` are unreadable or report a fault."""

    readings: int = 0
    missing: int = 0
    faulty: int = 0
    out_of_order: int = 0
    reconnects: int = 0
