"""The steps of a bring-up: what to do, and for how long each is recorded."""

from dataclasses import dataclass

from monochord.core.units import Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One recording: its name, which is that of its file, what to do, and its length."""

    name: str
    instruction: str
    seconds: Seconds


STEPS = (
    Step(
        name="quiet",
        seconds=3.0,
        instruction="Switch both drivers off, damp the string, then leave all alone.",
    ),
    Step(
        name="pluck",
        seconds=2.0,
        instruction="Drivers off. Pluck the string once with a fingernail, 25 mm from microphone 1.",
    ),
    Step(
        name="tap",
        seconds=2.0,
        instruction="Drivers off. Tap the string once, briefly, within a centimetre of microphone 1's end.",
    ),
    Step(
        name="driver_1",
        seconds=4.0,
        instruction="Driver 2 off. As it records, switch driver 1 on; touch the string if it does not start.",
    ),
    Step(
        name="driver_2",
        seconds=4.0,
        instruction="Driver 1 off. As it records, switch driver 2 on; touch the string if it does not start.",
    ),
    Step(
        name="both",
        seconds=4.0,
        instruction="Switch both drivers on and touch nothing.",
    ),
    Step(
        name="press",
        seconds=3.0,
        instruction="Both drivers on. Press a smooth rod just over a third of the way from mic 1; hold it.",
    ),
    Step(
        name="damped",
        seconds=3.0,
        instruction="Both drivers on. Damp the whole string with your hand, so that it cannot ring.",
    ),
)
"""The steps in order."""
LOOPBACK = "loopback"
"""Name of a recording of a loop-back: what is sent on channel 1, what returns on channel 2."""


def steps(drift: Seconds = 0.0) -> tuple[Step, ...]:
    """Return the steps, with the drift over so many seconds last where it is above zero.

    Examples
    --------
    >>> [step.name for step in steps(60.0)][-2:]
    ['damped', 'drift']
    """
    if not drift:
        return STEPS
    return (
        *STEPS,
        Step(name="drift", seconds=drift, instruction="Both drivers on. Touch nothing until it ends."),
    )
