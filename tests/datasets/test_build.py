"""Sessions become a dataset whole, or not at all."""

import os
import re
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.datasets.conftest import Make, Write
from tests.sessions.made import make as make_session

from monochord.core.errors import InputError
from monochord.datasets.build import BuildOptions, build_dataset, find_sessions
from monochord.datasets.manifest import file_checksum
from monochord.physics.sensors import SensorTuning, load_sensor, sensor_toml
from monochord.physics.strings import load_string
from monochord.sessions import TUNING, read_session
from monochord.sessions.resample import resample

RATE = 8000


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_equal_sessions_give_equal_bytes_in_whatever_order(write: Write, tmp_path: Path) -> None:
    files = [write(name) for name in ("b", "a", "c")]
    one, two = (
        build_dataset(order, tmp_path / str(len(order[0].name) + n))
        for n, order in enumerate((files, files[::-1]))
    )
    assert contents(one.path) == contents(two.path)
    assert [part.name for part in one.manifest.parts] == ["a", "b", "c"]


def test_samples_are_unchanged_and_faults_are_flagged(make: Make) -> None:
    samples = 0.1 * np.random.default_rng(0).normal(size=(2, 4 * RATE)).astype(np.float32)
    samples[0, 1599], samples[1, 2400], samples[0, 4100] = 1.0, np.nan, -np.inf  # at a window's edges, too
    dataset = make({"one": {"samples": samples, "lost": (5000, 6500)}})
    assert np.flatnonzero(dataset.clipped).tolist() == [1, 5]  # infinite is clipped, too
    assert np.flatnonzero(dataset.not_finite).tolist() == [3, 5]
    assert np.flatnonzero(dataset.has_gap).tolist() == [6, 7, 8]
    assert np.flatnonzero(~dataset.usable).tolist() == [3, 5, 6, 7, 8]
    expected = samples.copy()
    expected[:, 5000:6500] = 0.0
    assert np.array_equal(dataset.audio(0), expected, equal_nan=True)
    assert dataset.manifest.counts["masked"] == 5


def test_a_sensor_as_tuned_counts_where_a_session_was_recorded_without(write: Write, tmp_path: Path) -> None:
    string, file = load_string("prototype").string, tmp_path / "sensor.toml"
    file.write_text(sensor_toml("prototype", SensorTuning(open_frequency=990.0)), encoding="utf-8")
    tuned = replace(string, tension=0.97 * string.tension)
    recorded = write("recorded", string=tuned, more={TUNING: "{}"})
    sessions = [recorded, write("one", string=string), write("nameless")]
    options = BuildOptions(sensor=str(file))
    parts = build_dataset(sessions, tmp_path / "out", options).manifest.parts
    own = load_sensor(str(file)).string.tension
    assert {part.name: part.tension for part in parts} == {
        "nameless": own, "one": own, "recorded": tuned.tension
    }  # fmt: skip
    assert {part.tuned for part in parts} == {"recorded"}
    other = write("other", string=load_sensor("long").string)
    with pytest.raises(InputError, match=r"other\.mcap"):
        build_dataset([other], tmp_path / "none", options)
    skipping = replace(options, skip=True)
    manifest = build_dataset([other, sessions[1]], tmp_path / "skipped", skipping).manifest
    assert ([part.name for part in manifest.parts], list(manifest.refused)) == (["one"], ["other"])


def test_labels_follow_the_touches(make: Make) -> None:
    dataset = make({"one": {}})
    assert dataset.label("contact")[:30].tolist() == [0.0] * 10 + [1.0] * 10 + [0.0] * 10
    assert dataset.label("position")[15] == pytest.approx(0.05)
    assert dataset.label("force")[35] == pytest.approx(0.6)
    assert not dataset.valid["force"][25]
    assert not dataset.label("calibrating").any()


def test_windows_that_reach_into_the_taps_have_no_labels(make: Make) -> None:
    dataset = make({"one": {"driven": (1.05, 10.95)}})
    taps = np.flatnonzero(dataset.label("calibrating"))
    assert taps.tolist() == [*range(11), *range(109, 120)]
    assert np.isnan(dataset.label("contact")[taps]).all()
    assert dataset.label("contact")[11] == 1.0


def test_columns_that_only_some_sessions_have(make: Make) -> None:
    time = np.arange(200) / 100
    labels = {"contact": np.ones(200), "grip": time}
    short = 0.1 * np.ones((2, 2 * RATE), np.float32)
    dataset = make({"one": {"samples": short, "labels": labels}, "two": {"samples": 2 * short}})
    assert np.isfinite(dataset.label("grip")).tolist() == [True] * 20 + [False] * 20
    assert np.isnan(dataset.label("force"))[:20].all()


def test_an_existing_folder_is_never_written_to(write: Write, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match="out"):
        build_dataset([write("one")], tmp_path / "out")
    assert not list((tmp_path / "out").iterdir())


def test_what_fails_midway_leaves_nothing(write: Write, tmp_path: Path) -> None:
    (bad := tmp_path / "sessions" / "bad.mcap").parent.mkdir(exist_ok=True)
    files = [write("a"), write("z"), bad]
    bad.write_bytes(b"no session")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(InputError, match="bad"):
        build_dataset(files, tmp_path / "out")
    assert sorted(tmp_path.iterdir()) == before
    dataset = build_dataset(files, tmp_path / "out", BuildOptions(skip=True))
    assert [part.name for part in dataset.manifest.parts] == ["a", "z"]
    assert list(dataset.manifest.refused) == ["bad"]
    with pytest.raises(InputError, match="no usable session"):
        build_dataset([bad], tmp_path / "none", BuildOptions(skip=True))


