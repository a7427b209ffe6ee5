"""Presets of plans, one TOML file each, found by its name.

A plan may be another one again, with other builds, days and objects: its table ``again`` says which one and
how it differs, see `Again`; what the file states besides replaces the other plan's, and its groups are added.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError, did_you_mean
from monochord.core.presets import Presets
from monochord.lab.plan import Group, Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class Again:
    """How the groups of a plan differ from those of another one.

    Parameters
    ----------
    plan
        The other plan: a name from `plan_names`.
    builds, designs
        Added to each build of its groups of the plan's own sensor, and of those with a drawn design.
    days
        Added to each day.
    materials
        Objects in the place of its own. A group that is named after its object gets the other's name.
    """

    plan: str
    builds: int = 0
    designs: int = 0
    days: int = 0
    materials: dict[str, str] = field(default_factory=dict[str, str])

    def groups(self, groups: Sequence[Group]) -> tuple[Group, ...]:
        """Return the groups of the other plan as they are here."""
        objects = {group.material for group in groups}
        for material in self.materials:
            if material not in objects:
                given = f"again.materials '{material}'"
                raise InputError(
                    given, ", ".join(sorted(objects)) + f" of {self.plan}", did_you_mean(material, objects)
                )
        names = {group.name: group.name.replace(group.material, self._material(group)) for group in groups}
        return tuple(self._group(group, names) for group in groups)

    def _material(self, group: Group) -> str:
        return self.materials.get(group.material, group.material)

    def _group(self, group: Group, names: Mapping[str, str]) -> Group:
        further = self.designs if group.design else self.builds
        return replace(
            group,
            name=names[group.name],
            like=names.get(group.like, group.like),
            material=self._material(group),
            builds=tuple(build + further for build in group.builds),
            first_build=None if group.first_build is None else group.first_build + further,
            days=tuple(day + self.days for day in group.days),
        )


def _read(tree: dict[str, Any], where: str) -> Plan:
    """Return a plan by its table; raises `InputError` if it cannot be used."""
    if "again" in tree:
        again = from_tree(Again, tree["again"], f"{where}, again")
        other = load_plan(again.plan)
        groups = [to_tree(group) for group in again.groups(other.groups)]
        own = {key: value for key, value in tree.items() if key != "again"}
        tree = {**to_tree(other), **own, "groups": [*groups, *tree.get("groups", [])]}
    return from_tree(Plan, tree, where)


PLANS = Presets(package=__name__, kind="plan", read=_read)


def plan_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> plan_names()[:3]
    ['builds', 'designs', 'everywhere']
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
