"""The virtual laboratory: stands in for people, robots and instruments, so that device code can be tested."""

from monochord.core.workers import run_all
from monochord.lab.assignment import Assignment, assignments
from monochord.lab.collection import collect
from monochord.lab.deviation import NONE, Deviation
from monochord.lab.offline import make
from monochord.lab.plan import Group, Plan
from monochord.lab.plans import load_plan, plan_names
from monochord.lab.render import Rendering, render

__all__ = [
    "NONE",
    "Assignment",
    "Deviation",
    "Group",
    "Plan",
    "Rendering",
    "assignments",
    "collect",
    "load_plan",
    "make",
    "plan_names",
    "render",
    "run_all",
]
