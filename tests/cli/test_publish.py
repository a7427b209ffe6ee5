"""``monochord publish``: a folder for the Hugging Face Hub, whose figures are those of the files."""

import hashlib
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from tests.cli.running import Capture, record, refusal

import monochord as mc
from monochord.perception.model import folder_of

PLAN = ["groups=[{name='hold', sessions=3, grid=[2, 1], hold=0.2}]"]


def front_matter(folder: Path) -> dict[str, Any]:
    yaml = pytest.importorskip("yaml")
    _, head, _ = (folder / "README.md").read_text(encoding="utf-8").split("---\n", 2)
    return yaml.safe_load(head)


def sums_hold(folder: Path) -> bool:
    check = subprocess.run(
        ["sha256sum", "--check", "SHA256SUMS"], cwd=folder, capture_output=True, check=False
    )
    return check.returncode == 0


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with sessions, a dataset of them, and a report of the bundled model on them."""
    folder = tmp_path_factory.mktemp("made")
    sessions = mc.collect("quick", folder / "sessions", settings=PLAN, workers=1)
    mc.build(sessions, folder / "dataset")
    report = mc.evaluate("demo", sessions=sessions, baselines=False)
    (folder / "report").mkdir()
    (folder / "report" / "scores.json").write_text(json.dumps(report.tree()), encoding="utf-8")
    return folder


def test_a_models_card_has_the_scores_of_its_report(made: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "hub" / "model"
    words = ["publish", "demo", "--scores", made / "report", "--licence", "apache-2.0", "--out", out]
    files = record(capsys, *words)["files"]
    assert sorted(files) == ["README.md", "SOURCES.md", "model.json", "scores.json", "weights.safetensors"]
    assert files["model.json"] == hashlib.sha256((out / "model.json").read_bytes()).hexdigest()
    assert sums_hold(out)
    assert mc.load(out).definition.weights == mc.load("demo").definition.weights

    card = front_matter(out)
    assert (card["license"], card["library_name"]) == ("apache-2.0", "monochord")
    assert "simulated" in card["tags"]
    rows = [
        row
        for row in json.loads((made / "report" / "scores.json").read_text(encoding="utf-8"))["table"]
        if row["state"] == "touched"
    ]
    (index,) = card["model-index"]
    told = [(result["task"]["name"], result["metrics"][0]["value"]) for result in index["results"]]
    expected = [
        (f"{name} of a touch", row[name]["mae"]["value"]) for row in rows for name in ("position", "force")
    ]
    assert told == expected
    error = 1e3 * rows[0]["position"]["mae"]["value"]
    assert f"| {error:.3g} mm (" in (out / "README.md").read_text(encoding="utf-8")


def test_the_hubs_own_reader_takes_both_cards(made: Path, tmp_path: Path) -> None:
    hub = pytest.importorskip("huggingface_hub")
    model = mc.publish("demo", tmp_path / "model", licence="apache-2.0", scores=made / "report", title="Mine")
    card = hub.ModelCard.load(model.path / "README.md")
    assert {result.metric_type for result in card.data.eval_results} == {"mae", "answered"}
    assert card.data.model_name == "Mine"
    data = mc.publish(made / "dataset", tmp_path / "data", licence="cc-by-4.0")
    card = hub.DatasetCard.load(data.path / "README.md")
    assert (card.data.license, card.data.size_categories) == ("cc-by-4.0", ["n<1K"])


def test_a_dataset_is_whole_and_its_card_counts_it(made: Path, tmp_path: Path) -> None:
    folder = mc.publish(made / "dataset", tmp_path / "data", licence="cc-by-4.0", title="Three sessions")
    assert sums_hold(folder.path)
    data = mc.load_dataset(folder.path)
    assert mc.audit(data).clean
    text = (folder.path / "README.md").read_text(encoding="utf-8")
    for fact in (
        "# Three sessions",
        "**Simulated**",
        "3, simulated",
        f"| hold_000 | {data.manifest.parts[0].object} |",
    ):
        assert fact in text
    for name, count in data.manifest.counts.items():
        assert f"- {name}: {count}\n" in text
    assert not (folder.path / "features").exists()
    (folder.path / "audio" / "0000.npy").write_bytes(b"")
    assert not sums_hold(folder.path)


def test_scores_of_another_model_or_for_a_dataset_are_refused(made: Path, tmp_path: Path) -> None:
    scores = json.loads((made / "report" / "scores.json").read_text(encoding="utf-8"))
    scores["options"]["weights"] = "0" * 64
    other = tmp_path / "scores.json"
    other.write_text(json.dumps(scores), encoding="utf-8")
    with pytest.raises(mc.InputError, match="scores of weights"):
        mc.publish("demo", tmp_path / "out", licence="mit", scores=other)
    with pytest.raises(mc.InputError, match="scores of a model"):
        mc.publish(made / "dataset", tmp_path / "out", licence="mit", scores=other)
    other.write_text("[]", encoding="utf-8")
    with pytest.raises(mc.InputError):
        mc.publish("demo", tmp_path / "out", licence="mit", scores=other)
    assert not (tmp_path / "out").exists()


def link(target: Path, name: str) -> None:
    """Replace a file or folder by a link to it."""
    original = target / name
    moved = target.parent / f"{target.name} {name} elsewhere"
    original.rename(moved)
    original.symlink_to(moved)


@pytest.mark.parametrize("name", ["weights.safetensors", "metrics.json", "model.json"])
def test_no_link_of_a_model_is_followed(name: str, tmp_path: Path, capsys: Capture) -> None:
    model = tmp_path / "mine"
    shutil.copytree(folder_of(Path("demo")) or Path(), model)
    (model / "metrics.json").write_text(json.dumps({"heads": {}}))
    link(model, name)
    line = refusal(capsys, "publish", model, "--licence", "mit", "--out", tmp_path / "hub")
    assert f"{name} (a symbolic link)" in line
    assert not (tmp_path / "hub").exists()


def test_no_linked_folder_is_followed(made: Path, tmp_path: Path, capsys: Capture) -> None:
    run_folder, dataset = tmp_path / "run", tmp_path / "dataset"
    shutil.copytree(folder_of(Path("demo")) or Path(), run_folder / "model")
    shutil.copytree(made / "dataset", dataset)
    link(run_folder, "model")
    link(dataset, "audio" if (dataset / "audio").is_dir() else "split.json")
    link(tmp_path, "dataset")
    for what in (run_folder, dataset):
        line = refusal(capsys, "publish", what, "--licence", "mit", "--out", tmp_path / "hub")
        assert "(a symbolic link)" in line
    (tmp_path / "report").symlink_to(made / "report")
    words = ("--scores", tmp_path / "report", "--licence", "mit", "--out", tmp_path / "hub")
    assert "report (a symbolic link)" in refusal(capsys, "publish", "demo", *words)


DAMAGED = (
    *("", "[]", "{}", "[" * 100_000, "\xff"),
    *('{"heads": 5}', '{"heads": {"a": [1]}}', '{"heads": {"a": {"windows": 3, "mae": "b"}}}'),
)


@pytest.mark.parametrize("text", DAMAGED)
def test_damaged_metrics_are_one_line(text: str, tmp_path: Path, capsys: Capture) -> None:
    model = tmp_path / "mine"
    shutil.copytree(folder_of(Path("demo")) or Path(), model)
    (model / "metrics.json").write_bytes(text.encode("latin-1"))
    line = refusal(capsys, "publish", model, "--licence", "mit", "--out", tmp_path / "hub")
    assert "metrics.json" in line
    assert not (tmp_path / "hub").exists()


@pytest.mark.parametrize(
    "table", [None, 5, "a", [1], [{}], [{"state": "touched"}], [{"state": "touched", "position": 5}]]
)
def test_damaged_scores_are_one_line(table: object, made: Path, tmp_path: Path, capsys: Capture) -> None:
    tree = json.loads((made / "report" / "scores.json").read_text())
    (tmp_path / "scores.json").write_text(json.dumps({**tree, "table": table}))
    words = ("--scores", tmp_path / "scores.json", "--licence", "mit", "--out", tmp_path / "hub")
    assert "scores.json" in refusal(capsys, "publish", "demo", *words)
