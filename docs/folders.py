"""Reference pages made from the package: a new command, plug-in, preset or module is documented at once."""

import inspect
import tomllib
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from pkgutil import walk_packages
from types import ModuleType
from typing import Any

import click

import monochord
from monochord.cli import monochord as cli
from monochord.core.registry import Registry
from monochord.front.available import registries

PRESETS = ("sensors", "strings", "materials")
NOT_IN_LIBRARY = ("cli", "benchmarks", "figures")
"""Packages whose contents are on the pages of commands and plug-ins."""


def write(folder: Path) -> None:
    """Write the generated pages into a folder; a page that would not change is left alone."""
    pages = {"commands": commands, "plugins": plugins, "presets": presets}
    for package in packages():
        pages[f"library/{package}"] = partial(library, package)
    for name, text_of in pages.items():
        page, text = folder / f"{name}.md", text_of()
        page.parent.mkdir(exist_ok=True)
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def commands() -> str:
    """Return the page of all commands with their help."""
    parent = click.Context(cli, info_name="monochord", **cli.context_settings)
    parts = ["# Commands\n"]
    for name in cli.list_commands(parent):
        command = cli.get_command(parent, name)
        if command is not None:
            parts.append(f"## {name}\n")
            parts += _usages(command, click.Context(command, info_name=name, parent=parent))
    return "\n".join(parts)


def _usages(command: click.Command, context: click.Context) -> Iterator[str]:
    """Yield the help of a command and of its subcommands."""
    yield f"```text\n{command.get_help(context)}\n```\n"
    if not isinstance(command, click.Group):
        return
    for name in command.list_commands(context):
        part = command.get_command(context, name)
        if part is not None:
            yield from _usages(part, click.Context(part, info_name=name, parent=context))


def plugins() -> str:
    """Return the page of all plug-ins with their options."""
    parts = [
        "# Plug-ins\n",
        "Options of a plug-in are set in its table of a configuration file or with `--set`.\n",
    ]
    for registry in registries().values():
        parts.append(f"## {registry.package.rpartition('.')[2].capitalize()}\n")
        parts += [_plugin(registry, name) for name in registry.names()]
    return "\n".join(parts)


def _plugin(registry: Registry[Any], name: str) -> str:
    cls = registry.load(name)
    directive = f".. autoclass:: {cls.__module__}.{cls.__name__}\n   :no-members:\n"
    return f"### {name}\n\n```{{eval-rst}}\n{directive}```\n"


def presets() -> str:
    """Return the page of all strings, sensors and materials, each with its source."""
    parts = [
        "# Presets\n",
        "Each is a file of numbers with its source. A path, `FILE.toml`, names one of your own.\n",
    ]
    for package in PRESETS:
        parts.append(f"## {package.capitalize()}\n")
        paths = sorted(Path(str(files(f"monochord.physics.{package}"))).glob("*.toml"))
        parts += [_preset(path.stem, tomllib.loads(path.read_text(encoding="utf-8"))) for path in paths]
    return "\n".join(parts)


def _preset(name: str, definition: dict[str, Any]) -> str:
    title, source, notes = definition["title"], definition["source"], definition.get("notes", "")
    return f"### {name}\n\n{title}.\n\nSource: {source}.\n\n{notes}\n"


def packages() -> list[str]:
    """Return the names of the packages that have a library page."""
    names = (module.name for module in walk_packages(monochord.__path__) if "." not in module.name)
    return [name for name in names if not name.startswith("_") and name not in NOT_IN_LIBRARY]


def library(package: str) -> str:
    """Return the page of a package: every public module with its docstrings."""
    root = import_module(f"monochord.{package}")
    packages = {registry.package for registry in registries().values()}
    parts = [f"# monochord.{package}\n", _automodule(root)]
    for info in walk_packages(root.__path__, f"{root.__name__}."):
        parent, _, name = info.name.rpartition(".")
        private = any(part.startswith("_") for part in info.name.split("."))
        plugin = parent in packages and name != "base"
        if not private and not plugin:
            parts += [f"## {info.name.removeprefix('monochord.')}\n", _automodule(import_module(info.name))]
    return "\n".join(parts)


def _automodule(module: ModuleType) -> str:
    """Return the directive for a module and for what it defines itself, not what it imports."""
    own = [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and (inspect.isclass(value) or inspect.isfunction(value))
        and value.__module__ == module.__name__
    ]
    exports = hasattr(module, "__all__") or hasattr(module, "__path__")
    members = f"   :members: {', '.join(own)}\n" if own else "   :no-members:\n"
    directive = f".. automodule:: {module.__name__}\n{members if exports else ''}"
    return f"```{{eval-rst}}\n{directive}```\n"
