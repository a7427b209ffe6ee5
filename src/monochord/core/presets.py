"""Presets as data: one TOML file each in a folder, found by name.

Another distribution adds presets by entry points of the group ``monochord.FOLDER``, such as
``monochord.sensors``: the entry's name is the preset's, its value the package that holds ``NAME.toml``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Generic, TypeVar

from monochord.core.config import load_toml, override
from monochord.core.errors import InputError, did_you_mean
from monochord.core.ranges import checked
from monochord.core.registry import installed, refuse_clash

Preset = TypeVar("Preset")


@dataclass(frozen=True, slots=True, kw_only=True)
class Presets(Generic[Preset]):
    """The presets of one kind: the files of the folder `package`, each read into an object.

    `kind` is for messages: "string", "material". `read` creates an object from a file's table and its name in
    messages. Without a ``name`` of its own an object gets the file's stem, if it is `named`.

    >>> from monochord.physics.materials import load_material, material_names
    >>> "wood" in material_names(), load_material("allen-key").young_modulus
    (True, 205000000000.0)
    """

    package: str
    kind: str
    read: Callable[[dict[str, Any], str], Preset]
    named: bool = True

    def names(self) -> list[str]:
        """Return the names of the presets, sorted."""
        return preset_names(self.package)

    @checked
    def load(
        self, name: str | Path, assignments: Sequence[str] = (), values: Mapping[str, Any] | None = None
    ) -> Preset:
        """Return a preset by name, or read one from your own file.

        Parameters
        ----------
        name
            A name from `names`, with hyphens or underscores, or the path of a TOML file in the presets'
            format.
        assignments
            Overrides as text, such as ``radius=0.004``, applied last.
        values
            Values that replace the file's, by name.

        Raises
        ------
        InputError
            If there is no such preset, or the file cannot be used.

        Examples
        --------
        >>> import monochord as mc
        >>> mc.load_sensor("prototype").string.length, mc.load_string("appendix").string.tension
        (0.2, 65.0)
        >>> mc.load_material("wood", ["radius=0.004"]).radius
        0.004
        """
        path = preset_path(self.package, self.kind, name)
        name_of = {"name": path.stem} if self.named else {}
        tree = override({**name_of, **load_toml(path), **(values or {})}, assignments)
        return self.read(tree, f"{self.kind} {path.stem}")


def preset_names(package: str) -> list[str]:
    """Return the names of a package's presets and of installed ones, sorted.

    >>> "wood" in preset_names("monochord.physics.materials")
    True
    """
    return sorted({*_built_in_names(package), *installed(_folder(package))})


def preset_path(package: str, kind: str, name: str | Path) -> Path:
    """Return the file of a preset by its name, with hyphens or underscores, or the path of a TOML file.

    Raises `InputError` if there is no such preset, or more than one; `kind` is for the message.

    >>> preset_path("monochord.physics.materials", "material", "allen-key").name
    'allen_key.toml'
    """
    name = str(name)
    if name.endswith(".toml"):
        return Path(name)
    key, names = name.replace("-", "_"), preset_names(package)
    if key not in names:
        raise InputError(f"{kind} '{name}'", ", ".join(names) + " or FILE.toml", did_you_mean(key, names))
    added, built_in = installed(_folder(package)).get(key, ()), key in _built_in_names(package)
    refuse_clash(kind, key, added, built_in=built_in)
    try:
        return Path(str(files(package if built_in else added[0].value) / f"{key}.toml"))
    except (Exception, SystemExit) as error:  # importing a package runs its code
        given = f"{kind} '{name}' ({type(error).__name__}: {error})"
        raise InputError(given, "a preset of an installed package", "reinstall it") from error


def _folder(package: str) -> str:
    return package.rpartition(".")[2]


def _built_in_names(package: str) -> set[str]:
    paths = (Path(entry.name) for entry in files(package).iterdir())
    return {path.stem for path in paths if path.suffix == ".toml"}
