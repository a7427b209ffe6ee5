"""Monochord without its packages: one line says which one is needed, and how it is installed."""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture, refusal
from tests.fuzz.targets.models import RATE, drawn_model

import monochord as mc
from monochord.cli import run
from monochord.core import registry
from monochord.core.errors import MissingLibraryError
from monochord.perception import MOVED
from monochord.perception.features import FEATURES

WHEEL = "monochord_encoders-*.whl"


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A model with the feature log_mel."""
    drawn_model(tmp_path / "model", heads=("contact", "position"))
    return tmp_path / "model"


@pytest.fixture
def absent(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No package adds anything."""
    registry._installed.cache_clear()
    monkeypatch.setattr(registry, "_entries", lambda _: ())
    yield
    registry._installed.cache_clear()


@pytest.mark.usefixtures("absent")
@pytest.mark.parametrize(
    "words",
    [
        "weights",
        "weights get ast",
        "weights --help",
        "train --dataset {small}/dataset --out {out} --set feature.name=ast",
        "train paper --dataset {small}/dataset --out {out} --set feature.name=log_mel",
        "figure tsne --set dataset={small}/dataset --set features=log_mel --out {out}.png",
    ],
)
def test_a_command_that_needs_it_is_refused_in_one_line(
    words: str, small: Path, tmp_path: Path, capsys: Capture
) -> None:
    line = refusal(capsys, *words.format(small=small, out=tmp_path / "out").split())
    assert "requires the package monochord-encoders. Install it: " in line
    assert " -m pip install " in line
    assert "/packages/monochord-encoders # in a checkout" in line
    assert line.endswith(WHEEL)
    assert not list(tmp_path.iterdir())


def test_a_saved_model_that_needs_it_is_refused_in_one_line(
    model: Path, absent: None, tmp_path: Path, capsys: Capture
) -> None:
    soundfile.write(tmp_path / "take.wav", np.zeros((RATE, 2)), RATE)
    line = refusal(capsys, "live", model, tmp_path / "take.wav")
    assert "'log_mel' requires the package monochord-encoders" in line
    assert line.endswith(WHEEL)
    with pytest.raises(MissingLibraryError, match="monochord-encoders"):
        mc.load(model).predict(np.zeros((2, RATE), np.float32))


@pytest.mark.usefixtures("absent")
@pytest.mark.parametrize("name", ["ast", "log_mel", "log-mel", "yamnet"])
def test_the_error_says_what_was_given_what_is_expected_and_what_to_do(name: str) -> None:
    with pytest.raises(MissingLibraryError) as caught:
        mc.features(np.zeros((2, 4410), np.float32), sample_rate=44100, feature=name)
    error, package = caught.value, MOVED[name.replace("-", "_")]
    assert error.given == f"The feature '{name}' without the package {package}"
    assert error.expected == f"the package {package}"
    assert f"packages/{package} # in a checkout of Monochord; elsewhere from " in error.remedy
    assert f"{package.replace('-', '_')}-*.whl" in error.remedy
    assert FEATURES.names() == ["fft_harmonic", "one_microphone", "reading"]


@pytest.mark.usefixtures("absent")
def test_help_does_not_list_its_command(capsys: Capture) -> None:
    assert run(["--help"]) == 0
    assert "weights" not in capsys.readouterr().out


def test_only_the_package_of_a_network_that_is_not_installed_is_named(capsys: Capture) -> None:
    if "yamnet" in FEATURES.names():
        pytest.skip("monochord-yamnet is installed")
    line = refusal(capsys, "weights", "get", "yamnet")
    assert "requires the package monochord-yamnet" in line
    assert line.endswith("monochord_encoders-*.whl and monochord_yamnet-*.whl")


def test_what_is_moved_is_in_no_folder_of_monochord() -> None:
    folder = Path(str(import_module("monochord.perception.features").__file__)).parent
    assert not [name for name in MOVED if (folder / f"{name}.py").exists()]
