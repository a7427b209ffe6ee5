import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture

from monochord.cli import run
from monochord.core.types import POSE, WRENCH, Block, Feed, Readings
from monochord.physics.sensors import SensorTuning, load_sensor, sensor_toml
from monochord.sessions import TUNING, Description, SessionClock, SessionWriter, read_session

RATE = 44100
FEEDS = (
    Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=1000.0, ticks=1000.0),
    Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4, rate=250.0, ticks=1e9),
)


def write(path: Path, *, lost: int = 0, close: bool = True, **described: Any) -> Path:
    """A second of a session; three force readings are missing."""
    description: dict[str, Any] = {
        "name": path.stem,
        "sample_rate": RATE,
        "feeds": FEEDS,
        "object": "key",
        **described,
    }
    writer = SessionWriter(path, Description(**description), SessionClock(epoch_ns=10**18))
    noise = 0.1 * np.random.default_rng(0).standard_normal((2, RATE)).astype(np.float32)
    writer.audio(Block(samples=noise[:, :20000], start=0, adc_time=0.0))
    writer.audio(
        Block(samples=noise[:, 20000:], start=20000 + lost, dropped=lost, adc_time=(20000 + lost) / RATE)
    )
    for feed in description["feeds"]:
        count = np.delete(np.arange(round(feed.rate)), [10, 20, 21]) if feed is FEEDS[0] else np.arange(250)
        writer.readings(
            Readings(
                stream=feed.stream,
                time=count / feed.rate,
                values=np.ones((len(count), len(feed.columns))),
                sequence=count,
                device_time=np.round(count * feed.ticks / feed.rate).astype(np.int64),
                status=(count == 30).astype(np.uint32),
            )
        )
    writer.labels(
        np.array([0.1, 0.5]), {"contact": np.array([0.0, 1.0]), "position": np.array([np.nan, 0.1])}
    )
    writer.event(0.5, "note", "press")
    if close:
        writer.close()
    else:
        writer.flush()
        writer._file.close()
    return path


