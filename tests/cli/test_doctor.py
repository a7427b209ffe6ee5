import json
from pathlib import Path

import pytest

from monochord.capture.jack.machine import Check
from monochord.cli import doctor as command
from monochord.cli import run


def test_it_prints_a_line_for_each_thing(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert run(["doctor", "--json"]) == 0
    checks = json.loads(capsys.readouterr().out)["checks"]
    assert {"Python", "JACK"} <= {check["name"].split()[0] for check in checks}
    assert {"name", "state", "detail", "remedy", "required"} == set(checks[0])
    states = [line[0] for line in lines if line[0] in {"ok", "warn", "missing"}]
    assert states == [check["state"] for check in checks]
    assert [line[0] for line in lines].count("->") == len(states) - states.count("ok")


def test_it_tells_where_the_recordings_are(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MONOCHORD_REALSTRINGS", str(tmp_path))
    assert run(["doctor"]) == 0
    assert "MONOCHORD_REALSTRINGS" in capsys.readouterr().out.splitlines()[-2]
    (tmp_path / "manifest.csv").write_text("file\n", encoding="ascii")
    assert run(["doctor"]) == 0
    assert capsys.readouterr().out.splitlines()[-2].endswith(f"0 sounds of strings in {tmp_path}")


@pytest.mark.parametrize(("required", "status"), [(True, 1), (False, 0)])
def test_it_fails_only_for_what_is_required(
    monkeypatch: pytest.MonkeyPatch, *, required: bool, status: int
) -> None:
    def lacking() -> list[Check]:
        return [Check(name="x", state="missing", detail="none", remedy="get one", required=required)]

    monkeypatch.setattr(command, "checks", lacking)
    assert run(["doctor"]) == status
