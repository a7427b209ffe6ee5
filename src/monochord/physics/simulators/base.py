"""The contract of a simulator: frozen options that simulate one string and touch."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.curves import thinned
from monochord.core.notebook import html_table, lines, panels
from monochord.core.ranges import Checked
from monochord.core.types import Contact, Floats, StringParams
from monochord.core.units import Hertz, Seconds
from monochord.physics.theory import TensionLaw, open_frequency, segment_frequencies

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A string and a touch to simulate.

    `assignments` are overrides such as ``drive.amplitude=0.002`` that a simulator applies to its setup of
    string and touch; an unknown one raises.
    """

    string: StringParams
    contact: Contact | None
    seconds: Seconds
    assignments: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sound:
    """The result of a simulation.

    `microphones` is (2, n) in m/s, or in full scale for a simulator with converters. `summary` holds plain
    values for display or JSON: among them ``position`` and ``force`` of the touch (None without one),
    ``peaks``, the dominant frequency on each side of it, and ``theory``, the corresponding closed-form
    frequencies.
    """

    microphones: Floats
    sample_rate: int
    summary: Mapping[str, Any]

    def plot(self) -> "tuple[Axes, ...]":
        """Plot both microphones over time.

        Returns
        -------
        tuple of Axes
            One for each microphone, in a new pyplot figure.

        Raises
        ------
        MissingLibraryError
            If matplotlib is not installed; the error says how to install it.
        """
        axes = panels([f"microphone {number + 1}" for number in range(len(self.microphones))])
        time = np.arange(self.microphones.shape[1]) / self.sample_rate
        for row, panel in zip(self.microphones, axes, strict=True):
            panel.plot(*thinned(time, row), linewidth=0.7)
        return axes

    def __repr__(self) -> str:
        return lines(*self._facts())

    def _repr_html_(self) -> str:
        return html_table(*self._facts())

    def _facts(self) -> tuple[str, list[tuple[str, str]]]:
        channels, frames = self.microphones.shape
        length = f"{frames / self.sample_rate:g} s of {channels} microphones at {self.sample_rate} Hz"
        place, force = (self.summary.get(name) for name in ("position", "force"))
        touch = "nothing" if place is None else f"{1e3 * place:g} mm from pickup 1 with {force or 0.0:g} N"
        peaks = ", ".join(f"{peak:.1f} Hz" for peak in self.summary.get("peaks") or ())
        return "Sound, simulated", [("length", length), ("touch", touch), ("peaks", peaks or "not measured")]


class Simulator(Checked, ABC):
    """Options of a simulator, as a frozen keyword-only dataclass."""

    @classmethod
    def setup(cls) -> type:
        """Return the dataclass that a case's assignments override, for listing."""
        return Case

    @abstractmethod
    def run(self, case: Case) -> Sound:
        """Simulate; raises `InputError` for a case that the simulator does not support."""


def expected_peaks(string: StringParams, contact: Contact | None, law: TensionLaw) -> tuple[Hertz, Hertz]:
    """Return the fundamentals of both segments under a touch, or twice that of the untouched string."""
    if contact is None:
        both = open_frequency(string)
        return both, both
    return segment_frequencies(string, contact, law)
