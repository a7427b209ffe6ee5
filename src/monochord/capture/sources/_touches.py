"""When and where a simulated string is touched: a script, or an endless draw."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.core.units import Metres, Newtons, Samples, Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """From `start` on the string is touched at `position` with `force`; without a position it is released."""

    start: Seconds
    position: Metres | None = None
    force: Newtons = 1.0

    def refuse_impossible(self, length: Metres) -> None:
        """Refuse a touch that a string of `length` cannot have."""
        if not 0.0 <= self.start < math.inf:
            raise InputError(f"touch at {self.start:g} s", "0 s or later")
        if self.position is not None and not 0.0 < self.position < length:
            raise InputError(f"touch at {self.position:g} m", f"strictly between 0 and {length:g} m")
        if not 0.0 <= self.force < math.inf:
            raise InputError(f"touch of {self.force:g} N", "0 N or more")


def play_at_random(
    *, seed: int, hold: Seconds, positions: tuple[Metres, Metres], forces: tuple[Newtons, Newtons]
) -> Iterator[Touch]:
    """Yield touches without end, the first after about one `hold`.

    A touch is followed by another elsewhere or by a release, by chance alike; a release by a touch. Each
    lasts 0.7 to 1.3 times `hold`.
    """
    random = np.random.default_rng(seed)
    start, touched = 0.0, False
    while True:
        start += hold * random.uniform(0.7, 1.3)
        touched = not touched or bool(random.integers(2))
        position, force = random.uniform(*positions), random.uniform(*forces)
        yield Touch(start=start, position=position if touched else None, force=force)


def play_script(touches: Iterable[Touch], sample_rate: int) -> Iterator[tuple[Samples, Contact | None]]:
    """Yield each touch as the index of its first sample and the contact, None for a release."""
    for each in touches:
        contact = None if each.position is None else Contact(position=each.position, force=each.force)
        yield round(each.start * sample_rate), contact
