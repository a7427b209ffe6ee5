"""An update as messages of ROS 2: the values of their fields in order, for `monochord.sessions.packing`."""

import json
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

from monochord.core.reasons import Reason
from monochord.core.types import Estimate
from monochord.live.events import Event
from monochord.live.sinks._record import NANO
from monochord.live.update import Update

Values: TypeAlias = Sequence[object]
"""A message's values, those of its parts included."""
DECIDED = {None: -1, False: 0, True: 1}
NOT_ESTIMATED = Estimate.abstain("", Reason.NOT_ESTIMATED)
NOT_TRACKED = Estimate.abstain("", Reason.NOT_TRACKED)


class Answer(NamedTuple):
    """What a robot reads of an update: tracked values where known, else those of the window alone.

    `contact` and `slip` are None while unknown; `alone` are the window's contact, position, force and slip.
    """

    contact: bool | None
    slip: bool | None
    position: Estimate
    force: Estimate
    alone: tuple[Estimate, ...] = ()

    @classmethod
    def of(cls, update: Update, *, tracked: bool) -> "Answer":
        """Return the answer of an update, with `tracked` values or without."""
        get = update.prediction.estimates.get
        contact, position = get("contact", NOT_ESTIMATED), get("position", NOT_ESTIMATED)
        force, slip = get("force", NOT_ESTIMATED), get("slip", NOT_ESTIMATED)
        alone = contact, position, force, slip
        touches, slides = _likely(contact), _likely(slip)
        if tracked:
            touches, slides = update.decided.get("contact", touches), update.decided.get("slip", slides)
            over_time = update.tracked.estimates
            place, newtons = over_time.get("position", position), over_time.get("force", force)
            position, force = place if place.valid else position, newtons if newtons.valid else force
        return cls(touches, slides, position, force, alone)


def head(stamp: int, frame: str) -> tuple[int, int, str]:
    """Return the values of a header, stamped in ns since the Unix epoch."""
    return (*divmod(stamp, NANO), frame)


def messages(update: Update, answer: Answer, stamp: int, frame: str) -> Iterator[tuple[str, Values]]:
    """Yield the topics of a window with their messages; one whose quantity is unknown is left out."""
    contact, slip, position, header = answer.contact, answer.slip, answer.position, head(stamp, frame)
    yield "estimates", _touch(update, answer, header)
    if contact is not None:
        yield "contact", (contact,)
    if slip is not None or contact is False:
        yield "slip", (bool(slip) and contact is not False,)
    if position.valid and contact is not False:
        yield "touch", (*header, position.value, 0.0, 0.0)
    if answer.force.valid or contact is False:
        force, torque = wrench(answer)
        yield "wrench", (*header, 0.0, 0.0, force, 0.0, torque, 0.0)


def wrench(answer: Answer) -> tuple[float, float]:
    """Return the force on the object along z in N, and its torque about pickup 1 around y in N m.

    A force F along z at the position x has the torque (x, 0, 0) x (0, 0, F) = (0, -x F, 0). It is NaN where
    something touches and the position is withheld.

    >>> at, force = Estimate(value=0.08, std=3e-4, unit="m"), Estimate(value=0.5, std=0.1, unit="N")
    >>> wrench(Answer(True, False, at, force))
    (0.5, -0.04)
    """
    if answer.contact is False:
        return 0.0, 0.0
    force, position = float(answer.force.value), answer.position
    return force, -float(position.value) * force if position.valid else math.nan


def event(each: Event, update: Update, stamp: int, frame: str) -> tuple[int, Values]:
    """Return an event's onset in ns since the Unix epoch, and its message, stamped with it."""
    before = update.prediction.time + update.window.duration - each.time
    onset = stamp - round(before * NANO)
    data = json.dumps({"delay": each.delay, "confidence": each.confidence})
    return onset, (*head(onset, frame), each.kind, "", data)


def _touch(update: Update, answer: Answer, header: Values) -> Values:
    """Return the message of all estimates."""
    prediction, decided, tracked = update.prediction, update.decided, update.tracked.estimates
    values = [*header, prediction.start, update.window.duration, prediction.latency]
    for each in answer.alone:
        values += each.value, each.std, each.valid, each.reason
    values += DECIDED[decided.get("contact")], DECIDED[decided.get("slip")]
    for each in (tracked.get("position", NOT_TRACKED), tracked.get("force", NOT_TRACKED)):
        values += each.value, each.std, each.valid, each.reason
    return values


def _likely(probability: Estimate) -> bool | None:
    """Return the window's more likely value; None where unknown."""
    return bool(probability.value >= 0.5) if probability.valid else None
