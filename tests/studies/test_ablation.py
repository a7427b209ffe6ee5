"""The paper's tables by feature: variations that can be trained, on windows that are split alike."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from studies.ablation import ablation, split_like, training_of, variations
from tests.conftest import sing

from monochord.core.config import override
from monochord.core.errors import InputError
from monochord.datasets.build import BuildOptions, build_dataset
from monochord.datasets.split import split_dataset
from monochord.datasets.store import Dataset
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.features import FEATURES


@pytest.fixture(name="several", scope="module")
def _several(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Return the dataset of four sessions of two seconds, split by session."""
    home = tmp_path_factory.mktemp("several")
    files = [sing(home / f"sung_{number}.mcap", number, seconds=2) for number in range(4)]
    dataset = build_dataset(files, home / "dataset")
    split_dataset(dataset, fractions=(0.5, 0.25, 0.25)).write(dataset.path / "split.json")
    return dataset


def test_other_windows_are_split_like_the_first(several: Dataset, tmp_path: Path) -> None:
    split = split_dataset(several, fractions=(0.5, 0.25, 0.25))
    files = sorted(several.path.parent.glob("*.mcap"))
    other = build_dataset(files, tmp_path / "short", BuildOptions(window=0.05, hop=0.05))
    same = split_like(other, several, split)
    for name, rows in split.parts.items():
        one = {several.manifest.parts[at].name for at in several.session[rows].tolist()}
        two = {other.manifest.parts[at].name for at in other.session[same.parts[name]].tolist()}
        assert one == two
        assert len(same.parts[name]) > 1.9 * len(rows)
    assert same.dataset != split.dataset


def test_a_split_that_cuts_sessions_or_lacks_one_is_refused(several: Dataset, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="time"):
        split_like(several, several, split_dataset(several, by="time"))
    fewer = build_dataset(sorted(several.path.parent.glob("*.mcap"))[:3], tmp_path / "fewer")
    with pytest.raises(InputError, match="sung_3"):
        split_like(fewer, several, split_dataset(several))


@pytest.mark.usefixtures("yamnet_package")
@pytest.mark.parametrize("name", variations())
def test_every_variation_names_settings_that_exist(name: str) -> None:
    variation = variations()[name]
    if variation.estimator:
        ESTIMATORS.build(variation.estimator, override({}, variation.estimator_set))
    training_of(variation).resolved()


@pytest.mark.skipif("yamnet" in FEATURES.names(), reason="monochord-yamnet is installed")
def test_a_package_that_is_not_installed_is_told_before_anything_is_trained(
    several: Dataset, tmp_path: Path
) -> None:
    line = ["--dataset", str(several.path), "--sessions", "none", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(ablation, line)
    assert "monochord-yamnet" in str(result.exception)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_variation_keeps_its_rows(several: Dataset, tmp_path: Path) -> None:
    rows = tmp_path / "rows.json"
    line = ["--dataset", str(several.path), "--sessions", str(several.path.parent / "*.mcap")]
    line += ["--only", "closed_form", "--out", str(tmp_path / "out"), "--rows", str(rows)]
    CliRunner().invoke(ablation, line, catch_exceptions=False)
    kept = json.loads(rows.read_text())
    assert {(row["part"], row["simulated"]) for row in kept} == {("test", True)}
    assert {row["condition"] for row in kept} == {"clean", "music 10 dB"}
    result = CliRunner().invoke(ablation, [*line[:4], "--only", "closed"])
    assert isinstance(result.exception, InputError)
