"""A design says what a string will do, and recommends one for a reason."""

import json
import tomllib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tests.cli.running import Capture, records
from tests.twins import sound_of

import monochord as mc
from monochord.cli import run
from monochord.front.design import StringDesign
from monochord.front.design_figure import draw
from monochord.physics.design import Wishes, ambiguity, bounds_at, candidate, curves, sensor_from, string_of
from monochord.physics.sensors import Sensor, with_length

GAUGE = 0.254e-3
TOUCH = mc.Contact(position=0.077, force=1.0)


@pytest.fixture(scope="module")
def made() -> StringDesign:
    return mc.design()


def test_the_prototypes_string_has_the_prototypes_figures() -> None:
    """Stress, drift, swing and sag are those that the hardware's pages state for 65 N."""
    string = mc.load_sensor("prototype").string
    mine = string_of(Wishes(), GAUGE, 65.0, 0.2)
    assert mine.linear_density == pytest.approx(string.linear_density, rel=1e-3)
    assert mine.tension_per_force == pytest.approx(string.tension_per_force, rel=1e-3)
    one = candidate(Wishes(frame="aluminium"), GAUGE, 65.0, 0.2)
    assert 1283e6 < one.stress < 1.03 * 1283e6  # a press of 2 N adds 1.8 %
    assert one.drift == pytest.approx(1.52, abs=0.01)
    assert 1e3 * one.swing == pytest.approx(0.153, abs=0.002)
    assert 1e3 * one.sag == pytest.approx(0.646, abs=0.002)


@pytest.mark.parametrize(
    ("mount", "force", "expected"),
    [("bolted", 1.0, 0.13), ("light", 1.0, 0.33), ("soft", 1.0, 0.54), ("known", 2.0, 0.08)],
)
def test_bounds_by_mount(mount: str, force: float, expected: float) -> None:
    wishes = Wishes(mount=mount)  # pyright: ignore[reportArgumentType]
    string = string_of(wishes, GAUGE, 65.0, 0.2)
    assert bounds_at(wishes, string, replace(TOUCH, force=force))[1] == pytest.approx(expected, abs=0.015)


def test_force_goes_as_stretch_over_tension_cubed() -> None:
    cents = {each: candidate(Wishes(), GAUGE, each, 0.2).cents_per_newton for each in (65.0, 80.0, 100.0)}
    assert cents[80.0] / cents[100.0] == pytest.approx((100.0 / 80.0) ** 3, rel=0.03)
    assert cents[65.0] / cents[100.0] == pytest.approx((100.0 / 65.0) ** 3, rel=0.05)
    stds = [candidate(Wishes(), GAUGE, each, 0.2).force_std for each in (20.0, 40.0, 65.0)]
    assert stds == sorted(stds)
    assert stds[0] < 0.1 * stds[2]


def test_slopes_of_the_curves_are_differences_of_their_lines() -> None:
    string = string_of(Wishes(), GAUGE, 50.0, 0.2)
    own = curves(Wishes(range=0.05), string, count=251)
    slope = np.gradient(own.lines, own.positions, axis=0)
    np.testing.assert_allclose(own.slopes[1:-1, :, 0], slope[1:-1], rtol=1e-4)
    np.testing.assert_allclose(own.force_std, own.force_std[:, ::-1], rtol=0.05)


def test_an_ambiguous_place_has_a_double_that_sounds_alike() -> None:
    """At x = L / 3 the second mode of the short side sounds as its fundamental at another place would."""
    wishes = Wishes(range=0.11)
    string = string_of(wishes, GAUGE, 65.0, 0.2)
    own = ambiguity(wishes, string)
    np.testing.assert_array_equal(own.pairs, own.pairs[::-1])
    # m / x = m' / x' and n / (L - x) = n' / (L - x'): at 80 mm modes 2 and 3 are 3 and 2 of the place 120 mm.
    at = int(np.argmin(np.abs(own.positions - 0.08)))
    assert own.pairs[at] > 0
    assert own.share < ambiguity(wishes, replace(string, tension=20.0)).share
    assert ambiguity(replace(wishes, resolution=0.1), string).share == 0.0


def test_what_is_recommended_meets_every_wish_and_is_the_fastest(made: StringDesign) -> None:
    one = made.chosen
    assert one.lacks == ()
    assert one.force_std <= made.wishes.force_resolution
    assert one.clearance <= made.wishes.gap
    others = [each for each in made.candidates if each.fits_model and not each.lacks]
    assert all(each.settling >= 0.95 * one.settling for each in others)
    assert [each.string.tension for each in made.compared] == [20.0, 40.0, 65.0]
    text = "\n".join(made.lines())
    assert all(f"\n{tension} N: " in text for tension in (20, 40, 65))
    front = made.pareto
    assert all(a.settling < b.settling and a.force_std > b.force_std for a, b in pairwise(front))


def sounds(sensor: Sensor, build: int) -> bool:
    """Return whether the bundled model takes the sound of a build, and locates a touch on it."""
    twin = mc.VirtualSensor(sensor, seed=build, build=build, world="plausible")
    place = 0.4 * twin.sensor.string.length
    sound, _ = sound_of(twin, 0.4, (place, 1.0), 0.5)
    string = with_length(sensor.string, twin.sensor.string.length)
    built = replace(sensor, string=string)
    table = mc.load("demo").predict(sound, sensor=built)
    return abs(float(np.nanmedian(table.position.value[-20:])) - place) < 2e-3


