"""Locates where a recorded string is stopped or touched, like ``monochord locate``."""

import math
from array import array
from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from monochord.capture.sources import SOURCES
from monochord.core.config import Tree, override
from monochord.core.errors import InputError
from monochord.core.pitch_names import pitch, pitch_name
from monochord.core.ranges import Positive, checked
from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Window
from monochord.core.units import Hertz, Metres, Seconds
from monochord.dsp.pitch import PitchFinder
from monochord.front.located import NUT, PICKUP, SAME_FRET, Located, Place
from monochord.live import LiveRun, run
from monochord.live.calibration import calibrated
from monochord.live.listen import Listenable, source_of
from monochord.live.settings import RECORDINGS, put_estimator, refuse_string_twice
from monochord.live.settings import recording as recording_table
from monochord.live.sinks.base import Listener, Run, Update, Writer
from monochord.perception.model.table import EstimateColumn, PredictionTable
from monochord.perception.usable import unusable_reason
from monochord.physics.theory import light_touch, open_frequency
from monochord.sessions import read_session

"""Why a window with a position has no fret."""
CONTACT = "contact"
"""The estimate that only the two-segment form provides."""
FEW = 0.2
"""Share of windows with sound that have a position, below which the sound may be another string's."""
SAMPLED = 64
"""Most windows without a position whose pitch is looked for."""
FLAT = 0.97
"""Pitch of a string half a semitone flat, relative to the pitch that it should have."""
LOWEST, HIGHEST = 30.0, 2000.0
"""Range of that pitch in Hz: of a bass below its low B, up to a guitar's highest fret."""
MIN_EVIDENCE = 27.0
"""Smallest evidence of that pitch in nats; white noise stays below 25."""
INPUT_NOTES = "one_microphone", "unlike_inputs", "microphone_1_dead", "microphone_2_dead"
"""Keys of the health notes on two channels that are not two microphones."""
LASTING = 0.1
"""Share of windows from which such a note is told."""
DOMINANT = 0.5
"""Share of those windows that one note must have."""
UNITS = {"position": "m", "frequency": "Hz", "fret": ""}
"""Units of what each window has."""
FRETS = 12.0 / math.log(2.0)
"""Frets of a relative change of frequency of one."""


@checked
def locate(
    recording: Listenable,
    model: str | Path | None = None,
    *,
    length: Positive[Metres] | None = None,
    open: str | Positive[Hertz] | None = None,  # noqa: A002  (the musician's word)
    string: str | None = None,
    sensor: str | None = None,
    calibrate: Mapping[str, Metres] | Sequence[tuple[str | Path, Metres]] = (),
    estimator: str | None = None,
    window: Positive[Seconds] | None = None,
    hop: Positive[Seconds] | None = None,
    settings: Sequence[str] = (),
    each: Callable[[Place], object] | None = None,
    **options: Any,
) -> Located:
    """Locate where a recorded string is stopped, as on a guitar, or where a sensor is touched.

    With `length` and `open`, position follows from pitch alone, x = L (1 - f_open / f): the sound must be of
    that string, pressed down, and one note at a time. A light touch at a node (a natural harmonic) and a bend
    have the pitch of another place, which is then stated. With a sensor, or with two channels that carry one
    segment each, both segments tell.

    Parameters
    ----------
    recording
        A sound file of any format that libsndfile reads (wav, flac, mp3, ogg, aiff), a session, an array
        (channels, samples) or (samples,) with ``sample_rate=`` in Hz, or another input of `listen` that ends.
    model
        A trained model's folder, or a bundled one such as ``"demo"``; by default, nothing learned is used.
    length
        Length of the string from nut to bridge, in m.
    open
        Pitch of the open string: a note such as ``"E2"``, ``"Bb2"``, ``"E4+12"`` (cents), or a number of Hz.
    string, sensor
        A preset in place of `length` and `open`, or of the sensor.
    calibrate
        Recordings of known places: path and position in m from the nut.
    estimator
        Name of an estimator, if there is no model; ``"closed_form"`` by default.
    window, hop
        Length of a window, 0.1 s or the model's by default, and distance of windows, 0.01 s, in s.
    settings
        Overrides of settings, such as ``"estimator.reach=0.7"``.
    each
        Function that is called with the `Place` of each window in turn.
    options
        Options of the source, such as ``sample_rate=44100`` or ``allow_truncated=True``.

    Returns
    -------
    Located
        A row for each window: time, position, standard error, frequency, fret, note, or the reason why there
        is no position; with `lines`, `draw` and `to_pandas`.

    Raises
    ------
    InputError
        If the recording cannot be read, is shorter than a window, or the string is not known.

    Examples
    --------
    An A string of 0.65 m, stopped so that an E sounds:

    >>> import numpy as np
    >>> time = np.arange(22050) / 44100
    >>> note = sum(0.2 / n * np.exp(-n * time) * np.sin(2 * np.pi * 164.81 * n * time) for n in range(1, 12))
    >>> import monochord as mc
    >>> places = mc.locate(note, sample_rate=44100, length=0.65, open="A2")
    >>> places
    Located(41 windows, 41 with a position: 216.2 mm from the nut (median))
    >>> [(round(each.fret, 1), each.note) for each in places.held_notes()]
    [(7.0, 'E3+0')]
    """
    refuse_string_twice(string, sensor, length, open)
    tree: Tree = {"sinks": {}}
    put_estimator(
        tree,
        model,
        estimator=estimator,
        length=length,
        open_frequency=None if open is None else pitch(open),
        string=string,
        sensor=sensor,
        window=window,
        hop=hop,
    )
    file = None if _names_source(recording) else recording
    if isinstance(file, str | Path):
        tree["source"] = {**recording_table(file), **options}
    takes = [*(calibrate.items() if isinstance(calibrate, Mapping) else calibrate)]
    setup = LiveRun.read(calibrated(override(tree, settings), takes))
    if not isinstance(file, str | Path):
        setup = replace(setup, source=source_of(recording, dict(options), setup.window, setup.seconds))
    places = _Places(setup, each, by_pitch=model is None)
    summary = run(replace(setup, sinks=(places,)))
    if not (summary.windows or summary.skipped or summary.interrupted):
        given = f"{file if isinstance(file, str | Path) else 'sound'} (shorter than a window)"
        least = min(setup.window.length, setup.seconds)
        raise InputError(given, f"{least:g} s or more", "use a shorter --window")
    simulated = places.has_truth  # of a source that is no recording, which then simulates
    if isinstance(file, str | Path) and recording_table(file)["name"] == RECORDINGS[".mcap"]:
        simulated = read_session(file).description.simulated
    return replace(places.located(), simulated=simulated, interrupted=summary.interrupted)


