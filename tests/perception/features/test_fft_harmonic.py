"""The harmonics of both segments: each column on sound whose harmonics are known."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal
from monochord.perception.features import FEATURES
from monochord.perception.features.base import SupportsCompliance
from monochord.physics.materials import Material
from monochord.physics.sensors import load_sensor
from monochord.physics.strings import load_string
from monochord.physics.theory import hertz_stiffness, stiff_partials
from monochord.physics.twin import Scene, advance, begin, hold

Sing = Callable[..., Audio]
Row = Callable[..., dict[str, float]]
RATE, SIZE, LENGTH = 44100, 4410, 0.2
STRING = load_string("prototype").string
TONES = {"tones": True}
TIME = np.arange(SIZE) / RATE


@pytest.mark.parametrize(
    ("position", "modes"),
    [(0.055, (1, 1)), (0.083, (1, 2)), (0.1013, (1, 3)), (0.127, (1, 4)), (0.148, (2, 1))],
)
def test_place_whichever_modes_the_drivers_sustain(
    row: Row, sing: Sing, position: float, modes: tuple[int, int]
) -> None:
    columns = row("fft_harmonic", sing(position, modes))
    assert columns["ratio place"] == pytest.approx(position / LENGTH, abs=2e-4)
    assert (columns["ratio mode 1"], columns["ratio mode 2"]) == modes
    assert columns["ratio open"] == pytest.approx(0.0, abs=0.05)
    near = np.array([columns[f"ratio near {point}"] for point in range(1, 25)])
    assert near.sum() == pytest.approx(1.0, abs=1e-5)
    assert near @ np.linspace(0.0, 1.0, 24) == pytest.approx(position / LENGTH, abs=2e-4)


@pytest.mark.parametrize("size", [882, 22050])
def test_place_in_short_and_long_windows(row: Row, sing: Sing, size: int) -> None:
    columns = row("fft_harmonic", sing(0.083, (1, 2), size=size))
    assert columns["ratio place"] == pytest.approx(0.083 / LENGTH, abs=1e-3)


def test_tension_moves_the_open_frequency_and_not_the_place(row: Row, sing: Sing) -> None:
    slack, tight = (row("fft_harmonic", sing(0.083, (1, 2), tension=65.0 * by)) for by in (0.995, 1.005))
    assert tight["ratio open"] - slack["ratio open"] == pytest.approx(5.0, abs=0.1)
    assert tight["ratio place"] == pytest.approx(slack["ratio place"], abs=1e-4)


def test_level_is_the_power_of_a_harmonic(row: Row, sing: Sing) -> None:
    columns = row("fft_harmonic", sing(0.083, (1, 1), partials=2, crosstalk=0.1))
    assert columns["mic 1 own 1 level"] == pytest.approx(np.log10(0.2**2 / 2.0), abs=0.01)
    assert columns["mic 1 own 2 level"] == pytest.approx(np.log10(0.1**2 / 2.0), abs=0.01)
    assert columns["difference segment 1 1 level"] == pytest.approx(2.0, abs=0.05)
    assert columns["difference segment 2 1 level"] == pytest.approx(-2.0, abs=0.05)
    assert columns["ratio segment 1 2 timbre"] == pytest.approx(2.0 * np.log10(0.5), abs=0.02)
    assert columns["ratio segment 1 1 likeness"] == pytest.approx(0.2 / 1.01, abs=0.01)
    assert columns["mic 1 own 5 level"] < -6.0


def test_growth_is_that_of_the_amplitude(row: Row, sing: Sing) -> None:
    columns = row("fft_harmonic", sing(0.083, (1, 2), decay=7.0))
    assert columns["mic 1 own 1 growth"] == pytest.approx(-7.0, abs=0.1)
    assert columns["mic 2 own 2 growth"] == pytest.approx(-7.0, abs=0.1)
    assert columns["mic 1 rise"] == pytest.approx(-0.7 * np.log10(np.e), abs=0.02)


def test_a_line_off_its_partial_has_an_offset(row: Row, sing: Sing) -> None:
    window = sing(0.083, (1, 1))
    beside = 0.02 * np.sin(2.0 * np.pi * 2.0 * 1010.565 * LENGTH / 0.083 * 1.004 * TIME)
    columns, moved = (row("fft_harmonic", (window + extra).astype(np.float32)) for extra in (0.0, beside))
    assert abs(columns["mic 1 own 1 offset"]) < 0.01
    assert moved["mic 1 own 2 offset"] == pytest.approx(4.0, abs=2.5)
    assert moved["mic 1 own 2 level"] == pytest.approx(np.log10(0.02**2 / 2.0), abs=0.01)


def test_sidebands_of_a_wavering_tone(row: Row, sing: Sing) -> None:
    window = sing(0.083, (1, 2))
    wavering = window * (1.0 + 0.2 * np.sin(2.0 * np.pi * 50.0 * TIME)).astype(np.float32)
    still, moving = row("fft_harmonic", window), row("fft_harmonic", wavering)
    assert still["mic 1 own 1 side"] < -3.0
    assert moving["mic 1 own 1 side"] == pytest.approx(2.0 * np.log10(0.1) + np.log10(2.0), abs=0.1)
    assert moving["mic 1 unrest"] > still["mic 1 unrest"] + 0.005


def test_rumble_and_noise_between_the_lines(row: Row, sing: Sing) -> None:
    window = sing(0.083, (1, 2), partials=4)
    noise = 1e-3 * np.random.default_rng(5).standard_normal((2, SIZE))
    low = 1e-2 * np.sin(2.0 * np.pi * 300.0 * TIME)
    plain, rough = row("fft_harmonic", window), row("fft_harmonic", (window + noise + low).astype(np.float32))
    assert rough["mic 1 rumble 150 Hz"] == pytest.approx(np.log10(1e-4 / 2.0), abs=0.05)
    assert plain["mic 1 rumble 150 Hz"] < -6.0
    for gap in ("2 kHz", "6 kHz", "12 kHz"):
        assert rough[f"mic 2 gaps {gap}"] > plain[f"mic 2 gaps {gap}"] + 2.0
    assert rough["mic 1 flatness"] > plain["mic 1 flatness"] + 0.5


def test_an_untouched_string_leads_over_a_touch(row: Row, sing: Sing) -> None:
    for modes in ((1, 1), (1, 2), (3, 1), (2, 3)):
        columns = row("fft_harmonic", sing(None, modes, partials=2))
        assert columns["ratio contact"] < 0.0
        assert columns["ratio rest"] == pytest.approx(0.0, abs=1.0)
    assert row("fft_harmonic", sing(0.083, (1, 2)))["ratio contact"] > 0.5


@pytest.mark.parametrize("feature", ["fft_harmonic", "closed_form", "untouched"])
def test_unsuitable_signals_are_refused(feature: str) -> None:
    for signal, size in (
        (Signal(sample_rate=RATE, channels=1, string=STRING), SIZE),
        (Signal(sample_rate=RATE, channels=2), SIZE),
        (Signal(sample_rate=8000, channels=2, string=STRING), SIZE),
        (Signal(sample_rate=RATE, channels=2, string=STRING), 441),
    ):
        with pytest.raises(InputError):
            FEATURES.build(feature).prepare(signal, size)


def test_microphones_that_mix_both_ends_alike_are_refused(signal: Signal) -> None:
    with pytest.raises(InputError, match=r"own' = 0\.5"):
        FEATURES.build("fft_harmonic", {"own": 0.5}).prepare(signal, SIZE)


def _end_forces(place: float, frequency: float, displacement: float) -> Floats:
    """Return the forces at both ends of a string whose touch moves by `displacement` m at a frequency."""
    speed = np.sqrt(STRING.tension / STRING.linear_density)
    numbers = np.arange(1.0, 4000.0) * 0.01
    bending = np.pi**2 * np.pi * STRING.young_modulus * STRING.core_diameter**4 / 64.0 / STRING.tension
    partials = stiff_partials(speed / (2.0 * LENGTH), bending / LENGTH**2, numbers)
    wave = np.pi / LENGTH * np.interp(frequency, partials, numbers)
    return STRING.tension * wave * displacement / np.sin(wave * np.array([place, LENGTH - place]))


def _touched(place: float, force: float, stiffness: float) -> Audio:
    """Return both microphones' signals of two lines and of the tones that a Hertzian touch makes of them."""
    pushes = (0.15, 0.08)
    lines = (STRING.tension / STRING.linear_density) ** 0.5 / (2.0 * np.array([place, LENGTH - place]))
    beta = np.pi**3 * STRING.young_modulus * STRING.core_diameter**4 / (64.0 * STRING.tension)
    lines *= np.sqrt(1.0 + beta / np.array([place, LENGTH - place]) ** 2)
    ends = np.stack([f * np.cos(2.0 * np.pi * line * TIME) for f, line in zip(pushes, lines, strict=True)])
    second = pushes[0] * pushes[1] / (6.0 * stiffness * force)
    for line, moved in ((lines.sum(), second), (2.0 * lines[0] + lines[1], second * pushes[0] / 3.0 / force)):
        ends += np.outer(_end_forces(place, line, moved), np.cos(2.0 * np.pi * line * TIME))
    return (2.0 * np.array([[0.85, 0.15], [0.15, 0.85]]) @ ends).astype(np.float32)


