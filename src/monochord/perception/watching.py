"""What an estimator may know of the string besides the touch: its pitch and its microphones."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from monochord.core.inputs import Inputs
from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Estimates, Window

NOT_MEASURED = Estimate.abstain("Hz", Reason.NOT_MEASURED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """The state of the string, as an estimator measures it besides the touch.

    `open_frequency` is the last measured frequency of the untouched string in Hz, without stiffness.
    `deviation` is the relative deviation of `open_frequency` from the known frequency, such as 0.01 for 1 %
    above; None without a measurement. `follows` says whether estimates use the measured pitch. `inputs` is
    what the two channels carry; None where the estimator does not look.
    """

    open_frequency: Estimate = NOT_MEASURED
    deviation: float | None = None
    follows: bool = True
    inputs: Inputs | None = None


class Watching(ABC):
    """A prepared estimator that also monitors the string.

    A prepared estimator that does not monitor the string is a plain function.
    """

    @abstractmethod
    def __call__(self, window: Window) -> Estimates:
        """Return the estimates of a window."""

    @property
    @abstractmethod
    def condition(self) -> Condition:
        """The state of the string after the last window."""
