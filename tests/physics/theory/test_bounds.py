"""Sensitivities and the Cramer-Rao bounds."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monochord.core.errors import InputError
from monochord.core.types import Contact, Floats, StringParams
from monochord.physics.theory import far_segment_sensitivity, frequency_sensitivities
from monochord.physics.theory.bounds import contact_bound, far_segment_bound, series_bound, tone_bound
from monochord.physics.theory.segments import position_from_far_segment, split_frequencies
from monochord.physics.theory.stiffness import inharmonicity, partial_numbers
from monochord.physics.theory.tension import TensionLaw, tension_from_force

STRING = StringParams(
    length=0.65, linear_density=6.5e-4, tension=65.0, core_diameter=2.54e-4, tension_per_force=6.0
)


FAR = Contact(position=0.6, force=0.0)


def _series(f0: float, b: float, waves: Floats) -> Floats:
    t = np.arange(800) / 8000.0
    n = np.arange(1, waves.shape[0] + 1)
    angle = 2 * np.pi * (n * f0 * np.sqrt(1 + b * n**2))[:, None] * t
    return np.sum(waves[:, :1] * np.cos(angle) + waves[:, 1:] * np.sin(angle), axis=0)


@pytest.mark.parametrize("known", [True, False], ids=["B known", "B unknown"])
def test_series_bound_equals_the_fisher_matrix(*, known: bool) -> None:
    # Fundamental (and stiffness), and two wave amplitudes a partial, differentiated numerically.
    waves = np.array([[1.0, 0.2], [0.5, -0.6], [-0.1, 0.4]])
    f0, b, noise = 201.3, 3e-4, 0.05
    columns = [(_series(f0 + 1e-4, b, waves) - _series(f0 - 1e-4, b, waves)) / 2e-4]
    if not known:
        columns.append((_series(f0, b + 1e-7, waves) - _series(f0, b - 1e-7, waves)) / 2e-7)
    for i in range(waves.size):
        unit = np.zeros(waves.size)
        unit[i] = 1.0
        columns.append(_series(f0, b, unit.reshape(waves.shape)))
    matrix = np.array(columns) @ np.array(columns).T / noise**2
    scale = np.sqrt(np.diag(matrix))
    numeric = np.sqrt(np.linalg.inv(matrix / np.outer(scale, scale))[0, 0]) / scale[0]
    snr = np.sum(waves**2, axis=1) / (2 * noise**2)
    bound = series_bound(
        f0, [1, 2, 3], snr, inharmonicity=b, known_inharmonicity=known, duration=0.1, sample_rate=8000.0
    )
    assert bound == pytest.approx(numeric, rel=0.01)


def test_tone_bound_is_reached_by_maximum_likelihood() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(800) / 8000.0
    snr, f = 10.0, 987.6
    errors: list[float] = []
    for _ in range(100):
        sound = np.cos(2 * np.pi * f * t + rng.uniform(0, 6.28)) + rng.normal(0, np.sqrt(0.5 / snr), 800)
        grid = f + np.linspace(-1.0, 1.0, 81)
        power = np.abs(np.exp(-2j * np.pi * np.outer(grid, t)) @ sound) ** 2
        k = int(np.argmax(power[1:-1])) + 1
        left, middle, right = power[k - 1 : k + 2]
        errors.append(grid[k] + 0.025 * 0.5 * (left - right) / (left - 2 * middle + right) - f)
    bound = float(tone_bound(0.1, 8000.0, snr))
    assert np.std(errors) == pytest.approx(bound, rel=0.25)


def test_longer_louder_and_richer_windows_tell_more() -> None:
    base = float(tone_bound(0.1, 44100.0, 100.0))
    assert float(tone_bound(0.2, 44100.0, 100.0)) == pytest.approx(base / 2**1.5, rel=1e-4)
    assert float(tone_bound(0.1, 44100.0, 400.0)) == pytest.approx(base / 2.0)
    assert series_bound(100.0, [1], 100.0, duration=0.1, sample_rate=44100.0) == pytest.approx(base)
    few = series_bound(100.0, [1, 2], 100.0, duration=0.1, sample_rate=8000.0)
    more = series_bound(100.0, [1, 2, 5], 100.0, duration=0.1, sample_rate=8000.0)
    assert more < few


def test_unknown_stiffness_costs_and_one_partial_cannot_tell_it() -> None:
    known = series_bound(100.0, [1, 2, 3], 10.0, duration=0.1, sample_rate=8000.0)
    unknown = series_bound(
        100.0, [1, 2, 3], 10.0, known_inharmonicity=False, duration=0.1, sample_rate=8000.0
    )
    assert unknown > known
    assert (
        series_bound(100.0, [2], 10.0, known_inharmonicity=False, duration=0.1, sample_rate=8000.0) == np.inf
    )
    assert series_bound(100.0, [], 10.0, duration=0.1, sample_rate=8000.0) == np.inf


TENSION, END, OPEN, LONGER, ALIKE = 0.3, 2e-4, 0.05, 1e-4, 0.4
"""Standard errors of all that is unknown below, and the correlation of both lengthenings."""


def _pitches(law: TensionLaw, x: float, force: float, tension: float, *lengths: float) -> Floats:
    """Return both segments' and the untouched frequency of a sensor with errors of tension, ends, contact."""
    end_1, end_2, longer_1, longer_2 = lengths
    own = replace(STRING, tension=STRING.tension + tension)
    touched = tension_from_force(
        own, force, x, law
    )  # as if the ends were right: what is left out is of second order
    speeds = np.sqrt(np.array([touched, touched, own.tension]) / own.linear_density)
    segments = [x + end_1 + longer_1, own.length - x + end_2 + longer_2, own.length + end_1 + end_2]
    return speeds / (2.0 * np.array(segments))


