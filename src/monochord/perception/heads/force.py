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
    reference
        Names of the untouched reference's columns that are its inputs, likewise.
    limit
        Largest standard error in N that is stated; with a larger one it abstains.
    rise
        Add the rise of the pitch over the untouched string's to the inputs, as measures in which force is
        nearly linear. Requires the feature fft_harmonic and the reference.
    blur, drop
        Noise on the scaled inputs, in their standard deviations, and the share of hidden units that are left
        out, both in training alone: what holds on builds that are close by then counts for less.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = (128, 128, 128)
    linear: bool = True
    loss: Literal["square", "gauss", "laplace"] = "laplace"
    columns: tuple[str, ...] = ()
    reference: tuple[str, ...] = ()
    limit: Newtons = 1.0
    rise: bool = False
    blur: float = 0.0
    drop: float = 0.0

    def task(self) -> Task:
        """Return a quantity in N."""
        return Task(
            label="force",
            unit="N",
            loss=self.loss,
            columns=self.columns,
            reference=self.reference,
            hidden=self.hidden,
            linear=self.linear,
            weight=self.weight,
            limit=self.limit,
            rise=self.rise,
            blur=self.blur,
            drop=self.drop,
        )
