"""Reference pages that follow the folders: a new verb or plug-in is documented by being there."""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import click

import monochord
from monochord.cli import monochord as verbs
from monochord.registry import Registry


def write(folder: Path) -> None:
    """Write `verbs.md` and `plugins.md` into a folder, leaving a file alone that would not change."""
    for name, text in (("verbs.md", _verbs()), ("plugins.md", _plugins())):
        page = folder / name
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def _verbs() -> str:
    parent = click.Context(verbs, info_name="monochord", **verbs.context_settings)
    parts = ["# Verbs\n"]
    for name in verbs.list_commands(parent):
        verb = verbs.get_command(parent, name)
        if verb is not None:
            usage = verb.get_help(click.Context(verb, info_name=name, parent=parent))
            parts.append(f"## {name}\n\n```text\n{usage}\n```\n")
    return "\n".join(parts)


def _plugins() -> str:
    parts = [
        "# Plug-ins\n",
        "Options of a plug-in are set by its table in a configuration file or by `--set`.\n",
    ]
    for registry in _registries():
        parts.append(f"## {registry.package.rpartition('.')[2].capitalize()}\n")
        parts += [_described(registry, name) for name in registry.names()]
    return "\n".join(parts)


def _registries() -> Iterator[Registry[Any]]:
    for room in walk_packages(monochord.__path__, "monochord."):
        held = list(vars(import_module(room.name)).values()) if room.ispkg else []
        yield from (v for v in held if isinstance(v, Registry) and v.package == room.name)


def _described(registry: Registry[Any], name: str) -> str:
    directive = f".. autoclass:: {registry.package}.{name}.{registry.load(name).__name__}\n   :no-members:\n"
    return f"### {name}\n\n```{{eval-rst}}\n{directive}```\n"
