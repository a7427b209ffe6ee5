"""The contract of a head: frozen options that define a task to be learned."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Checked, NonNegative, PartialShare, Positive

Loss: TypeAlias = Literal["logistic", "square", "gauss", "laplace"]
"""Of a probability: "logistic". Of a quantity: "square" states one standard error for all windows; "gauss"
and "laplace" learn one for each window, from errors so distributed."""
CONTACT = "contact"
"""The label on which all heads that need a touch depend."""
POSITION = "position"
"""The label of where something touches, in m from pickup 1."""
MAX_UNITS, MAX_MEMBERS = 4096, 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Task(Checked):
    """What a head learns, and from what.

    Parameters
    ----------
    label
        Column of the dataset that it learns.
    unit
        Of the label, in SI; empty for a probability.
    loss
        What training minimises.
    touched
        Whether it means something only where something touches: it then trains on windows with contact and
        abstains without.
    context
        Whether the untouched reference is an input beside the window's own feature.
    columns
        Names of the feature's columns that are its inputs, with * for any letters; all if empty.
    reference
        Names of the reference's columns that are its inputs, likewise.
    hidden
        Units of each hidden layer, ReLU; none for a linear head.
    linear
        Whether a ridge regression, solved in closed form, is added; the hidden layers then learn what it
        leaves over. For a quantity alone.
    members
        Networks of hidden layers that differ in how they began; the estimate is their mean, and its standard
        error grows with what they disagree by.
    weight
        Of its loss in the sum of losses.
    limit
        Largest standard error that is stated; with a larger one it abstains.
    rise
        Whether the rise of the pitch is an input beside the columns; see `monochord.perception.model.rise`.
    blur
        Standard deviation of normal noise that training adds to the scaled inputs.
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
            raise InputError(f"{self.members} members without hidden layers", "one, or hidden layers")
        if self.linear and self.is_probability:
            raise InputError("a linear path with the logistic loss", "one with a quantity")
        if self.linear and (self.blur or self.drop):
            raise InputError("blur or drop beside a linear path", "hidden layers alone", "set linear = false")

    @property
    def is_probability(self) -> bool:
        """Whether its estimate is the probability of a yes, and not a quantity."""
        return self.loss == "logistic"

    @property
    def outputs(self) -> int:
        """Outputs of its last layer: the value, and the logarithm of its spread where learned."""
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
        """Return what it learns; raises `InputError` for impossible options."""
