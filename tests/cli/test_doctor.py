import io
from pathlib import Path

import pytest
import soundfile
from tests.cli.running import Capture, record

from monochord.bringup import STEPS, Virtual
from monochord.capture.jack.machine import MachineCheck
from monochord.cli import doctor as command
from monochord.cli import run
from monochord.physics.sensors import load_sensor


def test_it_prints_a_line_for_each_thing(capsys: Capture) -> None:
    assert run(["doctor"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    checks = record(capsys, "doctor")["checks"]
    assert {"Python", "JACK"} <= {check["name"].split()[0] for check in checks}
    assert {"name", "state", "detail", "remedy", "required"} == set(checks[0])
    states = [line[0] for line in lines if line[0] in {"ok", "warn", "missing"}]
    assert states == [check["state"] for check in checks]
    assert [line[0] for line in lines].count("->") == len(states) - states.count("ok")


def test_it_tells_where_the_recordings_are(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
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
    def lacking() -> list[MachineCheck]:
        return [MachineCheck(name="x", state="missing", detail="none", remedy="get one", required=required)]

    monkeypatch.setattr(command, "checks", lacking)
    assert run(["doctor"]) == status


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recording of each step of a healthy sensor."""
    folder = tmp_path_factory.mktemp("takes")
    virtual = Virtual(sensor=load_sensor("prototype"))
    for step in STEPS:
        take = virtual.take(step)
        soundfile.write(folder / f"{step.name}.wav", take.samples.T, take.sample_rate, subtype="FLOAT")
    return folder


def test_a_sensor_is_brought_up_from_recordings(takes: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "mine.toml"
    words = ["doctor", "--sensor", "prototype", "--recordings", str(takes), "--out", str(out)]
    printed = record(capsys, *words)
    assert printed["passed"]
    assert printed["faults"] == []
    assert printed["files"] == [str(out), str(out.with_suffix(".html"))]
    assert {"step", "name", "value", "unit", "passed", "fault", "advice"} == set(printed["checks"][0])
    assert (
        run(["tune", str(takes / "both.wav"), "--sensor", str(out), "--out", str(tmp_path / "t.toml")]) == 0
    )
    assert run(words) == 2
    assert "already exists" in capsys.readouterr().err
    assert run([*words, "--force"]) == 0
    assert "written to" in capsys.readouterr().out


def test_the_status_is_1_if_a_check_fails(takes: Path, tmp_path: Path, capsys: Capture) -> None:
    for file in takes.glob("*.wav"):
        samples, rate = soundfile.read(file, dtype="float32")
        soundfile.write(tmp_path / file.name, samples * [1.0, 0.0], rate, subtype="FLOAT")
    assert run(["doctor", "--sensor", "prototype", "--recordings", str(tmp_path)]) == 1
    assert "1 fault(s): microphone 2 dead." in capsys.readouterr().out.splitlines()


def test_a_step_is_skipped_and_another_repeated_at_the_terminal(
    takes: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    answers = [
        "",
        "s",
        "r",
        "",
        *"ssssss",
    ]  # quiet; no pluck; quiet again, before the tap; none of the others
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join([*answers, ""])))
    words = ["--source", "wav", "--set", f"source.path={takes / 'quiet.wav'}"]
    assert run(["doctor", "--sensor", "prototype", *words]) == 0
    printed = capsys.readouterr()
    asked = [line.split(" ")[0] for line in printed.err.splitlines() if " s): " in line]
    assert asked == ["quiet", "pluck", "tap", "quiet", "tap", *(step.name for step in STEPS[3:])]
    assert printed.err.count("recording ...") == 2
    assert printed.out.count("hum of microphone 1") == 1  # what has not changed is not printed again


def test_the_virtual_sensor_needs_no_hands(capsys: Capture) -> None:
    words = ["--source", "twin", "--set", "source.world=plausible", "--set", "source.build=1005"]
    assert run(["doctor", "--sensor", "prototype", *words, "--drift", "4"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "No fault. Simulated: a rehearsal on the virtual sensor."
    assert any(line.startswith("ok") and " drift " in line for line in lines)
