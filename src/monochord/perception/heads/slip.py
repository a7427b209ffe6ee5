"""Whether what touches slides."""

from dataclasses import dataclass

from monochord.perception.heads.base import Head, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip(Head):
    """The probability that a touch slides, by logistic regression.

    Parameters
    ----------
    weight
        Of its loss, the paper's lambda_s.
    hidden
        Units of each hidden layer; none is logistic regression.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = ()

    def task(self) -> Task:
        """Return a probability that has a meaning while something touches."""
        return Task(label="slip", loss="logistic", hidden=self.hidden, weight=self.weight)
