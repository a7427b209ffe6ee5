import json

import pytest

from monochord.cli import doctor as verb
from monochord.cli import run
from monochord.realtime.machine import Check


def test_it_prints_a_line_for_each_thing(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("ok       Python ")
    assert any(line.split()[1] == "JACK" for line in lines)


def test_json_is_one_object(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", "--json"]) == 0
    checks = json.loads(capsys.readouterr().out)["checks"]
    assert {"name", "state", "found", "remedy", "required"} == set(checks[0])


@pytest.mark.parametrize(("required", "status"), [(True, 1), (False, 0)])
def test_it_fails_only_for_what_is_required(
    monkeypatch: pytest.MonkeyPatch, *, required: bool, status: int
) -> None:
    def lacking() -> list[Check]:
        return [Check(name="x", state="missing", found="none", remedy="get one", required=required)]

    monkeypatch.setattr(verb, "checks", lacking)
    assert run(["doctor"]) == status
