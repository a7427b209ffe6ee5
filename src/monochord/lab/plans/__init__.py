"""Presets of plans, one TOML file each, found by its name."""

from collections.abc import Sequence
from functools import partial

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.presets import Presets
from monochord.lab.plan import Plan

MOVED = "hardware", "unseen"
"""Former presets, which are files of the repository now, in `studies/plans`."""


PLANS = Presets(package=__name__, kind="plan", read=partial(from_tree, Plan))


def plan_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> plan_names()
    ['paper', 'quick', 'small']
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
    if name in MOVED:
        remedy = f"it is a file of the repository now: studies/plans/{name}.toml"
        raise InputError(f"plan '{name}'", ", ".join(plan_names()), remedy)
    return PLANS.load(name, assignments)
