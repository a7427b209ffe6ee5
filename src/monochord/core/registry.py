"""A plug-in folder is its own registry, and installed packages add to it by entry points.

The folder holds ``base.py`` with one abstract class and one file per implementation; a file whose name
begins with ``_`` is private. The file's name is the plug-in's name in configuration and on the command
line (a hyphen reads as an underscore). Adding a plug-in adds a file and edits nothing.

Another distribution adds plug-ins by entry points of the group ``monochord.FOLDER``, such as
``monochord.sources``: the entry's name is the plug-in's, its value the class or the module that holds it.
"""

import inspect
import logging
import pkgutil
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, distributions, entry_points
from types import ModuleType
from typing import Any, Generic, TypeVar

from monochord.core.config import from_tree
from monochord.core.errors import InputError, did_you_mean

T = TypeVar("T")
_log = logging.getLogger("monochord")


@dataclass(frozen=True, slots=True)
class Registry(Generic[T]):
    """The plug-ins of one folder, and those that installed packages add to it.

    Parameters
    ----------
    package
        The folder as a dotted name: ``"monochord.capture.sources"``.
    base
        The abstract class that its plug-ins subclass.
    moved
        Names that are in another package now, each with the way to get it.
    """

    package: str
    base: type[T]
    moved: Mapping[str, str] = field(default_factory=dict[str, str], compare=False)

    @property
    def folder(self) -> str:
        """The folder's own name, such as ``sources``."""
        return self.package.rpartition(".")[2]

    @property
    def kind(self) -> str:
        """What one of its plug-ins is called: the folder's name without its plural s."""
        return self.folder.removesuffix("s")

    def names(self) -> list[str]:
        """Return the names of all plug-ins, sorted, without importing any."""
        return sorted({*self._own_names(), *installed(self.folder)})

    def load(self, name: str) -> type[T]:
        """Return the plug-in class called `name`.

        Raises
        ------
        InputError
            If there is none of this name (with a suggestion), or more than one.
        TypeError
            If a file of the folder holds no plug-in, or several.
        """
        key, names = name.replace("-", "_"), self.names()
        if key not in names:
            remedy = self.moved.get(key) or did_you_mean(key, names)
            raise InputError(f"{self.kind} '{name}'", ", ".join(names), remedy)
        added = installed(self.folder).get(key, ())
        own = key in self._own_names()
        refuse_clash(self.kind, key, added, own=own)
        return self._class_in(import_module(f"{self.package}.{key}")) if own else self._added(added[0])

    def build(self, name: str, options: Mapping[str, Any] | None = None, *, where: str | None = None) -> T:
        """Return the plug-in `name` built from plain option values; a plug-in is a frozen dataclass.

        `where` is the path of the options in error messages, the plug-in's name by default.
        """
        return from_tree(self.load(name), options or {}, where=name if where is None else where)

    def name_of(self, plug_in: T) -> str:
        """Return the name of a plug-in; raises `InputError` if its class is not registered."""
        kind = type(plug_in)
        package, _, name = kind.__module__.rpartition(".")
        if package == self.package and name in self._own_names():
            return name
        for name in installed(self.folder):
            with suppress(InputError):
                if self.load(name) is kind:
                    return name
        raise InputError(f"{self.kind} {kind.__name__}, which has no name", ", ".join(self.names()))

    def _own_names(self) -> set[str]:
        names = (module.name for module in pkgutil.iter_modules(import_module(self.package).__path__))
        return {name for name in names if name != "base" and not name.startswith("_")}

    def _class_in(self, module: ModuleType) -> type[T]:
        """Return the one public plug-in class that a module defines."""
        own = [
            member
            for member_name, member in inspect.getmembers(module, inspect.isclass)
            if member.__module__ == module.__name__
            and issubclass(member, self.base)
            and not member_name.startswith("_")
        ]
        if len(own) != 1:
            message = f"{module.__name__} must hold exactly one public {self.base.__name__}, not {len(own)}"
            raise TypeError(message)
        return own[0]

    def _added(self, entry: EntryPoint) -> type[T]:
        """Return the plug-in class of an installed package."""
        given = f"{self.kind} '{entry.name}' of the package {_distribution(entry)}"
        remedy = f"reinstall or remove {_distribution(entry)}"
        try:
            value = entry.load()
            value = self._class_in(value) if isinstance(value, ModuleType) else value
        except (Exception, SystemExit) as error:  # whatever the package does as it is imported
            raise InputError(
                f"{given} ({type(error).__name__}: {error})", f"a {self.base.__name__} that loads", remedy
            ) from error
        if not (inspect.isclass(value) and issubclass(value, self.base)):
            raise InputError(f"{given} ({entry.value})", f"a subclass of {self.base.__name__}", remedy)
        return value


def installed(folder: str) -> Mapping[str, tuple[EntryPoint, ...]]:
    """Return what installed distributions add to a folder of plug-ins or presets, by name.

    Parameters
    ----------
    folder
        The folder's own name: ``sources``, ``sensors``. The group of entry points is ``monochord.FOLDER``;
        nothing of a distribution is imported.

    Returns
    -------
    Mapping[str, tuple[EntryPoint, ...]]
        More than one entry of a name is a clash, see `refuse_clash`.

    Examples
    --------
    >>> dict(installed("no_such_folder"))
    {}
    """
    return _installed(folder, tuple(sys.path))


@cache
def _installed(folder: str, path: tuple[str, ...]) -> Mapping[str, tuple[EntryPoint, ...]]:  # noqa: ARG001
    """Return the entry points by name; `path` is where Python looks for them, which takes milliseconds."""
    entries: dict[str, tuple[EntryPoint, ...]] = {}
    for entry in _entries(f"monochord.{folder}"):
        name = entry.name.replace("-", "_")
        entries[name] = (*entries.get(name, ()), entry)
    return entries


def _entries(group: str) -> Iterable[EntryPoint]:
    """Return the entry points of a group; one package whose list is damaged does not hide the others'."""
    with suppress(Exception):
        return entry_points(group=group)
    by_package: dict[str, Iterable[EntryPoint]] = {}
    for package in distributions():
        try:
            by_package.setdefault(package.name, package.entry_points.select(group=group))
        except Exception as error:  # noqa: BLE001  (whatever the library makes of damage)
            given = f"package {package.metadata['Name']} (its entry points are damaged: {error})"
            _log.warning(
                "monochord: %s", InputError(given, "the entry points of its author", "reinstall or remove it")
            )
            by_package[package.name] = ()
    return [entry for entries in by_package.values() for entry in entries]


def refuse_clash(kind: str, name: str, added: tuple[EntryPoint, ...], *, own: bool) -> None:
    """Raise `InputError` if a name is defined more than once, by Monochord or by packages."""
    if len(added) + own > 1:
        owners = [*(["Monochord"] if own else []), *sorted(map(_distribution, added))]
        given = f"{kind} '{name}' (of {' and of '.join(owners)})"
        raise InputError(given, "one of each name", f"remove the package {owners[-1]}")


def _distribution(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else "unknown"
