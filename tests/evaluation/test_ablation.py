"""A grid trains and evaluates each variation once, by the same rules; a failure leaves the others alone."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
from tests.conftest import LEARNABLE, sung

from monochord.core.config import load_toml, override
from monochord.core.errors import InputError
from monochord.core.types import Block
from monochord.datasets.build import BuildOptions, build_dataset
from monochord.datasets.split import split_dataset
from monochord.datasets.store import Dataset, open_dataset
from monochord.evaluation.ablation import DONE, AblationError, ablate, compared, split_like
from monochord.evaluation.grids import WHOLE, Grid, Variation, grid_names, load_grid
from monochord.evaluation.results import Results
from monochord.evaluation.scorecard import scorecard
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.training.configs import config_path
from monochord.perception.training.settings import TrainingSettings
from monochord.sessions import Description, SessionClock, SessionWriter

Oracle = Callable[..., Results]
PHYSICS = Variation(estimator="closed_form", estimator_set=("tension_law=geometric",))


@pytest.fixture(name="several", scope="module")
def _several(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Return the dataset of four sessions of two seconds, split by session."""
    home = tmp_path_factory.mktemp("several")
    for number in range(4):
        samples, seconds, labels = sung(number)
        description = Description(name=f"sung_{number}", sample_rate=LEARNABLE, simulated=True)
        with SessionWriter(
            home / f"sung_{number}.mcap", description, SessionClock(epoch_ns=10**18)
        ) as writer:
            writer.audio(Block(samples=samples[:, : 2 * LEARNABLE], start=0, adc_time=0.0))
            writer.labels(seconds[:200], {name: values[:200] for name, values in labels.items()})
    dataset = build_dataset(sorted(home.glob("*.mcap")), home / "dataset")
    split_dataset(dataset, fractions=(0.5, 0.25, 0.25)).write(dataset.path / "split.json")
    return dataset


def physics(several: Dataset, **variations: Variation) -> Grid:
    """Return a grid that trains nothing."""
    sessions = (str(several.path.parent / "*.mcap"),)
    return Grid(
        dataset=several.path, sensor="prototype", sessions=sessions, whole=False, variations=variations
    )


@pytest.mark.slow
def test_a_failure_is_reported_and_the_others_go_on(several: Dataset, tmp_path: Path) -> None:
    steps: list[tuple[str, str]] = []
    absent = Variation(estimator="closed_form", sessions=(str(tmp_path / "absent"),))
    odd = replace(PHYSICS, estimator_set=("law=2",))
    grid = physics(several, physics=PHYSICS, other=absent, odd=odd)
    grid = replace(grid, config="nowhere", whole=True)
    outcome = ablate(grid, tmp_path, lambda *step: steps.append(step), workers=2)
    assert list(outcome.scores) == ["physics"]
    assert list(outcome.failed) == [WHOLE, "other", "odd"]
    assert outcome.failed[WHOLE].startswith("variation whole, train: configuration 'nowhere'")
    assert "variation other, dataset: sessions '" in outcome.failed["other"]
    assert "variation odd, evaluate: option 'closed_form.law'" in outcome.failed["odd"]
    assert {("physics", "evaluation"), ("other", f"failed: {outcome.failed['other']}")} < set(steps)
    with pytest.raises(AblationError, match=r"3 of 4 variations failed \(.*\); variation whole, train: "):
        outcome.refuse_failed()
    assert not (tmp_path / WHOLE / DONE).exists()


@pytest.mark.slow
def test_other_windows_are_built_once(several: Dataset, tmp_path: Path) -> None:
    sparse = replace(PHYSICS, hop=0.4)
    linear = replace(sparse, estimator_set=(), feature="mine")
    outcome = ablate(physics(several, closed_form=PHYSICS, sparse=sparse, linear=linear), tmp_path)
    assert not outcome.failed
    (folder,) = (tmp_path / "datasets").iterdir()
    assert folder.name.startswith("100ms_every_400ms_")
    windows = {name: card["windows"] for name, card in outcome.scores.items()}
    assert windows == {"closed_form": 20, "sparse": 5, "linear": 5}
    own = {name: rows[0]["feature"] for name, rows in outcome.rows.items()}
    assert own == {"closed_form": "closed_form", "sparse": "closed_form, sparse", "linear": "mine"}
    (row, *_) = outcome.rows["sparse"]
    assert (row["part"], row["condition"], row["simulated"]) == ("validation", "clean", True)


@pytest.mark.slow
def test_nothing_is_computed_twice(several: Dataset, tmp_path: Path) -> None:
    grid, steps = physics(several, physics=PHYSICS), list[tuple[str, str]]()
    first = ablate(grid, tmp_path)
    mark = (tmp_path / "physics" / DONE).stat().st_mtime_ns
    again = ablate(replace(grid, title="another"), tmp_path, lambda *step: steps.append(step))
    assert (again.scores, again.rows, steps) == (first.scores, first.rows, [])
    assert (tmp_path / "physics" / DONE).stat().st_mtime_ns == mark
    assert {row["feature"] for row in first.rows["physics"]} == {
        "closed_form, physics",
        "closed_form, physics, ridge",
        "closed_form, physics, extra trees",
    }
    tested = ablate(replace(grid, part="test"), tmp_path, lambda *step: steps.append(step))
    assert tested.scores != first.scores
    assert ("physics", "evaluation") in steps
    with pytest.raises(InputError, match="a variation of another grid"):
        ablate(replace(grid, sensor=""), tmp_path)