def test_sessions_of_one_name_are_named_by_their_folders(write: Write, tmp_path: Path) -> None:
    files = [write("one", folder="monday"), write("one", folder="tuesday"), write("two")]
    dataset = build_dataset(files, tmp_path / "out")
    assert [part.name for part in dataset.manifest.parts] == ["monday/one", "tuesday/one", "two"]
    with pytest.raises(InputError, match="monday/one"):
        build_dataset([files[0], files[0]], tmp_path / "twice")


def test_sessions_of_different_rates_are_refused(write: Write, tmp_path: Path) -> None:
    mono = np.ones((1, RATE), np.float32)
    with pytest.raises(InputError, match=r"two.*1 channels"):
        build_dataset([write("one"), write("two", mono, channels=1)], tmp_path / "out")


def test_a_session_of_a_higher_rate_is_read_as_its_resampled_copy(write: Write, tmp_path: Path) -> None:
    file, copy = write("one", lost=(5000, 6500)), tmp_path / "by hand" / "one.mcap"
    copy.parent.mkdir()
    resample(read_session(file), copy, RATE // 2)
    options = BuildOptions(sample_rate=RATE // 2)
    one, other = (build_dataset([each], tmp_path / each.parent.name[:2], options) for each in (file, copy))
    assert one.manifest.sample_rate == RATE // 2
    assert one.has_gap.any()
    own, by_hand = contents(one.path), contents(other.path)
    assert {name: own[name] == by_hand[name] for name in own} == {
        name: name != "manifest.json" for name in by_hand
    }
    assert one.manifest.parts[0].checksum == file_checksum(file)  # by which a model knows its training


def test_nothing_and_nowhere_are_refused(write: Write, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no sessions"):
        build_dataset([], tmp_path / "out")
    with pytest.raises(InputError, match="absent"):
        build_dataset([write("one")], tmp_path / "absent" / "out")
    with pytest.raises(InputError, match="0 s"):
        BuildOptions(window=0.0)
    with pytest.raises(InputError, match=r"100\.0"):
        BuildOptions(hop=100.0)


def test_a_session_shorter_than_a_window_has_none(make: Make) -> None:
    dataset = make({"one": {}, "short": {"samples": np.ones((2, 100), np.float32)}})
    assert [part.windows for part in dataset.manifest.parts] == [120, 0]


def test_progress_is_reported(write: Write, tmp_path: Path) -> None:
    calls: list[tuple[str, int, int]] = []
    build_dataset([write("a"), write("b")], tmp_path / "out", progress=lambda *now: calls.append(now))
    assert calls == [("a", 0, 2), ("b", 1, 2), ("", 2, 2)]


def test_memory_holds_a_session_at_a_time(write: Write, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    files = [write(f"s{n}", rng.normal(size=(2, 20 * RATE)).astype(np.float32)) for n in range(5)]

    def peak(count: int) -> int:
        tracemalloc.start()
        build_dataset(files[:count], tmp_path / f"out{count}")
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    peak(1)
    assert peak(5) < 1.5 * peak(2)


def test_files_folders_and_patterns(write: Write, tmp_path: Path) -> None:
    one, two = write("one"), write("two", folder="sessions/deep")
    assert find_sessions([str(tmp_path / "sessions")]) == [two, one]
    assert find_sessions([str(tmp_path / "sessions" / "o*.mcap"), str(one)]) == [one]
    assert find_sessions([str(two)]) == [two]
    for absent in ("nothing*.mcap", "nothing", str(tmp_path / "empty")):
        with pytest.raises(InputError, match=re.escape(absent)):
            find_sessions([absent])


def test_a_folder_that_vanishes_is_passed_over(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, gone, real = write("one"), tmp_path / "sessions" / "gone", os.scandir
    gone.mkdir()

    def scandir(path: Any) -> Any:
        if gone.exists() and Path(path) == gone:
            gone.rmdir()
        return real(path)

    monkeypatch.setattr(os, "scandir", scandir)
    assert find_sessions([str(tmp_path / "sessions")]) == [one]
    assert not gone.exists()


@pytest.mark.parametrize("rate", [None, RATE])
def test_a_damaged_session_is_refused_unless_forced(tmp_path: Path, rate: int | None) -> None:
    """As it is, or to be resampled."""
    path = tmp_path / "a.mcap"
    make_session(path, seconds=1.0)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    session, options = read_session(path), BuildOptions(sample_rate=rate)
    assert session.damaged == 1
    assert session.description.sample_rate > RATE
    with pytest.raises(InputError, match=r"a\.mcap .*damaged"):
        build_dataset([path], tmp_path / "refused", options)
    forced = build_dataset([path], tmp_path / "forced", replace(options, force=True))
    assert forced.manifest.sample_rate == rate or session.description.sample_rate


@pytest.mark.slow
def test_several_processes_give_the_same_bytes(write: Write, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    files = [write(f"s{n}", rng.normal(size=(2, 2 * RATE)).astype(np.float32)) for n in range(4)]
    files.insert(2, tmp_path / "broken.mcap")
    files[2].write_bytes(b"no session")
    options = BuildOptions(skip=True)
    one = build_dataset(files, tmp_path / "one", options)
    two = build_dataset(files, tmp_path / "two", options, workers=2)
    assert list(one.manifest.refused) == ["broken"]
    assert len(one.manifest.parts) == 4
    assert contents(one.path) == contents(two.path)
