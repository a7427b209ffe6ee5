"""The position head: where along the string something touches."""

from dataclasses import asdict, dataclass
from typing import Literal

from monochord.core.units import Metres
from monochord.perception.heads.base import POSITION, Head, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Position(Head):
    """The position of the touch from pickup 1, by three hidden layers.

    Parameters
    ----------
    weight
        Weight of the head's loss, the paper's lambda_x.
    hidden
        Units of each hidden layer.
    loss
        "square" as in the paper; "gauss" and "laplace" state a standard error per window.
    columns
        Names of the feature's columns that are inputs; * matches any characters. Empty: all.
    limit
        Largest standard error in m that the head states. Above it, the head abstains.
    refines
        Name of a column with a position over the string's length, such as ``position`` of the feature
        reading, which also tells how probably it is right within 5 mm. The head learns its error.
    certain
        With `refines`, the least probability at which the head states a position.
    drop
        Dropout share of the hidden units, in training only.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = (128, 128, 128)
    loss: Literal["square", "gauss", "laplace"] = "laplace"
    columns: tuple[str, ...] = ()
    limit: Metres = 0.03
    refines: str = ""
    certain: float = 0.9
    drop: float = 0.0

    def task(self) -> Task:
        """Return the task of a quantity in m."""
        return Task(label=POSITION, unit="m", **asdict(self))
