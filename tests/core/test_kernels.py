"""A kernel's cache on disk: what is damaged is compiled again, and its file replaced."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

MODULE = """
from monochord.core.kernels import kernel

@kernel()
def twice(x: float) -> float:
    return 2.0 * x

print(twice(1.5), sum(twice.stats.cache_misses.values()))
"""
Damage = Callable[[bytes], bytes]
DAMAGES: dict[str, Damage] = {
    "empty": lambda _: b"",
    "truncated": lambda content: content[: len(content) // 2],
    "a bit flipped": lambda content: content[:200] + bytes([content[200] ^ 4]) + content[201:],
}


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("cache") / "doubling.py"
    file.write_text(MODULE, encoding="utf-8")
    assert printed(file) == "3.0 1"
    return file


def printed(file: Path) -> str:
    """Run the module, and return what it prints: 3.0, and how often its kernel was compiled."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(file.parent)!r}); import {file.stem}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


def test_a_whole_cache_is_used(module: Path) -> None:
    assert printed(module) == "3.0 0"


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_file_is_replaced(module: Path, suffix: str, damage: Damage) -> None:
    (file,) = module.parent.rglob(f"*.{suffix}")
    file.write_bytes(damage(file.read_bytes()))
    assert printed(module) == "3.0 1"
    assert printed(module) == "3.0 0"


def test_what_cannot_be_written_is_compiled_all_the_same(tmp_path: Path) -> None:
    file = tmp_path / "doubling.py"
    file.write_text(MODULE, encoding="utf-8")
    assert printed(file) == "3.0 1"
    (index,) = tmp_path.rglob("*.nbi")
    index.unlink()
    index.mkdir()  # what a file cannot replace, even for the superuser
    assert printed(file) == "3.0 1"
