"""The contract of a head: frozen options that define a task to be learned."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal, TypeAlias

from monochord.core.errors import InputError

Loss: TypeAlias = Literal["logistic", "square", "gauss", "laplace"]
"""Of a probability: "logistic". Of a quantity: "square" states one standard error for all windows; "gauss"
and "laplace" learn one for each window, from errors so distributed."""
CONTACT = "contact"
"""The label on which all heads that need a touch depend."""
POSITION = "position"
"""The label of where something touches, in m from pickup 1."""
MAX_UNITS, MAX_MEMBERS = 4096, 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
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
    """

    label: str
    unit: str = ""
    loss: Loss
    touched: bool = True
    context: bool = True
    columns: tuple[str, ...] = ()
    reference: tuple[str, ...] = ()
    hidden: tuple[int, ...] = ()
    linear: bool = False
    members: int = 1
    weight: float = 1.0
    limit: float = math.inf
    rise: bool = False
    blur: float = 0.0
    drop: float = 0.0

    def __post_init__(self) -> None:
        if not all(1 <= units <= MAX_UNITS for units in self.hidden):
            given = f"hidden layers of {', '.join(map(str, self.hidden))} units"
            raise InputError(given, f"1 to {MAX_UNITS} units each")
        if not 1 <= self.members <= MAX_MEMBERS or (self.members > 1 and not self.hidden):
            given = f"{self.members} members of {len(self.hidden)} hidden layers"
            raise InputError(given, f"1 to {MAX_MEMBERS}, and hidden layers where there are several")
        if not 0.0 < self.weight < math.inf:
            raise InputError(f"weight {self.weight:g} of a loss", "a number above 0", "leave the head out")
        if self.linear and self.is_probability:
            raise InputError("a linear path with the logistic loss", "one with a quantity")
        if not self.limit > 0.0:
            raise InputError(f"limit {self.limit:g} of a standard error", "a number above 0")
        if not (0.0 <= self.blur < math.inf and 0.0 <= self.drop < 1.0):
            given = f"blur {self.blur:g} and drop {self.drop:g} of a head"
            raise InputError(given, "a blur of 0 or more, and a share from 0 on and below 1")
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


class Head(ABC):
    """Options of a head, as a frozen keyword-only dataclass."""

    @abstractmethod
    def task(self) -> Task:
        """Return what it learns; raises `InputError` for impossible options."""
