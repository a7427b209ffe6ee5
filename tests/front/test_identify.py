"""A build is measured from plucked and driven sound, a ruler, and a caliper or scales."""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture, records, refusal

import monochord as mc
from monochord.cli import run
from monochord.core.types import Audio
from monochord.front.identify import Identification
from monochord.physics.identification import NAMES, even_std, fit_string, steel_density_of
from monochord.physics.theory import inharmonicity

BUILDS = 50
CALIPER, SCALES = 1e-6, 3e-3
"""Largest errors of both measurements, as the command assumes."""


@dataclass(frozen=True, kw_only=True)
class Build:
    """A drawn build, its string as it is tuned on its day, and two recordings of it."""

    string: mc.StringParams
    ruler: float
    caliper: float
    weighed: float
    support: float
    plucked: Audio
    driven: Audio

    @classmethod
    def drawn(cls, seed: int) -> "Build":
        plucked, driven = (
            mc.VirtualSensor("prototype", world="plausible", build=seed, day=seed, seed=seed + take)
            for take in (0, 1000)
        )
        plucked.drive(False, False)
        sensor = plucked.sensor
        string = replace(sensor.string, tension=sensor.string.tension + sensor.drift)
        errors = np.random.default_rng([seed, 1]).uniform(-1.0, 1.0, 2)
        return cls(
            string=string,
            ruler=sensor.measured_length or string.length,
            caliper=string.core_diameter + CALIPER * errors[0],
            weighed=string.linear_density * (1.0 + SCALES * errors[1]),
            support=sensor.losses.support,
            plucked=plucked.advance(1.0)[0],
            driven=driven.advance(3.0)[0],
        )

    def identified(
        self, folder: Path, *, caliper: float | None = None, weighed: float | None = None
    ) -> Identification:
        for name in ("plucked", "driven"):
            soundfile.write(folder / f"{name}.wav", getattr(self, name).T, 44100, subtype="FLOAT")
        takes = folder / "plucked.wav", folder / "driven.wav"
        return mc.identify(*takes, length=self.ruler, caliper=caliper, weighed=weighed)


@pytest.fixture(scope="module")
def build() -> Build:
    return Build.drawn(3)


def test_a_fit_returns_the_string_whose_partials_it_is_given() -> None:
    sensor, numbers = mc.load_sensor("prototype"), np.arange(1.0, 8.0)
    string = replace(sensor.string, tension=61.0)
    heard = mc.stiff_partials(mc.open_frequency(string), inharmonicity(string), numbers)
    for driver, pull in zip(sensor.drivers, (30.0, 8.0), strict=True):
        shape = np.sin(numbers * np.pi * driver.drive / string.length) ** 2
        heard = heard * (
            1.0 - pull * shape / (string.linear_density * string.length * (2 * np.pi * heard) ** 2)
        )
    fit = fit_string(
        sensor,
        numbers,
        heard,
        1e-5 * heard,
        length=(0.2, 1e-6),
        linear_density=(string.linear_density, 1e-4 * string.linear_density),
    )
    values = dict(zip(NAMES, fit.values, strict=True))
    assert values["tension"] == pytest.approx(61.0, rel=1.5e-3)  # ends are expected to yield by 0.5 per mille
    assert values["pull_1"] == pytest.approx(30.0, abs=1.5)
    # 11 mm from an end the string hardly moves, so that what is assumed of magnets remains.
    assert abs(values["pull_2"] - 8.0) < 2.0 * fit.relative_std("pull_2") * values["pull_2"]


def test_correlations_are_those_of_the_budget(build: Build, tmp_path: Path) -> None:
    """T = mu (2 L f0)^2: its variance is that of density, length and pitch, and so are its correlations."""
    result = build.identified(tmp_path, caliper=build.caliper)
    length, density = even_std(5e-4) / build.ruler, 2.0 * even_std(CALIPER) / build.caliper
    tension = result.estimates["tension"]
    assert tension.std / tension.value == pytest.approx(np.hypot(2.0 * length, density), rel=0.05)
    between = dict(zip(NAMES, result.fit.correlation[NAMES.index("tension")], strict=True))
    assert between["length"] == pytest.approx(2.0 * length / np.hypot(2.0 * length, density), abs=0.05)
    assert between["linear_density"] == pytest.approx(density / np.hypot(2.0 * length, density), abs=0.05)
    np.testing.assert_allclose(result.fit.correlation, result.fit.correlation.T, atol=1e-9)


def test_sound_and_ruler_alone_give_pitch_but_neither_tension_nor_density(
    build: Build, tmp_path: Path
) -> None:
    result = build.identified(tmp_path)
    for name in ("tension", "linear_density"):
        assert not result.estimates[name].valid
        assert "sound and ruler" in result.estimates[name].reason
    assert any("--caliper" in line and "--weighed" in line for line in result.unknown)
    pitch = result.estimates["open_frequency"]
    assert abs(pitch.value - mc.open_frequency(build.string)) < 4.0 * pitch.std < 4.0
    std = result.fit.relative_std("tension")
    assert 0.03 < std < 0.1
    assert result.fit.values[NAMES.index("tension")] == pytest.approx(build.string.tension, rel=3.0 * std)
    assert mc.open_frequency(result.sensor.string) == pytest.approx(pitch.value)
    assert result.sensor.string.linear_density == mc.load_sensor("prototype").string.linear_density


