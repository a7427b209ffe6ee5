"""Strings: one TOML file each, with its source."""

from dataclasses import dataclass
from typing import Any

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.lengths import refuse_other_units
from monochord.core.notebook import html_table, lines
from monochord.core.presets import Presets
from monochord.core.types import Contact, StringParams
from monochord.core.units import Hertz

__all__ = ["load_string", "string_names"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StringPreset:
    """A string with its source.

    `open_frequency` is the fundamental stated by the source or required by the tuning; the string's tension,
    density and length agree with it. `contact` is the preset's default touch, ``None`` for an untouched
    string. `notes` says which values are assumed.
    """

    name: str
    title: str
    source: str
    open_frequency: Hertz
    string: StringParams
    notes: str = ""
    contact: Contact | None = None

    def __repr__(self) -> str:
        return lines(*self._facts())

    def _repr_html_(self) -> str:
        return html_table(*self._facts())

    def _facts(self) -> tuple[str, list[tuple[str, str]]]:
        string = self.string
        return f"String: {self.title}", [
            ("name", self.name),
            ("length", f"{1e3 * string.length:g} mm"),
            ("tension", f"{string.tension:g} N"),
            ("open frequency", f"{self.open_frequency:g} Hz"),
            ("source", self.source),
        ]

    @property
    def usual_contact(self) -> Contact:
        """The default touch: `contact`, or else a clamp without force at x/L = 0.35."""
        return self.contact or Contact(position=0.35 * self.string.length, force=0.0)


def _read(tree: dict[str, Any], where: str) -> StringPreset:
    preset = from_tree(StringPreset, tree, where)
    length, contact = preset.string.length, preset.contact
    refuse_other_units(length=length)
    if contact is not None and not 0.0 < contact.position < length:
        given = f"{where}.contact.position {contact.position:g} m"
        raise InputError(given, f"strictly between 0 and {length:g} m")
    return preset


STRINGS = Presets(package=__name__, kind="string", read=_read)
string_names, load_string = STRINGS.names, STRINGS.load
