"""The callbacks hold nothing that could wait: seen in their compiled code."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

CALLBACKS = ("capture", "play", "xrun", "shutdown", "port_registration", "silent")
ALLOWED = re.compile(r"jack_\w+|mem(cpy|set)|write|llvm\.(mem(cpy|set)|s?u?(max|min)|lifetime)[\w.]*")
PRINT_CODE = """
from monochord.capture.jack import callbacks
for name in {names}:
    print("=== " + name)
    print(getattr(callbacks, name).inspect_llvm())
"""


def printed(code: str, cache: Path) -> str:
    """Run a program that compiles into a folder, and return what it prints."""
    run = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=False,
    )
    if "DeviceError" in run.stderr:
        pytest.skip("libjack is not installed (Debian: apt install jackd2)")
    assert run.returncode == 0, run.stderr
    return run.stdout


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that is empty when `compiled` begins, and then holds its code."""
    return tmp_path_factory.mktemp("numba")


@pytest.fixture(scope="module")
def compiled(cache: Path) -> dict[str, str]:
    """The body of each callback, without numba's wrapper, which only hands an error on."""
    assert not list(cache.iterdir())  # code that comes from a cache cannot be read
    parts = re.split(r"^=== (\w+)$", printed(PRINT_CODE.format(names=CALLBACKS), cache), flags=re.MULTILINE)
    return dict(zip(parts[1::2], map(body, parts[2::2]), strict=True))


def body(code: str) -> str:
    functions = re.findall(r"^define [^\n]*@([\w.]+)\([^\n]*\{\n(.*?)^\}", code, re.MULTILINE | re.DOTALL)
    compiled = [text for name, text in functions if name.startswith("_ZN9monochord")]
    assert len(compiled) == 1
    return compiled[0]


@pytest.mark.parametrize("name", CALLBACKS)
def test_it_calls_nothing_but_jack_and_what_never_waits(compiled: dict[str, str], name: str) -> None:
    called = set(re.findall(r"call [^@\n]*@([\w.]+)", compiled[name]))
    assert [function for function in called if not ALLOWED.fullmatch(function)] == []


@pytest.mark.parametrize("name", CALLBACKS)
def test_it_cannot_fail(compiled: dict[str, str], name: str) -> None:
    assert set(re.findall(r"ret (\S+ \S+)", compiled[name])) == {"i32 0"}


def test_the_ring_is_published_last(compiled: dict[str, str]) -> None:
    code = compiled["capture"]
    publish = code.index("store atomic i64")
    assert "release" in code[publish:].splitlines()[0]
    assert code.count("load atomic i64") == 2
    assert "memcpy" in code[:publish]
    assert "memcpy" not in code[publish:]


def cache_hits(folder: Path, code: str) -> int:
    return int(printed(f"{code}\nprint(callbacks.xrun.cache_hits)", folder))


@pytest.mark.slow
@pytest.mark.usefixtures("compiled")
def test_compiled_code_is_cached_but_not_for_another_layout(cache: Path) -> None:
    load = "from monochord.capture.jack import arena, callbacks"
    other = "from monochord.capture.jack import arena\narena.XRUNS += 1\n" + load
    assert [cache_hits(cache, code) for code in (load, other, other)] == [1, 0, 1]
