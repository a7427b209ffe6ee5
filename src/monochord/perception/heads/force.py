"""How hard something presses."""

from dataclasses import dataclass
from typing import Literal

from monochord.core.units import Newtons
from monochord.perception.heads.base import Head, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Force(Head):
    """The normal force, by a ridge regression and three hidden layers.

    Parameters
    ----------
    weight
        Of its loss, the paper's lambda_F.
    hidden
        Units of each hidden layer.
    linear
        Add a ridge regression, solved in closed form; the hidden layers learn what it leaves over.
    loss
        "square" as in the paper; "gauss" and "laplace" state a standard error for each window.
    columns
        Names of the feature's columns that are its inputs, with * for any letters; all if empty. Without
        those of timbre it cannot take the object's timbre for the force.
    limit
        Largest standard error in N that is stated; with a larger one it abstains.
    rise
        Add the rise of the pitch over the untouched string's to the inputs, as measures in which force is
        nearly linear. Requires the feature fft_harmonic and the reference.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = (128, 128, 128)
    linear: bool = True
    loss: Literal["square", "gauss", "laplace"] = "laplace"
    columns: tuple[str, ...] = ()
    limit: Newtons = 1.0
    rise: bool = False

    def task(self) -> Task:
        """Return a quantity in N."""
        return Task(
            label="force",
            unit="N",
            loss=self.loss,
            columns=self.columns,
            hidden=self.hidden,
            linear=self.linear,
            weight=self.weight,
            limit=self.limit,
            rise=self.rise,
        )
