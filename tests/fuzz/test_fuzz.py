"""The fuzzer finds what is planted; every target survives what once failed, and a second of new input."""

import sys
from pathlib import Path

import pytest
from tests.fuzz import driver
from tests.fuzz.__main__ import main
from tests.fuzz.base import TARGETS, Input, pack, target_names, unpack
from tests.fuzz.driver import fuzz, seeds_of, shrunk, verdicts
from tests.fuzz.worker import Work

CORPUS = Path(__file__).with_name("corpus")
PLANTED = '''
"""Fails in every way, as its input says."""

import os
from pathlib import Path
from monochord.core.errors import InputError
from tests.fuzz.base import Target


class Fuzz(Target):
    def seeds(self, folder):
        yield {"a.txt": b"fine " * 20}

    def run(self, folder):
        text = Path(folder, "a.txt").read_bytes()
        if b"trace" in text:
            raise KeyError("planted")
        if b"hang" in text:
            while True:
                pass
        if b"bomb" in text:
            bytearray(2 << 30)
        if b"die" in text:
            os.abort()
        if not text.startswith(b"fine"):
            raise InputError("text", "fine")
'''


@pytest.fixture
def planted(tmp_path: Path) -> Path:
    (tmp_path / "planted.py").write_text(PLANTED, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_whatever_ends_badly_is_counted_and_the_rest_goes_on(planted: Path) -> None:
    texts = (b"fine", b"trace", b"fine", b"hang", b"bomb", b"other", b"die", b"fine")
    given = tuple({"a.txt": text} for text in texts)
    results = list(verdicts(Work(folder=planted, name="planted", given=given)))
    kinds = [verdict.kind for _, verdict, _ in results]
    assert kinds == ["accepted", "traceback", "accepted", "hang", "memory", "refused", "died", "accepted"]
    assert [case for case, _, _ in results] == list(range(8))
    assert "KeyError" in results[1][1].place
    assert [repeated for _, _, repeated in results if repeated] == [given[n] for n in (1, 3, 4, 6)]


def test_equal_seeds_draw_equal_cases_and_a_failure_is_made_smaller(planted: Path) -> None:
    seeds = ({"a.txt": b"x" * 500 + b"trace" + b"y" * 500},)
    one, other = (fuzz(planted, "planted", seeds, seconds=0.5, seed=3) for _ in range(2))
    assert min(one.cases, other.cases) > 20
    assert one.counts["traceback"] > 0
    ((place, failure),) = one.failures.items()
    assert other.failures[place].given == failure.given
    assert shrunk(planted, "planted", failure.given, place) == {"a.txt": b"trace"}


def test_the_command_ends_with_1_where_something_failed_and_tells_how_to_repeat_it(
    planted: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (planted / "planted.py").read_text(encoding="utf-8").replace('fine " * 20', 'trace"')
    (planted / "planted.py").write_text(text, encoding="utf-8")
    command = ["tests.fuzz", "planted", "--folder", str(planted)]
    monkeypatch.setattr(sys, "argv", [*command, "--seconds", "0.3", "--out", str(planted / "out")])
    assert main() == 1
    file = next((planted / "out" / "planted").glob("*-a.txt"))
    assert str(file) in capsys.readouterr().out
    monkeypatch.setattr(sys, "argv", [*command, "--repeat", str(file)])
    assert main() == 1
    assert "KeyError: 'planted'" in capsys.readouterr().out


def test_what_a_target_makes_ready_counts_for_no_case(planted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slow = """
    def warm(self):
        end = time.process_time() + 1.0
        while time.process_time() < end:
            pass
        self.ready = True

    def run(self, folder):
        assert self.ready
"""
    head, _, _ = (planted / "planted.py").read_text(encoding="utf-8").partition("    def run")
    (planted / "planted.py").write_text(f"import time\n{head}{slow}", encoding="utf-8")
    monkeypatch.setattr(driver, "LIMIT", 0.5)
    ((_, verdict, _),) = verdicts(Work(folder=planted, name="planted", given=({"a.txt": b""},)))
    assert verdict.kind == "accepted"
    assert verdict.seconds < 0.5


def test_what_is_packed_is_unpacked(tmp_path: Path) -> None:
    long: Input = {"take.mcap": bytes(100_000)}
    for given in ({"take.mcap": b"abc"}, long, {"a/b.npy": b"\0", "c.json": b"{}"}):
        name, content = pack("0", given)
        (tmp_path / name).write_bytes(content)
        assert unpack(tmp_path / name) == given
        assert len(content) < 1000


@pytest.mark.slow
@pytest.mark.parametrize("name", target_names(TARGETS))
def test_a_second_of_each_target_ends_well(name: str) -> None:
    findings = fuzz(TARGETS, name, seeds_of(TARGETS, name), seconds=1.0, seed=0)
    assert not findings.failures, {place: failure.text for place, failure in findings.failures.items()}
    assert findings.counts["accepted"] > 0


@pytest.mark.parametrize("name", sorted(folder.name for folder in CORPUS.iterdir()))
def test_what_once_failed_ends_well(name: str) -> None:
    files = sorted((CORPUS / name).iterdir())
    given = tuple(map(unpack, files))
    bad = {
        files[case].name: verdict
        for case, verdict, _ in verdicts(Work(folder=TARGETS, name=name, given=given))
        if verdict.failed
    }
    assert not bad
