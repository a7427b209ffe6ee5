"""Sensors: one TOML file a design, with its source.

A file names its string preset, ``string = "prototype"``; ``[override]`` changes values of it. The other keys
are the fields of `monochord.physics.twin.Sensor`.
"""

from typing import Any

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.presets import Presets
from monochord.physics.strings import load_string
from monochord.physics.twin.setup import Sensor


def _read(tree: dict[str, Any], where: str) -> Sensor:
    string, override = tree.get("string"), tree.pop("override", {})
    if not isinstance(string, str) or not isinstance(override, dict):
        given = f"{where}: string = {string!r} with override = {override!r}"
        raise InputError(given, 'the name of a string preset, and a table: string = "prototype"')
    tree["string"] = {**to_tree(load_string(string).string), **override}
    for needed in ("title", "source"):
        if not tree.get(needed):
            raise InputError(f"option '{where}.{needed}' (not given)", "a text")
    return from_tree(Sensor, tree, where)


SENSORS = Presets(package=__name__, kind="sensor", read=_read)
sensor_names, load_sensor = SENSORS.names, SENSORS.load
