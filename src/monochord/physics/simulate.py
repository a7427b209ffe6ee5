"""The sound of a touched string, for programs."""

from typing import Any

from monochord.core.types import Contact
from monochord.core.units import Metres, Newtons, Seconds
from monochord.physics.simulators import SIMULATORS, Case, Sound
from monochord.physics.strings import load_string


def simulate(
    string: str = "appendix",
    *,
    position: Metres | None = None,
    force: Newtons | None = None,
    touched: bool = True,
    seconds: Seconds = 0.4,
    simulator: str = "split_string",
    settings: tuple[str, ...] = (),
    **options: Any,
) -> Sound:
    """Simulate a string at rest or under one touch that does not change.

    Parameters
    ----------
    string
        A preset's name or a TOML file.
    position, force
        Of the touch, in m from pickup 1 and in N; the preset's usual ones by default.
    touched
        Whether anything touches the string.
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
        Both microphones (2, n), the sample rate, and a summary with the peaks beside theory.

    Raises
    ------
    InputError
        For an unknown string or simulator, or a touch that the string cannot have.

    Examples
    --------
    >>> sound = simulate("appendix", position=0.2275, force=0.0, route="modal")
    >>> sound.microphones.shape, [round(peak) for peak in sound.summary["peaks"]]
    ((2, 17640), [695, 374])
    """
    preset = load_string(string)
    usual = preset.usual_contact
    contact = Contact(
        position=usual.position if position is None else position,
        force=usual.force if force is None else force,
    )
    case = Case(
        string=preset.string, contact=contact if touched else None, seconds=seconds, assignments=settings
    )
    return SIMULATORS.build(simulator, options).run(case)
