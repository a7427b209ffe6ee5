"""Whether something touches."""

from dataclasses import dataclass

from monochord.perception.heads.base import CONTACT, Head, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact(Head):
    """The probability of contact, by logistic regression on the window alone.

    It sees no reference, since it is what tells which windows are untouched and may serve as one.

    Parameters
    ----------
    weight
        Of its loss, the paper's lambda_c.
    hidden
        Units of each hidden layer; none is logistic regression.
    """

    weight: float = 1.0
    hidden: tuple[int, ...] = ()

    def task(self) -> Task:
        """Return a chance that holds always."""
        return Task(
            label=CONTACT,
            loss="logistic",
            touched=False,
            context=False,
            hidden=self.hidden,
            weight=self.weight,
        )
