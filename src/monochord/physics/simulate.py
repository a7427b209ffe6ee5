"""Simulates the sound of a touched string, for Python programs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from monochord.core.lengths import refuse_other_units
from monochord.core.ranges import Finite, NonNegative, Positive, checked
from monochord.core.types import Contact
from monochord.core.units import Metres, Newtons, Seconds
from monochord.physics.simulators import SIMULATORS, Case, Sound
from monochord.physics.strings import load_string


@checked
def simulate(
    string: str | Path = "appendix",
    *,
    position: Finite[Metres] | None = None,
    force: NonNegative[Newtons] | None = None,
    touched: bool = True,
    seconds: Positive[Seconds] = 0.4,
    simulator: str = "split_string",
    settings: Sequence[str] = (),
    **options: Any,
) -> Sound:
    """Simulate a string at rest or under one constant touch.

    Parameters
    ----------
    string
        A preset's name or a TOML file.
    position
        Position of the touch from pickup 1, in m; by default the preset's.
    force
        Normal force of the touch, in N; by default the preset's.
    touched
        Whether the string is touched.
    seconds
        Length of the sound, in s.
    simulator
        ``"split_string"``, the paper's, or ``"twin"``, a whole string with drivers and microphones.
    settings
        Overrides of the simulator's setup, such as ``"drive.amplitude=0.002"``.
    options
        Options of the simulator, such as ``route="modal"``.

    Returns
    -------
    Sound
        Both microphones (2, n), the sample rate, and a summary that compares the peaks with theory.

    Raises
    ------
    InputError
        If the string or simulator is unknown, or the touch is impossible on the string.

    Examples
    --------
    >>> sound = simulate("appendix", position=0.2275, force=0.0, route="modal")
    >>> sound.microphones.shape, [round(peak) for peak in sound.summary["peaks"]]
    ((2, 17640), [695, 374])
    """
    refuse_other_units(position=position)
    preset = load_string(string)
    usual = preset.usual_contact
    contact = Contact(
        position=usual.position if position is None else position,
        force=usual.force if force is None else force,
    )
    case = Case(
        string=preset.string,
        contact=contact if touched else None,
        seconds=seconds,
        assignments=tuple(settings),
    )
    return SIMULATORS.build(simulator, options).run(case)
