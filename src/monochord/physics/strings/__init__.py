"""Strings as data: one TOML file a string, each with its source, found by its name."""

from dataclasses import dataclass
from pathlib import Path

from monochord.core.config import from_tree, load_toml, to_tree
from monochord.core.errors import InputError
from monochord.core.presets import preset_names, preset_path
from monochord.core.types import Contact, StringParams
from monochord.core.units import Hertz


@dataclass(frozen=True, slots=True, kw_only=True)
class StringPreset:
    """A string with what is known of it.

    `open_frequency` is the fundamental that the source states or the tuning asks for; the string's own
    tension, density and length agree with it. `contact` is where the preset is touched by default, ``None``
    for a string that is left alone. `notes` says which values are assumed.
    """

    name: str
    title: str
    source: str
    open_frequency: Hertz
    string: StringParams
    notes: str = ""
    contact: Contact | None = None

    @property
    def usual_contact(self) -> Contact:
        """The touch where none is asked for: `contact`, or else a clamp without force at x/L 0.35."""
        return self.contact or Contact(position=0.35 * self.string.length, force=0.0)


def string_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> "appendix" in string_names()
    True
    """
    return preset_names(__name__)


def load_string(name: str) -> StringPreset:
    """Return a preset by its name, or read one from a file of your own.

    Parameters
    ----------
    name
        A name from `string_names`, or the path of a TOML file laid out as the presets are.

    Raises
    ------
    InputError
        If there is no such preset, or the file cannot be used.

    Examples
    --------
    >>> load_string("appendix").string.tension
    65.0
    """
    return _read(preset_path(__name__, "string", name))


def _read(path: Path) -> StringPreset:
    where = f"string {path.stem}"
    preset = from_tree(StringPreset, {**load_toml(path), "name": path.stem}, where)
    _refuse_impossible(preset.string, where)
    length, contact = preset.string.length, preset.contact
    if contact is not None and not 0.0 < contact.position < length:
        given = f"{where}.contact.position {contact.position:g} m"
        raise InputError(given, f"strictly between 0 and {length:g} m")
    return preset


def _refuse_impossible(string: StringParams, where: str) -> None:
    for key, value in to_tree(string).items():
        if key in {"length", "linear_density", "tension", "young_modulus"} and not value > 0.0:
            raise InputError(f"{where}.string.{key} {value:g}", "above 0")
        if not value >= 0.0:
            raise InputError(f"{where}.string.{key} {value:g}", "0 or more")
