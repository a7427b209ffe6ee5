"""A model made ready for a string: all that its windows need is derived once."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Indices, Signal, StringParams
from monochord.core.units import Metres, Samples
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor
from monochord.perception.model.correction import Correction
from monochord.perception.model.definition import Definition, FeatureRecord
from monochord.perception.model.forest import NO_FOREST
from monochord.perception.model.network import HeadNetwork
from monochord.perception.model.probe import probed, refuse_another
from monochord.perception.tuning.sessions import at_length_of, force_scale
from monochord.physics.sensors import retuned, with_length
from monochord.physics.theory import open_frequency

MAX_RETUNING = 0.12
"""Largest relative deviation of a string's pitch from the training's, if that is known."""


class CorrectionVariables(NamedTuple):
    """Where a correction's variables stand: `columns`, less another column for those at `differences`."""

    columns: Indices
    differences: Indices
    less: Indices

    def of(self, row: Audio) -> Floats:
        """Return the variables of a window from its features (columns,)."""
        values = row[self.columns].astype(np.float64)
        values[self.differences] -= row[self.less]
        return values


@dataclass(frozen=True, kw_only=True, eq=False)
class PreparedModel:
    """A definition and its weights on a string; parameters as those of `monochord.perception.model.Model`."""

    definition: Definition
    weights: Mapping[str, Audio]
    string: StringParams | None = None
    length_std: Metres | None = None
    sensing_range: tuple[Metres, Metres] | None = None

    def tuned(self, string: StringParams) -> "PreparedModel":
        """Return the model for a string at this tuning and length; see `monochord.Model.tuned`."""
        trained = self.definition.string
        if trained is None:
            return self
        pitch, known = open_frequency(string), open_frequency(trained)
        if not abs(pitch / known - 1.0) <= MAX_RETUNING:
            given = f"a string tuned to {pitch:.1f} Hz for a model"
            allowed = f"within {100.0 * MAX_RETUNING:.0f} % of {known:.1f} Hz, as it was trained"
            raise InputError(given, allowed, "tune the sensor, or train a model for it")
        if pitch == known and string.length == trained.length:
            return self
        return replace(self, string=retuned(with_length(trained, string.length), pitch))

    @cached_property
    def length_scale(self) -> float:
        """The length of the string over that of the training."""
        trained = self.definition.string
        return 1.0 if self.string is None or trained is None else self.string.length / trained.length

    @cached_property
    def places(self) -> tuple[Metres, Metres] | None:
        """The range of positions that are stated, on a string of the training's length, in m; None for any.

        It is the overlap of sensor and training. A sensor states its range in m, the training in shares of
        the string.
        """
        stated, trained = self.sensing_range, self.definition.sensing_range
        stated = stated and (stated[0] / self.length_scale, stated[1] / self.length_scale)
        if stated is None or trained is None:
            return stated or trained
        return max(stated[0], trained[0]), min(stated[1], trained[1])

    def check_size(self, size: Samples) -> None:
        """Raise `InputError` if a window size in frames differs from the training's."""
        trained = self.definition
        if size != trained.window:
            remedy = f"set --window {trained.window / trained.sample_rate:g}"
            allowed = f"{trained.window} frames at {trained.sample_rate} Hz"
            raise InputError(f"windows of {size} frames for a model", allowed, remedy)

    @cached_property
    def corrections(self) -> dict[str, Correction]:
        """The corrections, by head, their kernels compiled; heads without a correction are absent."""
        names = self.definition.heads
        found = {name: correction for name in names if (correction := self.correction(name))}
        for name, correction in found.items():  # else the first touch of a stream would wait for them
            if count := self.variables[name].columns.size:
                correction.error(np.zeros(count))
        return found

    def correction(self, name: str) -> Correction | None:
        """Return the correction of a head, None if it has none; raises `InputError` for an unknown head."""
        if name not in self.definition.heads:
            raise InputError(f"head '{name}'", ", ".join(self.definition.heads))
        record = self.definition.heads[name].correction
        if record is None:
            return None
        centre, scale, mean, covariance = (
            self.weights[f"{name}.correction.{each}"].astype(np.float64)
            for each in ("centre", "scale", "mean", "covariance")
        )
        return Correction(
            centre=centre,
            scale=scale,
            mean=mean,
            covariance=covariance,
            noise=record.noise,
            forest=self.weights.get(f"{name}.correction.forest", NO_FOREST),
        )

    @cached_property
    def gate(self) -> str:
        """The head that estimates contact."""
        return self.definition.gate

    @cached_property
    def place(self) -> str | None:
        """The head that estimates position; None without one."""
        return self.definition.place

    @cached_property
    def shape(self) -> tuple[int, int]:
        """The shape of a window."""
        return self.definition.channels, self.definition.window

    @cached_property
    def network(self) -> HeadNetwork:
        """The network of all heads."""
        return HeadNetwork.of(self.definition, self.weights)

    @cached_property
    def extractor(self) -> Extractor:
        """The extractor of the feature, checked against the training."""
        trained, record = self.definition, self.definition.feature
        signal = Signal(sample_rate=trained.sample_rate, channels=trained.channels, string=trained.string)
        feature = FEATURES.build(record.name, record.options)
        prepared = feature.prepare(signal, trained.window)
        _refuse_other_columns(record, prepared.columns)
        values = probed(prepared, trained.channels, trained.window)
        refuse_another(record.name, values, self.weights["scaler.probe"], self.weights["scaler.scale"])
        if self.string is None:
            return prepared
        reference = at_length_of(self.string, trained.string) if trained.string else self.string
        return feature.prepare(replace(signal, string=reference, design=trained.string), trained.window)

    @cached_property
    def length_and_error(self) -> tuple[float, float]:
        """The string's length over that of the training, and its relative standard error."""
        share, name = self.definition.length_std, self.place
        scale, trained = self.length_scale, self.definition.string
        correction = self.definition.heads[name].correction if name else None
        if correction is not None and correction.touches:
            share = 0.0
        elif self.length_std is not None and trained is not None:
            share = self.length_std / (scale * trained.length)
        return scale, share

    @cached_property
    def force_scale(self) -> float | None:
        """Forces on the string over those on the training's; None without a string of its own."""
        string, trained = self.string, self.definition.string
        return None if string is None or trained is None else force_scale(string, trained)

    @cached_property
    def variables(self) -> dict[str, CorrectionVariables]:
        """The variables of each correction; see `Definition.variables_of`."""
        variables: dict[str, CorrectionVariables] = {}
        for name, record in self.definition.heads.items():
            if record.correction:
                pairs = np.array(self.definition.variables_of(name), np.int64).reshape(-1, 2)
                less = np.flatnonzero(pairs[:, 1] >= 0)
                variables[name] = CorrectionVariables(pairs[:, 0], less, pairs[less, 1])
        return variables

    @cached_property
    def refined(self) -> dict[str, tuple[int, float]]:
        """The column that each head refines, and the string's length in units of the head's scale."""
        refined: dict[str, tuple[int, float]] = {}
        for name, record in self.definition.heads.items():
            column, string = self.definition.refined(name), self.definition.string
            if column is not None and string is not None:
                refined[name] = column, string.length / record.scale
        return refined

    @cached_property
    def fault_limits(self) -> Floats:
        """The limit (faults,) of the log odds of each fault; empty without any."""
        return np.array(self.definition.faults.limits if self.definition.faults else ())

    @cached_property
    def fault_columns(self) -> Indices:
        """The columns of the kinds; see `Definition.fault_columns`."""
        return np.array(self.definition.fault_columns, np.int64)


def _refuse_other_columns(record: FeatureRecord, columns: tuple[str, ...]) -> None:
    if columns == record.columns:
        return
    pairs = zip(columns, record.columns, strict=False)
    first = next((f", '{trained}' where there is '{now}'" for now, trained in pairs if now != trained), "")
    given = f"feature '{record.name}' of {len(columns)} columns"
    raise InputError(given, f"the {len(record.columns)} columns of the training{first}", "train again")
