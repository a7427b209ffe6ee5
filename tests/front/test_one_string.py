"""Whoever measures an untouched string, gets one answer: `tune`, `identify` and the check of a pluck."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.front.test_identify import Build

import monochord as mc
from monochord.bringup.check import Take
from monochord.bringup.string import measure_pluck
from monochord.core.types import Audio
from monochord.perception.tuning import Tuning
from monochord.physics.theory import inharmonicity, open_frequency

BUILDS = range(1, 25)
RATE = 44100


@dataclass(frozen=True, kw_only=True)
class Told:
    """Pitch and inharmonicity over the true ones, less one, each with its stated standard error."""

    pitch: tuple[float, float]
    stiffness: tuple[float, float]


def told(tuning: Tuning, build: Build) -> Told:
    pitch, bend = open_frequency(build.string), inharmonicity(build.string)
    return Told(
        pitch=(tuning.frequency / pitch - 1.0, tuning.frequency_std / pitch),
        stiffness=(tuning.inharmonicity / bend - 1.0, tuning.inharmonicity_std / bend),
    )


def measured(build: Build, folder: Path) -> dict[str, Told]:
    """Return what each command tells of one pluck, and of it beside steady sound."""
    sounds: dict[str, Audio] = {"pluck": build.plucked, "steady": build.driven}
    for name, sound in sounds.items():
        soundfile.write(folder / f"{name}.wav", sound.T, RATE, subtype="FLOAT")
    files = {name: str(folder / f"{name}.wav") for name in sounds}
    checked = measure_pluck(Take(samples=build.plucked, sample_rate=RATE), mc.load_sensor("prototype"))
    assert checked
    identified = mc.identify(*files.values(), length=build.ruler, caliper=build.caliper)
    pitch, bend = (identified.estimates[name] for name in ("open_frequency", "inharmonicity"))
    return {
        "tune, steady": told(mc.tune(files["steady"], sensor="prototype").tuning, build),
        "tune, pluck": told(mc.tune(files["pluck"], sensor="prototype").tuning, build),
        "tune, both": told(mc.tune(*files.values(), sensor="prototype").tuning, build),
        "doctor": told(checked.tuning, build),
        "identify": told(
            Tuning(
                frequency=pitch.value,
                frequency_std=pitch.std,
                inharmonicity=bend.value,
                inharmonicity_std=bend.std,
            ),
            build,
        ),
    }


@pytest.fixture(scope="module")
def all_told(tmp_path_factory: pytest.TempPathFactory) -> list[Mapping[str, Told]]:
    folder = tmp_path_factory.mktemp("strings")
    return [measured(Build.drawn(seed), folder) for seed in BUILDS]


@pytest.mark.parametrize("quantity", ["pitch", "stiffness"])
@pytest.mark.parametrize("command", ["tune, steady", "tune, pluck", "tune, both", "doctor", "identify"])
def test_a_command_is_within_its_stated_error_of_the_truth(
    all_told: list[Mapping[str, Told]], command: str, quantity: str
) -> None:
    off = np.array(
        [abs(error) / std for error, std in (getattr(each[command], quantity) for each in all_told)]
    )
    assert np.mean(off < 2.0) >= 0.91
    assert off.max() < 4.0
    assert np.sqrt(np.mean(off**2)) < 1.3


@pytest.mark.parametrize("quantity", ["pitch", "stiffness"])
def test_the_commands_agree_within_their_stated_errors(
    all_told: list[Mapping[str, Told]], quantity: str
) -> None:
    for each in all_told:
        answers = [getattr(own, quantity) for own in each.values()]
        for one, one_std in answers:
            assert all(abs(one - other) < 4.0 * math.hypot(one_std, std) for other, std in answers)


def test_a_pluck_tells_the_pitch_to_a_thousandth_and_the_stiffness_to_a_tenth(
    all_told: list[Mapping[str, Told]],
) -> None:
    for command in ("tune, pluck", "doctor", "identify"):
        pitch, stiffness = (
            np.sqrt(np.mean([getattr(each[command], name)[0] ** 2 for each in all_told]))
            for name in ("pitch", "stiffness")
        )
        assert pitch < 7e-4, command
        assert stiffness < 0.1, command
