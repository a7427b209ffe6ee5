"""The command `list`: names for options, and the settings for ``--set``."""

import json
from collections.abc import Iterable, Sequence
from typing import Any

import click

from monochord.cli._options import completes
from monochord.cli._output import echo
from monochord.core.errors import InputError, did_you_mean
from monochord.front.listing import ON_REQUEST, Entry
from monochord.front.listing import shelves as all_shelves


@click.command()
@click.argument("kind", required=False, **completes(lambda: all_shelves().keys()))
@click.argument("name", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def list(kind: str | None, name: str | None, *, as_json: bool) -> None:  # noqa: A001
    """List the names that options take, and the settings.

    Without arguments, list everything but settings and devices. KIND lists one kind, such as sources,
    materials or models; NAME shows one entry. Plug-ins are shown with their options and defaults. The kind
    'settings' lists the settings of a command, and 'devices' the audio inputs of this machine.

    \b
    monochord list sources
    monochord list settings live
    monochord list devices
    """  # noqa: D301
    shelves = all_shelves()
    if kind is not None:
        wanted = kind if kind in shelves else f"{kind}s"
        if wanted not in shelves:
            raise InputError(f"kind '{kind}'", ", ".join(shelves), did_you_mean(kind, shelves))
        shelves = {wanted: shelves[wanted]}
    entries = {shelf: [*of()] for shelf, of in shelves.items() if kind or shelf not in ON_REQUEST}
    if name is not None:
        entries = {shelf: _named(name, shelf, rows) for shelf, rows in entries.items()}
    if as_json:
        echo(json.dumps(entries))
    else:
        echo(*"\n\n".join(_text(*shelf) for shelf in entries.items()).split("\n"))


def _named(name: str, shelf: str, entries: Iterable[Entry]) -> Sequence[Entry]:
    rows = [*entries]
    key = name.replace("-", "_")
    names = [row["name"] for row in rows]
    chosen = [row for row in rows if row["name"] == key or row["name"].startswith(f"{key}_")]
    if not chosen:
        raise InputError(f"{shelf.removesuffix('s')} '{name}'", ", ".join(names), did_you_mean(key, names))
    return [row for row in chosen if row["name"] == key] or chosen


def _text(shelf: str, entries: Iterable[Entry]) -> str:
    lines = [shelf]
    for entry in entries:
        lines.append(f"  {entry['name']:<16} {entry['summary']}")
        for option in entry.get("options", []):
            default = "(required)" if option["required"] else f"[{_shown(option['default'])}]"
            shelf = f"{option['name'].removesuffix('s')}s"
            # An empty table is one of the user's own names.
            is_plugin = isinstance(option["default"], dict) and option["default"]
            more = f"; options: 'monochord list {shelf}'" if is_plugin else ""
            lines.append(f"  {'':<18} {option['name']} {default}{more}")
    return "\n".join(lines)


def _shown(default: Any) -> str:
    return "none" if default is None else str(default)
