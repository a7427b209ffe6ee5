"""Real takes with known frets, cut into windows, and what estimators make of them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Estimate, Floats, Signal, Window
from monochord.core.units import Metres, Seconds
from monochord.evaluation import realstrings
from monochord.evaluation.realstrings import SCALE, Take
from monochord.perception.estimators import ESTIMATORS

Calibration = tuple[tuple[float, ...], ...]
"""Takes of known touch, as the closed-form estimator takes them; the open note comes first."""
Mix = Callable[[Audio], Audio]
"""Changes the samples (channels, n) of a take, as by adding interference."""
SHORTEST, LONGEST = 0.01, 60.0  # s, of a window and of the distance of two
NEAR: Metres = 5.0e-3
"""An answer at most this far off counts as right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol:
    """Which windows of a take are looked at: from `first` to `last` after the onset, every `hop`."""

    length: Seconds = 0.1
    first: Seconds = 0.15
    last: Seconds = 1.05
    hop: Seconds = 0.1

    def __post_init__(self) -> None:
        for name, span in (("window", self.length), ("hop", self.hop)):
            if not SHORTEST <= span <= LONGEST:
                raise InputError(f"{name} {span:g} s", f"{SHORTEST:g} to {LONGEST:g} s")
        if not 0.0 <= self.first <= self.last - self.length <= LONGEST:
            given = f"windows of {self.length:g} s from {self.first:g} s to {self.last:g} s"
            allowed = f"a first of 0 s or more, and a last one window or more after it, up to {LONGEST:g} s"
            raise InputError(given, allowed)

    def windows(self, take: Audio, heard: Audio, rate: int) -> list[Window]:
        """Return the windows of `heard` that lie wholly in it, counted from the onset of `take`."""
        begin, size = realstrings.onset(take), round(self.length * rate)
        seconds = np.arange(self.first, self.last - self.length + 1e-9, self.hop)
        starts = [begin + round(after * rate) for after in seconds.tolist()]
        return [
            Window(samples=heard[:, start : start + size].copy(), start=start, sample_rate=rate)
            for start in starts
            if start + size <= heard.shape[1]
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Strings:
    """The strings whose open note was recorded: by name, the open take and the fretted takes."""

    open_notes: dict[str, Take]
    fretted: dict[str, list[Take]]


@cache
def recorded_strings() -> Strings:
    """Return all plucked takes with known fret on strings that have an open note.

    Raises
    ------
    InputError
        If there are no real recordings on this machine.
    """
    labelled = realstrings.takes(kind="plucked", labelled=True)
    if not labelled:
        remedy = "name it in the environment as MONOCHORD_REALSTRINGS"
        raise InputError("no real recordings", "a folder with manifest.csv", remedy)
    opens = {string_name(take): take for take in labelled if take.position == 0.0}
    fretted: dict[str, list[Take]] = {string: [] for string in opens}
    for take in labelled:
        if take.position > 0.0 and string_name(take) in opens:
            fretted[string_name(take)].append(take)
    return Strings(open_notes=opens, fretted=fretted)


def calibrated_strings(protocol: Protocol) -> Iterator[tuple[str, Calibration, list[Take]]]:
    """Yield each recorded string: its name, its open note as calibration, and its fretted takes."""
    strings = recorded_strings()
    for name, take in strings.open_notes.items():
        yield name, open_note(take, protocol), strings.fretted[name]


def string_name(take: Take) -> str:
    """Return the name of a take's string: its instrument and the string's own name."""
    return f"{take.instrument} {take.string}"


def open_note(take: Take, protocol: Protocol) -> Calibration:
    """Return an open take as calibration: the median frequency and inharmonicity of its windows.

    From its audio alone: ``((frequency in Hz, 0.0, inharmonicity),)``.

    Raises
    ------
    InputError
        If no window has a frequency, as where all begin after the note has died away.
    """
    seen = [
        (told["frequency"].value, told["inharmonicity"].value)
        for told in located(take, ((take.frequency, 0.0),), protocol)
        if told["frequency"].valid
    ]
    if not seen:
        given = f"take {take.path.name} from {protocol.first:g} s to {protocol.last:g} s"
        raise InputError(given, "a stretch with a clear note in it", "begin earlier after the onset")
    frequency, stiffness = np.median(np.array(seen), axis=0).tolist()
    return ((frequency, 0.0, stiffness),)


def located(
    take: Take, calibration: Calibration, protocol: Protocol, mix: Mix | None = None
) -> list[Mapping[str, Estimate]]:
    """Return the estimates of every window of a take.

    Parameters
    ----------
    take
        A take of known string.
    calibration
        Of that string; begins with its open note.
    protocol
        Which windows.
    mix
        Changes the samples of the take first, as by adding interference.
    """
    samples, rate = take.read()
    heard = samples if mix is None else mix(samples)
    known = {"length": SCALE, "open_frequency": calibration[0][0], "calibration": calibration}
    estimator = ESTIMATORS.build("closed_form", known)
    signal = Signal(sample_rate=rate, channels=heard.shape[0])
    estimate = estimator.prepare(signal, round(protocol.length * rate))
    return [estimate(window) for window in protocol.windows(samples, heard, rate)]


def position_errors(take: Take, told: list[Mapping[str, Estimate]]) -> Floats:
    """Return estimate minus fret position in m for every window, NaN where the estimator abstained."""
    return np.array([estimates["position"].value for estimates in told]) - take.position
