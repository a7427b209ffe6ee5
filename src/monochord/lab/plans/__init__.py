"""Presets of plans, one TOML file each, found by its name."""

from collections.abc import Sequence

from monochord.core.config import from_tree, load_toml, override
from monochord.core.presets import preset_names, preset_path
from monochord.lab.plan import Plan


def plan_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> plan_names()
    ['paper', 'quick', 'small']
    """
    return preset_names(__name__)


def load_plan(name: str, assignments: Sequence[str] = ()) -> Plan:
    """Return a preset by its name, or read one from a file of your own.

    Parameters
    ----------
    name
        A name from `plan_names`, or the path of a TOML file laid out as the presets are.
    assignments
        Overrides, such as ``sensor=prototype_one_driver``.

    Raises
    ------
    InputError
        If there is no such preset, or the file cannot be used.

    Examples
    --------
    >>> [group.name for group in load_plan("small").groups]
    ['hold', 'slide']
    """
    path = preset_path(__name__, "plan", name)
    return from_tree(Plan, {"name": path.stem, **override(load_toml(path), assignments)}, f"plan {path.stem}")
