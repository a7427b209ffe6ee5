"""The force head: the normal force of the touch."""

from dataclasses import asdict, dataclass
from typing import Literal

from monochord.core.ranges import Share
from monochord.core.units import Newtons
from monochord.perception.heads.base import Head, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Force(Head):
    """The normal force, by three hidden layers.

    Parameters
    ----------
    weight
        Weight of the head's loss, the paper's lambda_F.
    hidden
        Units of each hidden layer.
    loss
        "square" as in the paper; "gauss" and "laplace" state a standard error per window.
    columns
        Names of the feature's columns that are inputs; * matches any characters. Empty: all. Without the
        timbre columns, the head cannot mistake the object's timbre for force.
    limit
        Largest standard error in N that the head states. Above it, the head abstains.
    limit_share
        Largest standard error as a share of the force, where that is more than `limit`: a press of 4 N is
        told with an error that one of 1 N is not.
    blur, drop
        Standard deviation of noise on the scaled inputs, and dropout share of the hidden units, both in
        training only. They reduce overfitting to the builds of the training.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = (128, 128, 128)
    loss: Literal["square", "gauss", "laplace"] = "laplace"
    columns: tuple[str, ...] = ()
    limit: Newtons = 1.0
    limit_share: Share = 0.35
    blur: float = 0.0
    drop: float = 0.0

    def task(self) -> Task:
        """Return the task of a quantity in N."""
        return Task(label="force", unit="N", **asdict(self))
