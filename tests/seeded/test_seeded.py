"""A fault is put where its text stands, in a copy, and its tests notice it or not; every fault applies."""

import json
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from tests.seeded.__main__ import ROOT, main
from tests.seeded.faults import SOURCE, DoesNotApplyError, read_faults

MODULE = """\
def doubled(number: int) -> int:
    if number:
        number *= 2
    return number
"""
TESTS = """\
from monochord.core.numbers import doubled

def test_two_is_doubled():
    assert doubled(2) == 4
"""
FAULTS = """\
[[fault]]
name = "tripled"
package = "core"
file = "core/numbers.py"
before = "*= 2"
after = "*= 3"
effect = "too much"

[[fault]]
name = "none-doubled"
package = "core"
file = "core/elsewhere.py"
before = '''
if number:
    number *= 2
'''
after = "number += 0"
effect = "nothing"

[[fault]]
name = "nought-is-one"
package = "core"
file = "core/numbers.py"
before = "return number"
after = "return number or 1"
effect = "a nought too few"
fix = "Nought is nought"

[[fault]]
name = "endless"
package = "core"
file = "core/numbers.py"
before = "if number:"
after = "while number:"
effect = "a hang"

[[fault]]
name = "gone"
package = "core"
file = "core/numbers.py"
before = "number /= 2"
after = "number /= 3"
effect = "nothing"
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A small tree with a module, a test of it, and faults."""
    for file, text in {
        SOURCE / "__init__.py": "",
        SOURCE / "core" / "__init__.py": "",
        SOURCE / "core" / "numbers.py": MODULE,
        Path("tests", "core", "test_numbers.py"): TESTS,
        Path("faults.toml"): FAULTS,
        Path("pytest.ini"): "[pytest]\nmarkers = slow\n",
    }.items():
        path = tmp_path / "tree" / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return tmp_path / "tree"


def run(tree: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "tests.seeded", "--root", tree, "--faults", tree / "faults.toml"]
    return subprocess.run([*command, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


def test_what_tests_make_of_a_fault_is_told_and_the_tree_stays(tree: Path, tmp_path: Path) -> None:
    assert run(tree, "tripled").returncode == 0
    names = ["tripled", "nought-is-one", "gone"]
    done = run(tree, *names, "--json", str(tmp_path / "a.json"))
    assert (done.returncode, done.stderr) == (1, "")
    told = json.loads((tmp_path / "a.json").read_text())
    assert [row["name"] for row in told["faults"]] == names
    assert [row["outcome"] for row in told["faults"]] == ["caught", "missed", "does not apply"]
    assert told["counts"] == {"caught": 1, "missed": 1, "does not apply": 1, "not judged": 0}
    assert told["faults"][0]["by"] == "tests/core/test_numbers.py::test_two_is_doubled"
    assert (tree / SOURCE / "core" / "numbers.py").read_text() == MODULE


def test_a_fault_that_hangs_its_tests_is_not_judged(tree: Path) -> None:
    done = run(tree, "endless", "--limit", "3")
    assert done.returncode == 1
    assert "not judged" in done.stdout
    assert "more than 3 s" in done.stdout


def test_a_test_that_fails_anyway_catches_nothing(tree: Path) -> None:
    (tree / "tests" / "core" / "test_numbers.py").write_text(f"{TESTS}    assert False\n")
    done = run(tree, "tripled", "--tests", "tests/core/test_numbers.py")
    assert done.returncode == 1
    assert "fails without the fault, too" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(("triple",), "tripled"), (("--tests", "tests/dsp"), "tests/dsp"), (("--faults", "absent"), "absent")],
)
def test_a_bad_argument_is_status_2(
    tree: Path,
    arguments: tuple[str, ...],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    given = ["--root", str(tree), "--faults", str(tree / "faults.toml"), *arguments]
    monkeypatch.setattr(sys, "argv", ["seeded", *given])
    monkeypatch.setattr("signal.signal", lambda *_: None)  # this process keeps its own
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert words in capsys.readouterr().err.splitlines()[-1]


def test_a_fault_follows_its_text_at_any_indentation(tree: Path) -> None:
    fault = read_faults(tree / "faults.toml")["none-doubled"]
    assert fault.applied(tree)[1] == "def doubled(number: int) -> int:\n    number += 0\n    return number\n"
    (tree / SOURCE / "dsp").mkdir()
    moved = (tree / SOURCE / "core" / "numbers.py").rename(tree / SOURCE / "dsp" / "odd.py")
    moved.write_text(MODULE.replace("\n", "\n    "))
    file, text = fault.applied(tree)
    assert file == moved
    assert "\n        number += 0\n" in text
    moved.write_text(MODULE + MODULE)
    with pytest.raises(DoesNotApplyError, match="2"):
        fault.applied(tree)


def test_a_fault_of_a_script_follows_its_text_to_another_one(tree: Path) -> None:
    fault = replace(read_faults(tree / "faults.toml")["tripled"], file="live/page.js")
    script = tree / SOURCE / "live" / "static" / "page.js"
    script.parent.mkdir(parents=True)
    script.write_text("number *= 2;\n")
    assert fault.applied(tree) == (script, "number *= 3;\n")


def test_a_single_test_may_be_named_that_should_notice_a_fault(tree: Path) -> None:
    listed = (tree / "faults.toml").read_text()
    one = 'effect = "too much"\ntests = ["tests/core/test_numbers.py::test_two_is_doubled"]'
    (tree / "faults.toml").write_text(listed.replace('effect = "too much"', one))
    (tree / "tests" / "core" / "test_numbers.py").write_text(f"{TESTS}\ndef test_else():\n    assert False\n")
    done = run(tree, "tripled")
    assert done.returncode == 0
    assert "test_two_is_doubled" in done.stdout


def test_a_third_of_all_faults_are_of_fixes_and_each_applies_to_the_source_as_it_is() -> None:
    faults = read_faults()
    assert len(faults) >= 120
    assert 3 * sum(bool(fault.fix) for fault in faults.values()) >= len(faults)
    assert min(Counter(fault.package for fault in faults.values()).values()) >= 3
    for fault in faults.values():
        file, text = fault.applied(ROOT)
        assert text != file.read_text(encoding="utf-8")
        if file.suffix == ".py":
            compile(text, file, "exec")
        absent = [name for name in fault.tests if not (ROOT / name.partition("::")[0]).exists()]
        assert not absent, fault.name
