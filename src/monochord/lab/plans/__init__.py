"""Presets of plans, one TOML file each, found by its name."""

from collections.abc import Sequence

from monochord.core.config import from_tree
from monochord.core.presets import Presets
from monochord.lab.plan import Plan

PLANS = Presets(package=__name__, kind="plan", read=lambda tree, where: from_tree(Plan, tree, where))


def plan_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> plan_names()[:3]
    ['builds', 'designs', 'hardware']
    """
    return PLANS.names()


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
    return PLANS.load(name, assignments)
