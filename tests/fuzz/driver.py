"""Starts the processes that feed targets, and sees to it that none hangs: what they die of is a finding."""

import math
import multiprocessing
import os
import re
import sys
import time
from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from multiprocessing.context import SpawnProcess
from pathlib import Path
from signal import SIGKILL, SIGUSR1
from tempfile import TemporaryDirectory

from tests.fuzz.base import Input, load_target
from tests.fuzz.worker import LIMIT, Verdict, Work, drawn, run

START = 120.0
"""Seconds by the clock, beside those of a case, that a process may take to begin: it may compile kernels."""
SPAWN = multiprocessing.get_context("spawn")
ROOT = str(Path(__file__).parents[2])


@dataclass(slots=True)
class Failure:
    """A place that failed: how, its first input, and how often."""

    kind: str
    text: str
    given: Input
    count: int = 1


@dataclass(slots=True)
class Findings:
    """What came of a target."""

    cases: int = 0
    counts: Counter[str] = field(default_factory=Counter[str])
    failures: dict[str, Failure] = field(default_factory=dict[str, Failure])
    peak: int = 0
    slowest: float = 0.0

    def add(self, verdict: Verdict, given: Input | None) -> None:
        """Count a case."""
        self.cases += 1
        self.counts[verdict.kind] += 1
        self.peak, self.slowest = max(self.peak, verdict.peak), max(self.slowest, verdict.seconds)
        if verdict.place in self.failures:
            self.failures[verdict.place].count += 1
        elif verdict.failed and given is not None:
            self.failures[verdict.place] = Failure(verdict.kind, verdict.text, given)


def seeds_of(folder: Path, name: str) -> tuple[Input, ...]:
    """Return the valid inputs of a target, from its real writers."""
    with TemporaryDirectory() as place:
        return tuple(load_target(folder, name).seeds(Path(place)))


def fuzz(folder: Path, name: str, seeds: tuple[Input, ...], *, seconds: float, seed: int) -> Findings:
    """Feed a target with the seeds as they are, then edited, for so long."""
    findings = Findings()
    as_they_are = Work(folder=folder, name=name, given=seeds)
    drawn_ones = Work(folder=folder, name=name, seed=seed, seeds=seeds, seconds=seconds)
    for work in (as_they_are, drawn_ones):
        for _, verdict, given in verdicts(work):
            findings.add(verdict, given)
    return findings


def verdicts(work: Work) -> Iterator[tuple[int, Verdict, Input | None]]:
    """Yield what came of each case; a process that hangs or dies is followed by another, behind that case."""
    if ROOT not in sys.path:  # which a process takes over from this one
        sys.path.append(ROOT)
    while work.seconds > 0.0:
        ended = yield from _of_one_process(work)
        if ended is None:
            return
        case, verdict, spent = ended
        given = work.given[case] if work.given else drawn(work, load_target(work.folder, work.name), case)
        yield case, verdict, given
        work = replace(work, first=case + 1, seconds=work.seconds - spent)


def _of_one_process(
    work: Work,
) -> Generator[tuple[int, Verdict, Input | None], None, tuple[int, Verdict, float] | None]:
    """Yield what came of each case; return at which case the process hung or died, if it did."""
    with TemporaryDirectory() as place:
        trace = Path(place, "trace")
        beat = SPAWN.Array("d", [float(work.first), time.monotonic() + START, 0.0, math.inf])
        here, there = SPAWN.Pipe(duplex=False)
        process = SPAWN.Process(target=run, args=(work, beat, trace, there), daemon=True)
        process.start()
        there.close()
        try:
            while True:
                while not here.poll(0.2):
                    if beat[1] and _hangs(process.pid, time.monotonic() - beat[1], beat[3]):
                        return int(beat[0]), _stopped(process, trace, "hang"), _spent(beat[2])
                try:
                    result = here.recv()
                except EOFError:
                    process.join(5.0)
                    return int(beat[0]), _stopped(process, trace, "died"), _spent(beat[2])
                if result is None:
                    return None
                yield result
        finally:
            process.kill()
            process.join()


def _hangs(process: int | None, elapsed: float, before: float) -> bool:
    """Return whether a case takes too long, by the clock or by the processor."""
    try:
        words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has just ended
        return False
    used = (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
    return used - before > LIMIT or elapsed > 6.0 * LIMIT


def _spent(begin: float) -> float:
    """Return for how long a process fed its target; one that did not come to that is not tried for ever."""
    return time.monotonic() - begin if begin else START


def _stopped(process: SpawnProcess, trace: Path, kind: str) -> Verdict:
    """Return where a process hung or died, as its own last words tell."""
    if kind == "hang" and process.pid:
        os.kill(process.pid, SIGUSR1)
        time.sleep(0.5)
        with suppress(ProcessLookupError):
            os.kill(process.pid, SIGKILL)
    text = trace.read_text(errors="replace") if trace.exists() else ""
    ours = re.search(r'/monochord/([\w/]+\.py)", line \d+ in (\w+)', text)
    where = f"{ours[1]}:{ours[2]}" if ours else "outside of Monochord"
    code = f" with status {process.exitcode}" if kind == "died" else ""
    return Verdict(
        kind=kind,
        place=f"{kind}{code} in {where}",
        text=text[-4000:],
        seconds=LIMIT if kind == "hang" else 0.0,
    )


def shrunk(folder: Path, name: str, given: Input, place: str) -> Input:
    """Return a smaller input that fails in the same place, as small as some seconds of trying make it."""
    best = given
    for smaller in _of_one_process(Work(folder=folder, name=name, given=(given,), shrink=place)):
        best = smaller
    return best  # pyright: ignore[reportReturnType]
