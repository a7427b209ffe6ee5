"""Where something touches."""

from dataclasses import dataclass
from typing import Literal

from monochord.core.units import Metres
from monochord.perception.heads.base import Head, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Position(Head):
    """The place of the touch from pickup 1, by three hidden layers.

    Parameters
    ----------
    weight
        Of its loss, the paper's lambda_x.
    hidden
        Units of each hidden layer.
    loss
        "square" as in the paper; "gauss" and "laplace" state for each window how sure they are.
    limit
        Largest standard error in m that is stated; with a larger one it abstains.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = (128, 128, 128)
    loss: Literal["square", "gauss", "laplace"] = "laplace"
    limit: Metres = 0.03

    def task(self) -> Task:
        """Return an amount in m."""
        return Task(
            label="position",
            unit="m",
            loss=self.loss,
            hidden=self.hidden,
            weight=self.weight,
            limit=self.limit,
        )
