"""The harmonics of both segments: what each column says of sound whose harmonics are known."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal
from monochord.perception.features import FEATURES
from monochord.physics.materials import Material
from monochord.physics.sensors import load_sensor
from monochord.physics.strings import load_string
from monochord.physics.theory import hertz_stiffness, stiff_partials
from monochord.physics.twin import Scene, advance, begin, hold

Sing = Callable[..., Audio]
RATE, SIZE, LENGTH = 44100, 4410, 0.2
STRING = load_string("prototype").string
TONES = {"tones": True}


def told(signal: Signal, window: Audio) -> dict[str, float]:
    extract = FEATURES.build("fft_harmonic").prepare(signal, window.shape[1])
    return dict(zip(extract.columns, extract(window[np.newaxis])[0].tolist(), strict=True))


def test_it_has_four_groups_of_seventy_five(signal: Signal) -> None:
    columns = FEATURES.build("fft_harmonic").prepare(signal, SIZE).columns
    groups = [column.rsplit(" ", 9)[0].split(" ")[0] for column in columns]
    assert [groups.count(group) for group in ("mic", "difference", "ratio")] == [150, 75, 75]
    assert sum(column.startswith("mic 1 ") for column in columns) == 75


@pytest.mark.parametrize("position", [0.055, 0.083, 0.1013, 0.127, 0.148])
@pytest.mark.parametrize("modes", [(1, 1), (1, 2), (1, 3), (1, 4), (2, 1)])
def test_place_is_told_whichever_modes_the_drivers_hold(
    signal: Signal, sing: Sing, position: float, modes: tuple[int, int]
) -> None:
    row = told(signal, sing(position, modes))
    assert row["ratio place"] == pytest.approx(position / LENGTH, abs=2e-4)
    assert (row["ratio mode 1"], row["ratio mode 2"]) == modes
    assert row["ratio open"] == pytest.approx(0.0, abs=0.05)
    nearest = max(range(1, 25), key=lambda point: row[f"ratio near {point}"])
    assert (nearest - 1) / 23 == pytest.approx(position / LENGTH, abs=0.5 / 23 + 1e-9)
    assert sum(row[f"ratio near {point}"] for point in range(1, 25)) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("size", [882, 2205, 22050])
def test_place_is_told_by_short_and_long_windows(signal: Signal, sing: Sing, size: int) -> None:
    row = told(signal, sing(0.083, (1, 2), size=size))
    assert row["ratio place"] == pytest.approx(0.083 / LENGTH, abs=1e-3)


def test_tension_moves_the_open_frequency_and_not_the_place(signal: Signal, sing: Sing) -> None:
    slack, tight = (told(signal, sing(0.083, (1, 2), tension=65.0 * by)) for by in (0.995, 1.005))
    assert tight["ratio open"] - slack["ratio open"] == pytest.approx(5.0, abs=0.1)
    assert tight["ratio place"] == pytest.approx(slack["ratio place"], abs=1e-4)


def test_level_is_the_power_of_a_harmonic(signal: Signal, sing: Sing) -> None:
    row = told(signal, sing(0.083, (1, 1), partials=2, crosstalk=0.1))
    assert row["mic 1 own 1 level"] == pytest.approx(np.log10(0.2**2 / 2.0), abs=0.01)
    assert row["mic 1 own 2 level"] == pytest.approx(np.log10(0.1**2 / 2.0), abs=0.01)
    assert row["difference segment 1 1 level"] == pytest.approx(2.0, abs=0.05)
    assert row["difference segment 2 1 level"] == pytest.approx(-2.0, abs=0.05)
    assert row["ratio segment 1 2 timbre"] == pytest.approx(2.0 * np.log10(0.5), abs=0.02)
    assert row["ratio segment 1 1 likeness"] == pytest.approx(0.2 / 1.01, abs=0.01)
    assert row["mic 1 own 5 level"] < -6.0


def test_growth_is_that_of_the_amplitude(signal: Signal, sing: Sing) -> None:
    row = told(signal, sing(0.083, (1, 2), decay=7.0))
    assert row["mic 1 own 1 growth"] == pytest.approx(-7.0, abs=0.1)
    assert row["mic 2 own 2 growth"] == pytest.approx(-7.0, abs=0.1)
    assert row["mic 1 rise"] == pytest.approx(-0.7 * np.log10(np.e), abs=0.02)


def test_a_line_off_its_place_has_an_offset(signal: Signal, sing: Sing) -> None:
    window = sing(0.083, (1, 1))
    row = told(signal, window)
    extra = 2.0 * 1010.565 * LENGTH / 0.083 * 1.004
    beside = (0.02 * np.sin(2.0 * np.pi * extra * np.arange(SIZE) / RATE)).astype(np.float32)
    moved = told(signal, window + beside)
    assert abs(row["mic 1 own 1 offset"]) < 0.01
    assert moved["mic 1 own 2 offset"] == pytest.approx(4.0, abs=2.5)
    assert moved["mic 1 own 2 level"] == pytest.approx(np.log10(0.02**2 / 2.0), abs=0.01)


def test_sidebands_are_told(signal: Signal, sing: Sing) -> None:
    window = sing(0.083, (1, 2))
    wavering = window * (1.0 + 0.2 * np.sin(2.0 * np.pi * 50.0 * np.arange(SIZE) / RATE)).astype(np.float32)
    still, moving = told(signal, window), told(signal, wavering)
    assert still["mic 1 own 1 side"] < -3.0
    assert moving["mic 1 own 1 side"] == pytest.approx(2.0 * np.log10(0.1) + np.log10(2.0), abs=0.1)
    assert moving["mic 1 unrest"] > still["mic 1 unrest"] + 0.005


def test_rumble_and_filled_gaps_are_told(signal: Signal, sing: Sing) -> None:
    window, time = sing(0.083, (1, 2), partials=4), np.arange(SIZE) / RATE
    hiss = 1e-3 * np.random.default_rng(5).standard_normal((2, SIZE))
    low = 1e-2 * np.sin(2.0 * np.pi * 300.0 * time)
    plain, rough = told(signal, window), told(signal, (window + hiss + low).astype(np.float32))
    assert rough["mic 1 rumble 150 Hz"] == pytest.approx(np.log10(1e-4 / 2.0), abs=0.05)
    assert plain["mic 1 rumble 150 Hz"] < -6.0
    for gap in ("2 kHz", "6 kHz", "12 kHz"):
        assert rough[f"mic 2 gaps {gap}"] > plain[f"mic 2 gaps {gap}"] + 2.0
    assert rough["mic 1 flatness"] > plain["mic 1 flatness"] + 0.5


def test_an_untouched_string_is_told_from_a_touched_one(signal: Signal, sing: Sing) -> None:
    for modes in ((1, 1), (1, 2), (3, 1), (2, 3)):
        row = told(signal, sing(None, modes, partials=2))
        assert row["ratio contact"] < 0.0
        assert row["ratio rest"] == pytest.approx(0.0, abs=1.0)
    assert told(signal, sing(0.083, (1, 2)))["ratio contact"] > 0.5


def test_what_it_cannot_serve_is_refused(signal: Signal) -> None:
    feature = FEATURES.build("fft_harmonic")
    with pytest.raises(InputError, match=r"1 channel.*allowed is two channels of a known string"):
        feature.prepare(Signal(sample_rate=RATE, channels=1, string=signal.string), SIZE)
    with pytest.raises(InputError, match=r"an unknown string.*--string"):
        feature.prepare(Signal(sample_rate=RATE, channels=2), SIZE)
    with pytest.raises(InputError, match="sample rate 8000 Hz: allowed is from 8085 Hz"):
        feature.prepare(Signal(sample_rate=8000, channels=2, string=signal.string), SIZE)
    with pytest.raises(InputError, match="window of 441 frames: allowed is from 611 frames"):
        feature.prepare(signal, 441)


def _at_the_ends(place: float, frequency: float, moved: float) -> Floats:
    """Return the forces at both ends of a string whose touch moves by `moved` m at a frequency."""
    speed = np.sqrt(STRING.tension / STRING.linear_density)
    numbers = np.arange(1.0, 4000.0) * 0.01
    bending = np.pi**2 * np.pi * STRING.young_modulus * STRING.core_diameter**4 / 64.0 / STRING.tension
    partials = stiff_partials(speed / (2.0 * LENGTH), bending / LENGTH**2, numbers)
    wave = np.pi / LENGTH * np.interp(frequency, partials, numbers)
    return STRING.tension * wave * moved / np.sin(wave * np.array([place, LENGTH - place]))


def _touched(place: float, force: float, stiffness: float) -> Audio:
    """Return what both microphones hear of two lines and of the tones that a Hertzian touch makes of them."""
    time, pushes = np.arange(SIZE) / RATE, (0.15, 0.08)
    lines = (STRING.tension / STRING.linear_density) ** 0.5 / (2.0 * np.array([place, LENGTH - place]))
    beta = np.pi**3 * STRING.young_modulus * STRING.core_diameter**4 / (64.0 * STRING.tension)
    lines *= np.sqrt(1.0 + beta / np.array([place, LENGTH - place]) ** 2)
    ends = np.stack([f * np.cos(2.0 * np.pi * line * time) for f, line in zip(pushes, lines, strict=True)])
    second = pushes[0] * pushes[1] / (6.0 * stiffness * force)
    for line, moved in ((lines.sum(), second), (2.0 * lines[0] + lines[1], second * pushes[0] / 3.0 / force)):
        ends += np.outer(_at_the_ends(place, line, moved), np.cos(2.0 * np.pi * line * time))
    return (2.0 * np.array([[0.85, 0.15], [0.15, 0.85]]) @ ends).astype(np.float32)


@pytest.mark.parametrize(("force", "stiffness"), [(0.5, 3e5), (1.0, 3e5), (0.7, 2e6)])
def test_combination_tones_tell_how_far_the_touch_gives_way(
    signal: Signal, force: float, stiffness: float
) -> None:
    extract = FEATURES.build("fft_harmonic", TONES).prepare(signal, SIZE)
    window = _touched(0.083, force, stiffness)
    row = dict(zip(extract.columns, extract(window[np.newaxis])[0].tolist(), strict=True))
    give = 1000.0 * STRING.tension / (stiffness * force)
    assert 10.0 ** row["ratio tone give a + b"] == pytest.approx(give, rel=0.03)
    assert 10.0 ** row["ratio tone third 2 a + b"] == pytest.approx(1.0 / (3.0 * force), rel=0.05)
    assert 10.0 ** row["ratio tone push 1"] == pytest.approx(0.15, rel=0.02)
    assert 10.0 ** row["ratio tone push 2"] == pytest.approx(0.08, rel=0.02)
    assert row["ratio tone side a + b"] < -1.5


@pytest.mark.parametrize("modulus", [3e9, 1e11])
def test_on_the_twin_they_tell_the_stiffness_of_its_touch(signal: Signal, modulus: float) -> None:
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
    take, _ = advance(begin(load_sensor("prototype"), Scene(touches=(hold(place, force, material),))), RATE)
    row = FEATURES.build("fft_harmonic", TONES).prepare(signal, SIZE)
    found = dict(zip(row.columns, row(take.microphones[np.newaxis, :, -SIZE:])[0].tolist(), strict=True))
    hertz = hertz_stiffness(STRING, material.radius, modulus, material.poisson_ratio)
    stiffness = 1.5 * hertz ** (2.0 / 3.0) * force ** (1.0 / 3.0)
    give = 1000.0 * STRING.tension / (stiffness * force)
    assert 10.0 ** found["ratio tone give a + b"] == pytest.approx(give, rel=0.3)


def test_tones_take_the_place_of_timbre_and_change_nothing_else(signal: Signal, sing: Sing) -> None:
    window = sing(0.083, (1, 2))[np.newaxis]
    plain, toned = (FEATURES.build("fft_harmonic", o).prepare(signal, SIZE) for o in ({}, TONES))
    ours, theirs = (dict(zip(e.columns, e(window)[0].tolist(), strict=True)) for e in (plain, toned))
    assert len(theirs) == len(ours) == 300
    assert sum(name.startswith("ratio ") for name in theirs) == 75
    assert {name: value for name, value in theirs.items() if name in ours}.items() <= ours.items()
    assert all(" timbre" in name for name in ours.keys() - theirs.keys())


def test_without_a_touch_tones_are_zero(signal: Signal) -> None:
    extract = FEATURES.build("fft_harmonic", TONES).prepare(signal, SIZE)
    row = dict(zip(extract.columns, extract(np.zeros((1, 2, SIZE), np.float32))[0].tolist(), strict=True))
    assert all(value == 0.0 for name, value in row.items() if "tone" in name)


def test_another_object_sounds_as_it_is_thought_to(signal: Signal) -> None:
    extract = FEATURES.build("fft_harmonic", TONES).prepare(signal, SIZE)
    forces, stiffness = np.array([0.5, 1.0, 1.5]), 4e5
    soft, hard = (
        extract(np.stack([_touched(0.083, f, k * f ** (1.0 / 3.0)) for f in forces]))
        for k in (stiffness, 4.0 * stiffness)
    )
    thought = extract.as_if(soft, forces, np.full(3, 0.25))
    sung = ("push 1", "push 2", "give a + b", "third 2 a + b")
    tones = [extract.columns.index(f"ratio tone {name}") for name in sung]
    np.testing.assert_allclose(thought[:, tones], hard[:, tones], atol=0.05)
    # Each segment grows by T / K, which the lines made up here do not know of.
    longer = STRING.tension / (stiffness * forces ** (1.0 / 3.0))
    moved = (thought - soft)[:, extract.columns.index("ratio open")]
    np.testing.assert_allclose(moved, 0.75 * 2000.0 * longer / LENGTH, rtol=0.1)
    still = extract.as_if(soft, np.zeros(3), np.full(3, 0.25))
    assert (still == soft).all()


def test_without_tones_no_other_object_can_be_thought_of(signal: Signal) -> None:
    extract = FEATURES.build("fft_harmonic").prepare(signal, SIZE)
    with pytest.raises(InputError, match=r"'fft_harmonic' for objects that give way .* with tones"):
        extract.as_if(np.zeros((1, 300), np.float32), np.ones(1), np.ones(1))


def test_ears_that_cannot_be_are_refused() -> None:
    signal = Signal(sample_rate=RATE, channels=2, string=STRING)
    with pytest.raises(InputError, match=r"own 0.5, gain 2: allowed is own above 0.5"):
        FEATURES.build("fft_harmonic", {"own": 0.5}).prepare(signal, SIZE)