KNOWLEDGE: dict[str, dict[str, float]] = {
    "all else known": {},
    "tuning and ends unknown": {"tension_std": TENSION, "end_std": END},
    "all unknown, but measured untouched": {
        "tension_std": TENSION, "end_std": END, "open_frequency_std": OPEN, "lengthening_std": LONGER,
        "lengthening_correlation": ALIKE,
    },
}  # fmt: skip


@pytest.mark.parametrize("known", KNOWLEDGE)
@pytest.mark.parametrize("law", ["linear", "geometric"])
def test_contact_bound_equals_the_fisher_matrix_of_all_that_is_unknown(law: TensionLaw, known: str) -> None:
    # Position, force, tension, both ends and both lengthenings, differentiated numerically.
    x, force, snr, knowledge = 0.2, 2.0, 0.1, KNOWLEDGE[known]
    values = np.array([x, force, 0.0, 0.0, 0.0, 0.0, 0.0])
    steps = np.array([1e-6, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6, 1e-6])
    slopes = np.array(
        [
            (_pitches(law, *(values + step)) - _pitches(law, *(values - step))) / (2.0 * step.max())
            for step in np.diag(steps)
        ]
    )
    noise = np.array([0.0, 0.0, knowledge.get("open_frequency_std", np.inf)])
    for side, (f, length) in enumerate(zip(split_frequencies(STRING, x, force, law), (x, 0.45), strict=True)):
        b = inharmonicity(STRING, length)
        numbers = partial_numbers(3000.0, f, b)
        noise[side] = series_bound(f, numbers, snr, duration=0.1, sample_rate=8000.0, inharmonicity=b)
    prior = np.zeros((7, 7))
    prior[2:5, 2:5] = np.diag(np.array([TENSION, END, END]) ** -2.0)
    prior[5:, 5:] = np.linalg.inv(LONGER**2 * np.array([[1.0, ALIKE], [ALIKE, 1.0]]))
    free = [2, 5, 7][list(KNOWLEDGE).index(known)]
    scale = np.array([1e-4, 0.1, 0.3, 1e-4, 1e-4, 1e-4, 1e-4])[:free]
    fisher = (slopes @ np.diag(noise**-2.0) @ slopes.T + prior)[:free, :free]
    expected = scale * np.sqrt(np.diag(np.linalg.inv(fisher * np.outer(scale, scale))))
    touch = Contact(position=x, force=force)
    bound = contact_bound(
        STRING, touch, snr, highest=3000.0, duration=0.1, sample_rate=8000.0, law=law, **knowledge
    )
    assert bound == pytest.approx(expected[:2], rel=1e-3)


