"""A grid trains and judges each variation by the same rules, once; what fails leaves the others alone."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from tests.conftest import LEARNABLE, sung

from monochord.core.errors import InputError
from monochord.core.types import Block
from monochord.datasets.build import build_dataset
from monochord.datasets.split import split_dataset
from monochord.datasets.store import Dataset
from monochord.evaluation.ablation import DONE, AblationError, ablate, compared
from monochord.evaluation.grid import WHOLE, Grid, Variation
from monochord.evaluation.results import Results
from monochord.evaluation.scorecard import scorecard
from monochord.sessions import Description, SessionClock, SessionWriter

Oracle = Callable[..., Results]
PHYSICS = Variation(estimator="closed_form", estimator_set=("tension_law=geometric",))


@pytest.fixture(name="several", scope="module")
def _several(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Return the dataset of four sessions of four seconds, split by session."""
    home = tmp_path_factory.mktemp("several")
    for number in range(4):
        samples, time, labels = sung(number)
        told = Description(name=f"sung_{number}", sample_rate=LEARNABLE, simulated=True)
        with SessionWriter(home / f"sung_{number}.mcap", told, SessionClock(epoch_ns=10**18)) as writer:
            writer.audio(Block(samples=samples[:, : 4 * LEARNABLE], start=0, adc_time=0.0))
            writer.labels(time[:400], {name: values[:400] for name, values in labels.items()})
    dataset = build_dataset(sorted(home.glob("*.mcap")), home / "dataset")
    split_dataset(dataset, fractions=(0.5, 0.25, 0.25)).write(dataset.path / "split.json")
    return dataset


def physics(several: Dataset, **variations: Variation) -> Grid:
    """Return a grid that trains nothing."""
    sessions = (str(several.path.parent / "*.mcap"),)
    return Grid(
        dataset=several.path, sensor="prototype", sessions=sessions, whole=False, variations=variations
    )


def test_what_fails_is_told_with_its_own_line_and_the_others_go_on(several: Dataset, tmp_path: Path) -> None:
    told: list[tuple[str, str]] = []
    absent = Variation(estimator="closed_form", sessions=(str(tmp_path / "absent"),))
    grid = replace(
        physics(several, physics=PHYSICS, other=absent, odd=replace(PHYSICS, estimator_set=("law=2",))),
        config="nowhere",
        whole=True,
    )
    found = ablate(grid, tmp_path, lambda *what: told.append(what), workers=2)
    assert list(found.scores) == ["physics"]
    assert list(found.failed) == [WHOLE, "other", "odd"]
    assert found.failed[WHOLE].startswith("variation whole, train: configuration 'nowhere'")
    assert "variation other, dataset: sessions '" in found.failed["other"]
    assert "variation odd, evaluate: option 'closed_form.law'" in found.failed["odd"]
    assert ("physics", "evaluation") in told
    assert ("other", f"failed: {found.failed['other']}") in told
    with pytest.raises(AblationError, match=r"3 of 4 variations failed \(.*\); variation whole, train: "):
        found.refuse_failed()
    assert not (tmp_path / WHOLE / DONE).exists()
    told.clear()
    ablate(physics(several, physics=PHYSICS), tmp_path, lambda *what: told.append(what)).refuse_failed()
    assert not told


@pytest.mark.slow
def test_windows_of_ones_own_are_built_once_and_rows_say_what_differs(
    several: Dataset, tmp_path: Path
) -> None:
    sparse = replace(PHYSICS, hop=0.4)
    mine = replace(sparse, estimator_set=(), feature="mine")
    found = ablate(physics(several, closed_form=PHYSICS, sparse=sparse, linear=mine), tmp_path)
    assert not found.failed
    (folder,) = (tmp_path / "datasets").iterdir()
    assert folder.name.startswith("100ms_every_400ms_")
    count = {name: card["windows"] for name, card in found.scores.items()}
    assert count == {"closed_form": 40, "sparse": 10, "linear": 10}
    names = {name: {row["feature"] for row in rows} for name, rows in found.rows.items()}
    assert names == {"closed_form": {"closed_form"}, "sparse": {"closed_form, sparse"}, "linear": {"mine"}}
    (row, *_) = found.rows["sparse"]
    assert (row["part"], row["condition"], row["simulated"]) == ("validation", "clean", True)


def test_what_is_done_is_not_done_again(several: Dataset, tmp_path: Path) -> None:
    grid, told = physics(several, physics=PHYSICS), list[tuple[str, str]]()
    first = ablate(grid, tmp_path)
    mark = (tmp_path / "physics" / DONE).stat().st_mtime_ns
    again = ablate(replace(grid, title="another"), tmp_path, lambda *what: told.append(what))
    assert (again.scores, again.rows, told) == (first.scores, first.rows, [])
    assert (tmp_path / "physics" / DONE).stat().st_mtime_ns == mark
    tested = ablate(replace(grid, part="test"), tmp_path, lambda *what: told.append(what))
    assert tested.scores != first.scores
    assert ("physics", "evaluation") in told
    with pytest.raises(InputError, match="a variation of another grid"):
        ablate(replace(grid, sensor=""), tmp_path)


@pytest.mark.slow
def test_an_interruption_ends_what_runs_and_the_same_command_goes_on(
    several: Dataset, tmp_path: Path
) -> None:
    grid = tmp_path / "grid.toml"
    grid.write_text('sensor = "prototype"\nwhole = false\n[variations.physics]\nestimator = "closed_form"\n')
    program = [sys.executable, "-c", "from monochord.cli import main; main()"]
    asked = ["ablate", str(grid), "--dataset", str(several.path), "--out", str(tmp_path / "out")]
    with subprocess.Popen([*program, *asked], stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr
        assert process.stderr.readline() == "physics: dataset\n"
        assert process.stderr.readline() == "physics: evaluation\n"
        time.sleep(0.2)
        begun = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 130
        assert "failed" not in process.stderr.read()
    assert begun
    assert not any(child.is_running() for child in begun)
    assert not (tmp_path / "out" / "physics" / DONE).exists()
    assert subprocess.run([*program, *asked], capture_output=True, check=False).returncode == 0


def test_a_row_for_each_variation_of_all_objects(oracle: Oracle) -> None:
    scores = json.loads(json.dumps(scorecard(oracle(objects=("wood", "plastic")), draws=0).tree()))
    (row,) = compared({WHOLE: scores})
    assert (row["variation"], row["position_mae"], row["slip_area"]) == (WHOLE, 0.0, 1.0)
    assert row["windows"] == 2 * scores["table"][0]["position"]["windows"]
