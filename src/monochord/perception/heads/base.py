"""The contract of a head: frozen options that define a learning task."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Checked, NonNegative, PartialShare, Positive, Share
from monochord.core.units import Metres

Loss: TypeAlias = Literal["logistic", "square", "gauss", "laplace"]
"""Loss of a head. A probability has "logistic". For a quantity, "square" states one standard error for all
windows; "gauss" and "laplace" learn a standard error per window, for errors of that distribution."""
LEARNED_SPREADS = ("gauss", "laplace")
"""Losses that learn a standard error per window."""
CONTACT = "contact"
"""The contact label. Every head that is defined only during a touch depends on it."""
REFINED_SCALE: Metres = 1e-3
"""Scale of the error of a position that a head refines."""
CERTAINTY = "certainty"
"""Name of the column with the probability that the position which a head refines is right."""
RIGHT_WITHIN: Metres = 5e-3
"""Largest error of a position that counts as right."""
POSITION = "position"
"""The label of the touch position, in m from pickup 1."""
MAX_UNITS = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Task(Checked):
    """The target, inputs and network of a head.

    Parameters
    ----------
    label
        The dataset's column that the head learns.
    unit
        SI unit of the label; empty for a probability.
    loss
        The loss that training minimises.
    touched
        Whether the label is defined only during a touch. The head then trains on windows with contact, and
        abstains without contact.
    columns
        Names of the feature's columns that are inputs; * matches any characters. Empty: all.
    hidden
        Units of each hidden layer (ReLU); empty for a linear head.
    weight
        Weight of this head's loss in the joint loss.
    limit
        Largest standard error that the head states, in `unit`. Above it, the head abstains.
    limit_share
        Largest standard error as a share of the value, where that is more than `limit`.
    refines
        Name of a column with a position over the string's length, which the head corrects by a learned error;
        empty for none. The feature tells in a column `CERTAINTY` how probably that position is right.
    certain
        With `refines`, the least probability at which the head states an estimate.
    blur
        Standard deviation of the normal noise that training adds to the scaled inputs.
    drop
        Share of the hidden units that are left out at each step of the training.

    Examples
    --------
    >>> Task(label="force", unit="N", loss="laplace", hidden=(64, 64)).outputs
    2
    """

    label: str
    unit: str = ""
    loss: Loss
    touched: bool = True
    columns: tuple[str, ...] = ()
    hidden: tuple[Annotated[int, Meta(ge=1, le=MAX_UNITS)], ...] = ()
    weight: Positive[float] = 1.0
    limit: Annotated[float, Meta(gt=0.0)] = math.inf
    limit_share: Share = 0.0
    refines: str = ""
    certain: Share = 0.9
    blur: NonNegative[float] = 0.0
    drop: PartialShare = 0.0

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.refines and self.loss not in LEARNED_SPREADS:
            given = f"refines = '{self.refines}' for a head of {self.loss} loss"
            raise InputError(given, f"a loss that learns its standard error: {', '.join(LEARNED_SPREADS)}")

    @property
    def is_probability(self) -> bool:
        """Whether the head estimates a probability; otherwise it estimates a quantity."""
        return self.loss == "logistic"

    def states(self, value: float, std: float) -> bool:
        """Return whether a head may state a value with its standard error.

        >>> force = Task(label="force", unit="N", loss="laplace", limit=1.0, limit_share=0.35)
        >>> force.states(2.0, 1.1), force.states(4.0, 1.1)
        (False, True)
        """
        return std <= max(self.limit, self.limit_share * abs(value))

    @property
    def outputs(self) -> int:
        """Number of outputs: the value, and the logarithm of a learned spread."""
        return 1 + (self.loss in LEARNED_SPREADS)


class Head(Checked, ABC):
    """Options of a head, as a frozen keyword-only dataclass.

    Examples
    --------
    >>> from monochord import Head, Task
    >>> @dataclass(frozen=True, slots=True, kw_only=True)
    ... class SlipVelocity(Head):
    ...     def task(self) -> Task:
    ...         return Task(label="slip_velocity", unit="m/s", loss="gauss")
    >>> SlipVelocity().task().touched
    True
    """

    @abstractmethod
    def task(self) -> Task:
        """Return the learning task; raises `InputError` for options that exclude each other."""
