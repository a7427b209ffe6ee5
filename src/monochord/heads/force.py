"""How hard something presses."""

from dataclasses import dataclass
from typing import Literal

from monochord.heads.base import Head, Task
from monochord.units import Newtons


@dataclass(frozen=True, slots=True, kw_only=True)
class Force(Head):
    """The normal force, by three hidden layers.

    Parameters
    ----------
    weight
        Of its loss, the paper's lambda_F.
    hidden
        Units of each hidden layer.
    loss
        "square" as in the paper; "gauss" and "laplace" state for each window how sure they are.
    limit
        Largest standard error in N that is stated; with a larger one it abstains.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = (128, 128, 128)
    loss: Literal["square", "gauss", "laplace"] = "laplace"
    limit: Newtons = 1.0

    def task(self) -> Task:
        """Return an amount in N."""
        return Task(
            label="force", unit="N", loss=self.loss, hidden=self.hidden, weight=self.weight, limit=self.limit
        )