@pytest.mark.parametrize(
    "wishes",
    [
        {},
        {"gauge": GAUGE, "range": 0.1},
        {"gauge": 0.2286e-3, "length": 0.3},
        {"gauge": GAUGE, "range": 0.05, "force_resolution": 0.3},
    ],
)
def test_the_bundled_model_takes_every_build_of_what_is_recommended(
    made: StringDesign, wishes: dict[str, float]
) -> None:
    made = mc.design(**wishes) if wishes else made
    assert made.chosen.fits_model
    assert all(sounds(made.sensor, build) for build in range(3))
    assert "The model 'demo' takes it" in made.reasons()[2]
    rows = [line for line in made.lines() if line.startswith("*")]
    assert rows
    assert all(" takes" in row for row in rows)


def test_marks_are_what_the_model_says(made: StringDesign) -> None:
    model = mc.load("demo")

    def refuses(sensor: Sensor, length: float) -> bool:
        built = replace(sensor, string=with_length(sensor.string, length))
        try:
            model.predict(np.zeros((2, 4410)), sensor=built)
        except mc.InputError:
            return True
        return False

    taken = [each for each in made.candidates if each.fits_model]
    sample = [*taken[::6], *made.candidates[::25]]
    for one in sample:
        sensor = sensor_from(made.wishes, one)
        refused = [refuses(sensor, share * one.string.length) for share in (0.99, 1.01)]
        assert one.fits_model is not any(refused), one
    assert {each.fits_model for each in sample} == {True, False}


def test_another_string_is_recommended_where_no_model_is_wished_or_none_takes_it() -> None:
    free = mc.design(gauge=GAUGE, range=0.1, model="none")
    assert free.chosen.fits_model is None
    assert free.chosen.settling < mc.design(gauge=GAUGE, range=0.1).chosen.settling
    assert not [line for line in free.lines() if "model" in line.lower() and "demo" in line]
    far = mc.design(gauge=0.2794e-3, range=0.25, length=0.4)
    assert far.chosen.fits_model is False
    assert far.chosen.lacks == ()
    assert "takes no string of these wishes" in far.reasons()[2]


def test_impossible_wishes_name_what_is_lacking() -> None:
    made = mc.design(gauge=GAUGE, force_resolution=1e-3)
    assert any(word.startswith("force") for word in made.chosen.lacks)
    assert "No string" in made.reasons()[1]
    assert made.mounts["known"] < made.mounts["light"] < made.mounts["soft"]
    frames = mc.design(gauge=GAUGE, tension=65.0).frames
    assert {name: round(drift, 2) for name, (drift, _) in frames.items()} == {
        "steel": 0.0, "stainless": 0.76, "aluminium": 1.53, "carbon": -1.45, "pla": 7.6,
    }  # fmt: skip


def test_the_file_is_a_sensor_of_the_twin_and_of_the_hardware(tmp_path: Path, capsys: Capture) -> None:
    path, made = tmp_path / "sensor.toml", mc.design(gauge=GAUGE)
    (printed,) = records(capsys, "design", "--gauge", GAUGE, "--out", path)
    assert printed["recommended"]["string"] == json.loads(json.dumps(made.tree()))["recommended"]["string"]
    assert printed["reasons"] == made.reasons()
    assert path.read_text(encoding="utf-8") == made.toml()
    sensor = mc.load_sensor(str(path))
    assert sensor.string == made.chosen.string
    assert sensor.range == pytest.approx(made.chosen.range)
    assert tomllib.loads(made.toml())["override"]["tension"] == made.chosen.string.tension
    twin = mc.VirtualSensor(str(path), seed=1)
    middle = 0.5 * sensor.string.length
    twin.press(middle - 0.01, 1.0)
    sound, labels = twin.advance(0.4)
    assert labels["contact"][-1] == 1.0
    assert 0.01 < np.abs(sound[:, -4410:]).max() < 1.0
    from hardware.cad.parameters import load_hardware
    from hardware.cad.physics import physics

    figures = physics(load_hardware(str(path)))
    assert figures["tension_N"] == made.chosen.string.tension
    assert figures["swing_mm"] == pytest.approx(1e3 * made.chosen.swing, rel=1e-6)
    assert run(["design", "--out", str(path)]) == 2
    assert "--force" in capsys.readouterr().err


def test_it_is_drawn(made: StringDesign, tmp_path: Path, capsys: Capture) -> None:
    pytest.importorskip("matplotlib")
    path = tmp_path / "design.svg"
    assert run(["design", "--gauge", "0.254e-3", "--figure", str(path)]) == 0
    assert path.stat().st_size > 10_000
    assert str(path) in capsys.readouterr().out
    page = draw(made)
    assert len(page.axes) == 6
    heights = [bar.get_height() for bar in page.axes[5].patches]  # pyright: ignore[reportAttributeAccessIssue]
    assert heights == pytest.approx([force for _, force in made.frames.values()])