def lines(capsys: Capture) -> list[dict[str, Any]]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_check_tells_good_from_bad_in_a_line_each(tmp_path: Path, capsys: Capture) -> None:
    good = write(tmp_path / "good.mcap", feeds=())
    cut = write(tmp_path / "cut.mcap", close=False)
    hurt = write(tmp_path / "hurt.mcap")
    data = bytearray(hurt.read_bytes())
    data[len(data) // 2] ^= 1
    hurt.write_bytes(data)
    (tmp_path / "other.mcap").write_text("text")
    assert run(["sessions", "check", str(good)]) == 0
    assert capsys.readouterr().out.startswith("ok")
    assert run(["sessions", "check", *map(str, (good, cut, hurt, tmp_path / "other.mcap"))]) == 2
    captured = capsys.readouterr()
    printed = captured.out.splitlines()
    assert [line.split()[0] for line in printed] == ["ok", "bad", "bad"]
    assert captured.err.count("\n") == 1
    assert "other.mcap" in captured.err
    assert run(["sessions", "check", str(tmp_path / "none.mcap"), str(tmp_path), str(good), "--json"]) == 2
    captured = capsys.readouterr()
    assert [json.loads(line)["ok"] for line in captured.out.splitlines()] == [False, False, True]
    assert captured.err.count("\n") == 2


def test_what_went_wrong_in_recording_is_noted_and_bad_if_strict(tmp_path: Path, capsys: Capture) -> None:
    path = str(write(tmp_path / "a.mcap", lost=100))
    assert run(["sessions", "check", path, "--json"]) == 0
    (result,) = lines(capsys)
    assert result["ok"]
    assert result["path"] == path
    remarks = " ".join(result["remarks"])
    assert "100 frames" in remarks
    assert "3 of 1000" in remarks
    assert run(["sessions", "check", path, "--strict"]) == 2
    assert capsys.readouterr().out.startswith("bad")


def test_show_tells_what_is_in_it(tmp_path: Path, capsys: Capture) -> None:
    path = str(
        write(tmp_path / "a.mcap", lost=100, radius=0.003, notes="two\nlines", simulated=True, day=2, seed=7)
    )
    assert run(["sessions", "show", path, "--json"]) == 0
    (result,) = lines(capsys)
    assert result["seconds"] == pytest.approx((RATE + 100) / RATE)
    assert result["begin"] == "2001-09-09T01:46:40.000+00:00"
    assert result["ending"] == "closed"
    assert (result["audio"]["gaps"], result["audio"]["lost_frames"]) == (1, 100)
    wrench = result["streams"]["wrench"]
    assert (wrench["readings"], wrench["missing"], wrench["faulty"]) == (997, 3, 1)
    assert result["streams"]["pose"]["measured_rate"] == pytest.approx(250.0)
    assert result["labels"] == {"columns": ["contact", "position"], "rows": 2}
    assert result["events"] == {"note": 1}
    assert result["about"]["object"] == "key"
    assert run(["sessions", "show", path]) == 0
    text = capsys.readouterr().out
    for part in ("key", "3 mm", "seed 7", "1.00 s", "100 frames", "3 missing, 1 faulty", "two lines"):
        assert part in text


def test_recover_repairs_what_was_cut_off_and_leaves_the_rest(tmp_path: Path, capsys: Capture) -> None:
    cut, whole = write(tmp_path / "cut.mcap", close=False), write(tmp_path / "whole.mcap")
    with cut.open("ab") as file:
        file.write(b"\x06half a chunk")
    before = whole.read_bytes()
    frames = read_session(cut).audio.samples
    assert run(["sessions", "recover", str(cut), str(whole)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert "13 bytes" in printed[0]
    assert len(printed) == 2
    assert whole.read_bytes() == before
    np.testing.assert_array_equal(read_session(cut).audio.samples, frames)
    assert run(["sessions", "check", str(cut)]) == 0
    assert run(["sessions", "recover", str(cut), str(tmp_path / "none.mcap"), "--json"]) == 2
    result = [json.loads(line) for line in capsys.readouterr().out.splitlines()[1:]]
    assert [each["path"] for each in result] == [str(cut), str(tmp_path / "none.mcap")]
    assert "error" in result[1]


def test_an_export_takes_options_and_says_how_much_it_wrote(tmp_path: Path, capsys: Capture) -> None:
    path, out = str(write(tmp_path / "a.mcap")), tmp_path / "out"
    options = ["--set", "fps=10", "--set", "force=true"]
    assert run(["sessions", "export", "lerobot", path, "--out", str(out), *options, "--json"]) == 0
    (result,) = lines(capsys)
    assert result["sessions"] == 1
    assert result["bytes"] == sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
    assert json.loads((out / "meta/info.json").read_text())["fps"] == 10


def test_a_users_own_files_become_a_session(tmp_path: Path, capsys: Capture) -> None:
    sound = 0.1 * np.random.default_rng(0).standard_normal((RATE, 2)).astype(np.float32)
    soundfile.write(tmp_path / "take.wav", sound, RATE, subtype="FLOAT")
    (tmp_path / "take.csv").write_text("time,contact,position,force,slip\n0,0,,,\n0.5,1,0.3,1.2,0\n")
    files = [str(tmp_path / "take.wav"), str(tmp_path / "take.csv")]
    out = tmp_path / "take.mcap"
    about = ["--object", "Allen key", "--radius", "0.002", "--string", "appendix"]
    assert run(["sessions", "import", *files, "--out", str(out), *about, "--json"]) == 0
    (result,) = lines(capsys)
    assert result["about"]["object"] == "Allen key"
    assert result["about"]["string"]["length"] == 0.65
    np.testing.assert_array_equal(read_session(out).audio.samples, sound.T)
    assert run(["locate", str(out)]) == 0


def test_an_import_names_the_columns_that_are_no_known_labels(tmp_path: Path, capsys: Capture) -> None:
    soundfile.write(tmp_path / "take.wav", np.zeros((RATE, 2)), RATE)
    for names, note in (("contact,settled", ""), ("contact,warmth,x", "warmth, x")):
        (tmp_path / "take.csv").write_text(f"time,{names}\n0{',1' * (1 + names.count(','))}\n")
        files = [str(tmp_path / name) for name in ("take.wav", "take.csv")]
        assert run(["sessions", "import", *files, "--out", str(tmp_path / f"{len(names)}.mcap")]) == 0
        error = capsys.readouterr().err
        assert (note in error, error.count("\n")) == (True, 1 if note else 0)


def test_a_folder_is_not_truncated(tmp_path: Path, capsys: Capture) -> None:
    path, out = str(write(tmp_path / "a.mcap")), tmp_path / "out"
    assert run(["sessions", "export", "wav-csv", path, "--out", str(out)]) == 0
    again = ["sessions", "import", str(out / "a"), "--out", str(tmp_path / "b.mcap")]
    assert run([*again, "--allow-truncated"]) == 2
    assert "--allow-truncated" in capsys.readouterr().err
    assert run(again) == 0


def test_a_users_own_files_are_of_the_sensor_as_tuned(tmp_path: Path) -> None:
    sensor = tmp_path / "sensor.toml"
    sensor.write_text(sensor_toml("prototype", SensorTuning(open_frequency=990.0)))
    soundfile.write(tmp_path / "take.wav", np.zeros((RATE, 2)), RATE)
    out = tmp_path / "take.mcap"
    assert (
        run(["sessions", "import", str(tmp_path / "take.wav"), "--out", str(out), "--sensor", str(sensor)])
        == 0
    )
    description = read_session(out).description
    assert description.string == load_sensor(str(sensor)).string
    assert json.loads(description.more[TUNING])["open_frequency"] == 990.0


def test_what_an_objects_name_tells_is_told_once(tmp_path: Path, capsys: Capture) -> None:
    description: dict[str, Any] = {"object": "plastic, radius 5 mm", "material": "plastic", "radius": 0.005}
    run(["sessions", "show", str(write(tmp_path / "bench.mcap", **description))])
    assert capsys.readouterr().out.count("plastic") == 1


def test_an_export_that_fails_leaves_nothing(tmp_path: Path, capsys: Capture) -> None:
    one, other = write(tmp_path / "one.mcap"), write(tmp_path / "other.mcap", feeds=FEEDS[:1])
    out = tmp_path / "out"
    assert run(["sessions", "export", "lerobot", str(one), str(other), "--out", str(out)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not out.exists()


def test_a_stream_whose_rate_is_not_known_is_told_so(tmp_path: Path, capsys: Capture) -> None:
    feed = replace(FEEDS[1], rate=0.0)
    path, noise = tmp_path / "a.mcap", np.zeros((1, 4410), np.float32)
    with SessionWriter(
        path, Description(name="a", sample_rate=RATE, channels=1, feeds=(feed,)), SessionClock(epoch_ns=0)
    ) as writer:
        writer.audio(Block(samples=noise, start=0, adc_time=0.0))
    assert run(["sessions", "show", str(path)]) == 0
    assert "unknown; 0 missing" in capsys.readouterr().out


def test_what_damage_cost_is_told_and_kept_beside(tmp_path: Path, capsys: Capture) -> None:
    path = write(tmp_path / "a.mcap")
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert run(["sessions", "recover", str(path)]) == 0
    printed = capsys.readouterr().out
    assert f"{path}.cut" in printed
    assert Path(f"{path}.cut").read_bytes()[:1000] in content
    assert run(["sessions", "check", str(path)]) == 0
