"""A plug-in folder is its own registry.

The folder holds ``base.py`` with one abstract class and one file per implementation; a file whose name
begins with ``_`` is private. The file's name is the plug-in's name in configuration and on the command
line (a hyphen reads as an underscore). Adding a plug-in adds a file and edits nothing.
"""

import inspect
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Generic, TypeVar

from monochord.core.config import from_tree
from monochord.core.errors import InputError, did_you_mean

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Registry(Generic[T]):
    """The plug-ins of one folder.

    Parameters
    ----------
    package
        The folder as a dotted name: ``"monochord.capture.sources"``.
    base
        The abstract class that its plug-ins subclass.
    """

    package: str
    base: type[T]

    @property
    def kind(self) -> str:
        """What one of its plug-ins is called: the folder's name without its plural s."""
        return self.package.rpartition(".")[2].removesuffix("s")

    def names(self) -> list[str]:
        """Return the names of all plug-ins, sorted, without importing any."""
        folder = import_module(self.package).__path__
        found = (module.name for module in pkgutil.iter_modules(folder))
        return sorted(name for name in found if name != "base" and not name.startswith("_"))

    def load(self, name: str) -> type[T]:
        """Return the plug-in class called `name`; raises `InputError` with a suggestion if there is none."""
        key, names = name.replace("-", "_"), self.names()
        if key not in names:
            raise InputError(f"{self.kind} '{name}'", ", ".join(names), did_you_mean(key, names))
        module = import_module(f"{self.package}.{key}")
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

    def build(self, name: str, options: Mapping[str, Any] | None = None) -> T:
        """Return the plug-in `name` built from plain option values; a plug-in is a frozen dataclass."""
        return from_tree(self.load(name), options or {}, where=name)
