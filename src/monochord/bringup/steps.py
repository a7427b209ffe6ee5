"""The steps of a bring-up: what to do, and for how long each is recorded."""

from dataclasses import dataclass

from monochord.core.units import Metres, Seconds

PLUCK_PLACE: Metres = 0.025
TAP_PLACE: Metres = 0.01
"""Where the string is plucked, and within what distance it is tapped, from microphone 1."""
PRESS_SHARE = 1 / 3
"""Where it is pressed, as a share of its length from microphone 1."""
PADS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Where a hand damps it, as shares of its length."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One recording: its name, which is that of its file, what to do, and its length.

    `lit` are the parts of the sensor that it is about, by their names in `monochord.bringup.drawing`, and
    `on` the drivers that are on.
    """

    name: str
    instruction: str
    seconds: Seconds
    lit: tuple[str, ...]
    on: tuple[int, ...] = ()


STEPS = (
    Step(
        name="quiet",
        lit=("driver_1", "driver_2", "damp"),
        seconds=3.0,
        instruction="Switch both drivers off, damp the string, then leave all alone.",
    ),
    Step(
        name="pluck",
        lit=("pluck", "string", "microphone_1"),
        seconds=2.0,
        instruction=f"Drivers off. Pluck the string once with a fingernail, {1e3 * PLUCK_PLACE:g} mm "
        "from microphone 1.",
    ),
    Step(
        name="tap",
        lit=("tap", "end_1", "microphone_1"),
        seconds=2.0,
        instruction=f"Drivers off. Tap the string once, briefly, within {1e3 * TAP_PLACE:g} mm "
        "of microphone 1's end.",
    ),
    Step(
        name="driver_1",
        lit=("driver_1",),
        on=(1,),
        seconds=4.0,
        instruction="Driver 2 off. As it records, switch driver 1 on; touch the string if it does not start.",
    ),
    Step(
        name="driver_2",
        lit=("driver_2",),
        on=(2,),
        seconds=4.0,
        instruction="Driver 1 off. As it records, switch driver 2 on; touch the string if it does not start.",
    ),
    Step(
        name="both",
        lit=("driver_1", "driver_2"),
        on=(1, 2),
        seconds=4.0,
        instruction="Switch both drivers on and touch nothing.",
    ),
    Step(
        name="press",
        lit=("press", "microphone_1"),
        on=(1, 2),
        seconds=3.0,
        instruction="Both drivers on. Press a smooth rod just over a third of the way from mic 1; hold it.",
    ),
    Step(
        name="damped",
        lit=("damp",),
        on=(1, 2),
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
        Step(
            name="drift",
            seconds=drift,
            lit=("string",),
            on=(1, 2),
            instruction="Both drivers on. Touch nothing until it ends.",
        ),
    )
