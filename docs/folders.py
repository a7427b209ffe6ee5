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
from monochord.core.registry import Registry

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
            parts.append(f"## {name}\n")
            parts += _usages(verb, click.Context(verb, info_name=name, parent=parent))
    return "\n".join(parts)


def _usages(verb: click.Command, context: click.Context) -> Iterator[str]:
    """Yield the help of a verb, and then of every command that it holds."""
    yield f"```text\n{verb.get_help(context)}\n```\n"
    if not isinstance(verb, click.Group):
        return
    for name in verb.list_commands(context):
        part = verb.get_command(context, name)
        if part is not None:
            yield from _usages(part, click.Context(part, info_name=name, parent=context))


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
