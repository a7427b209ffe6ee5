"""What each part of a model buys: it is trained again without it, and judged by the same rules.

Every variation is trained and evaluated by the programs that a person would start, in processes of their own.
What is there already is not made again, so that a grid can be interrupted and grown. One that fails is told
with its line, and the others go on.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from monochord.core.config import Tree
from monochord.core.interruption import Interruption, interruption
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.evaluation._children import AblationError, Children
from monochord.evaluation._job import DONE, SPLIT, Job, Told
from monochord.evaluation.grid import WHOLE, Grid
from monochord.evaluation.paper_rows import RANDOM_WEIGHTS, Row, labelled

__all__ = ["DONE", "Ablation", "AblationError", "ablate", "compared"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ablation:
    """What came of a grid, by the name of each variation.

    `scores` are those of `monochord evaluate --json`, `rows` the paper's, each under the name that it has in
    the grid's table, and `failed` the line of what failed.
    """

    scores: dict[str, Tree] = field(default_factory=dict[str, Tree])
    rows: dict[str, list[Row]] = field(default_factory=dict[str, list[Row]])
    failed: dict[str, str] = field(default_factory=dict[str, str])

    def refuse_failed(self) -> None:
        """Raise `AblationError`, in one line, if anything failed."""
        if self.failed:
            count = len(self.failed) + len(self.scores)
            first = next(iter(self.failed.values()))
            names = ", ".join(self.failed)
            raise AblationError(f"{len(self.failed)} of {count} variations failed ({names}); {first}")


def ablate(grid: Grid, out: Path, told: Told = lambda *_: None, *, workers: int = 1) -> Ablation:
    """Return the scores of every variation of a grid.

    Parameters
    ----------
    grid
        What is compared.
    out
        Folder that gets one for each variation, with its run and its report.
    told
        Told of every step.
    workers
        Variations that are trained and judged at a time, each by a process of one thread.

    Returns
    -------
    Ablation
        Its `refuse_failed` raises where anything failed.

    Raises
    ------
    InputError
        If the dataset or the split cannot be used, or a folder holds a variation that was made otherwise.
    KeyboardInterrupt
        If it was interrupted; the same call goes on.

    Examples
    --------
    ``monochord ablate parts --dataset dataset --out ablation`` does so.
    """
    base = open_dataset(grid.dataset)
    split = (grid.split or base.path / SPLIT).absolute()
    Split.read(split)
    children, found = Children(), Ablation()
    jobs = [
        Job(grid=grid, name=name, variation=variation, home=out / name, children=children)
        for name, variation in grid.compared.items()
    ]
    for job in jobs:
        if job.is_done:
            _keep(found, job, job.held)
    with interruption() as wish, wish.ending(children.stop):
        ready = _prepared([job for job in jobs if not job.is_done], base, split, found, told, wish)
        _carry_out(ready, found, told, workers, wish)
        if wish.requested:
            raise KeyboardInterrupt
    order = list(grid.compared)
    return Ablation(
        scores={name: found.scores[name] for name in order if name in found.scores},
        rows=_named(grid, found.rows),
        failed={name: found.failed[name] for name in order if name in found.failed},
    )


def _prepared(
    jobs: Sequence[Job], base: Dataset, split: Path, found: Ablation, told: Told, wish: Interruption
) -> list[Job]:
    """Return the jobs whose datasets could be made, one after the other."""
    ready: list[Job] = []
    for job in jobs:
        job.home.mkdir(parents=True, exist_ok=True)
        told(job.name, "dataset")
        try:
            ready.append(job.prepared(base, split, wish))
        except AblationError as error:
            _fail(found, job, error, told)
    return ready


def _carry_out(jobs: Sequence[Job], found: Ablation, told: Told, workers: int, wish: Interruption) -> None:
    """Carry out jobs, so many at a time; beside each other rather those that share no features."""
    waiting, running = list(jobs), dict[Future[Tree], Job]()
    with ThreadPoolExecutor(workers) as pool, ExitStack() as stack:
        stack.callback(lambda: [job.children.stop() for job in jobs])
        while (waiting and not wish.requested) or running:
            while waiting and len(running) < workers and not wish.requested:
                busy = {job.kin for job in running.values()}
                job = min(waiting, key=lambda one: one.kin in busy)
                waiting.remove(job)
                running[pool.submit(job.carry_out, told)] = job
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                job = running.pop(future)
                try:
                    _keep(found, job, future.result())
                    told(job.name, f"done, {len(waiting) + len(running)} left")
                except AblationError as error:
                    if not wish.requested:
                        _fail(found, job, error, told)


def _keep(found: Ablation, job: Job, held: Tree) -> None:
    found.scores[job.name], found.rows[job.name] = held["scores"], held["rows"]


def _fail(found: Ablation, job: Job, error: AblationError, told: Told) -> None:
    found.failed[job.name] = str(error)
    told(job.name, f"failed: {error}")


def _named(grid: Grid, rows: Mapping[str, list[Row]]) -> dict[str, list[Row]]:
    """Return rows under the names that they have in a table beside those of other grids."""
    found: dict[str, list[Row]] = {}
    for name, variation in grid.compared.items():
        for row in rows.get(name, []):
            own, drawn = row["feature"].removesuffix(RANDOM_WEIGHTS), row["feature"].endswith(RANDOM_WEIGHTS)
            told = variation.feature or (own if name in (WHOLE, own) else f"{own}, {name}")
            found.setdefault(name, []).append({**row, "feature": labelled(told, drawn=drawn)})
    return found


def compared(scores: Mapping[str, Tree], condition: str = "clean") -> list[dict[str, Any]]:
    """Return a row for each variation, of all objects: what it has, and how far that is from the whole.

    Examples
    --------
    >>> compared({"whole": {"table": [], "contact": {}, "slip": {}}})
    []
    """
    rows: list[dict[str, Any]] = []
    for name, card in scores.items():
        told = [
            each for each in card["table"] if each["state"] == "touched" and each["condition"] == condition
        ]
        if not told:
            continue
        row = told[-1]  # all objects, where there are several
        contact = card["contact"].get(row["object"], {}).get(condition, {})
        slip = card["slip"].get(row["object"], {}).get(condition, {})
        rows.append(
            {
                "variation": name,
                "windows": row["position"]["windows"],
                "position_mae": row["position"]["mae"].get("value"),
                "position_within": row["position"]["within"].get("value"),
                "force_mae": row["force"]["mae"].get("value"),
                "force_within": row["force"]["within"].get("value"),
                "contact_accuracy": contact.get("accuracy", {}).get("value"),
                "slip_area": slip.get("area", {}).get("value"),
                "simulated": card["simulated"],
            }
        )
    return rows
