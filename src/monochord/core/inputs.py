"""What two channels carry: two microphones, one in both, or one beside an input that carries nothing."""

from enum import Enum
from typing import NamedTuple

MIN_LOOKS = 3
"""Fewest looks that change what was known before, or that decide for a recording."""


class Inputs(Enum):
    """What two channels carry."""

    UNKNOWN = ""
    TWO = "two microphones"
    SAME = "both channels carry the same sound: there is one microphone"
    FIRST = "microphone 2 is silent"
    SECOND = "microphone 1 is silent"
    APART = "the microphones share no sound"

    @property
    def channel(self) -> int | None:
        """The channel to read where there is one microphone; None otherwise."""
        return {Inputs.SAME: 0, Inputs.FIRST: 0, Inputs.SECOND: 1}.get(self)

    @property
    def reason(self) -> str:
        """Why nothing can be estimated that needs two microphones; empty for two, or where it is unknown."""
        return "" if self is Inputs.TWO else self.value


class InputState(NamedTuple):
    """What the channels of a stream carry by the looks so far; passed in and out.

    What a look does not tell stays as it was. Two microphones are believed at once; anything else at once
    where nothing was known before, else after `MIN_LOOKS` looks in succession that say it. Channels that
    share no sound always take so many, and so does their end.

    >>> state = InputState()
    >>> for seen in (Inputs.SAME, Inputs.UNKNOWN, Inputs.TWO, Inputs.SAME):
    ...     state = state.after(seen)
    ...     print(state.inputs.name)
    SAME
    SAME
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
        at_once = seen is Inputs.TWO if self.inputs is not Inputs.UNKNOWN else seen is not Inputs.APART
        if looks < MIN_LOOKS and (self.inputs is Inputs.APART or not at_once):
            return self._replace(seen=seen, looks=looks)
        return InputState(seen, seen, looks)
