"""Reference pages that follow the folders: a new verb, plug-in or preset is documented by being there."""

import tomllib
from collections.abc import Iterator
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import click

import monochord
from monochord.cli import monochord as verbs
from monochord.registry import Registry

PRESETS = ("sensors", "strings", "materials")


def write(folder: Path) -> None:
    """Write `verbs.md`, `plugins.md` and `presets.md` into a folder, leaving alone what would not change."""
    for name, text in (("verbs.md", _verbs()), ("plugins.md", _plugins()), ("presets.md", presets())):
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


def presets() -> str:
    """Return the page of all strings, sensors and materials, each with its source."""
    parts = [
        "# Presets\n",
        "Each is a file of numbers with its source; one of your own is named by its path, `FILE.toml`.\n",
    ]
    for room in PRESETS:
        parts.append(f"## {room.capitalize()}\n")
        held = sorted(Path(str(files(f"monochord.physics.{room}"))).glob("*.toml"))
        parts += [_preset(path.stem, tomllib.loads(path.read_text(encoding="utf-8"))) for path in held]
    return "\n".join(parts)


def _preset(name: str, told: dict[str, Any]) -> str:
    return f"### {name}\n\n{told['title']}.\n\nSource: {told['source']}.\n\n{told.get('notes', '')}\n"
