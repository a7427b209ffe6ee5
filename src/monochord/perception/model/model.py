"""The model: features, scaling and heads in one frozen object, offline and live."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from monochord.core.errors import InputError
from monochord.core.identity import calibrated_elsewhere
from monochord.core.labels import LabelTrack, window_labels
from monochord.core.notebook import html_table, lines
from monochord.core.ranges import Checked, Count, Finite, NonNegative, Pair, Positive, SampleRate, checked
from monochord.core.shapes import refuse_other_channels
from monochord.core.shapes import sound as checked_sound
from monochord.core.types import (
    Audio,
    Block,
    Estimates,
    Floats,
    Signal,
    StringParams,
    Window,
)
from monochord.core.units import Metres, Samples, Seconds
from monochord.core.windows import windows
from monochord.dsp.resample import resampled
from monochord.metrics import hit_rate
from monochord.perception.features.base import RecurrentExtractor
from monochord.perception.model.correction import Correction
from monochord.perception.model.definition import Definition
from monochord.perception.model.network import HeadOutput
from monochord.perception.model.prepared import PreparedModel
from monochord.perception.model.saving import save
from monochord.perception.model.state import ModelState
from monochord.perception.model.stepping import model_input, read_all, step_all
from monochord.perception.model.stream import FixedPitchStream, FollowedPitchStream, ModelStream
from monochord.perception.model.summary import brief, facts
from monochord.perception.model.table import PredictionTable
from monochord.perception.tuning.sessions import refuse_foreign
from monochord.physics.sensors import Sensor, as_sensor, with_sensor
from monochord.physics.strings import load_string

_log = logging.getLogger("monochord")
MAX_RETUNING = 0.12
"""Largest relative deviation of a string's pitch from the training's, if that is known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Model(Checked):
    """A trained model: `predict` estimates a whole sound, `step` a single window.

    The model is immutable. The state of a stream is passed in and out of `step`.

    Parameters
    ----------
    definition
        Everything except the learned weights.
    weights
        Arrays float32 with the names and shapes of `Definition.shapes`.
    string
        The string at its present tuning and length; None for the training's. Features are relative to its
        pitch, and positions to its length.
    length_std
        The standard error of its length in m, where it was measured; None for a length that is the design's.
    sensing_range
        The positions that the sensor can estimate, in m; None if the sensor does not state them. See
        `places`.

    Examples
    --------
    >>> from monochord.perception.model import load
    >>> model, state = load("demo"), ModelState()
    >>> silence = np.zeros((2, model.definition.window), np.float32)
    >>> window = Window(samples=silence, start=0, sample_rate=44100, has_gap=False)
    >>> state, estimates = model.step(state, window)
    >>> estimates["position"].reason
    'silence'
    """

    definition: Definition
    weights: Mapping[str, Audio]
    string: StringParams | None = None
    length_std: NonNegative[Metres] | None = None
    sensing_range: Pair[Finite[Metres]] | None = None

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        for name, shape in self.definition.shapes().items():
            if ".correction." in name and name not in self.weights:
                continue  # it is learned from the outputs of the model
            if name not in self.weights or self.weights[name].shape != shape:
                given = (
                    f"weights with {name} of shape {self.weights[name].shape}"
                    if name in self.weights
                    else f"weights without {name}"
                )
                raise InputError(given, f"{name} {shape}, as the definition says")

    @cached_property
    def prepared(self) -> PreparedModel:
        """The model made ready for its string."""
        return PreparedModel(
            definition=self.definition,
            weights=self.weights,
            string=self.string,
            length_std=self.length_std,
            sensing_range=self.sensing_range,
        )

    @property
    def tick(self) -> Seconds | None:
        """Time in s between the windows that its memory hears; None for a model without memory.

        Windows in between are read as well, and leave the memory unchanged; fewer tell it less.
        """
        extractor = self.prepared.extractor
        return extractor.tick if isinstance(extractor, RecurrentExtractor) else None

    @property
    def places(self) -> tuple[Metres, Metres] | None:
        """The range of positions that are stated, on a string of the training's length, in m; None for any.

        It is the overlap of sensor and training. A sensor states its range in m, the training in shares of
        the string.
        """
        return self.prepared.places

    @checked
    def tuned(self, string: StringParams) -> "Model":
        """Return the model for a string at this tuning and length; features are relative to its pitch.

        The wire is the training's; its tension follows the open frequency. Positions scale with the length.
        The training's pitch and length give the same bits.

        Raises
        ------
        InputError
            If the pitch deviates from the training's by more than a tuning can be estimated.
        """
        retuned_string = self.prepared.tuned(string).string
        return self if retuned_string == self.string else replace(self, string=retuned_string)

    @checked
    def within(self, sensing_range: Pair[Finite[Metres]]) -> "Model":
        """Return the model for a sensor with this sensing range, in m.

        Raises
        ------
        InputError
            If the range does not overlap the training's.
        """
        model = replace(self, sensing_range=sensing_range)
        if model.places is not None and not model.places[0] < model.places[1]:
            stated, trained = (
                " to ".join(f"{1e3 * place:g}" for place in each or ())
                for each in (sensing_range, self.definition.sensing_range)
            )
            given = f"a sensor with a range of {stated} mm for a model"
            allowed = f"a part of {trained} mm, as it was trained"
            raise InputError(given, allowed, "train a model for the sensor")
        return model

    def takes(self, string: StringParams, sensing_range: tuple[Metres, Metres]) -> bool:
        """Return whether the model takes a string of this length and pitch, and this sensing range in m.

        Examples
        --------
        >>> from monochord.perception.model import load
        >>> from monochord.physics.sensors import with_length
        >>> string = load_string("prototype").string
        >>> [load("demo").takes(with_length(string, each), (0.05, 0.15)) for each in (0.19, 0.2)]
        [False, True]
        """
        try:
            if self.definition.string is not None:
                refuse_foreign(string, self.definition.string)
            self.tuned(string).within(sensing_range)
        except InputError:
            return False
        return True

    @checked
    def check(self, signal: Signal, size: Count | None = None) -> None:
        """Check that the model fits a signal in windows of `size` frames, and prepare the features.

        Without this call, tables and filters of the features are computed at the first prediction.

        Raises
        ------
        InputError
            If the sample rate, channels, string or window differ from the training's, or a feature has
            changed since the training.
        """
        trained = self.definition
        if signal.sample_rate != trained.sample_rate:
            given = f"sound at {signal.sample_rate} Hz for a model"
            remedy = "record at this rate, or resample a session: monochord sessions resample"
            raise InputError(given, f"{trained.sample_rate} Hz, as it was trained", remedy)
        refuse_other_channels(signal.channels, trained.channels, "for a model")
        if trained.string and signal.string:
            refuse_foreign(signal.string, trained.string)
        if size is not None:
            self.prepared.check_size(size)
        _ = self.prepared.extractor

    @checked
    def predict(
        self,
        sound: ArrayLike,
        *,
        sample_rate: SampleRate = 44100,
        hop: Positive[Seconds] = 0.01,
        sensor: str | Path | Sensor = "",
        string: str | Path = "",
    ) -> PredictionTable:
        """Return the estimates for every window of a sound, as the live loop computes them.

        The sound is a stream of its own. The model remembers the windows before and follows the string's
        pitch from the beginning of the sound, so an untouched first second improves the estimates.

        Parameters
        ----------
        sound
            Samples (channels, n), full scale is 1; float32 or convertible to it.
        sample_rate
            In Hz; sound at a higher rate than the training's is resampled, as live.
        hop
            Time from one window start to the next, in s. Windows have the training's length.
        sensor
            The sensor, for its string: a `Sensor`, a preset's name, or a file that ``monochord tune`` wrote.
        string
            A string preset; used if no sensor is given.

        Returns
        -------
        PredictionTable
            A row for each window; row k starts at time k `hop`.

        Raises
        ------
        InputError
            If the sound is shorter than a window, or its shape, rate or string does not fit the training.

        Examples
        --------
        >>> from monochord.perception.model import load
        >>> table = load("demo").predict(np.zeros((2, 8820)), sample_rate=44100)
        >>> len(table), table.position.valid.any(), str(table.position.reason[0])
        (11, np.False_, 'silence')
        """
        samples = checked_sound(sound)
        blocks, trained_rate = [Block(samples=samples, start=0)], self.definition.sample_rate
        if sample_rate > trained_rate:
            blocks = [*resampled(blocks, sample_rate=sample_rate, new_rate=trained_rate)]
            sample_rate = trained_rate
        size, step = self.definition.window, round(hop * sample_rate)
        if step < 1:
            raise InputError(f"hop {hop:g} s", f"at least one sample, {1.0 / sample_rate:.1g} s")
        signal = Signal(sample_rate=sample_rate, channels=samples.shape[0])
        if sensor:
            signal = with_sensor(signal, as_sensor(sensor))
        elif string:
            signal = replace(signal, string=load_string(string).string)
        estimate = self.stream(signal, size)
        frames = blocks[-1].start + blocks[-1].samples.shape[1]
        if frames < size:
            given = f"sound of {frames} frames"
            raise InputError(given, f"at least one window, {size} frames")
        starts: list[int] = []
        rows: list[Estimates] = []
        for window in windows(blocks, size=size, hop=step, sample_rate=sample_rate):
            estimates = estimate(window)
            starts.append(window.start)
            rows.append({name: estimates[name] for name in self.definition.heads})
        return PredictionTable.of(starts, sample_rate, rows)

    @checked
    def score(
        self,
        sound: ArrayLike,
        truth: LabelTrack | Mapping[str, Floats],
        *,
        sample_rate: SampleRate = 44100,
        hop: Positive[Seconds] = 0.01,
        sensor: str | Path | Sensor = "",
        string: str | Path = "",
        tolerance: NonNegative[Metres] = 0.005,
    ) -> float:
        """Return the share of touched windows whose position is estimated within a tolerance, 0 to 1.

        An abstention is a miss. Higher is better, as in scikit-learn. Windows that contain the beginning or
        the end of a touch do not count.

        Parameters
        ----------
        sound, sample_rate, hop, sensor, string
            As in `predict`.
        truth
            Arrays (n,) for n samples by name, ``contact`` (0 or 1) and ``position`` in m, as
            `VirtualSensor.advance` returns them; or a `LabelTrack`, with times in s from the sound's
            beginning.
        tolerance
            Largest error of a hit, in m.

        Raises
        ------
        InputError
            If no window is touched at a known position, or `predict` refuses the sound.

        Examples
        --------
        >>> from monochord.physics.twin.virtual_sensor import VirtualSensor
        >>> from monochord.perception.model import load
        >>> twin = VirtualSensor("prototype", seed=1)
        >>> _ = twin.press(0.09, 1.0, material="plastic")
        >>> sound, truth = twin.advance(1.0)
        >>> load("demo").score(sound, truth, sensor="prototype") > 0.5
        True
        """
        frames = checked_sound(sound).shape[1]
        track = truth if isinstance(truth, LabelTrack) else _track(frames, sample_rate, truth)
        table = self.predict(sound, sample_rate=sample_rate, hop=hop, sensor=sensor, string=string)
        end = table.time + self.definition.window / self.definition.sample_rate
        labels = window_labels(track, table.time, end)
        rows = np.isfinite(labels["position"])
        if self.definition.place is None or not rows.any():
            given = "a sound without a touch at a known position"
            raise InputError(given, "truth with contact and position")
        return hit_rate(labels["position"][rows], table[self.definition.place].value[rows], tolerance)

    @checked
    def save(self, folder: str | Path) -> "Model":
        """Save the model in a folder, which `load` reads, and return the model with its checksum.

        The same model gives the same bytes. A model in the folder is replaced.

        Raises
        ------
        InputError
            If the folder cannot be written.

        Examples
        --------
        >>> from tempfile import TemporaryDirectory
        >>> from monochord.perception.model import load
        >>> with TemporaryDirectory() as folder:
        ...     saved = load("demo").save(f"{folder}/mine")
        ...     load(f"{folder}/mine").definition == saved.definition
        True
        """
        try:
            return replace(self, definition=save(self.definition, self.weights, Path(folder)))
        except OSError as error:
            raise InputError(f"folder {folder} ({error.strerror})", "a writable folder") from error

    @checked
    def stream(self, signal: Signal, size: Count) -> ModelStream:
        """Return the model for one stream of windows in order, as the live loop runs it.

        Call the result with each window of `size` frames to get the estimates. Features are relative to the
        tuning of the signal's sensor. If untouched windows show another tuning, features follow it.

        Raises
        ------
        InputError
            If the sample rate, channels, string or window differ from the training's.
        """
        if said := calibrated_elsewhere(self.definition.calibrated_on, signal.sensor):
            _log.warning("monochord: %s", said)
        model = self.tuned(signal.string) if signal.string else self
        model = replace(model, length_std=signal.length_std)
        model = model.within(signal.sensing_range) if signal.sensing_range else model
        model.check(signal, size)
        string = model.string or model.definition.string
        if string is not None and model.definition.channels == 2:
            signal_on_string = Signal(sample_rate=signal.sample_rate, channels=2, string=string)
            try:
                return FollowedPitchStream(model.prepared, signal_on_string, size)
            except InputError:  # windows too short for a pitch
                pass
        return FixedPitchStream(model.prepared)

    def __repr__(self) -> str:
        return lines(*brief(self.definition))

    def _repr_html_(self) -> str:
        return html_table(*facts(self.definition))

    @checked
    def step(self, state: ModelState, window: Window) -> tuple[ModelState, Estimates]:
        """Return the state after a window, and the window's estimates.

        Parameters
        ----------
        state
            The state before the window; ``ModelState()`` at the start. A window that starts no later than its
            predecessor begins another stream.
        window
            A window of the training's length.

        Raises
        ------
        InputError
            If the window has another length.
        """
        return step_all([model_input(self.prepared, state, window)])[0]

    @checked
    def outputs(self, state: ModelState, window: Window) -> tuple[ModelState, Mapping[str, HeadOutput]]:
        """Return the state after a window, and the output of each head before calibration and correction.

        An unusable window has no outputs, and is not remembered.
        """
        (reading,) = read_all([model_input(self.prepared, state, window)])
        return reading.state, reading.outputs

    @staticmethod
    @checked
    def step_all(
        streams: Sequence[tuple["Model", ModelState]], windows: Sequence[Window]
    ) -> list[tuple[ModelState, Estimates]]:
        """Return the result of `step` for one window of each of several streams, with the same bits.

        All heads are computed at once. Therefore all models must come from one trained model; each may be
        tuned to another string.

        Parameters
        ----------
        streams
            The model of each stream, and its state before the window.
        windows
            The window of each stream, of the training's length.
        """
        pairs = zip(streams, windows, strict=True)
        return step_all([model_input(model.prepared, state, window) for (model, state), window in pairs])

    @property
    def corrections(self) -> dict[str, Correction]:
        """The corrections, by head; heads without a correction are absent."""
        return self.prepared.corrections

    @checked
    def correction(self, name: str) -> Correction | None:
        """Return the correction of a head, None if it has none; raises `InputError` for an unknown head."""
        return self.prepared.correction(name)


def _track(frames: Samples, sample_rate: int, truth: Mapping[str, Floats]) -> LabelTrack:
    """Return labels (n,), one a sample, on the clock of the sound."""
    columns = {name: np.asarray(values, np.float64) for name, values in truth.items()}
    for name in ("contact", "position"):
        if name not in columns or columns[name].shape != (frames,):
            given = (
                f"truth with {name} of shape {columns[name].shape}"
                if name in columns
                else f"truth without {name}"
            )
            raise InputError(given, f"{name} ({frames},), one value per sample")
    return LabelTrack(time=np.arange(frames) / sample_rate, columns=columns)
