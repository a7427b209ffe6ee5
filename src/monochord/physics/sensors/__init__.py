"""Sensors as data: one TOML file a design, each with its source, found by its name.

A file names its string preset, ``string = "prototype"``; what differs from it stands in ``[override]``. The
rest is laid out as `monochord.physics.twin.Sensor` is.
"""

from pathlib import Path
from typing import Any

from monochord.core.config import from_tree, load_toml, to_tree
from monochord.core.errors import InputError
from monochord.core.presets import preset_names, preset_path
from monochord.physics.strings import load_string
from monochord.physics.twin.setup import Sensor


def sensor_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> "prototype" in sensor_names()
    True
    """
    return preset_names(__name__)


def load_sensor(name: str) -> Sensor:
    """Return a preset by its name, or read one from a file of your own.

    Parameters
    ----------
    name
        A name from `sensor_names`, or the path of a TOML file laid out as the presets are.

    Raises
    ------
    InputError
        If there is no such preset, or the file cannot be used.

    Examples
    --------
    >>> load_sensor("prototype").range
    (0.05, 0.15)
    """
    return _read(preset_path(__name__, "sensor", name))


def _read(path: Path) -> Sensor:
    where = f"sensor {path.stem}"
    tree: dict[str, Any] = {**load_toml(path), "name": path.stem}
    string, differs = tree.get("string"), tree.pop("override", {})
    if not isinstance(string, str) or not isinstance(differs, dict):
        given = f"{where}: string = {string!r} with override = {differs!r}"
        raise InputError(given, 'the name of a string preset, and a table: string = "prototype"')
    tree["string"] = {**to_tree(load_string(string).string), **differs}
    for needed in ("title", "source"):
        if not tree.get(needed):
            raise InputError(f"option '{where}.{needed}' (not given)", "a text")
    return from_tree(Sensor, tree, where)
