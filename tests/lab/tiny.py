"""A plan of two short sessions."""

from monochord.lab.assignment import Assignment, assignments
from monochord.lab.plan import Delays, ForceSensor, Group, Plan

LATE = Delays(audio=(0.02, 0.05), wrench=(0.005, 0.01), pose=(0.03, 0.06))


def tiny(**changes: object) -> Plan:
    """A touch of half a second, and one that slides both ways."""
    options: dict[str, object] = {
        "name": "tiny",
        "delays": LATE,
        "groups": (
            Group(name="hold", grid=(2, 1), forces=(0.8, 1.2), hold=0.5, days=(1,)),
            Group(name="slide", protocol="slide", grid=(2, 1), forces=(0.8, 1.2), hold=0.5, strokes=2,
                  speeds=(0.01, 0.03)),
        ),
    }  # fmt: skip
    return Plan(**(options | changes))  # pyright: ignore[reportArgumentType]


def quiet(**changes: object) -> Plan:
    """The same without noise of the instruments."""
    sensor = ForceSensor(noise=0.0, torque_noise=0.0, drift=0.0, crosstalk=(0.0, 0.0), lost=0.0)
    return tiny(force_sensor=sensor, pose_noise=0.0, **changes)


def session(name: str, plan: Plan | None = None, seed: int = 0) -> Assignment:
    """One session of a plan by its name."""
    named = {one.name: one for one in assignments(plan or tiny(), seed)}
    return named[name]
