"""`--workers` and `--cluster` are the same in every command, and change neither bytes nor numbers."""

import hashlib
import json
from collections.abc import Callable, Generator
from importlib import import_module
from pathlib import Path
from typing import Any

import click
import pytest
from tests.cli.running import Capture

from monochord.cli import run

COMMANDS = ("build", "collect", "evaluate", "train")
EVALUATED = {
    "model": ["demo", "--sessions", "*.mcap", "--noise", "hum:10"],
    "physics": ["--dataset", "dataset", "--sensor", "prototype", "--set", "tension_law=geometric"],
}


@pytest.fixture(scope="module")
def cluster() -> Generator[str]:
    """Address of a cluster of two processes."""
    from distributed import LocalCluster

    options: Any = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
    started: Any = LocalCluster(host="127.0.0.1", **options)
    with started:
        yield started.scheduler_address


@pytest.fixture(params=["one", "two", "cluster"])
def spread(request: pytest.FixtureRequest) -> list[str]:
    """The options of one process, of two, and of a cluster."""
    if request.param == "cluster":
        return ["--cluster", request.getfixturevalue("cluster")]
    return ["--workers", "1" if request.param == "one" else "2"]


@pytest.fixture(scope="module")
def same() -> Callable[[str, str], None]:
    """Return what takes the result of a job by each way, and refuses one that differs from the first."""
    first: dict[str, str] = {}

    def check(job: str, result: str) -> None:
        assert first.setdefault(job, result) == result

    return check


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_has_both_options_as_all_have_them(name: str) -> None:
    command: click.Command = getattr(import_module(f"monochord.cli.{name}"), name)
    usual: click.Command = import_module("monochord.cli.collect").collect
    for option in ("workers", "cluster"):
        own, other = (
            next(each.to_info_dict() for each in one.params if each.name == option)
            for one in (command, usual)
        )
        assert own == other


@pytest.mark.slow
def test_a_dataset_has_the_same_bytes(
    spread: list[str], small: Path, tmp_path: Path, same: Callable[[str, str], None]
) -> None:
    assert run(["build", str(small), "--out", str(tmp_path / "out"), *spread]) == 0
    files = sorted(path for path in (tmp_path / "out").rglob("*") if path.is_file())
    lines = [f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}" for path in files]
    same("build", "\n".join(lines))


@pytest.mark.slow
@pytest.mark.parametrize("tested", EVALUATED)
def test_an_evaluation_has_the_same_numbers(
    spread: list[str],
    small: Path,
    tmp_path: Path,
    same: Callable[[str, str], None],
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
    tested: str,
) -> None:
    monkeypatch.chdir(small)  # relative paths are those of the caller, on a cluster too
    assert run(["evaluate", *EVALUATED[tested], "--json", "--out", str(tmp_path), *spread]) == 0
    text = capsys.readouterr().out
    card = json.loads(text)
    assert card["sessions"] == 2
    assert bool(card["baselines"]) == (tested == "physics")
    same(tested, text + hashlib.sha256((tmp_path / "results.npz").read_bytes()).hexdigest())


@pytest.mark.slow
def test_features_have_the_same_bytes(
    spread: list[str],
    small: Path,
    tmp_path: Path,
    same: Callable[[str, str], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("monochord.perception.training.rows.CHUNK", 64)
    settings = ("feature.name=log_mel", "optimiser.epochs=1", "noise.copies=1")
    given = [part for each in (*settings, f"cache={tmp_path / 'cache'}") for part in ("--set", each)]
    dataset = ["--dataset", str(small / "dataset")]
    assert run(["train", "paper", *dataset, *given, "--out", str(tmp_path / "run"), *spread]) == 0
    files = sorted((tmp_path / "cache").rglob("*.npy"))
    assert len(files) > 4
    lines = [f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}" for path in files]
    same("train", "\n".join(lines))
