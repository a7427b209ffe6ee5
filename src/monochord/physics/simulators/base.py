"""The contract of a model: frozen options, run for one string and touch into a sound."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from monochord.core.ranges import Checked
from monochord.core.types import Contact, Floats, StringParams
from monochord.core.units import Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What to simulate.

    `assignments` are overrides such as ``drive.amplitude=0.002`` that a model applies to its own setup of the
    string and the touch; an unknown one is refused.
    """

    string: StringParams
    contact: Contact | None
    seconds: Seconds
    assignments: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Sound:
    """The result of a model.

    `microphones` is (2, n) in m/s, or in full scale from a model that has converters; `summary` holds plain
    values for display or JSON: among them ``position`` and ``force`` of the touch (None without one),
    ``peaks``, the dominant frequency on each side of it, and ``theory``, the closed forms' frequencies there.
    """

    microphones: Floats
    sample_rate: int
    summary: Mapping[str, Any]


class Simulator(Checked, ABC):
    """Options of a model, as a frozen keyword-only dataclass."""

    @classmethod
    def setup(cls) -> type:
        """Return the dataclass whose values the assignments of a case override: where they are listed."""
        return Case

    @abstractmethod
    def run(self, case: Case) -> Sound:
        """Simulate; raises `InputError` for what the model does not support."""
