"""What contacts of a rigid-body simulation do to a string, as the motions that lead a virtual sensor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from monochord.core.units import Metres, MetresPerSecond, Newtons, Seconds
from monochord.physics.twin.virtual_sensor import CLEARANCE, MAX_ACROSS, MAX_ALONG, MAX_FORCE

RISE: MetresPerSecond = 1.0
"""Speed at which an object of which the simulation says nothing more leaves the string."""
LEAST_CLEARANCE: Metres = 1e-5
"""Clearance of an object a step before it touches: above 0, so that it comes from above."""
END_SHARE = 0.02
"""Share of the string at each end on which the virtual sensor cannot be touched."""
HOLD = 1.5
"""How much stronger a contact must be to take another one's slot."""
POSITION, FORCE, HEIGHT, ACROSS = range(4)
"""Columns of a slot's motion: m from the start, N, m above the string at rest, m/s across it."""

Row: TypeAlias = list[float]


class SimulatedContact(NamedTuple):
    """A contact of a string with an object, or an object close to it.

    `force` is the normal force in N, `gap` the distance in m, below 0 in contact; `approach` in m/s is the
    speed of the object towards the string, `across` the one across it, and `along` the one along it.
    `material` counts in the materials of the string's objects.
    """

    position: Metres
    force: Newtons
    gap: Metres
    approach: MetresPerSecond = 0.0
    along: MetresPerSecond = 0.0
    across: MetresPerSecond = 0.0
    material: int = 0

    @property
    def touches(self) -> bool:
        """Whether it is a contact."""
        return self.force > 0.0 or self.gap <= 0.0


@dataclass(slots=True)
class Counts:
    """How many readings of contacts a string has had in which something was left out.

    `clipped` were of more than 10 N, `off_string` within a fiftieth of the string from its ends or beyond,
    `extra` beyond the slots, `fast` more than 0.5 m/s across.
    """

    clipped: int = 0
    off_string: int = 0
    extra: int = 0
    fast: int = 0

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence for each count that is not zero."""
        said = (
            (self.clipped, f"of more than {MAX_FORCE:g} N were clipped to {MAX_FORCE:g} N"),
            (self.off_string, "at the string's ends or beyond them were left out"),
            (self.extra, "beyond the slots were left out: the strongest count"),
            (self.fast, f"of more than {MAX_ACROSS:g} m/s across the string were clipped to that speed"),
        )
        return tuple(f"{count} contact readings {what}" for count, what in said if count)


class ContactSlots:
    """Slots of a virtual sensor that follow contacts from step to step, so that none jumps along the string.

    The string's `length` is in m, the simulation's `step` in s; each material has `slots` contacts at once.
    """

    def __init__(self, length: Metres, step: Seconds, materials: int, slots: int) -> None:
        self._low, self._high = END_SHARE * length, (1.0 - END_SHARE) * length
        self._reach = 0.99 * MAX_ALONG * step
        self._step, self._slots = step, slots
        self._groups = [range(slots * each, slots * (each + 1)) for each in range(materials)]
        self.counts = Counts()
        self._middle = 0.5 * length
        self.restart()

    def restart(self) -> None:
        """Take all objects away, as they are before any contact; counts stay."""
        self._before = self._last = self.away()

    def away(self) -> list[Row]:
        """Return the motion of slots whose objects are off the string."""
        return [[self._middle, 0.0, CLEARANCE, 0.0] for group in self._groups for _ in group]

    def follow(self, contacts: Sequence[SimulatedContact]) -> list[Row]:
        """Return where the objects of all slots are after a step, one row each: (position, force, ...).

        An object that touches for the first time approaches within the step before at the speed that the
        simulation says: the row of that step, which was returned before, is changed for it.
        """
        rows = [[x, 0.0, min(height + RISE * self._step, CLEARANCE), 0.0] for x, _, height, _ in self._last]
        taken = set[int]()
        for contact in self._strongest(contacts):
            slot = self._slot_of(contact, taken)
            if slot is None:
                self.counts.extra += contact.touches
                continue
            taken.add(slot)
            rows[slot] = self._row(contact)
            if contact.touches and self._last[slot][HEIGHT] > 0.0:
                last = self._last[slot]
                last[HEIGHT] = min(max(contact.approach * self._step, LEAST_CLEARANCE), last[HEIGHT])
                if self._before[slot][HEIGHT] > 0.0:
                    last[POSITION] = contact.position
        self._before, self._last = self._last, rows
        return rows

    def _strongest(self, contacts: Sequence[SimulatedContact]) -> list[SimulatedContact]:
        """Return the contacts that may have slots, the strongest first, and objects nearby after them.

        One that has a slot is given up for another of more than `HOLD` times its force only.
        """
        ranked: list[tuple[float, float, SimulatedContact]] = []
        for contact in contacts:
            if self._low <= contact.position <= self._high:
                held = any(
                    self._last[slot][HEIGHT] <= 0.0
                    and abs(contact.position - self._last[slot][POSITION]) <= self._reach
                    for slot in self._groups[contact.material]
                )
                ranked.append((-contact.force * (HOLD if held else 1.0), contact.gap, contact))
            else:
                self.counts.off_string += contact.touches
        chosen: list[SimulatedContact] = []
        left = [self._slots] * len(self._groups)
        for _, _, contact in sorted(ranked):
            if left[contact.material]:
                chosen.append(contact)
                left[contact.material] -= 1
            else:
                self.counts.extra += contact.touches
        return chosen

    def _slot_of(self, contact: SimulatedContact, taken: set[int]) -> int | None:
        """Return the slot that a contact continues, or else a free one, or none."""
        near: list[tuple[bool, float, int]] = []
        for slot in self._groups[contact.material]:
            position, _, height, _ = self._last[slot]
            distance = abs(contact.position - position)
            free = height > 0.0 and self._before[slot][HEIGHT] > 0.0
            if slot not in taken and (distance <= self._reach or free):
                near.append((free, distance, slot))
        return min(near)[2] if near else None

    def _row(self, contact: SimulatedContact) -> Row:
        """Return what a contact does to the string, within what a virtual sensor takes."""
        if not contact.touches:
            return [contact.position, 0.0, contact.gap, 0.0]
        self.counts.clipped += contact.force > MAX_FORCE
        self.counts.fast += abs(contact.across) > MAX_ACROSS
        across = min(max(contact.across, -MAX_ACROSS), MAX_ACROSS)
        return [contact.position, min(contact.force, MAX_FORCE), 0.0, across]


def truth_of(contacts: Sequence[SimulatedContact], slip_speed: MetresPerSecond) -> tuple[float, ...]:
    """Return what a simulation knows of a string at a step, in the order of `TRUTH`.

    Of several contacts the strongest counts; NaN where nothing touches.
    """
    touching = [each for each in contacts if each.touches]
    if not touching:
        return 0.0, 0.0, np.nan, np.nan, np.nan, np.nan
    hardest = max(touching, key=lambda each: each.force)
    speed = float(np.hypot(hardest.along, hardest.across))
    return 1.0, len(touching), hardest.position, hardest.force, float(speed > slip_speed), speed


TRUTH = ("contact", "contacts", "position", "force", "slip", "slip_velocity")
UNTOUCHED = truth_of((), 0.0)
