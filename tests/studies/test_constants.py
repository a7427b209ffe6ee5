"""The numbers set by hand in a module, counted on modules whose numbers are known."""

from pathlib import Path

import pytest
from studies.constants import counts_of, table


@pytest.mark.parametrize(
    ("text", "constants", "numbers"),
    [
        ("LIMIT = 0.3", 1, 1),
        ("RANGE: tuple[float, float] = (0.1, -2 * 0.3)", 1, 3),
        ("LOW, HIGH = 1.0, 2.0", 2, 2),
        ("BANDS = np.array([[1.0, 2.0], [3.0, 4.0]])", 1, 4),
        ("LEVELS = {1: 0.5, 2: (0.1, 0.2)}", 1, 3),
        ("HALF = LIMIT / 2", 0, 0),
        ("limit = 0.3\nNAME = 'n'\nON = True\nREADER = Reader(3)", 0, 0),
        ("def f():\n    LIMIT = 0.3", 0, 0),
    ],
)
def test_named_numbers_are_counted(text: str, constants: int, numbers: int) -> None:
    counts = counts_of(text)
    assert (counts["constants"], counts["numbers"]) == (constants, numbers)


@pytest.mark.parametrize(
    ("text", "changing"),
    [
        ("count = 0\ndef f():\n    global count\n    count += 1", 1),
        ("SEEN = {}\ndef f():\n    SEEN[1] = 2\n    SEEN.pop(1)", 1),
        ("SEEN = []\ndef f():\n    return SEEN[0]", 0),
        ("def f():\n    own = []\n    own.append(1)", 0),
    ],
)
def test_globals_that_change_are_counted(text: str, changing: int) -> None:
    assert counts_of(text)["changing"] == changing


def test_caches_and_states_are_counted() -> None:
    counts = counts_of("class ModelState: ...\n@lru_cache(2)\ndef f(): ...\n@cached_property\ndef g(): ...")
    assert (counts["states"], counts["caches"]) == (1, 1)


def test_files_of_a_folder_are_counted(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "one.py").write_text("LIMIT = 1.5")
    (tmp_path / "two.toml").write_text("on = true\n[a]\nb = [1, 2.5]\nname = 'x'")
    (tmp_path / "none.py").write_text("def f(): return 3")
    assert table(tmp_path) == {"deep/one.py": {"constants": 1, "numbers": 1}, "two.toml": {"numbers": 2}}