class TestTones:
    @pytest.mark.parametrize(("force", "stiffness"), [(1.0, 3e5), (0.7, 2e6)])
    def test_they_measure_compliance_and_force(self, row: Row, force: float, stiffness: float) -> None:
        columns = row("fft_harmonic", _touched(0.083, force, stiffness), tones=True)
        compliance = 1000.0 * STRING.tension / (stiffness * force)
        assert 10.0 ** columns["ratio tone give a + b"] == pytest.approx(compliance, rel=0.03)
        assert 10.0 ** columns["ratio tone third 2 a + b"] == pytest.approx(1.0 / (3.0 * force), rel=0.05)
        assert 10.0 ** columns["ratio tone push 1"] == pytest.approx(0.15, rel=0.02)
        assert 10.0 ** columns["ratio tone push 2"] == pytest.approx(0.08, rel=0.02)
        assert columns["ratio tone side a + b"] < -1.5

    @pytest.mark.parametrize("modulus", [3e9, 1e11])
    def test_they_measure_the_stiffness_of_the_twins_touch(self, row: Row, modulus: float) -> None:
        material = Material(
            name="made",
            title="",
            source="",
            young_modulus=modulus,
            poisson_ratio=0.35,
            loss=0.2,
            friction_static=0.4,
            friction_kinetic=0.3,
            stribeck_speed=0.01,
            roughness=1e-7,
            roughness_length=1e-5,
            radius=4e-3,
        )
        force, place = 1.0, 0.083
        scene = Scene(touches=(hold(place, force, material),))
        take, _ = advance(begin(load_sensor("prototype"), scene), RATE)
        columns = row("fft_harmonic", take.microphones[:, -SIZE:], tones=True)
        hertz = hertz_stiffness(STRING, material.radius, modulus, material.poisson_ratio)
        stiffness = 1.5 * hertz ** (2.0 / 3.0) * force ** (1.0 / 3.0)
        compliance = 1000.0 * STRING.tension / (stiffness * force)
        assert 10.0 ** columns["ratio tone give a + b"] == pytest.approx(compliance, rel=0.3)

    def test_without_a_touch_they_are_zero(self, row: Row) -> None:
        columns = row("fft_harmonic", np.zeros((2, SIZE), np.float32), tones=True)
        assert not any(value for name, value in columns.items() if "tone" in name)

    def test_compliance_augmentation_gives_the_rows_of_another_object(self, signal: Signal) -> None:
        extract = FEATURES.build("fft_harmonic", TONES).prepare(signal, SIZE)
        assert isinstance(extract, SupportsCompliance)
        forces, stiffness = np.array([0.5, 1.0, 1.5]), 4e5
        soft, hard = (
            extract(np.stack([_touched(0.083, f, k * f ** (1.0 / 3.0)) for f in forces]))
            for k in (stiffness, 4.0 * stiffness)
        )
        augmented = extract.with_compliance(soft, forces, np.full(3, 0.25))
        names = ("push 1", "push 2", "give a + b", "third 2 a + b")
        tones = [extract.columns.index(f"ratio tone {name}") for name in names]
        np.testing.assert_allclose(augmented[:, tones], hard[:, tones], atol=0.05)
        # Each segment grows by T / K, which the synthetic lines do not follow.
        longer = STRING.tension / (stiffness * forces ** (1.0 / 3.0))
        shift = (augmented - soft)[:, extract.columns.index("ratio open")]
        np.testing.assert_allclose(shift, 0.75 * 2000.0 * longer / LENGTH, rtol=0.1)
        assert (extract.with_compliance(soft, np.zeros(3), np.full(3, 0.25)) == soft).all()
