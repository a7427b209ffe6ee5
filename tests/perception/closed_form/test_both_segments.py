"""The two-sided form: sounds that are computed from partials, and sensors by other simulators."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from tests import beam_elements, finite_differences
from tests.finite_differences import Take
from tests.perception.windows import RATE, SIZE, cut

from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.types import Audio, Estimates, Floats, Signal, StringParams
from monochord.perception.closed_form.explanations import RANGE, RATIO_STEP, RATIOS, distortion_of, priors
from monochord.perception.closed_form.lines import FREQUENCY, LEVEL, OWN, POWER, STD
from monochord.perception.estimators import ESTIMATORS
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import inharmonicity, open_frequency, stiff_partials, support_shortening

STRING = load_sensor("prototype").string


def partials(side: float, numbers: list[int], rise: float = 1.0) -> Floats:
    f0 = rise * open_frequency(STRING) * STRING.length / side
    return stiff_partials(f0, inharmonicity(STRING, side), np.array(numbers, float))


def sung(ends: Sequence[Floats], levels: Sequence[Floats], crosstalk: float = 0.15) -> Audio:
    """Lines of both ends, at levels in dB, with noise 60 dB below."""
    random, time = np.random.default_rng(7), np.arange(SIZE) / RATE
    one, two = (
        np.sin(2.0 * np.pi * np.outer(time, lines) + random.uniform(0.0, 6.0, len(lines)))
        @ 10.0 ** (level / 20.0)
        for lines, level in zip(ends, levels, strict=True)
    )
    own = 1.0 - crosstalk
    sound = 0.2 * np.stack((own * one + crosstalk * two, crosstalk * one + own * two))
    return (sound + 2e-4 * random.standard_normal(sound.shape)).astype(np.float32)


def touched(x: float, driven: tuple[int, int], rise: float = 1.002) -> Audio:
    """A touch by a point: of each segment the driven mode, and others 40 dB below it."""
    short = support_shortening(STRING)
    ends, levels = list[Floats](), list[Floats]()
    for side, mode in zip((x, STRING.length - x), driven, strict=True):
        numbers = [mode, *(n for n in range(1, 5) if n != mode)]
        ends.append(partials(side - short, numbers, rise))
        levels.append(np.array([0.0, *[-40.0] * (len(numbers) - 1)]))
    return sung(ends, levels)


UNTOUCHED = sung((partials(STRING.length, [3, 1, 2, 4]),) * 2, (np.array([0.0, -20.0, -25.0, -30.0]),) * 2)


def told(*sounds: Audio, sensing_range: tuple[float, float] | None = None) -> Estimates:
    """What is said of the last window, after 0.4 s of the untouched string."""
    signal = Signal(sample_rate=RATE, channels=2, string=STRING, sensing_range=sensing_range)
    estimate = ESTIMATORS.build("closed_form", {"sides": "both"}).prepare(signal, SIZE)
    return [estimate(window) for window in cut(np.concatenate([*([UNTOUCHED] * 4), *sounds], axis=1))][-1]


@pytest.mark.parametrize("driven", [(1, 1), (2, 1), (1, 3), (3, 2)])
@pytest.mark.parametrize("x", [0.061, 0.083, 0.1127, 0.138])
def test_a_touch_is_placed_whatever_its_drivers_sustain(x: float, driven: tuple[int, int]) -> None:
    said = told(touched(x, driven))
    assert said["contact"].value > 0.99
    assert said["position"].value == pytest.approx(x, abs=3e-4)
    assert abs(said["position"].value - x) < 2.0 * said["position"].std


def test_force_follows_from_tension_with_an_error_that_knows_of_the_give() -> None:
    forces = [told(touched(0.083, (1, 1), rise))["force"] for rise in (1.0, 1.003, 1.006)]
    values = [force.value for force in forces]
    assert values == sorted(values)
    assert all(0.1 < force.std < 1.0 for force in forces)


@pytest.mark.parametrize(
    ("x", "reason"), [(0.04, Reason.OUTSIDE_RANGE), (0.083, ""), (0.17, Reason.OUTSIDE_RANGE)]
)
def test_outside_the_sensing_range_contact_alone_is_told(x: float, reason: str) -> None:
    said = told(touched(x, (1, 1)), sensing_range=(0.05, 0.15))
    assert said["contact"].value > 0.99
    assert {said[name].reason for name in ("position", "force", "tension", "frequency_1")} == {reason}


@pytest.mark.parametrize(("x", "lower"), [(0.083, "frequency_2"), (0.117, "frequency_1")])
def test_the_lower_of_both_fundamentals_is_the_frequency(x: float, lower: str) -> None:
    said = told(touched(x, (1, 1)))
    assert said["frequency"] == said[lower]
    side = x if lower == "frequency_1" else STRING.length - x
    fundamental = 1.002 * open_frequency(STRING) * STRING.length / (side - support_shortening(STRING))
    assert said[lower].value == pytest.approx(fundamental, rel=1e-3)


def test_a_string_that_nothing_touches_is_told_so() -> None:
    said = told(UNTOUCHED)
    assert said["contact"].value < 0.01
    assert said["position"].reason is said["force"].reason is Reason.NO_CONTACT


def test_lines_of_no_string_have_no_place() -> None:
    random = np.random.default_rng(3)
    lines = random.uniform(900.0, 9000.0, 7)
    assert not told(sung((lines, lines[::-1] * 1.113), (np.zeros(7), np.zeros(7))))["position"].valid


def test_silence_and_noise_have_no_answer() -> None:
    assert told(np.zeros((2, SIZE), np.float32))["contact"].reason is Reason.SILENCE
    noise = 0.1 * np.random.default_rng(1).standard_normal((2, SIZE))
    assert not told(noise.astype(np.float32))["position"].valid


def test_one_segment_alone_has_no_force() -> None:
    side = STRING.length - 0.131 - support_shortening(STRING)
    silent = np.array([-90.0])
    far = sung(
        (partials(0.1, [1]), partials(side, [1, 2, 3, 4])), (silent, np.array([0.0, -20.0, -30.0, -40.0]))
    )
    said = told(far)
    assert not said["force"].valid
    assert not said["position"].valid or said["position"].value == pytest.approx(0.131, abs=2e-3)


@pytest.mark.parametrize("channels", [1, 3])
def test_another_signal_is_refused(channels: int) -> None:
    signal = Signal(sample_rate=RATE, channels=channels, string=STRING)
    with pytest.raises(InputError, match="two channels of a known string"):
        ESTIMATORS.build("closed_form", {"sides": "both"}).prepare(signal, SIZE)


@pytest.mark.parametrize("elsewhere", [0.0, 0.1])
def test_the_densities_of_the_ratio_integrate_to_one(elsewhere: float) -> None:
    pitch, ratio = (np.exp(each) for each in priors(3e-3, elsewhere, 0.01, 650.0))
    for density in (pitch, ratio):
        assert density.sum() * RATIO_STEP == pytest.approx(1.0, abs=0.02)
        assert 0.99 < RATIOS[density.argmax()] < 1.005
    assert np.average(RATIOS, weights=pitch) == pytest.approx(1.0, abs=1e-4)
    assert np.average(RATIOS, weights=ratio) < 0.998  # gives lower it more than presses raise it
    far = np.abs(RATIOS - 1.0 + 0.5 * RANGE).argmin()
    assert pitch[far] == pytest.approx(0.5 * elsewhere / RANGE, abs=1e-6)


def test_sums_and_differences_of_stronger_lines_are_distortion() -> None:
    lines = np.zeros((4, 5))
    lines[:, FREQUENCY] = 1650.0, 2590.0, 2.0 * 1650.0, 2.0 * 2590.0 - 1650.0
    lines[:, STD], lines[:, OWN], lines[:, LEVEL] = 0.2, 0.5, 10.0
    lines[:, POWER] = 1.0, 0.5, 1e-3, 1e-4
    density = distortion_of(lines, 10.0, 16000.0)
    assert (density[:2] == 0.0).all()
    assert (density[2:] > 10.0).all()


@cache
def scored(simulator: str, seed: int) -> tuple[float, Floats, Floats, Floats]:
    """Share of steady touched windows with a place, errors of places in mm, forces and their truth in N."""
    module = {"finite differences": finite_differences, "beam elements": beam_elements}[simulator]
    known: Take = module.take(seed, touches=5)
    tension = STRING.linear_density * (2.0 * known.length * open_frequency(STRING)) ** 2
    string = StringParams(
        length=known.length,
        linear_density=STRING.linear_density,
        tension=tension,
        core_diameter=STRING.core_diameter,
        tension_per_force=STRING.tension_per_force,
    )
    signal = Signal(sample_rate=RATE, channels=2, string=string)
    estimate = ESTIMATORS.build("closed_form", {"sides": "both"}).prepare(signal, SIZE)
    rows: list[tuple[float, float, float]] = []
    for window in cut(known.sound, SIZE // 2):
        said, start = estimate(window), window.start
        before = slice(max(start - 1500, 0), start + SIZE)
        if known.contact[before].all() and np.ptp(known.force[before]) < 1e-9:
            off = said["position"].value - known.position[start]
            rows.append((1e3 * off, said["force"].value, known.force[start]))
    off, force, truth = np.array(rows).T
    return float(np.isfinite(off).mean()), off[np.isfinite(off)], force, truth


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 12, 13])
@pytest.mark.parametrize("simulator", ["finite differences", "beam elements"])
def test_a_foreign_sensor_is_placed_untaught(simulator: str, seed: int) -> None:
    answered, off, force, truth = scored(simulator, seed)
    assert answered > 0.8
    assert np.mean(np.abs(off) < 5.0) > 0.97
    assert np.median(np.abs(off)) < 0.4
    assert np.nanmean(np.abs(force - truth)) < 0.8
