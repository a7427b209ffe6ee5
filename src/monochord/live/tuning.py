"""Tunes a sensor from untouched sound, as ``monochord tune`` does."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import takewhile
from pathlib import Path
from typing import Any

from monochord.capture.sources.base import Source, Stream
from monochord.core.errors import InputError
from monochord.core.lengths import refuse_other_units
from monochord.core.notebook import lines
from monochord.core.ranges import Positive, checked
from monochord.core.reasons import Reason
from monochord.core.types import StringParams
from monochord.core.units import Hertz, Metres, Seconds
from monochord.core.windows import windows
from monochord.live.listen import Listenable, source_of
from monochord.live.settings import WindowLength, WindowSettings
from monochord.perception.tuning import Tuning
from monochord.perception.tuning.measurement import (
    HOP,
    LENGTH,
    StringMeasurement,
    StringTake,
    measured_string,
    string_take,
)
from monochord.physics.sensors import (
    RULER_STD,
    SensorTuning,
    designs_with,
    load_sensor,
    refuse_other_length,
    sensor_design,
    sensor_names,
    sensor_toml,
    sensor_tuning,
    with_length,
)
from monochord.physics.theory import inharmonicity, open_frequency
from monochord.physics.twin import Sensor

WINDOW = WindowSettings(length=LENGTH, hop=HOP)
"""Default windows of a tuning."""
SECONDS: Seconds = 3.0
"""Default duration taken from a source, in s."""
STIFFNESS_DEVIATIONS = 4.0
"""Standard errors of stiffness deviation that indicate another wire than the design's."""


@dataclass(frozen=True, kw_only=True)
class SensorAsTuned:
    """A sensor's design with its tuning, measured from untouched sound.

    `design` is the preset's name, `sensor` that preset; `measurement` is of `seconds` of untouched sound of
    `source`, at `time`. `length` is the string's length in m, if it was measured.
    `refused` windows were not used.
    """

    design: str
    sensor: Sensor
    measurement: StringMeasurement
    seconds: Seconds
    source: str
    length: Metres | None = None
    time: str = ""
    refused: int = 0

    @cached_property
    def tuning(self) -> Tuning:
        """Pitch, stiffness and losses with their standard errors."""
        return self.measurement.tuning

    @property
    def string(self) -> StringParams:
        """The design's string, of the measured length, at the measured pitch's tension."""
        string = self.sensor.string
        return self.tuning.tuned(with_length(string, self.length) if self.length else string)

    @property
    def nominal(self) -> Hertz:
        """Open frequency of the design, in Hz."""
        return open_frequency(self.sensor.string)

    @property
    def deviation(self) -> float:
        """Relative deviation of the open frequency from the design's."""
        return self.tuning.deviation(self.sensor.string)

    @property
    def cents(self) -> float:
        """The deviation in cents, hundredths of a semitone."""
        return 1200.0 * math.log2(1.0 + self.deviation)

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the measurement."""
        tuning, notes = self.tuning, list[str]()
        missing = set(range(1, 3)) - set(tuning.channels)
        if missing:
            notes.append(f"microphone {min(missing)} does not pick up the string")
        expected = inharmonicity(self.string)
        if abs(tuning.inharmonicity - expected) > STIFFNESS_DEVIATIONS * tuning.inharmonicity_std:
            notes.append(f"stiffness {tuning.inharmonicity / expected:.2f} times the design's: another wire?")
        return tuple(notes)

    def __repr__(self) -> str:
        measured, length = self.measured(), "" if self.length is None else f"{1e3 * self.length:.1f} mm"
        return lines(
            f"SensorAsTuned: {self.design}, open string at {measured.open_frequency:.2f} Hz"
            f" +- {measured.open_frequency_std:.2f}",
            [
                ("off nominal", f"{self.cents:+.0f} cents"),
                ("tension", f"{measured.tension:.2f} N +- {measured.tension_std:.2f}"),
                ("length", length),
                ("notes", "; ".join(self.notes)),
            ],
        )

    def lines(self) -> list[str]:
        """Return the result in convenient units, as text lines."""
        tuning, measured = self.tuning, self.measured()
        partials = ", ".join(map(str, tuning.partials))
        off = f"{100.0 * self.deviation:+.2f} %, {self.cents:+.0f} cents"
        lines = [
            f"{self.design}: open string at {tuning.frequency:.2f} Hz +- {tuning.frequency_std:.2f}",
            f"  off nominal    {off} from {self.nominal:.1f} Hz",
            f"  tension        {measured.tension:.2f} N +- {measured.tension_std:.2f}",
            f"  inharmonicity  {tuning.inharmonicity:.2e} +- {tuning.inharmonicity_std:.1e}",
        ]
        if self.length is not None:
            longer = 1e3 * (self.length - self.sensor.string.length)
            lines.append(f"  length         {1e3 * self.length:.1f} mm, {longer:+.1f} mm off the design's")
        if measured.decay is not None:
            lines.append(
                f"  losses         free partials decay at {tuning.decay:.1f} 1/s +- {tuning.decay_std:.1f}"
            )
        lines.append(f"  measured       partials {partials} in {self.seconds:.1f} s of untouched sound")
        if self.refused:
            lines.append(f"  left out       {self.refused * HOP:.1f} s: touched, silent or torn")
        return lines + [f"  note           {note}" for note in self.notes]

    def toml(self) -> str:
        """Return the text of the sensor's file, which `load_sensor` reads."""
        return sensor_toml(self.design, self.measured())

    def measured(self) -> SensorTuning:
        """Return the measured values as written to the file."""
        return self.measurement.in_file(
            self.string, length=self.length, seconds=self.seconds, time=self.time, source=self.source
        )


