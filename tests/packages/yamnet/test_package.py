"""YAMNet as a package of its own: entry points suffice, and the tests of every plug-in hold for it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.packages.conftest import YAMNET

from monochord.cli import run
from monochord.perception.features import FEATURES
from monochord_yamnet import Yamnet

ROOT = YAMNET.parents[1]


@pytest.mark.usefixtures("yamnet_package")
def test_it_is_found_by_its_entry_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert FEATURES.load("yamnet") is Yamnet
    assert FEATURES.build("yamnet", {"layer": "27"}) == Yamnet(layer=27)
    monkeypatch.delenv("MONOCHORD_YAMNET", raising=False)
    monkeypatch.setenv("MONOCHORD_WEIGHTS", str(tmp_path))
    assert run(["weights", "check", "yamnet"]) == 2
    assert "MONOCHORD_YAMNET" in capsys.readouterr().err
    assert run(["weights", "export", "yamnet", "--out", str(tmp_path / "x.onnx")]) == 2
    assert "yamnet" in capsys.readouterr().err


@pytest.mark.slow
def test_installed_by_pip_it_keeps_what_every_plug_in_promises(tmp_path: Path) -> None:
    site = tmp_path / "site"
    path = os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])

    def python(*words: str | Path, home: Path = tmp_path) -> str:
        done = subprocess.run(
            [sys.executable, *words],
            env=os.environ | {"PYTHONPATH": path},
            cwd=home,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    pip = ["-m", "pip", "--disable-pip-version-check", "--quiet", "install", "--no-deps"]
    python(*pip, "--no-build-isolation", "--target", site, YAMNET)
    place = python("-c", "import monochord_yamnet; print(monochord_yamnet.__file__)")
    assert Path(place.strip()).is_relative_to(site)
    listed = json.loads(python("-m", "monochord", "list", "features", "--json"))["features"]
    assert "yamnet" in {one["name"] for one in listed}
    contracts = ["tests/contract/test_plugins.py", "tests/contract/test_features.py"]
    told = python("-m", "pytest", "-q", "-p", "no:cacheprovider", *contracts, "-k", "yamnet", home=ROOT)
    assert "passed" in told
