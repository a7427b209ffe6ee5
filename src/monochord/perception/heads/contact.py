"""Whether something touches."""

import math
from dataclasses import dataclass

from monochord.perception.heads.base import CONTACT, Head, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact(Head):
    """The probability of contact, by logistic regression on the window alone.

    The reference is no input, since contact decides which windows are untouched and enter it.

    Parameters
    ----------
    weight
        Of its loss, the paper's lambda_c.
    hidden
        Units of each hidden layer; none is logistic regression.
    limit
        Largest standard error of the yes or no, sqrt(p (1 - p)), that is stated: with 0.4 it abstains where
        the probability p is between 0.2 and 0.8. A wrong "no contact" is worse than none.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = ()
    limit: float = math.inf

    def task(self) -> Task:
        """Return a probability that has a meaning in every window."""
        return Task(
            label=CONTACT,
            loss="logistic",
            touched=False,
            context=False,
            hidden=self.hidden,
            weight=self.weight,
            limit=self.limit,
        )
