"""The slip head: whether the touching object slides."""

from dataclasses import asdict, dataclass

from monochord.perception.heads.base import Head, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip(Head):
    """The probability that a touch slides, by logistic regression.

    Parameters
    ----------
    weight
        Weight of the head's loss, the paper's lambda_s.
    hidden
        Units of each hidden layer; empty for logistic regression.
    columns
        Names of the feature's columns that are inputs; * matches any characters. Empty: all.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = ()
    columns: tuple[str, ...] = ()

    def task(self) -> Task:
        """Return the task of a probability that is defined during a touch."""
        return Task(label="slip", loss="logistic", **asdict(self))