def test_losses_come_from_the_pluck_and_held_partials_from_the_drivers(build: Build, tmp_path: Path) -> None:
    result = build.identified(tmp_path, weighed=build.weighed)
    loss = result.estimates["support_loss"]
    assert loss.value == pytest.approx(build.support, rel=0.15)
    assert result.held
    driven_alone = mc.identify(tmp_path / "driven.wav", length=build.ruler)
    assert not driven_alone.estimates["support_loss"].valid
    assert any("pluck" in line for line in driven_alone.unknown)
    plucked_alone = mc.identify(tmp_path / "plucked.wav", length=build.ruler)
    assert plucked_alone.held == ()
    assert any("drivers on" in line for line in plucked_alone.unknown)


def test_caliper_and_scales_that_disagree_name_another_metal(build: Build, tmp_path: Path) -> None:
    both = build.identified(tmp_path, caliper=build.caliper, weighed=build.weighed)
    one = build.identified(tmp_path, caliper=build.caliper)
    assert both.estimates["tension"].std < one.estimates["tension"].std
    assert not both.notes
    other = build.identified(tmp_path, caliper=build.caliper, weighed=1.05 * build.weighed)
    assert "not plain steel" in other.notes[0]
    assert other.estimates["linear_density"].value == pytest.approx(1.05 * build.weighed, rel=0.02)


def test_the_file_is_a_sensor_everywhere(build: Build, tmp_path: Path, capsys: Capture) -> None:
    result = build.identified(tmp_path, caliper=build.caliper)
    path = tmp_path / "mine.toml"
    words = ["identify", tmp_path / "plucked.wav", tmp_path / "driven.wav", "--length", build.ruler]
    (printed,) = records(capsys, *words, "--caliper", build.caliper, "--out", path)
    assert printed["estimates"]["tension"]["value"] == result.estimates["tension"].value
    assert printed["correlation"]["matrix"] == result.fit.correlation.tolist()
    assert path.read_text(encoding="utf-8") == result.toml()
    assert mc.load_sensor(str(path)).string == result.sensor.string
    assert tomllib.loads(result.toml())["override"]["tension"] == result.sensor.string.tension
    tuned = mc.tune(tmp_path / "plucked.wav", sensor=str(path))
    assert abs(tuned.deviation) < 5e-3
    (update,) = list(mc.listen("twin", "tuning", sensor=str(path), seconds=0.1, speed=0.0))
    assert update.time >= 0.0
    assert run([*map(str, words), "--out", str(path), "--force"]) == 0
    assert "no answer" in capsys.readouterr().out


def test_a_caliper_in_millimetres_is_asked_back(build: Build, tmp_path: Path, capsys: Capture) -> None:
    soundfile.write(tmp_path / "plucked.wav", build.plucked.T, 44100, subtype="FLOAT")
    words = ("identify", tmp_path / "plucked.wav", "--length", "0.2", "--caliper", "0.254")
    assert "unit" in refusal(capsys, *words)


def test_a_wound_string_has_no_density_by_caliper(tmp_path: Path) -> None:
    sensor = mc.load_sensor("prototype")
    string = replace(sensor.string, core_diameter=0.8 * sensor.string.core_diameter)
    twin = mc.VirtualSensor(replace(sensor, string=string), seed=1)
    twin.drive(False, False)
    (tmp_path / "wound.toml").write_text(
        'title = "wound"\nsource = "made up"\nstring = "prototype"\nrange = [0.05, 0.15]\n'
        f"[override]\ncore_diameter = {string.core_diameter}\n"
        "[[drivers]]\nsense = 0.015\ndrive = 0.028\n[[drivers]]\nsense = 0.178\ndrive = 0.189\n",
        encoding="utf-8",
    )
    wound = str(tmp_path / "wound.toml")
    result = mc.identify(twin, length=0.2, caliper=0.254e-3, sensor=wound)
    assert not result.estimates["tension"].valid
    assert "wound" in result.notes[0]
    assert result.fit.relative_std("tension") > 0.05


@pytest.mark.slow
def test_fifty_plausible_builds(tmp_path: Path) -> None:
    """Tension within 0.7 % in the median; the stated error covers 60 to 76 %; without density no answer."""
    errors: dict[str, list[float]] = {"caliper": [], "weighed": []}
    claims: dict[str, list[float]] = {"caliper": [], "weighed": []}
    alone, alone_claims = list[float](), list[float]()
    pitch = list[float]()
    for seed in range(BUILDS):
        build = Build.drawn(seed)
        both = {
            "caliper": build.identified(tmp_path, caliper=build.caliper),
            "weighed": build.identified(tmp_path, weighed=build.weighed),
        }
        for name, result in both.items():
            tension = result.estimates["tension"]
            errors[name].append(tension.value / build.string.tension - 1.0)
            claims[name].append(tension.std / build.string.tension)
        frequency = both["caliper"].estimates["open_frequency"]
        pitch.append((frequency.value - mc.open_frequency(build.string)) / frequency.std)
        result = build.identified(tmp_path)
        assert not result.estimates["tension"].valid
        alone.append(float(result.fit.values[NAMES.index("tension")]) / build.string.tension - 1.0)
        alone_claims.append(result.fit.relative_std("tension"))
    for name, values in errors.items():
        error, claim = np.abs(values), np.array(claims[name])
        assert np.median(error) < 7e-3
        assert 0.60 <= np.mean(error < claim) <= 0.76
        assert error.max() < 3.0 * claim.max()
    assert 0.8 < np.sqrt(np.mean(np.square(pitch))) < 1.25
    assert np.median(np.abs(alone)) > 0.02
    assert steel_density_of(2.54e-4) == pytest.approx(3.978e-4, rel=1e-4)