def test_the_untouched_pitch_removes_the_ends_from_the_force_and_leaves_the_contact() -> None:
    force = 1.0

    def bound(end: float, open_std: float, longer: float = 0.0, alike: float = 0.0) -> float:
        return contact_bound(
            STRING, Contact(position=0.2, force=force), 1e6, duration=0.1, sample_rate=44100.0,
            tension_std=2.0, end_std=end, open_frequency_std=open_std, lengthening_std=longer,
            lengthening_correlation=alike,
        )[1]  # fmt: skip

    firm, loose = bound(0.0, 0.01), bound(2e-4, 0.01)
    # What is left of the ends is the scale of the tension: an error in proportion to the force.
    assert loose == pytest.approx(np.hypot(firm, force * 2.0 * 2.0**0.5 * 2e-4 / STRING.length), rel=0.05)
    assert bound(2e-4, np.inf) > 100.0 * loose
    soft, softer = bound(0.0, 0.01, 2e-4), bound(0.0, 0.01, 4e-4)
    assert soft > 5.0 * loose
    assert softer == pytest.approx(2.0 * soft, rel=0.05)
    assert bound(0.0, 0.01, 4e-4, 1.0) == pytest.approx(2.0**0.5 * softer, rel=0.05)


@pytest.mark.parametrize("law", ["linear", "geometric"])
def test_a_surface_that_stiffens_tells_force_besides(law: TensionLaw) -> None:
    """With all else known, (x, F) follow from two lines, whose slopes are those of strings that shorten."""
    x, force, compliance = 0.2, 0.3, 2e-6

    def lines(x: float, force: float) -> Floats:
        give = STRING.tension * compliance * (0.3 / force) ** (1.0 / 3.0)
        half = np.array(split_frequencies(STRING, x, force, law)) * np.array([x, STRING.length - x])
        return half / (np.array([x, STRING.length - x]) + give - STRING.tension * compliance)

    slopes = np.column_stack(
        [
            (lines(x + step, force + push) - lines(x - step, force - push)) / (2.0 * (step + push))
            for step, push in ((1e-6, 0.0), (0.0, 1e-4))
        ]
    )
    noise = 1e-3 * np.array(split_frequencies(STRING, x, force, law))
    expected = np.sqrt(np.diag(np.linalg.inv(slopes.T @ np.diag(noise**-2.0) @ slopes)))
    options = {"duration": 0.1, "sample_rate": 44100.0, "line_std": 1e-3}
    slope = -STRING.tension * compliance / (3.0 * force)
    touch = Contact(position=x, force=force)
    bound = contact_bound(STRING, touch, 1e9, law=law, lengthening_slope=slope, **options)
    assert bound == pytest.approx(expected, rel=0.01)
    assert bound[1] < contact_bound(STRING, touch, 1e9, law=law, **options)[1]


def test_string_without_force_coupling_still_tells_position() -> None:
    # The ratio of the two frequencies locates, whatever the tension does.
    touch = Contact(position=0.2, force=0.0)
    deaf = replace(STRING, tension_per_force=0.0)
    x_only, never = contact_bound(deaf, touch, 10.0, duration=0.1, sample_rate=8000.0)
    x, _ = contact_bound(STRING, touch, 10.0, duration=0.1, sample_rate=8000.0)
    assert x_only == pytest.approx(x, rel=1e-9)
    assert never == np.inf
    x_deaf, x_built = (
        contact_bound(string, touch, 10.0, duration=0.1, sample_rate=8000.0, tension_std=5.0, end_std=1e-4)[0]
        for string in (deaf, STRING)
    )
    assert x_deaf == pytest.approx(x_built, rel=1e-9)
    assert x < x_built < 1e-4


