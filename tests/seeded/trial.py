"""Whether tests notice a fault: it is put into a copy of the tree, where they run until one fails."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.seeded.faults import DoesNotApplyError, Fault

CAUGHT, MISSED = "caught", "missed"
NOT_APPLIED, NOT_JUDGED = "does not apply", "not judged"
OUTCOMES = (CAUGHT, MISSED, NOT_APPLIED, NOT_JUDGED)
TEST_LIMIT = 120
"""Seconds that a test may take: a fault may make it wait for ever."""
LEFT_OUT = ("build", "dist", "shared")
"""Folders that no test needs; nor those whose names begin with a point."""
FAILED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What came of a fault.

    `outcome` is one of `OUTCOMES`; it is not judged where the tests cannot be run, take too long, or fail
    without the fault. `by` is the test that failed, or why there is none.
    """

    outcome: str
    by: str = ""
    seconds: float = 0.0


class Trials:
    """A tree whose tests are tried against faults, each in a copy; the tree itself is only read."""

    def __init__(self, root: Path, scratch: Path, limit: float) -> None:
        self._root, self._scratch, self._limit = root, scratch, limit
        self._sound = copied(root, scratch / "sound")

    def verdict(self, fault: Fault, tests: Sequence[str] = ()) -> Verdict:
        """Return what the tests make of a fault, those that it names by default."""
        try:
            file, text = fault.applied(self._root)
        except DoesNotApplyError as error:
            return Verdict(outcome=NOT_APPLIED, by=str(error))
        begin = time.monotonic()
        faulty = copied(self._root, self._scratch / "faulty")
        try:
            (faulty / file.relative_to(self._root)).write_text(text, encoding="utf-8")
            outcome, by = self._run(faulty, [*(tests or fault.paths(self._root))], slow=fault.slow)
            if outcome == CAUGHT and self._run(self._sound, [by], slow=fault.slow)[0] != MISSED:
                outcome, by = NOT_JUDGED, f"{by} fails without the fault, too"
        finally:
            shutil.rmtree(faulty)
        return Verdict(outcome=outcome, by=by, seconds=time.monotonic() - begin)

    def _run(self, tree: Path, tests: list[str], *, slow: bool) -> tuple[str, str]:
        options = ["-x", "-q", "-rfE", "-p", "no:cacheprovider", f"--timeout={TEST_LIMIT}"]
        options += [f"--basetemp={self._scratch / 'tests'}", *([] if slow else ["-m", "not slow"])]
        # Whoever starts this in the background has its tests' signals ignored.
        command = ["env", "--default-signal=INT,HUP", sys.executable, "-m", "pytest", *options, *tests]
        environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        status, output = _ended(command, tree, environment, self._limit)
        last = (output.strip().splitlines() or ["nothing was printed"])[-1]
        if status == 0:
            return MISSED, last
        if status == 1 and (names := FAILED.findall(output)):
            return CAUGHT, names[0]
        reason = f"more than {self._limit:g} s" if status is None else f"pytest ended with {status}"
        return NOT_JUDGED, f"{reason}: {last}"


@contextmanager
def trials(root: Path, limit: float) -> Generator[Trials]:
    """Yield trials on a tree; their copies go at the end."""
    with TemporaryDirectory(prefix="monochord-seeded-") as scratch:
        yield Trials(root, Path(scratch), limit)


def copied(root: Path, to: Path) -> Path:
    """Return a copy of a tree with what it has compiled, whose times are those of its files."""

    def unwanted(folder: str, names: list[str]) -> set[str]:
        top = Path(folder) == root
        return {name for name in names if top and (name.startswith(".") or name in LEFT_OUT)}

    # A file that a test of the tree makes at this moment may be gone when it is its turn.
    with suppress(shutil.Error):
        shutil.copytree(root, to, symlinks=True, ignore=unwanted)
    return to


def _ended(
    command: list[str], folder: Path, environment: dict[str, str], limit: float
) -> tuple[int | None, str]:
    """Return the status and the output of a command, None where it takes too long; nothing of it stays."""
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        errors="replace", start_new_session=True,
    ) as process:  # fmt: skip
        try:
            output = process.communicate(timeout=limit)[0]
        except subprocess.TimeoutExpired:
            return None, _stopped(process)
        except BaseException:
            _stopped(process)
            raise
        finally:
            _kill(process.pid, signal.SIGKILL)  # what its tests left
        return process.returncode, output


def _stopped(process: "subprocess.Popen[str]") -> str:
    """End a run that tests may clean up behind, and return what it printed."""
    _kill(process.pid, signal.SIGINT)
    with suppress(subprocess.TimeoutExpired):
        return process.communicate(timeout=10.0)[0]
    _kill(process.pid, signal.SIGKILL)
    return process.communicate()[0]


def _kill(group: int, number: int) -> None:
    with suppress(ProcessLookupError):
        os.killpg(group, number)
