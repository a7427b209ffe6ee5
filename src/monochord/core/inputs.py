"""What two channels carry: two microphones, one in both, or one beside an input that carries nothing."""

from enum import Enum
from typing import NamedTuple

from monochord.core.reasons import Reason

MIN_LOOKS, MANY_LOOKS = 3, 30
"""Fewest looks that change what was known before, or that decide for a recording; and for a copy, after two
microphones were known."""


class Inputs(Enum):
    """What two channels carry."""

    UNKNOWN = Reason.NONE
    TWO = "two microphones"
    SAME = Reason.ONE_MICROPHONE
    FIRST = Reason.MICROPHONE_2_SILENT
    SECOND = Reason.MICROPHONE_1_SILENT
    APART = Reason.UNLIKE_INPUTS

    @property
    def channel(self) -> int | None:
        """The channel to read where there is one microphone; None otherwise."""
        return {Inputs.SAME: 0, Inputs.FIRST: 0, Inputs.SECOND: 1}.get(self)

    @property
    def reason(self) -> Reason:
        """Why nothing can be estimated that needs two microphones; empty for two, or where it is unknown."""
        return Reason.of(self.value) if self is not Inputs.TWO else Reason.NONE


class InputState(NamedTuple):
    """What the channels of a stream carry by the looks so far; passed in and out.

    What a look does not tell stays as it was. Two microphones are believed at once, and so is an unused input
    where nothing was known before; else `MIN_LOOKS` looks in succession decide. A copy after two microphones
    takes `MANY_LOOKS`: where one segment of a string is silent, both microphones hear the other alone.

    >>> state = InputState()
    >>> for seen in (Inputs.FIRST, Inputs.UNKNOWN, Inputs.TWO, Inputs.FIRST):
    ...     state = state.after(seen)
    ...     print(state.inputs.name)
    FIRST
    FIRST
    TWO
    TWO
    """

    inputs: Inputs = Inputs.UNKNOWN
    seen: Inputs = Inputs.UNKNOWN
    looks: int = 0

    def after(self, seen: Inputs) -> "InputState":
        """Return the state after one more look."""
        if seen is Inputs.UNKNOWN:
            return self
        looks = self.looks + 1 if seen is self.seen else 1
        if looks < self._needed(seen):
            return self._replace(seen=seen, looks=looks)
        return InputState(seen, seen, looks)

    def _needed(self, seen: Inputs) -> int:
        """Return the number of looks in succession that change what is known to `seen`."""
        if seen is Inputs.SAME and self.inputs is Inputs.TWO:
            return MANY_LOOKS
        unused = seen in (Inputs.FIRST, Inputs.SECOND) and self.inputs is Inputs.UNKNOWN
        at_once = unused or (seen is Inputs.TWO and self.inputs is not Inputs.APART)
        return 1 if at_once else MIN_LOOKS