class _Places(Listener):
    """Collects the windows of a recording, and calls `each` with the place in each.

    `by_pitch` says that no model is used.
    """

    def __init__(self, setup: LiveRun, each: Callable[[Place], object] | None, *, by_pitch: bool) -> None:
        self._setup, self._each, self._by_pitch = setup, each, by_pitch
        self._starts, self._times = array("q"), array("d")
        self._values = {name: (array("d"), array("d")) for name in UNITS}
        self._reasons: list[str] = []
        self._inputs: Counter[str] = Counter()
        self._sounding = 0
        self._kept, self._every = list[Window](), 1
        self.has_truth = False

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        """Take the format of the sound, with the string."""
        string, option = run.signal.string, getattr(self._setup.estimator, "open_frequency", None)
        self._channels = run.signal.channels
        self._length: Metres = run.length or (string.length if string else math.nan)
        self._open: Hertz = option or (open_frequency(string) if string else math.nan)
        self._stopped = run.signal.channels == 1 or option is not None
        yield self

    @property
    def _has_frets(self) -> bool:
        return self._stopped and self._by_pitch

    def write(self, update: Update) -> None:
        """Add one window."""
        position, frequency = (update.prediction.estimate(name) for name in ("position", "frequency"))
        fret = Estimate.abstain("", Reason.NOT_STOPPED)
        if self._has_frets and position.valid and CONTACT not in update.prediction.estimates:
            number = 12.0 * math.log2(frequency.value / self._open)
            fret = Estimate(value=number, std=FRETS * frequency.std / frequency.value, unit="")
        for (values, stds), estimate in zip(self._values.values(), (position, frequency, fret), strict=True):
            values.append(estimate.value)
            stds.append(estimate.std)
        place = Place(
            time=update.time,
            position=position.value,
            std=position.std,
            frequency=frequency.value,
            fret=fret.value,
            note=pitch_name(frequency.value) if fret.valid else "",
            reason="" if position.valid else position.reason or Reason.NOT_GIVEN,
        )
        self._starts.append(update.start)
        self._times.append(update.time)
        self._reasons.append(place.reason)
        self._inputs.update(each.sentence for each in update.notes if each.key in INPUT_NOTES)
        self.has_truth |= bool(update.truth)
        if not position.valid and not unusable_reason(update.window):
            self._keep(update.window)
        if self._each is not None:
            self._each(place)

    def _keep(self, window: Window) -> None:
        """Count a window with sound, and keep one in so many of these."""
        if self._sounding % self._every == 0:
            self._kept.append(window)
        self._sounding += 1
        if len(self._kept) > SAMPLED:
            self._kept, self._every = self._kept[::2], 2 * self._every

    def located(self) -> Located:
        """Return the table of the windows."""
        table = self._table()
        valid = int(table.position.valid.sum())
        return Located(
            table=table,
            origin=NUT if self._stopped else PICKUP,
            length=self._length,
            open_frequency=self._open,
            window=self._setup.window.length,
            assumptions=self._assumptions(table) if self._has_frets else (),
            inputs=tuple(text for text, count in self._inputs.items() if count >= LASTING * len(table)),
            heard=self._heard(valid) if self._has_frets else "",
        )

    def _table(self) -> PredictionTable:
        reason = np.array(self._reasons, np.str_)
        estimates: dict[str, EstimateColumn] = {}
        for name, arrays in self._values.items():
            value, std = map(np.array, arrays)
            known = np.isfinite(value)
            why = np.where(known, "", np.where(reason == Reason.NONE, Reason.NOT_STOPPED, reason))
            for each in (value, std, known, why):
                each.flags.writeable = False
            estimates[name] = EstimateColumn(value=value, std=std, valid=known, reason=why, unit=UNITS[name])
        start, time = np.array(self._starts, np.int64), np.array(self._times)
        return PredictionTable(start=start, time=time, estimates=estimates)

    def _assumptions(self, table: PredictionTable) -> tuple[str, ...]:
        """Return what positions on a stopped string assume."""
        said = [
            "assumes                  the sound is this string's, pressed down: its pitch tells the place;",
            "                         a light touch at a node (harmonic) or a bend reads as another place",
        ]
        one_note, places = table.fret.valid, table.position
        rows = zip(places.value[one_note].tolist(), places.std[one_note].tolist(), strict=True)
        nodes = (light_touch(position, self._length, 2.0 * std) for position, std in rows)
        for n, count in Counter(n for n in nodes if n is not None).most_common(1):
            place = f"at 1/{n}, {1e3 * self._length / n:.2f} mm: the same note, in {count} windows"
            said.append(f"or lightly touched       {place}")
        if self._channels == 2:
            valid, one = int(places.valid.sum()), int(one_note.sum())
            split = f"one note in {one}, two segments in {valid - one} of {valid} windows"
            said.insert(0, f"both channels carry      {split}")
        return tuple(said)

    def _heard(self, valid: int) -> str:
        """Return what sounds instead of this string, empty where a fifth or more of the sound is answered."""
        sounding, nominal = valid + self._sounding, self._open
        if not sounding or valid >= FEW * sounding:
            return ""
        few = f"{100 * valid / sounding:.0f} % of windows with sound have a position"
        dominant = _dominant(self._kept)
        doubt = "not this string?         "
        if dominant is None:
            return f"{doubt}{few}, and no single note dominates; the open string is {_named(nominal)}"
        frequency, share = dominant
        highest = nominal / (1.0 - getattr(self._setup.estimator, "reach", 1.0 - nominal / HIGHEST))
        most = f"{100 * share:.0f} % of the others sound as {_named(frequency)}"
        if nominal * FLAT < frequency < highest:
            return f"few positions            {few}; {most}, which this string has"
        return f"{doubt}{few}; {most}; this string has {_named(nominal)} to {_named(highest)}"


def _dominant(windows: Sequence[Window]) -> tuple[Hertz, float] | None:
    """Return the note that most windows sound as, and their share; None where no note has half of them."""
    if not windows:
        return None
    size, rate = windows[0].samples.shape[1], windows[0].sample_rate
    finder = PitchFinder(sample_rate=rate, size=size, lowest=LOWEST, highest=min(HIGHEST, 0.2 * rate))
    best = [next(iter(finder.find(window.samples.astype(np.float64))), None) for window in windows]
    heard = np.array([each.frequency for each in best if each and each.evidence >= MIN_EVIDENCE])
    if not len(heard):
        return None
    near = np.abs(12.0 * np.log2(heard / heard[:, None])) <= SAME_FRET
    most = near[np.argmax(near.sum(axis=1))]
    share = float(most.sum()) / len(windows)
    return (float(np.median(heard[most])), share) if share >= DOMINANT else None


def _named(frequency: Hertz) -> str:
    return f"{pitch_name(frequency)} ({frequency:.1f} Hz)"


def _names_source(recording: Listenable) -> bool:
    return isinstance(recording, str) and recording.replace("-", "_") in SOURCES.names()
