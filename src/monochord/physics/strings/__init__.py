"""Strings as data: one TOML file a string, each with its source, found by its name."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from monochord.config import from_tree, load_toml
from monochord.errors import InputError, did_you_mean
from monochord.types import Contact, StringParams
from monochord.units import Hertz


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


def string_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> "appendix" in string_names()
    True
    """
    found = (Path(entry.name) for entry in files(__name__).iterdir())
    return sorted(path.stem for path in found if path.suffix == ".toml")


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
    if name.endswith(".toml"):
        return _read(Path(name))
    key, names = name.replace("-", "_"), string_names()
    if key not in names:
        raise InputError(f"string '{name}'", ", ".join(names) + " or FILE.toml", did_you_mean(key, names))
    return _read(Path(str(files(__name__) / f"{key}.toml")))


def _read(path: Path) -> StringPreset:
    tree = load_toml(path)
    where = f"string {path.stem}"
    contact = tree.pop("contact", None)
    preset = from_tree(StringPreset, {**tree, "name": path.stem}, where)
    touched = None if contact is None else from_tree(Contact, contact, f"{where}.contact")
    _refuse_impossible(preset.string, tree.get("string", {}), where)
    if touched is not None and not 0.0 < touched.position < preset.string.length:
        given, length = touched.position, preset.string.length
        raise InputError(f"{where}.contact.position {given:g} m", f"between 0 and {length:g} m")
    return StringPreset(
        name=preset.name,
        title=preset.title,
        source=preset.source,
        open_frequency=preset.open_frequency,
        string=preset.string,
        notes=preset.notes,
        contact=touched,
    )


def _refuse_impossible(string: StringParams, given: Mapping[str, Any], where: str) -> None:
    above_zero = {"length", "linear_density", "tension", "young_modulus"}
    for key in above_zero | given.keys():
        value = getattr(string, key)
        if not (value > 0.0 if key in above_zero else value >= 0.0):
            raise InputError(f"{where}.{key} {value:g}", "above 0" if key in above_zero else "0 or more")