@pytest.mark.slow
def test_an_interruption_ends_the_workers_and_the_same_command_goes_on(
    several: Dataset, tmp_path: Path
) -> None:
    grid = tmp_path / "grid.toml"
    grid.write_text('sensor = "prototype"\nwhole = false\n[variations.physics]\nestimator = "closed_form"\n')
    command = [sys.executable, "-c", "from monochord.cli import main; main()", "ablate", str(grid)]
    command += ["--dataset", str(several.path), "--out", str(tmp_path / "out")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr
        assert process.stderr.readline() == "physics: dataset\n"
        assert process.stderr.readline() == "physics: evaluation\n"
        time.sleep(0.2)
        workers = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 130
        assert "failed" not in process.stderr.read()
    assert workers
    psutil.wait_procs(workers, timeout=5)
    assert not any(worker.is_running() for worker in workers)
    assert not (tmp_path / "out" / "physics" / DONE).exists()
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_the_comparison_has_a_row_for_each_variation_and_baseline(oracle: Oracle) -> None:
    results = oracle(objects=("wood", "plastic"))
    card = scorecard(results, baselines={"ridge": results}, draws=0)
    scores = json.loads(json.dumps(card.tree()))
    rows = compared({WHOLE: scores})
    assert [(row["variation"], row["baseline"]) for row in rows] == [(WHOLE, ""), (WHOLE, "ridge")]
    for row in rows:
        assert (row["position_mae"], row["slip_area"]) == (0.0, 1.0)
        assert row["windows"] == 2 * scores["table"][0]["position"]["windows"]


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


def test_a_share_of_the_sessions_trains_and_the_test_stays(learnable: Path, dataset: Dataset) -> None:
    several = open_dataset(learnable)
    split = split_dataset(several)
    half, same, other = (split_like(several, several, split, 0.5, seed) for seed in (0, 0, 1))
    assert 0 < len(half.train) < len(split.train)
    assert set(half.train.tolist()) < set(split.train.tolist())
    np.testing.assert_array_equal(half.train, same.train)
    assert half.groups["train"] != other.groups["train"]
    np.testing.assert_array_equal(half.test, split.test)
    assert half.left_out == len(split.train) - len(half.train)
    with pytest.raises(InputError, match="a split by time"):
        split_like(several, several, split_dataset(several, by="time"))
    with pytest.raises(InputError, match="sessions without sung_"):
        split_like(dataset, several, split)


def test_a_grid_compares_the_whole_and_chosen_variations() -> None:
    variations = {"few": Variation(share=0.5), "tiny": Variation(share=0.1)}
    grid = Grid(dataset=Path("d"), variations=variations)
    assert list(grid.compared) == [WHOLE, "few", "tiny"]
    assert list(replace(grid, whole=False).compared) == ["few", "tiny"]
    assert list(grid.only(["tiny", WHOLE]).compared) == [WHOLE, "tiny"]
    with pytest.raises(InputError, match="did you mean 'few'"):
        grid.only(["fwe"])
    with pytest.raises(InputError, match="a grid that compares nothing"):
        Grid(whole=False)
    for name in ("whole", "datasets", "../up", ""):
        with pytest.raises(InputError, match=f"variation '{name}'"):
            Grid(variations={name: Variation()})


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"share": 0.0}, "share 0 of the training sessions"),
        ({"estimator": "closed_form", "config": "tones"}, "beside the estimator closed_form"),
        ({"estimator": "closed_form", "share": 0.5}, "beside the estimator closed_form"),
        ({"estimator": "closed_form", "set": ("context.on=false",)}, "beside the estimator closed_form"),
        ({"estimator_set": ("tension_law=geometric",)}, "estimator_set without an estimator"),
    ],
)
def test_an_impossible_variation_is_refused(options: dict[str, object], line: str) -> None:
    with pytest.raises(InputError, match=line):
        Variation(**options)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("options", [{"window": 0.05}, {"hop": 0.5}])
def test_other_windows_need_sessions(options: dict[str, float]) -> None:
    variation = Variation(**options)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="windows of its own"):
        Grid(variations={"other": variation})
    assert Grid(variations={"other": variation}, sessions=("sessions",)).compared["other"].is_built
    assert not Variation(share=0.5).is_built
    assert Variation(sessions=("one",)).is_built


@pytest.mark.parametrize("name", grid_names())
def test_every_preset_names_settings_that_exist(name: str) -> None:
    grid = load_grid(name)
    for variation in grid.compared.values():
        if variation.estimator:
            ESTIMATORS.build(variation.estimator, override({}, variation.estimator_set))
        tree = load_toml(config_path(variation.config or grid.config))
        TrainingSettings.read(override(tree, [*grid.set, *variation.set])).resolved()


def test_overrides_replace_what_a_preset_says() -> None:
    grid = load_grid("parts", {"dataset": "d", "part": "test"}, ['variations.one_driver.sessions=["one"]'])
    assert (grid.dataset, grid.part) == (Path("d"), "test")
    assert grid.compared["one_driver"].sessions == ("one",)