@checked
def tune(
    *sources: Listenable,
    sensor: str | Path = "",
    seconds: Positive[Seconds] = SECONDS,
    window: WindowLength = WINDOW.length,
    length: Positive[Metres] | None = None,
    **options: Any,
) -> SensorAsTuned:
    """Tune a sensor from its untouched sound.

    Parameters
    ----------
    sources
        Each as for `listen`: a recording, a source's name, a source object, a virtual sensor or an array;
        jack by default. Several sources are takes of one sensor.
    sensor
        The design: a preset's name, or the file of an earlier tuning. Optional where the source provides its
        string, as a session or the twin does.
    seconds
        Duration taken from each source, in s.
    window
        Length of the analysed windows, in s.
    length
        The string's length in m from end to end, measured with a ruler; by default the one in the earlier
        file, or else unknown. Models then state positions on a string of this length.
    options
        Options of the source, such as ``seed=1`` or ``speed=0.0`` for the twin; ``sample_rate`` of an array.

    Raises
    ------
    InputError
        If the sensor is unknown, the length is not the design's within 3 %, or the pitch cannot be found in
        the sound: it is silent, touched, from another string or no string, or the pitch is ambiguous.
    DeviceError
        If a device is missing or lost.

    Examples
    --------
    >>> tuned = tune("twin", seconds=1.0, speed=0.0)
    >>> tuned.design, abs(tuned.deviation) < 0.004, tuned.tuning.partials[0]
    ('prototype', True, 2)
    """
    opened = [source_of(source, options) for source in sources or ("jack",)]
    names = [str(source) if isinstance(source, str | Path) else type(source).__name__ for source in sources]
    settings = WindowSettings(length=window, hop=WINDOW.hop)
    return tuned(opened, names or ["jack"], str(sensor), seconds, settings, length)


def tuned(
    sources: Sequence[Source],
    names: Sequence[str],
    sensor: str = "",
    seconds: Seconds = SECONDS,
    window: WindowSettings = WINDOW,
    length: Metres | None = None,
) -> SensorAsTuned:
    """Return a tuned sensor, from source objects and their names; raises as `tune` does."""
    design = sensor_design(sensor) if sensor else ""
    if design:
        _refuse_length(length, design)  # before any device is opened
        earlier = sensor_tuning(sensor)
        length = earlier.length if length is None and earlier else length
    takes = list[StringTake]()
    for number, (source, name) in enumerate(zip(sources, names, strict=True)):
        with source.open() as stream:
            design = design or preset_of(stream.signal.string)
            _refuse_length(length, design)
            takes.append(heard_in(stream, load_sensor(design).string, seconds, number, window))
        if not takes[-1].windows + takes[-1].refused:
            given = f"{name} (shorter than a window)"
            raise InputError(given, f"{window.length:g} s or more", "use a shorter --window")
    if not any(take.partials for take in takes):
        reason = takes[-1].reason
        allowed = f"sound of an untouched string of the sensor {design}"
        raise InputError(f"{', '.join(names)}: {reason}", allowed, Reason.of(reason).remedy)
    measured = None if length is None else (length, RULER_STD)
    return SensorAsTuned(
        design=design,
        sensor=load_sensor(design),
        measurement=measured_string(load_sensor(design), takes, length=measured),
        seconds=sum(take.windows for take in takes) * window.hop,
        source=", ".join(names),
        length=length,
        refused=sum(take.refused for take in takes),
    )


def _refuse_length(length: Metres | None, design: str) -> None:
    """Raise `InputError` for an unknown design, or a measured length that a string of it cannot have."""
    refuse_other_units(length=length)
    known = load_sensor(design).string.length
    if length is not None:
        refuse_other_length(length, known, f"a string of {design}", "change the preset: it is another string")


def heard_in(
    stream: Stream, string: StringParams, seconds: Seconds, take: int = 0, window: WindowSettings = WINDOW
) -> StringTake:
    """Return the partials of an untouched string in the first seconds of a stream."""
    size, hop = window.frames(stream.signal.sample_rate)
    last = seconds * stream.signal.sample_rate - size
    each = windows(stream, size=size, hop=hop, sample_rate=stream.signal.sample_rate)
    begun = takewhile(lambda window: window.start <= last, each)
    return string_take(begun, stream.signal, string, size=size, hop=hop, take=take)


def preset_of(string: StringParams | None) -> str:
    """Return the name of the sensor preset with this string, at any tension; `InputError` if there is none.

    Examples
    --------
    >>> preset_of(load_sensor("long").string)
    'long'
    """
    if names := designs_with(string):
        return names[0]
    given = "a source that does not provide its string" if string is None else "a string of no preset"
    raise InputError(given, ", ".join(sensor_names()), "name the sensor: --sensor prototype")