def test_far_segment_bound_scales_with_the_frequency_error() -> None:
    assert far_segment_bound(164.8, 82.4, 0.65, 0.5) == pytest.approx(0.5 * 0.65 / (2 * 164.8))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: tone_bound(0.1, 8000.0, 0.0),
        lambda: contact_bound(STRING, FAR, 10.0, highest=400.0, duration=0.1, sample_rate=8000.0),
        lambda: contact_bound(STRING, FAR, 10.0, duration=0.1, sample_rate=8000.0, open_frequency_std=0.0),
        lambda: contact_bound(
            STRING, FAR, 10.0, duration=0.1, sample_rate=8000.0, lengthening_correlation=1.5
        ),
    ],
)
def test_impossible_knowledge_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()


PLAIN = StringParams(
    length=0.2, linear_density=4e-4, tension=65.0, core_diameter=2.54e-4, tension_per_force=6.0
)


@settings(max_examples=30)
@given(st.floats(0.02, 0.18), st.floats(0.01, 5.0), st.sampled_from(["linear", "geometric"]))
def test_sensitivities_equal_finite_differences(x: float, force: float, law: TensionLaw) -> None:
    exact = frequency_sensitivities(PLAIN, Contact(position=x, force=force), law)
    step = 1e-6
    ahead, behind = (split_frequencies(PLAIN, x + sign * step, force, law) for sign in (1, -1))
    np.testing.assert_allclose(exact[:, 0], (np.array(ahead) - behind) / (2 * step), rtol=1e-5, atol=1e-3)
    step = 1e-4
    harder, softer = (split_frequencies(PLAIN, x, force + sign * step, law) for sign in (1, -1))
    np.testing.assert_allclose(exact[:, 1], (np.array(harder) - softer) / (2 * step), rtol=1e-4, atol=1e-6)


@settings(max_examples=30)
@given(st.floats(100.0, 2000.0))
def test_far_segment_sensitivity_equals_a_finite_difference(f: float) -> None:
    step = 1e-3
    ahead = position_from_far_segment(f + step, 82.4, 0.65)
    behind = position_from_far_segment(f - step, 82.4, 0.65)
    assert far_segment_sensitivity(f, 82.4, 0.65) == pytest.approx((ahead - behind) / (2 * step), rel=1e-5)


def test_geometric_law_is_blind_to_the_first_touch() -> None:
    first = frequency_sensitivities(PLAIN, Contact(position=0.1, force=0.0), "geometric")
    np.testing.assert_array_equal(first[:, 1], 0.0)


def test_what_lines_are_worth_and_what_is_expected_enter_the_contact_bound() -> None:
    """Of a touch in the middle T / T0 errs by 2 hypot(line / sqrt 2, open), and a prior adds information."""
    string = StringParams(length=0.2, linear_density=4e-4, tension=65.0, tension_per_force=0.5)
    touch = Contact(position=0.1, force=1.0)
    bound = partial(
        contact_bound,
        duration=0.1,
        sample_rate=44100.0,
        line_std=5e-4,
        open_frequency_std=0.7,
        tension_std=5.0,
    )
    first = np.sqrt(65.0 / 4e-4) / 0.4
    _, force = bound(string, touch, 1e6)
    relative = 2.0 * np.hypot(5e-4 / np.sqrt(2.0), 0.7 / first)
    assert force == pytest.approx(relative * (65.5 / 0.5), rel=0.01)
    _, both = bound(string, touch, 1e6, force_prior_std=0.2)
    assert both == pytest.approx((force**-2 + 0.2**-2) ** -0.5, rel=1e-3)
    x, _ = bound(string, touch, 1e6)
    assert x == pytest.approx(0.2 * 0.25 * np.sqrt(2.0) * 5e-4, rel=0.01)
    slack = StringParams(length=0.2, linear_density=4e-4, tension=65.0)
    assert bound(slack, touch, 1e6)[1] == np.inf
    assert bound(slack, touch, 1e6, force_prior_std=0.3)[1] == 0.3
