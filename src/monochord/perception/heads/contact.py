"""The contact head: whether something touches the string."""

import math
from dataclasses import asdict, dataclass

from monochord.perception.heads.base import CONTACT, Head, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact(Head):
    """The probability of contact, by logistic regression on the window alone.

    Parameters
    ----------
    weight
        Weight of the head's loss, the paper's lambda_c.
    hidden
        Units of each hidden layer; empty for logistic regression.
    limit
        Largest standard error sqrt(p (1 - p)) that the head states. With 0.4 it abstains for probabilities p
        between 0.2 and 0.8. An abstention does less harm than a wrong "no contact".
    columns
        Names of the feature's columns that are inputs; * matches any characters. Empty: all.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = ()
    limit: float = math.inf
    columns: tuple[str, ...] = ()

    def task(self) -> Task:
        """Return the task of a probability that is defined in every window."""
        return Task(label=CONTACT, loss="logistic", touched=False, **asdict(self))
