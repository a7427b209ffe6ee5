"""All that a live run knows of a string at one window, as programs, sinks and the page get it."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from monochord.core.notebook import lines
from monochord.core.ranges import Checked
from monochord.core.types import (
    Estimate,
    Estimates,
    NamedEstimates,
    Prediction,
    StreamHealth,
    Tracked,
    Truth,
    Window,
)
from monochord.core.units import Samples, Seconds
from monochord.live.events import Event
from monochord.live.health import Note
from monochord.perception.watching import Condition

NO_DECISIONS: Mapping[str, bool] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Update(Checked, NamedEstimates):
    """All values of a string at one window: `mc.listen` yields it, and a sink takes it.

    Each estimate is an attribute: ``update.position``, ``update.force``. ``update.tracked.position`` is the
    estimate over time, which includes earlier windows of the same touch. `decided` holds ``contact`` and
    ``slip`` without flicker; a name is missing while undecided. `events` are those of this window, and
    `notes` the present messages about the sensor.

    `prediction` is the estimator's result for `window` alone, and `condition` the estimator's knowledge of
    the string, None where it does not watch it. `truth` is empty for real hardware; `skipped` counts the
    windows skipped so far because the reader was late, and `health` the source's losses. `adc_time` is the
    monotonic time of the window's first frame at the converter, where the source knows it, and `at_hand` the
    time at which its last frame became available. `string` is the string's name in a run with several; empty
    for one. Sinks in several threads share an update.

    Examples
    --------
    >>> from monochord import VirtualSensor, listen
    >>> update = next(listen(VirtualSensor("prototype", seed=1)))
    >>> update.time, update.contact.valid, update.position.valid, update.truth["contact"]
    (0.0, True, False, 0.0)
    """

    prediction: Prediction
    window: Window
    health: StreamHealth
    truth: Truth
    skipped: int
    tracked: Tracked = field(default_factory=Tracked)
    decided: Mapping[str, bool] = field(default_factory=lambda: NO_DECISIONS)
    events: tuple[Event, ...] = ()
    notes: tuple[Note, ...] = ()
    condition: Condition | None = None
    adc_time: Seconds | None = None
    at_hand: Seconds | None = None
    string: str = ""

    @property
    def time(self) -> Seconds:
        """Start of the window, in seconds since the stream began."""
        return self.prediction.time

    @property
    def start(self) -> Samples:
        """Sample index of the window's first frame."""
        return self.prediction.start

    @property
    def latency(self) -> Seconds:
        """Time from the window's last sample being available to its estimates, in s."""
        return self.prediction.latency

    @property
    def estimates(self) -> Estimates:
        """The window's estimates by name; further names may occur."""
        return self.prediction.estimates

    def _named(self) -> Estimates:
        return self.prediction.estimates

    def __str__(self) -> str:
        """Return time and estimates as text."""
        return f"{self.time:.2f} s: " + "; ".join(f"{name} {each}" for name, each in self.estimates.items())

    def __repr__(self) -> str:
        words = {name: f"{name} {self.truth[name]:g}" for name in ("contact", "slip") if name in self.truth}
        units = {"position": ("mm", 1e3), "force": ("N", 1.0)}
        words |= {n: f"{n} {s * self.truth[n]:.4g} {u}" for n, (u, s) in units.items() if n in self.truth}
        return lines(
            f"Update at {self}",
            [
                ("tracked", ", ".join(f"{name} {each}" for name, each in self.tracked.items())),
                ("truth", ", ".join(words.values())),
                ("notes", ", ".join(note.key for note in self.notes)),
                ("string", self.string),
            ],
        )

    def __getitem__(self, name: str) -> Estimate:
        """Return an estimate by name; deprecated, use ``update.position``."""
        said = f"update['{name}'] is deprecated: use update.{name}"
        warnings.warn(said, DeprecationWarning, stacklevel=2)
        return self.prediction[name]
