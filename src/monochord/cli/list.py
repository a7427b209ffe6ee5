"""The verb `list`: what there is to choose from, folder by folder."""

import dataclasses
import json
import math
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import click

import monochord
from monochord.cli._output import echo
from monochord.core.config import to_tree
from monochord.core.errors import InputError, did_you_mean
from monochord.core.registry import Registry
from monochord.lab.plans import load_plan, plan_names
from monochord.physics.materials import load_material, material_names
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.strings import load_string, string_names

Entry: TypeAlias = dict[str, Any]


@click.command()
@click.argument("kind", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def list(kind: str | None, *, as_json: bool) -> None:  # noqa: A001
    """Show all plug-ins and presets, or those of one KIND, with options and defaults."""
    shelves = _shelves()
    if kind is not None:
        wanted = kind if kind in shelves else f"{kind}s"
        if wanted not in shelves:
            raise InputError(f"kind '{kind}'", ", ".join(shelves), did_you_mean(kind, shelves))
        shelves = {wanted: shelves[wanted]}
    found = {name: [*entries()] for name, entries in shelves.items()}
    if as_json:
        echo(json.dumps(found))
    else:
        echo(*"\n\n".join(_text(*shelf) for shelf in found.items()).split("\n"))


def _shelves() -> dict[str, Callable[[], Iterable[Entry]]]:
    """Return what can be listed: every folder with a registry, found by its ``base.py``, and the presets."""
    shelves: dict[str, Callable[[], Iterable[Entry]]] = {}
    root = Path(monochord.__path__[0])
    for contract in root.rglob("base.py"):
        folder = ".".join(contract.relative_to(root.parent).parent.parts)
        for registry in (
            thing for thing in vars(import_module(folder)).values() if isinstance(thing, Registry)
        ):
            shelves[contract.parent.name] = lambda registry=registry: _plugins(registry)
    shelves |= {"strings": _strings, "sensors": _sensors, "materials": _materials, "plans": _plans}
    return dict(sorted(shelves.items()))


def _plugins(registry: Registry[Any]) -> Iterable[Entry]:
    for name in registry.names():
        kind = registry.load(name)
        summary = (kind.__doc__ or "").strip().partition("\n")[0]
        yield {"name": name, "summary": summary, "options": [_option(f) for f in dataclasses.fields(kind)]}


def _option(field: dataclasses.Field[Any]) -> Entry:
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    else:
        default = None if field.default is dataclasses.MISSING else field.default
    required = field.default is field.default_factory is dataclasses.MISSING
    plain = to_tree({"default": default}).get("default")
    if isinstance(plain, float) and not math.isfinite(plain):
        plain = str(plain)  # JSON has no infinity
    return {"name": field.name, "required": required, "default": plain}


def _strings() -> Iterable[Entry]:
    for name in string_names():
        preset = load_string(name)
        facts = {"source": preset.source, "notes": preset.notes, "open_frequency": preset.open_frequency}
        yield {"name": name, "summary": preset.title, **facts, "string": to_tree(preset.string)}


def _sensors() -> Iterable[Entry]:
    for name in sensor_names():
        yield _preset(name, to_tree(load_sensor(name)), "sensor")


def _materials() -> Iterable[Entry]:
    for name in material_names():
        yield _preset(name, to_tree(load_material(name)), "material")


def _plans() -> Iterable[Entry]:
    for name in plan_names():
        yield _preset(name, to_tree(load_plan(name)), "plan")


def _preset(name: str, tree: Entry, kind: str) -> Entry:
    """Return a preset as an entry: what is said of it beside what it is, by its kind."""
    facts = {"summary": tree.pop("title"), "source": tree.pop("source"), "notes": tree.pop("notes")}
    return {"name": name, **facts, kind: {key: value for key, value in tree.items() if key != "name"}}


def _text(shelf: str, entries: Iterable[Entry]) -> str:
    lines = [shelf]
    for entry in entries:
        lines.append(f"  {entry['name']:<16} {entry['summary']}")
        for option in entry.get("options", []):
            default = "(required)" if option["required"] else f"[{_shown(option['default'])}]"
            lines.append(f"  {'':<18} {option['name']} {default}")
    return "\n".join(lines)


def _shown(default: Any) -> str:
    return "none" if default is None else str(default)
