import json
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import pytest
from click.shell_completion import BashComplete
from tests.cli.running import Capture, refusal

from monochord import cli
from monochord.cli import run
from monochord_encoders import command
from monochord_encoders.network import Sizes, Weights, network_of
from monochord_encoders.weights import load_known

FILE = "model.safetensors"


@pytest.fixture
def published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tiny transformer as it would be published."""
    for needed in ("torch", "transformers"):
        pytest.importorskip(needed, reason=f"{needed} is not installed")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    sizes = Sizes(depth=1, width=64, inner=256, columns=9)
    network_of(Weights(sizes=sizes), 100).model.save_pretrained(tmp_path / "published")
    return tmp_path / "published" / FILE


@pytest.fixture
def address(published: Path) -> str:
    """Where it is given away."""
    return published.as_uri()


def from_address(monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    monkeypatch.setattr(command, "load_known", lambda name: replace(load_known(name), url=address))


def test_get_fetches_checks_and_tells(
    published: Path,
    address: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
) -> None:
    from_address(monkeypatch, address)
    monkeypatch.setenv("MONOCHORD_WEIGHTS", str(tmp_path / "weights"))
    monkeypatch.delenv("MONOCHORD_AST", raising=False)
    assert run(["weights", "get", "ast", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["path"] == str(tmp_path / "weights" / "ast" / FILE)
    assert result["sha256"] == sha256(published.read_bytes()).hexdigest()
    assert result["bytes"] == published.stat().st_size
    assert "depth 1, width 64" in result["holds"]
    assert run(["weights", "check", "ast"]) == 0
    assert result["sha256"] in capsys.readouterr().out


def test_get_puts_them_where_it_is_told(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    from_address(monkeypatch, address)
    assert run(["weights", "get", "ast", "--folder", str(tmp_path / "here")]) == 0
    assert (tmp_path / "here" / FILE).is_file()
    assert capsys.readouterr().out.startswith(f"{tmp_path / 'here' / FILE}: Audio Spectrogram Transformer")


def test_without_a_network_get_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    from_address(monkeypatch, "https://127.0.0.1:9/model.safetensors")
    assert "MONOCHORD_AST" in refusal(capsys, "weights", "get", "ast", "--folder", tmp_path)


@pytest.mark.parametrize("damage", ["cut", "text"])
def test_check_of_a_damaged_file_is_one_line(published: Path, capsys: Capture, damage: str) -> None:
    content = published.read_bytes()
    published.write_bytes(content[:-100] if damage == "cut" else b"not weights at all")
    assert FILE in refusal(capsys, "weights", "check", "ast", "--path", published.parent)


@pytest.mark.slow
def test_export_writes_an_onnx_file_and_says_of_which_weights(
    published: Path, tmp_path: Path, capsys: Capture
) -> None:
    pytest.importorskip("onnxscript", reason="onnxscript is not installed")
    out = tmp_path / "ast.onnx"
    few = ("--frames", 3)
    assert "3 frames" in refusal(capsys, "weights", "export", "ast", "--path", published, "--out", out, *few)
    assert run(["weights", "export", "ast", "--path", str(published), "--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["sha256"] == sha256(published.read_bytes()).hexdigest()
    assert result["bytes"] == out.stat().st_size > 0.9 * published.stat().st_size


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("get atst", "'ast'"),
        ("export atst --out out.onnx", "'ast'"),
        ("export ast --out out.onnx --frames 0", "--frames"),
        ("export ast --out out.onx", ".onnx"),
        ("export ast --out absent/out.onnx", "create 'absent' first"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_is_written(
    words: str,
    named: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert named in refusal(capsys, "weights", *words.split())
    assert not list(tmp_path.iterdir())


def test_the_shell_completes_names() -> None:
    complete = BashComplete(cli.monochord, {}, "monochord", "_MONOCHORD_COMPLETE")
    assert [item.value for item in complete.get_completions(["weights", "get"], "a")] == ["ast"]
    assert [item.value for item in complete.get_completions([], "we")] == ["weights"]
