"""The contract of a head: frozen options that define a learning task."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Checked, NonNegative, PartialShare, Positive

Loss: TypeAlias = Literal["logistic", "square", "gauss", "laplace"]
"""Loss of a head. A probability has "logistic". For a quantity, "square" states one standard error for all
windows; "gauss" and "laplace" learn a standard error per window, for errors of that distribution."""
CONTACT = "contact"
"""The contact label. Every head that is defined only during a touch depends on it."""
POSITION = "position"
"""The label of the touch position, in m from pickup 1."""
MAX_UNITS, MAX_MEMBERS = 4096, 16


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
    context
        Whether the untouched reference is an input, in addition to the window's feature.
    columns
        Names of the feature's columns that are inputs; * matches any characters. Empty: all.
    reference
        Names of the reference's columns that are inputs; * matches any characters. Empty: all.
    hidden
        Units of each hidden layer (ReLU); empty for a linear head.
    linear
        Add a ridge regression, solved in closed form. The hidden layers learn its residual. For quantities
        only.
    members
        Number of networks in the ensemble, which differ in their initial weights. The estimate is their mean,
        and their disagreement adds to its standard error.
    weight
        Weight of this head's loss in the joint loss.
    limit
        Largest standard error that the head states, in `unit`. Above it, the head abstains.
    rise
        Whether the rise of the pitch is an input too; see `monochord.perception.model.rise`.
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
    context: bool = True
    columns: tuple[str, ...] = ()
    reference: tuple[str, ...] = ()
    hidden: tuple[Annotated[int, Meta(ge=1, le=MAX_UNITS)], ...] = ()
    linear: bool = False
    members: Annotated[int, Meta(ge=1, le=MAX_MEMBERS)] = 1
    weight: Positive[float] = 1.0
    limit: Annotated[float, Meta(gt=0.0)] = math.inf
    rise: bool = False
    blur: NonNegative[float] = 0.0
    drop: PartialShare = 0.0

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.members > 1 and not self.hidden:
            raise InputError(f"{self.members} members without hidden layers", "1 member, or hidden layers")
        if self.linear and self.is_probability:
            raise InputError("linear = true with the logistic loss", "linear = true for quantities only")
        if self.linear and (self.blur or self.drop):
            raise InputError("blur or drop with linear = true", "hidden layers alone", "set linear = false")

    @property
    def is_probability(self) -> bool:
        """Whether the head estimates a probability; otherwise it estimates a quantity."""
        return self.loss == "logistic"

    @property
    def outputs(self) -> int:
        """Number of outputs: the value, and the logarithm of its spread if the loss learns it."""
        return 2 if self.loss in ("gauss", "laplace") else 1


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
