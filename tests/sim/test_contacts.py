"""Contacts of a simulation as motions of a virtual sensor's objects."""

import numpy as np
import pytest

from monochord import VirtualSensor
from monochord.sim._contacts import ACROSS, FORCE, HEIGHT, POSITION, ContactSlots, SimulatedContact

LENGTH, STEP = 0.2, 1e-3


def slots(count: int = 2, materials: int = 1) -> ContactSlots:
    return ContactSlots(LENGTH, STEP, materials, count)


def test_an_object_touches_at_the_speed_at_which_it_comes() -> None:
    following = slots(1)
    before = following.follow([])
    touching = following.follow([SimulatedContact(0.08, 0.5, -1e-5, approach=0.04)])
    assert before == [[0.08, 0.0, pytest.approx(0.04 * STEP), 0.0]]
    assert touching == [[0.08, 0.5, 0.0, 0.0]]


def test_an_object_nearby_is_as_far_off_as_it_is() -> None:
    (row,) = slots(1).follow([SimulatedContact(0.08, 0.0, 2e-3)])
    assert row == [0.08, 0.0, 2e-3, 0.0]


def test_a_slot_follows_its_contact_whatever_their_order_by_force() -> None:
    following = slots()
    for left, right in ((1.0, 0.5), (0.5, 1.0), (1.0, 0.5)):
        rows = following.follow([SimulatedContact(0.08, left, 0.0), SimulatedContact(0.11, right, 0.0)])
        assert [(row[POSITION], row[FORCE]) for row in rows] == [(0.08, left), (0.11, right)]


def test_the_strongest_contacts_find_slots_and_the_rest_is_counted() -> None:
    following = slots()
    contacts = [SimulatedContact(0.05 + 0.02 * k, force, 0.0) for k, force in enumerate((0.2, 0.9, 0.1, 0.5))]
    rows = following.follow(contacts)
    assert sorted(row[FORCE] for row in rows) == [0.5, 0.9]
    assert following.counts.extra == 2
    assert following.counts.notes == (
        "2 contact readings beyond the slots were left out: the strongest count",
    )


def test_what_a_virtual_sensor_does_not_take_is_clipped_and_counted() -> None:
    following = slots(1)
    (row,) = following.follow([SimulatedContact(0.08, 25.0, -1e-3, across=-0.7)])
    assert (row[FORCE], row[ACROSS]) == (10.0, -0.5)
    for _ in range(5):
        following.follow([])
    (row,) = following.follow([SimulatedContact(0.199, 1.0, 0.0)])
    assert row[HEIGHT] > 0.0
    assert (following.counts.clipped, following.counts.fast, following.counts.off_string) == (1, 1, 1)
    assert len(following.counts.notes) == 3


def test_objects_nearby_are_never_counted() -> None:
    following = slots(1)
    following.follow([SimulatedContact(x, 0.0, 1e-3) for x in (0.001, 0.05, 0.1)])
    assert following.counts.notes == ()


def test_a_contact_has_a_slot_of_its_material() -> None:
    rows = slots(1, materials=2).follow([SimulatedContact(0.08, 1.0, 0.0, material=1)])
    assert [row[FORCE] for row in rows] == [0.0, 1.0]


@pytest.mark.parametrize("seed", range(8))
def test_no_simulation_makes_motions_that_a_virtual_sensor_refuses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    following, twin = slots(), VirtualSensor("prototype", objects=["plastic"] * 2)
    moved = 0
    for _ in range(20):
        block = [following.away()]
        for _ in range(11):
            gaps = rng.choice([-1e-4, 1e-3, 4e-3], rng.integers(0, 5))
            block.append(
                following.follow(
                    [
                        SimulatedContact(
                            rng.uniform(-0.02, 0.22),
                            rng.exponential(4.0) * (gap < 0.0),
                            gap,
                            approach=rng.normal(0.0, 3.0),
                            across=rng.normal(),
                        )
                        for gap in gaps
                    ]
                )
            )
        rows = np.array(block[1:]).transpose(2, 1, 0)
        twin.lead(STEP, position=rows[0], force=rows[1], clearance=rows[2], across=rows[3])
        moved += int((rows[1] > 0.0).sum())
    assert moved > 50
