"""The contract of a head: frozen options that state a task to be learned."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal, TypeAlias

from monochord.core.errors import InputError

Loss: TypeAlias = Literal["logistic", "square", "gauss", "laplace"]
"""Of a chance: "logistic". Of an amount: "square" states one standard error for all windows; "gauss" and
"laplace" learn one for each window, from errors so distributed."""
CONTACT = "contact"
"""The label on which all heads that need a touch depend."""
MOST_UNITS = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What a head learns, and from what: all that training and prediction need to know of it.

    Parameters
    ----------
    label
        Column of the dataset that it learns, and the truth that its estimate stands beside.
    unit
        Of the label, in SI; empty for a chance.
    loss
        What training makes small.
    touched
        Whether it means something only where something touches: it then trains on windows with contact and
        abstains without.
    context
        Whether it sees the untouched reference beside the window's own feature.
    columns
        Names of the feature's columns that it sees, with * for any letters; all if there are none.
    hidden
        Units of each hidden layer, ReLU; none for a linear head.
    weight
        Of its loss in the sum.
    limit
        Largest standard error that is stated; with a larger one it abstains.
    """

    label: str
    unit: str = ""
    loss: Loss
    touched: bool = True
    context: bool = True
    columns: tuple[str, ...] = ()
    hidden: tuple[int, ...] = ()
    weight: float = 1.0
    limit: float = math.inf

    def __post_init__(self) -> None:
        if not all(1 <= units <= MOST_UNITS for units in self.hidden):
            given = f"hidden layers of {', '.join(map(str, self.hidden))} units"
            raise InputError(given, f"1 to {MOST_UNITS} units each")
        if not 0.0 < self.weight < math.inf:
            raise InputError(f"weight {self.weight:g} of a loss", "a number above 0", "leave the head out")
        if not self.limit > 0.0:
            raise InputError(f"limit {self.limit:g} of a standard error", "a number above 0")

    @property
    def is_chance(self) -> bool:
        """Whether its answer is the probability of a yes, and not an amount."""
        return self.loss == "logistic"

    @property
    def outputs(self) -> int:
        """Numbers that its last layer gives: the answer, and the logarithm of its spread where learned."""
        return 2 if self.loss in ("gauss", "laplace") else 1


class Head(ABC):
    """Options of a head, as a frozen keyword-only dataclass."""

    @abstractmethod
    def task(self) -> Task:
        """Return what it learns; raises `InputError` for options that make no sense."""
