"""Names of plug-ins and presets: the names that ``monochord list`` shows."""

from importlib import import_module
from pathlib import Path
from typing import Any

from monochord.core.errors import InputError, did_you_mean
from monochord.core.ranges import checked
from monochord.core.registry import Registry
from monochord.lab.plans import plan_names
from monochord.perception.model.bundled import bundled_names
from monochord.physics.materials import material_names
from monochord.physics.sensors import sensor_names
from monochord.physics.strings import string_names

PRESETS = {
    "materials": material_names,
    "models": bundled_names,
    "plans": plan_names,
    "sensors": sensor_names,
    "strings": string_names,
}
"""Kinds of presets, each with the function that returns their names."""


@checked
def available(kind: str) -> list[str]:
    """Return the names of all plug-ins or presets of a kind, those of installed packages too.

    Parameters
    ----------
    kind
        A kind of plug-in, such as ``"sources"``, ``"sinks"``, ``"features"`` or ``"estimators"``; or
        ``"sensors"``, ``"strings"``, ``"materials"``, ``"plans"`` or ``"models"``.

    Returns
    -------
    list of str
        Sorted. ``monochord list KIND`` shows each with its options.

    Raises
    ------
    InputError
        For an unknown kind.

    Examples
    --------
    >>> import monochord as mc
    >>> "jack" in mc.available("sources"), "prototype" in mc.available("sensors")
    (True, True)
    """
    kinds = {name: registry.names for name, registry in registries().items()} | PRESETS
    if kind not in kinds:
        raise InputError(f"kind '{kind}'", ", ".join(sorted(kinds)), did_you_mean(kind, kinds))
    return sorted(kinds[kind]())


def registries() -> dict[str, Registry[Any]]:
    """Return the registry of each folder of plug-ins, by the folder's name: every folder with a ``base.py``.

    >>> registries()["sinks"].kind
    'sink'
    """
    root = Path(__file__).parents[1]
    packages = [
        ".".join(base.relative_to(root.parent).parent.parts) for base in sorted(root.rglob("base.py"))
    ]
    things = [thing for package in packages for thing in vars(import_module(package)).values()]
    return {thing.folder: thing for thing in things if isinstance(thing, Registry)}
