"""The two-sided form on sound whose lines are known."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.types import Contact, Estimates, Window
from monochord.perception.closed_form.two_segments import UNITS, TwoSegments
from monochord.physics.strings import load_string
from monochord.physics.theory import segment_frequencies

RATE, SIZE = 44100, 4410
STRING = load_string("appendix").string
FORM = TwoSegments(string=STRING, law="linear", most_force=2.5)


def told(contact: Contact, *, hiss: float = 1e-4, shift: float = 0.0, form: TwoSegments = FORM) -> Estimates:
    """Three partials of each segment, the own one louder, heard in `hiss`; all moved by a share."""
    time = np.arange(SIZE) / RATE
    own = [
        sum(np.sin(2.0 * np.pi * n * f * (1.0 + shift) * time + n) / n**2 for n in (1, 2, 3))
        for f in segment_frequencies(STRING, contact)
    ]
    heard = 0.2 * np.stack((own[0] + 0.2 * own[1], own[1] + 0.2 * own[0]))
    heard += hiss * np.random.default_rng(1).standard_normal(heard.shape)
    return form.prepare(RATE, SIZE)(Window(samples=heard.astype(np.float32), start=0, sample_rate=RATE))


@pytest.mark.parametrize("position", [0.09, 0.2, 0.31, 0.43, 0.56])
@pytest.mark.parametrize("force", [0.1, 1.2, 2.4])
def test_position_tension_and_force_are_those_of_the_clamp(position: float, force: float) -> None:
    estimates = told(Contact(position=position, force=force))
    assert estimates["contact"].value == 1.0
    assert estimates["position"].value == pytest.approx(position, abs=2e-4)
    assert estimates["tension"].value == pytest.approx(65.0 + 6.0 * force, abs=0.15)
    assert estimates["force"].value == pytest.approx(force, abs=0.03)
    assert {name: estimate.unit for name, estimate in estimates.items()} == UNITS


def test_the_lower_of_both_is_the_frequency() -> None:
    for position, lower in ((0.2, "frequency_2"), (0.45, "frequency_1")):
        estimates = told(Contact(position=position, force=1.0))
        assert estimates["frequency"] == estimates[lower]


def test_errors_are_as_large_as_they_are_said_to_be() -> None:
    contact = Contact(position=0.23, force=1.0)
    estimates = told(contact, hiss=0.02)
    for name, truth in (("position", contact.position), ("force", contact.force)):
        estimate = estimates[name]
        assert estimate.valid
        assert abs(estimate.value - truth) < 4.0 * estimate.std


@pytest.mark.parametrize("shift", [-0.08, 0.25])
def test_a_tension_that_no_force_explains_is_no_reading_of_this_touch(shift: float) -> None:
    estimates = told(Contact(position=0.23, force=1.0), shift=shift)
    position = estimates["position"]
    assert not position.valid or abs(position.value - 0.23) > 5e-3


def test_swapping_the_channels_mirrors_the_string() -> None:
    left, right = (told(Contact(position=x, force=1.0))["position"].value for x in (0.2, STRING.length - 0.2))
    assert left == pytest.approx(STRING.length - right, abs=1e-4)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (np.zeros, "silence"),
        (lambda shape: np.full(shape, np.nan), "samples that are not numbers"),
        (lambda shape: 0.1 * np.random.default_rng(2).standard_normal(shape), "no harmonic structure"),
    ],
)
def test_it_abstains_from_all_with_one_reason(
    make: Callable[[tuple[int, int]], np.ndarray], reason: str
) -> None:
    samples = make((2, SIZE)).astype(np.float32)
    estimates = FORM.prepare(RATE, SIZE)(Window(samples=samples, start=0, sample_rate=RATE))
    assert {(estimate.valid, estimate.why_not) for estimate in estimates.values()} == {(False, reason)}
    assert set(estimates) == set(UNITS)
