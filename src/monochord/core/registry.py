"""Registries of plug-ins: a folder's files, and entry points of installed packages.

The folder holds ``base.py`` with one abstract class, and one file per implementation; a file whose name
begins with ``_`` is private. The file's name is the plug-in's name in configuration and on the command line
(a hyphen means an underscore). Adding a plug-in adds a file and edits nothing.

Another distribution adds plug-ins by entry points of the group ``monochord.FOLDER``, such as
``monochord.sources``: the entry's name is the plug-in's name, its value the class or the module with the
class.
"""

import inspect
import logging
import pkgutil
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, distributions, entry_points
from types import ModuleType
from typing import Any, Generic, TypeVar

from monochord.core.config import from_tree
from monochord.core.errors import InputError, MissingLibraryError, did_you_mean

T = TypeVar("T")
_log = logging.getLogger("monochord")


@dataclass(frozen=True, slots=True)
class Registry(Generic[T]):
    """The plug-ins of one folder, and those added by installed packages.

    `package` is the folder as a dotted name, ``"monochord.capture.sources"``, and `base` the abstract class
    of its plug-ins; `moved` has names that a package of the repository has, each with the package's name.
    """

    package: str
    base: type[T]
    moved: Mapping[str, str] = field(default_factory=dict[str, str], compare=False)

    @property
    def folder(self) -> str:
        """The last part of the folder's name, such as ``sources``."""
        return self.package.rpartition(".")[2]

    @property
    def kind(self) -> str:
        """The kind of plug-in: the folder's name without its plural s."""
        return self.folder.removesuffix("s")

    def names(self) -> list[str]:
        """Return the names of all plug-ins, sorted, without importing any."""
        return sorted({*self._built_in_names(), *installed(self.folder)})

    def load(self, name: str) -> type[T]:
        """Return the plug-in class with this name.

        Raises `InputError` if the name is unknown (with a suggestion) or ambiguous, or its package is not
        installed; `TypeError` if a file of the folder holds no plug-in, or several.
        """
        key, names = name.replace("-", "_"), self.names()
        if key not in names and (package := self.moved.get(key)):
            raise MissingLibraryError(f"The {self.kind} '{name}'", f"the package {package}", package)
        if key not in names:
            raise InputError(f"{self.kind} '{name}'", ", ".join(names), did_you_mean(key, names))
        added = installed(self.folder).get(key, ())
        built_in = key in self._built_in_names()
        refuse_clash(self.kind, key, added, built_in=built_in)
        return self._class_in(import_module(f"{self.package}.{key}")) if built_in else self._added(added[0])

    def build(self, name: str, options: Mapping[str, Any] | None = None, *, where: str | None = None) -> T:
        """Build the plug-in `name`, a frozen dataclass, from plain option values.

        `where` is the path of the options in error messages, by default the plug-in's name.
        """
        return from_tree(self.load(name), options or {}, where=name if where is None else where)

    def name_of(self, plug_in: T) -> str:
        """Return the name of a plug-in; raises `InputError` if its class is not registered."""
        kind = type(plug_in)
        package, _, name = kind.__module__.rpartition(".")
        if package == self.package and name in self._built_in_names():
            return name
        for name in installed(self.folder):
            with suppress(InputError):
                if self.load(name) is kind:
                    return name
        raise InputError(f"{self.kind} {kind.__name__}, which is not registered", ", ".join(self.names()))

    def _built_in_names(self) -> set[str]:
        names = (module.name for module in pkgutil.iter_modules(import_module(self.package).__path__))
        return {name for name in names if name != "base" and not name.startswith("_")}

    def _class_in(self, module: ModuleType) -> type[T]:
        """Return the one public plug-in class that a module defines."""
        classes = [
            member
            for member_name, member in inspect.getmembers(module, inspect.isclass)
            if member.__module__ == module.__name__
            and issubclass(member, self.base)
            and not member_name.startswith("_")
        ]
        if len(classes) != 1:
            message = (
                f"{module.__name__} must hold exactly one public {self.base.__name__}, not {len(classes)}"
            )
            raise TypeError(message)
        return classes[0]

    def _added(self, entry: EntryPoint) -> type[T]:
        """Return the plug-in class of an installed package."""

        def class_of(value: Any) -> type[T]:
            cls = self._class_in(value) if isinstance(value, ModuleType) else value
            if not (inspect.isclass(cls) and issubclass(cls, self.base)):
                raise TypeError(f"{entry.value} is no subclass of {self.base.__name__}")
            return cls

        return load_added(self.kind, entry, f"a {self.base.__name__} that can be imported", class_of)


def installed(folder: str) -> Mapping[str, tuple[EntryPoint, ...]]:
    """Return by name what distributions, none of them imported, add to a folder such as ``sources``.

    The entry point group is ``monochord.FOLDER``. Several entries for one name are a clash, see
    `refuse_clash`.

    >>> dict(installed("no_such_folder"))
    {}
    """
    return _installed(folder, tuple(sys.path))


@cache
def _installed(folder: str, path: tuple[str, ...]) -> Mapping[str, tuple[EntryPoint, ...]]:  # noqa: ARG001
    """Return the entry points by name; `path` is Python's search path; takes milliseconds."""
    entries: dict[str, tuple[EntryPoint, ...]] = {}
    for entry in _entries(f"monochord.{folder}"):
        name = entry.name.replace("-", "_")
        entries[name] = (*entries.get(name, ()), entry)
    return entries


def _entries(group: str) -> Iterable[EntryPoint]:
    """Return the entry points of a group; a package with a damaged list does not affect others."""
    with suppress(Exception):
        return entry_points(group=group)
    by_package: dict[str, Iterable[EntryPoint]] = {}
    for package in distributions():
        try:
            by_package.setdefault(package.name, package.entry_points.select(group=group))
        except Exception as error:  # noqa: BLE001  (whatever the library makes of damage)
            given = f"package {package.metadata['Name']} (its entry points are damaged: {error})"
            _log.warning("monochord: %s", InputError(given, "valid entry points", "reinstall or remove it"))
            by_package[package.name] = ()
    return [entry for entries in by_package.values() for entry in entries]


def load_added(kind: str, entry: EntryPoint, expected: str, read: Callable[[Any], T]) -> T:
    """Return what `read` makes of the object that an installed package's entry point names.

    Raises `InputError`, with `kind` and `expected`, if it cannot be imported, or `read` raises.
    """
    try:
        return read(entry.load())
    except (Exception, SystemExit) as error:  # importing a package runs its code
        package = _distribution(entry)
        given = f"{kind} '{entry.name}' of the package {package} ({type(error).__name__}: {error})"
        raise InputError(given, expected, f"reinstall or remove {package}") from error


def refuse_clash(kind: str, name: str, added: tuple[EntryPoint, ...], *, built_in: bool) -> None:
    """Raise `InputError` if a name is defined more than once, by Monochord or by packages."""
    if len(added) + built_in > 1:
        owners = [*(["Monochord"] if built_in else []), *sorted(map(_distribution, added))]
        given = f"{kind} '{name}' (of {' and of '.join(owners)})"
        raise InputError(given, "unique names", f"remove the package {owners[-1]}")


def _distribution(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else "unknown"
