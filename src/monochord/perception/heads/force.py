"""How hard something presses."""

from dataclasses import dataclass
from typing import Literal

from monochord.core.units import Newtons
from monochord.perception.heads.base import Head, Task


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
    columns
        Names of the feature's columns that it sees, with * for any letters; all if there are none. One that
        does not hear the object's timbre cannot take it for the force.
    limit
        Largest standard error in N that is stated; with a larger one it abstains.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = (128, 128, 128)
    loss: Literal["square", "gauss", "laplace"] = "laplace"
    columns: tuple[str, ...] = ()
    limit: Newtons = 1.0

    def task(self) -> Task:
        """Return an amount in N."""
        return Task(
            label="force",
            unit="N",
            loss=self.loss,
            columns=self.columns,
            hidden=self.hidden,
            weight=self.weight,
            limit=self.limit,
        )
