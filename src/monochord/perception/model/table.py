"""A model's predictions for a sound as a table: a row for each window, a column for each estimate."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import DTypeLike, NDArray

from monochord.core.errors import InputError, MissingLibraryError, did_you_mean
from monochord.core.notebook import html_table, panels
from monochord.core.ranges import Checked, SampleRate, checked
from monochord.core.types import Estimate, Estimates, Flags, Floats, Indices, Prediction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

SHOWN = 10
"""Number of rows that a notebook shows from each end of a table."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EstimateColumn:
    """One estimate in every window (n,). NumPy functions use its values.

    Attributes
    ----------
    value, std
        The estimates and their standard errors in `unit`; NaN where invalid.
    valid
        Whether the window has an estimate.
    reason
        Why the window has no estimate, as text; empty where valid.
    unit
        The unit, such as ``"m"`` or ``"N"``; empty for a probability.
    """

    value: Floats
    std: Floats
    valid: Flags
    reason: NDArray[np.str_]
    unit: str

    def __len__(self) -> int:
        return len(self.value)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:  # noqa: FBT001
        return np.array(self.value, dtype, copy=copy)

    def __getitem__(self, index: int) -> Estimate:
        """Return the estimate in one window."""
        return Estimate(
            value=float(self.value[index]),
            std=float(self.std[index]),
            unit=self.unit,
            valid=bool(self.valid[index]),
            reason=str(self.reason[index]),
        )

    def __repr__(self) -> str:
        unit = f" in {self.unit}" if self.unit else ""
        return f"EstimateColumn({len(self)} windows{unit}, {int(self.valid.sum())} valid)"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PredictionTable(Checked):
    """A model's estimates for a sound: an immutable table with a row for each window.

    ``len(table)`` is the number of windows. Iteration yields a `Prediction` for each window.
    ``table["position"]`` or ``table.position`` is a column with the arrays (n,) ``value``, ``std``, ``valid``
    and ``reason``.

    Attributes
    ----------
    start
        First frame (n,) of each window.
    time
        Start (n,) of each window, in s from the sound's beginning.
    estimates
        The columns, by name of the estimate.

    Examples
    --------
    >>> place = Estimate(value=0.08, std=1e-4, unit="m")
    >>> none = Estimate.abstain("m", "silence")
    >>> table = PredictionTable.of([0, 441], 44100, [{"position": place}, {"position": none}])
    >>> table.position.value, table["position"].reason.tolist()
    (array([0.08,  nan]), ['', 'silence'])
    >>> [row.time for row in table if row["position"].valid]
    [0.0]
    """

    start: Indices
    time: Floats
    estimates: Mapping[str, EstimateColumn]

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        shapes = {
            each.shape for each in (self.start, self.time, *(one.value for one in self.estimates.values()))
        }
        if shapes != {(self.start.size,)}:
            given = f"columns of shapes {', '.join(map(str, sorted(shapes)))}"
            raise InputError(given, "(n,), one value for each window")

    @classmethod
    @checked
    def of(
        cls, starts: Sequence[int], sample_rate: SampleRate, rows: Sequence[Estimates]
    ) -> "PredictionTable":
        """Return the table for windows with these first frames and estimates.

        All rows have estimates of the same names. `sample_rate` is in Hz.
        """
        columns: dict[str, EstimateColumn] = {}
        for name in rows[0] if rows else ():
            each = [row[name] for row in rows]
            columns[name] = EstimateColumn(
                value=_fixed(np.array([one.value for one in each], np.float64)),
                std=_fixed(np.array([one.std for one in each], np.float64)),
                valid=_fixed(np.array([one.valid for one in each], np.bool_)),
                reason=_fixed(np.array([one.reason for one in each], np.str_)),
                unit=each[0].unit,
            )
        start = np.array(starts, np.int64)
        return cls(start=_fixed(start), time=_fixed(start / sample_rate), estimates=columns)

    def __len__(self) -> int:
        return len(self.start)

    def __iter__(self) -> Iterator[Prediction]:
        return map(self._row, range(len(self)))

    @overload
    def __getitem__(self, key: str) -> EstimateColumn: ...
    @overload
    def __getitem__(self, key: int) -> Prediction: ...
    @checked
    def __getitem__(self, key: str | int) -> EstimateColumn | Prediction:
        """Return a column by name, or a row by index.

        Raises
        ------
        InputError
            If no column has this name.
        IndexError
            If no row has this index.
        """
        if not isinstance(key, str):
            return self._row(range(len(self))[key])
        if key not in self.estimates:
            names = tuple(self.estimates)
            raise InputError(f"estimate '{key}'", ", ".join(names), did_you_mean(key, names))
        return self.estimates[key]

    def __getattr__(self, name: str) -> EstimateColumn:
        if name.startswith("_") or name == "estimates" or name not in self.estimates:
            raise AttributeError(f"'{name}' is not estimated")
        return self.estimates[name]

    def __dir__(self) -> list[str]:
        return [*object.__dir__(self), *self.estimates]

    def _row(self, index: int) -> Prediction:
        return Prediction(
            start=int(self.start[index]),
            time=float(self.time[index]),
            estimates={name: column[index] for name, column in self.estimates.items()},
        )

    def to_pandas(self) -> "DataFrame":
        """Return a data frame indexed by time in s, with four columns for each estimate.

        The columns of position are ``position``, ``position_std``, ``position_valid`` and
        ``position_reason``.

        Raises
        ------
        MissingLibraryError
            If pandas is not installed; the error says how to install it.
        """
        try:
            from pandas import DataFrame, Index  # noqa: PLC0415
        except ImportError as error:
            raise MissingLibraryError("A data frame", "pandas >= 2.2", "pandas") from error
        columns: dict[str, NDArray[Any]] = {}
        for name, column in self.estimates.items():
            columns |= {name: column.value, f"{name}_std": column.std, f"{name}_valid": column.valid}
            columns[f"{name}_reason"] = column.reason
        return DataFrame(columns, index=Index(self.time, name="time"))

    def plot(self) -> "tuple[Axes, ...]":
        """Plot every estimate over time with a band of one standard error; position in mm.

        Returns
        -------
        tuple of Axes
            The axes of each estimate in a new pyplot figure.

        Raises
        ------
        MissingLibraryError
            If matplotlib is not installed; the error says how to install it.
        """
        scaled = {name: _scale(column.unit) for name, column in self.estimates.items()}
        names = [f"{name} ({unit})" if unit else name for name, (_, unit) in scaled.items()]
        axes = panels(names)
        for (name, (scale, _)), panel in zip(scaled.items(), axes, strict=True):
            column = self.estimates[name]
            value, std = scale * column.value, scale * column.std
            panel.plot(self.time, value, linewidth=1.0)
            if column.unit:
                panel.fill_between(self.time, value - std, value + std, alpha=0.3, linewidth=0.0)
        return axes

    def __repr__(self) -> str:
        if not len(self):
            return "PredictionTable(no windows)"
        counts = ", ".join(
            f"{name} {int(column.valid.sum())} valid" for name, column in self.estimates.items()
        )
        return f"PredictionTable({len(self)} windows from {self.time[0]:g} to {self.time[-1]:g} s: {counts})"

    def _repr_html_(self) -> str:
        header = ["time (s)"]
        for name, column in self.estimates.items():
            unit = _scale(column.unit)[1]
            header.append(f"{name} ({unit})" if unit else name)
        count = len(self)
        shown = [*range(count)] if count <= 2 * SHOWN else [*range(SHOWN), *range(count - SHOWN, count)]
        rows: list[list[str]] = []
        for before, index in zip([-1, *shown], shown, strict=False):
            if index != before + 1:
                rows.append(["..."] * len(header))
            cells = [_cell(column[index]) for column in self.estimates.values()]
            rows.append([f"{self.time[index]:.3f}", *cells])
        return html_table(f"{count} windows", rows, header)


def _fixed(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array that cannot be written to."""
    array.flags.writeable = False
    return array


def _scale(unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which people read an estimate: mm for m."""
    return (1e3, "mm") if unit == "m" else (1.0, unit)


def _cell(estimate: Estimate) -> str:
    if not estimate.valid:
        return estimate.reason
    scale, unit = _scale(estimate.unit)
    value = f"{scale * estimate.value:.2f}"
    return f"{value} \N{PLUS-MINUS SIGN} {scale * estimate.std:.2f}" if unit else value
