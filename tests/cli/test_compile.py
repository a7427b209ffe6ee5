"""Kernels are compiled ahead by one command, and nothing is left for the first touch."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.cli.running import Capture

from monochord.cli import _compile

ESTIMATES = """
import sys
import numpy as np
import monochord as mc
from numba.core import event

with event.install_recorder("numba:compile") as compiled:
    for world in ("ideal", "plausible"):
        twin = mc.VirtualSensor("prototype", world=world)
        before, _ = twin.advance(0.5)
        twin.press(0.08, 1.0)
        sound, _ = twin.advance(0.5)
    take = np.concatenate((before, sound), axis=1)
    updates = mc.listen(take, model="demo", sample_rate=44100, sensor="prototype")
    assert any([update.force.valid for update in updates])
    assert list(mc.listen("twin", model="demo", seconds=0.3, speed=0.0))
names = sorted({one.data["dispatcher"].py_func.__qualname__ for _, one in compiled.buffer})
assert not names, names
"""


def run(*arguments: str, cache: Path) -> "subprocess.CompletedProcess[str]":
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


@pytest.mark.slow
def test_after_it_the_first_touch_compiles_nothing(tmp_path: Path) -> None:
    ahead = run("-m", "monochord", "doctor", "--compile", "--json", cache=tmp_path)
    assert (ahead.returncode, ahead.stderr) == (0, "")
    assert ahead.stdout.startswith("{")
    first = run("-c", ESTIMATES, cache=tmp_path)
    assert first.returncode == 0, first.stderr


def test_kernels_that_do_not_exist_are_one_line(capsys: Capture) -> None:
    assert _compile.main(["drums"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "'drums'" in error
    assert "pitch" in error


def test_a_part_that_fails_is_named_with_its_last_line(capsys: Capture) -> None:
    def fails() -> None:
        _compile.compile_kernels(("pitch", "drums"))

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(_compile.PARTS, "fails", fails)
        assert _compile.main(["fails"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "'drums'" in error
