"""A process of its own that feeds one target, within limits: what it does to itself, its parent sees."""

import faulthandler
import os
import resource
import shutil
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz.base import REFUSALS, Input, Target, lay_out, load_target
from tests.fuzz.mutate import edited

MEMORY = 1 << 30
"""Bytes that a process may have for itself, and may touch."""
LIMIT = 10.0
"""Seconds of a processor that a case may take; six times as many by the clock, as the machine may be busy."""
ACCEPTED, REFUSED = "accepted", "refused"
SHRINKING = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What came of a case: accepted, refused, or a kind of failure, its place and its text."""

    kind: str
    place: str = ""
    text: str = ""
    seconds: float = 0.0
    peak: int = 0

    @property
    def failed(self) -> bool:
        return self.kind not in (ACCEPTED, REFUSED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """What a process is to do, from a case on: those of `given`, or without them drawn ones for `seconds`.

    With `shrink` the one input of `given` is made smaller as long as it fails in that place.
    """

    folder: Path
    name: str
    seed: int = 0
    first: int = 0
    seconds: float = float("inf")
    seeds: tuple[Input, ...] = ()
    given: tuple[Input, ...] = ()
    shrink: str = ""


def drawn(work: Work, target: Target, case: int) -> Input:
    """Return the input of a case: the same for the same seed, case and seeds."""
    random = Random(f"{work.seed} {work.name} {case}")
    seeds = list(work.seeds)
    return target.fit(edited(random, random.choice(seeds), seeds))


def run(work: Work, beat: Any, trace: Path, pipe: Connection) -> None:
    """Feed the target; send (case, verdict, input where it failed) for each case.

    `beat` holds the case, since when it runs, 0.0 between cases, when the first began, and the seconds of a
    processor before this case, without end before the first. On SIGUSR1, or where the process dies of itself,
    the stack goes to `trace`.
    """
    home = trace.parent / f"home-{os.getpid()}"
    home.mkdir()
    os.chdir(home)
    with trace.open("w") as log, Path(os.devnull).open("r+b") as null:
        faulthandler.enable(log)
        faulthandler.register(10, log, all_threads=False)
        for number in (0, 1, 2):
            os.dup2(null.fileno(), number)
        warnings.simplefilter("ignore")
        target = load_target(work.folder, work.name)
        target.warm()
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
        beat[2] = time.monotonic()
        if work.shrink:
            for smaller in _smaller(work, target, home, beat):
                pipe.send(smaller)
        else:
            for case, given in _cases(work, target):
                verdict = _timed(target, given, home, beat, case)
                pipe.send((case, verdict, given if verdict.failed else None))
    pipe.send(None)
    pipe.close()


def _cases(work: Work, target: Target) -> Iterator[tuple[int, Input]]:
    if work.given:
        yield from list(enumerate(work.given))[work.first :]
        return
    case, end = work.first, time.monotonic() + work.seconds
    while time.monotonic() < end:
        yield case, drawn(work, target, case)
        case += 1


def _timed(target: Target, given: Input, home: Path, beat: Any, case: int) -> Verdict:
    folder = home / "case"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    lay_out(given, folder)
    beat[3] = time.process_time()
    beat[0], beat[1] = float(case), time.monotonic()
    verdict = attempt(target, folder)
    beat[1] = 0.0
    return verdict


def attempt(target: Target, folder: Path) -> Verdict:
    """Run a target on what lies in a folder and say what came of it."""
    Path("/proc/self/clear_refs").write_text("5")  # the peak is that of this case
    begin = time.process_time()
    kind, place, text = ACCEPTED, "", ""
    try:
        target.run(folder)
    except REFUSALS as error:
        kind, text = REFUSED, str(error)
        if "\n" in text:
            kind, place = "traceback", "refused in more than one line"
    except BaseException as error:  # noqa: BLE001  (whatever it is, it is what is looked for)
        kind = "memory" if isinstance(error, MemoryError) else "traceback"
        place, text = _place(error), "".join(traceback.format_exception(error))[-4000:]
    seconds, peak = time.process_time() - begin, _peak()
    if kind in (ACCEPTED, REFUSED):
        if seconds > LIMIT:
            kind, place = "hang", "took too long"
        elif peak > MEMORY:
            kind, place = "memory", f"peak of {peak >> 20} MB"
    return Verdict(kind=kind, place=place, text=text, seconds=seconds, peak=peak)


def _peak() -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return 1024 * int(line.split()[1])
    return 0


def _place(error: BaseException) -> str:
    """Return the error's type and the innermost line of Monochord's that it went through."""
    where = "outside of Monochord"
    for frame in traceback.extract_tb(error.__traceback__):
        if "/monochord/" in frame.filename:
            where = f"{frame.filename.rpartition('/monochord/')[2]}:{frame.name}"
    detail = f" ({str(error)[:60]})" if isinstance(error, AssertionError) else ""
    return f"{type(error).__name__}{detail} in {where}"


def _smaller(work: Work, target: Target, home: Path, beat: Any) -> Iterator[Input]:
    """Yield ever smaller inputs that fail in the same place: stretches of each file are taken out in turn."""
    best, end = dict(work.given[0]), time.monotonic() + SHRINKING

    def fails(given: Input) -> bool:
        verdict = _timed(target, given, home, beat, 0)
        return verdict.failed and verdict.place == work.shrink

    for name in sorted(best, key=lambda each: -len(best[each])):
        step = len(best[name])
        while step >= 1:
            at = 0
            while at < len(best[name]):
                if time.monotonic() > end:
                    return
                trial = {**best, name: best[name][:at] + best[name][at + step :]}
                if fails(trial):
                    best = trial
                    yield best
                else:
                    at += step
            step = step // 2 if step > 64 else max(step // 4, min(step - 1, 1))
