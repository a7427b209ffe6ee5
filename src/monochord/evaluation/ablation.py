"""What each part of a model contributes: it is trained again without it, and evaluated by the same rules.

Every variation is trained and evaluated in a process of its own. What a folder already holds is not computed
again, so that a grid can be interrupted and extended. A variation that fails is reported, and the others go
on.
"""

import hashlib
import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from monochord.core.config import Tree, load_toml, override, to_tree
from monochord.core.errors import InputError, MonochordError
from monochord.core.interruption import interruption
from monochord.core.types import Audio
from monochord.datasets.build import BuildOptions, build_dataset, find_sessions
from monochord.datasets.manifest import FILE, file_checksum
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.evaluation.evaluate import Draw, evaluate, write
from monochord.evaluation.grids import SHARED, WHOLE, Grid, Variation
from monochord.evaluation.paper import RANDOM_WEIGHTS, PaperRow, labelled, paper_rows
from monochord.evaluation.select import SPLIT, EvaluationSettings
from monochord.perception.training.configs import config_path
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import train

Report: TypeAlias = Callable[[str, str], None]
"""Called with the name of a variation and what is being done with it."""
DONE = "variation.json"
"""Definition, scores and rows of a variation, in its folder; written last."""
RUN, REPORT = "run", "report"
"""Folders of the training run and of the report in that of a variation."""
BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that limit the threads of numerical libraries: one in each worker unless they are
set."""


class AblationError(MonochordError):
    """The dataset, training or evaluation of a variation failed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ablation:
    """Outcome of a grid, by the name of each variation.

    `scores` are those of `monochord evaluate --json`, `rows` those of the paper's table, each under its name
    there, and `failed` the error of each variation that failed.
    """

    scores: dict[str, Tree] = field(default_factory=dict[str, Tree])
    rows: dict[str, list[PaperRow]] = field(default_factory=dict[str, list[PaperRow]])
    failed: dict[str, str] = field(default_factory=dict[str, str])

    def refuse_failed(self) -> None:
        """Raise `AblationError`, in one line, if any variation failed."""
        if self.failed:
            count = len(self.failed) + len(self.scores)
            first = next(iter(self.failed.values()))
            names = ", ".join(self.failed)
            raise AblationError(f"{len(self.failed)} of {count} variations failed ({names}); {first}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A variation `name` of a grid in the folder `home`, on a dataset and a split."""

    grid: Grid
    name: str
    variation: Variation
    home: Path
    dataset: Path = Path()
    split: Path = Path()

    @property
    def cache_key(self) -> tuple[Any, ...]:
        """Equal for variations that compute the same features of the same windows."""
        return (self.dataset, *(line for line in self.variation.set if line.startswith("feature.")))

    @property
    def definition(self) -> Tree:
        """Everything that determines its training."""
        grid, variation = to_tree(self.grid), self.variation
        named = ("sensor",) if variation.estimator else ("sensor", "config", "set", "seed")
        tree = {name: grid[name] for name in named}
        tree["dataset"] = file_checksum(self.grid.dataset / FILE)
        tree["split"] = file_checksum(self.grid.split or self.grid.dataset / SPLIT)
        own = to_tree(replace(variation, feature="", sessions=self.sessions if variation.is_built else ()))
        return json.loads(json.dumps({"grid": tree, "variation": own}))

    @property
    def evaluation(self) -> Tree:
        """Everything that determines its evaluation."""
        return {"part": self.grid.part, "noise": list(self.grid.noise)}

    @property
    def sessions(self) -> tuple[str, ...]:
        """Sessions that its dataset is built from, if it needs one."""
        return self.variation.sessions or self.grid.sessions

    def stored(self) -> Tree:
        """Return what its folder holds of it, empty for nothing; refuse what was defined otherwise."""
        file = self.home / DONE
        if not file.is_file():
            return {}
        tree: Tree = json.loads(file.read_text(encoding="utf-8"))
        if tree.get("definition") != self.definition:
            given = f"{self.home}, a variation of another grid"
            raise InputError(given, "a new folder, or the grid that was begun with", "name another --out")
        return tree

    def is_done(self) -> bool:
        """Return whether nothing is left to do."""
        return self.stored().get("evaluation") == self.evaluation

    def settings(self) -> TrainingSettings:
        """Return the settings of its training."""
        grid, variation = self.grid, self.variation
        tree = load_toml(config_path(variation.config or grid.config))
        tree |= {"dataset": str(self.dataset), "split": str(self.split)}
        tree = override(tree, [*grid.set, *variation.set])
        return TrainingSettings.read(tree | ({"sensor": grid.sensor} if grid.sensor else {}))

    def evaluation_settings(self) -> EvaluationSettings:
        """Return the settings of its evaluation."""
        grid, variation = self.grid, self.variation
        common = EvaluationSettings(dataset=self.dataset, split=self.split, part=grid.part, noises=grid.noise)
        if not variation.estimator:
            return replace(common, model=str(self.home / RUN))
        options = override({}, variation.estimator_set)
        return replace(common, estimator=variation.estimator, options=options, sensor=grid.sensor or None)


def ablate(
    grid: Grid,
    out: Path,
    report: Report = lambda *_: None,
    *,
    workers: int = 1,
    music: Callable[[], Audio] | None = None,
    draw: Draw | None = None,
) -> Ablation:
    """Return the scores of every variation of a grid.

    Parameters
    ----------
    grid
        What is compared.
    out
        Folder that gets one folder for each variation, with its run and its report.
    report
        Called for every step.
    workers
        Variations that are trained and evaluated at a time, each by a process of one thread.
    music, draw
        As in `evaluate` and `write`: functions of a module, since they run in other processes.

    Returns
    -------
    Ablation
        Its `refuse_failed` raises if a variation failed.

    Raises
    ------
    InputError
        If the dataset or the split cannot be used, or a folder holds a variation that was defined otherwise.
    KeyboardInterrupt
        If it was interrupted; the same call goes on.

    Examples
    --------
    ``monochord ablate parts --dataset dataset --out ablation`` does so.
    """
    base = open_dataset(grid.dataset)
    split = (grid.split or base.path / SPLIT).absolute()
    Split.read(split)
    outcome, pending = Ablation(), list[Job]()
    for name, variation in grid.compared.items():
        job = Job(grid=grid, name=name, variation=variation, home=out / name)
        if job.is_done():
            _record(outcome, job, job.stored())
        else:
            pending.append(job)
    others = set(multiprocessing.active_children())

    def end_workers() -> None:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()

    with interruption() as stop, stop.ending(end_workers):

        def progress(*_: object) -> None:
            if stop.requested:
                raise KeyboardInterrupt

        ready: list[Job] = []
        for job in pending:
            job.home.mkdir(parents=True, exist_ok=True)
            report(job.name, "dataset")
            try:
                ready.append(_with_data(job, base, split, progress))
            except InputError as error:
                _fail(outcome, job, f"dataset: {error}", report)
        try:
            _carry_out(ready, outcome, report, workers, lambda: stop.requested, (music, draw))
        finally:
            end_workers()
        progress()
    order = list(grid.compared)
    return Ablation(
        scores={name: outcome.scores[name] for name in order if name in outcome.scores},
        rows=_named(grid, outcome.rows),
        failed={name: outcome.failed[name] for name in order if name in outcome.failed},
    )


def split_like(dataset: Dataset, base: Dataset, split: Split, share: float = 1.0, seed: int = 0) -> Split:
    """Return a split of a dataset that puts sessions into the same parts as the split of another dataset.

    Parameters
    ----------
    dataset
        A dataset of sessions of the same names, such as one of other windows.
    base, split
        The other dataset, and its split by whole sessions.
    share
        Share of the training sessions that stays, at least one, drawn by `seed`.

    Raises
    ------
    InputError
        If the split cuts sessions, or the dataset lacks one of its sessions.
    """
    if split.by == "time":
        given = "a split by time for other windows or fewer sessions"
        raise InputError(given, "one by session, object or day")
    groups = {
        name: sorted({base.manifest.parts[at].name for at in base.session[rows].tolist()})
        for name, rows in split.parts.items()
    }
    names = np.array([part.name for part in dataset.manifest.parts])
    for name in (each for group in groups.values() for each in group):
        if name not in names:
            raise InputError(f"sessions without {name}", "all sessions of the split")
    count = max(1, round(share * len(groups["train"])))
    groups["train"] = sorted(np.random.default_rng(seed).permutation(groups["train"])[:count].tolist())
    parts = {name: np.flatnonzero(np.isin(names[dataset.session], group)) for name, group in groups.items()}
    return replace(
        split,
        parts=parts,
        dataset=file_checksum(dataset.path / FILE),
        left_out=len(dataset) - sum(len(rows) for rows in parts.values()),
        groups={name: tuple(group) for name, group in groups.items()},
    )


def _with_data(job: Job, base: Dataset, split: Path, progress: Callable[..., None]) -> Job:
    """Return the job with its dataset and its split, which are made where they differ from the grid's."""
    variation, grid = job.variation, job.grid
    if not variation.is_built and variation.share == 1.0:
        return replace(job, dataset=base.path, split=split)
    dataset, own = _built(job, base, progress) if variation.is_built else base, (job.home / SPLIT).absolute()
    split_like(dataset, base, Split.read(split), variation.share, grid.seed).write(own)
    return replace(job, dataset=dataset.path, split=own)


def _built(job: Job, base: Dataset, progress: Callable[..., None]) -> Dataset:
    """Return the dataset of other windows or sessions, built unless another variation has built it."""
    manifest, variation = base.manifest, job.variation
    window = variation.window or manifest.window / manifest.sample_rate
    hop = variation.hop or variation.window or manifest.hop / manifest.sample_rate
    key = hashlib.sha256(json.dumps(job.sessions).encode()).hexdigest()[:8]
    folder = job.home.parent / SHARED / f"{1e3 * window:g}ms_every_{1e3 * hop:g}ms_{key}"
    if folder.exists():
        return open_dataset(folder)
    folder.parent.mkdir(exist_ok=True)
    return build_dataset(find_sessions(job.sessions), folder, BuildOptions(window=window, hop=hop), progress)


def _carry_out(
    jobs: Sequence[Job],
    outcome: Ablation,
    report: Report,
    workers: int,
    is_stopped: Callable[[], bool],
    callables: tuple[Callable[[], Audio] | None, Draw | None],
) -> None:
    """Train and evaluate jobs, so many at a time; preferably such as share no features run side by side."""
    waiting, running = list(jobs), dict[Future[str], tuple[Job, str]]()
    trained: list[Job] = []
    while (waiting or trained or running) and not is_stopped():
        while (waiting or trained) and len(running) < workers:
            if trained:
                job, step = trained.pop(), "evaluate"
            else:
                busy = {job.cache_key for job, _ in running.values()}
                job = min(waiting, key=lambda one: one.cache_key in busy)
                waiting.remove(job)
                step = "evaluate" if job.variation.estimator or job.stored() else "train"
            report(job.name, "training" if step == "train" else "evaluation")
            work = _train if step == "train" else _evaluate
            running[_submit(work, job, *(callables if step == "evaluate" else ()))] = job, step
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            job, step = running.pop(future)
            try:
                error = future.result()
            except BrokenProcessPool:
                error = "its process ended"
            if error and not is_stopped():
                _fail(outcome, job, f"{step}: {error}", report)
            elif not error and step == "train":
                trained.append(job)
            elif not error:
                _record(outcome, job, job.stored())
                report(job.name, f"done, {len(waiting) + len(trained) + len(running)} left")


def _submit(work: Callable[..., str], *arguments: Any) -> Future[str]:
    """Run a function in a process of its own, so that one that dies takes no other job with it."""
    pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _prepare_worker)
    with _worker_environment():
        future = pool.submit(work, *arguments)
    future.add_done_callback(lambda _: pool.shutdown(wait=False))
    return future


@contextmanager
def _worker_environment() -> Generator[None]:
    """Let workers started inside use one thread each and never see Control-C, which goes to all."""
    environment, blocked = dict(os.environ), signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    for name in BLAS_THREADS:
        os.environ.setdefault(name, "1")
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        os.environ.clear()
        os.environ.update(environment)


def _prepare_worker() -> None:
    """End this worker when its parent ends, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


def _train(job: Job) -> str:
    """Train a variation in a worker; return its error, empty for none."""
    try:
        train(job.settings(), job.home / RUN)
    except (MonochordError, OSError) as error:
        return str(error)
    return ""


def _evaluate(job: Job, music: Callable[[], Audio] | None, draw: Draw | None) -> str:
    """Evaluate a variation in a worker and write its folder; return its error, empty for none."""
    try:
        outcome = evaluate(job.evaluation_settings(), music=music)
        write(job.home / REPORT, outcome, draw or (lambda *_: {}))
        tree = {
            "definition": job.definition,
            "evaluation": job.evaluation,
            "scores": outcome.card.tree(),
            "rows": paper_rows(outcome.card, outcome.label, job.grid.part),
        }
        (job.home / DONE).write_text(json.dumps(tree) + "\n", encoding="utf-8")
    except (MonochordError, OSError) as error:
        return str(error)
    return ""


def _record(outcome: Ablation, job: Job, stored: Tree) -> None:
    outcome.scores[job.name], outcome.rows[job.name] = stored["scores"], stored["rows"]


def _fail(outcome: Ablation, job: Job, error: str, report: Report) -> None:
    outcome.failed[job.name] = f"variation {job.name}, {error}"
    report(job.name, f"failed: {outcome.failed[job.name]}")


def _named(grid: Grid, rows: Mapping[str, list[PaperRow]]) -> dict[str, list[PaperRow]]:
    """Return rows under the names that they have in a table beside those of other grids."""
    named: dict[str, list[PaperRow]] = {}
    for name, variation in grid.compared.items():
        for row in rows.get(name, []):
            feature, comma, baseline = row["feature"].partition(", ")
            plain, random = feature.removesuffix(RANDOM_WEIGHTS), feature.endswith(RANDOM_WEIGHTS)
            label = variation.feature or (plain if name in (WHOLE, plain) else f"{plain}, {name}")
            label = labelled(label, random=random) + comma + baseline
            named.setdefault(name, []).append({**row, "feature": label})
    return named


def compared(scores: Mapping[str, Tree], condition: str = "clean") -> list[dict[str, Any]]:
    """Return a row for each variation and for each of its baselines, over all objects.

    Examples
    --------
    >>> compared({"whole": {"table": [], "contact": {}, "slip": {}}})
    []
    """
    rows: list[dict[str, Any]] = []
    for name, card in scores.items():
        tables = {"": card, **card.get("baselines", {})}
        for baseline, table in tables.items():
            matching = [
                row for row in table["table"] if row["state"] == "touched" and row["condition"] == condition
            ]
            if not matching:
                continue
            row = matching[-1]  # all objects, where there are several
            contact = table["contact"].get(row["object"], {}).get(condition, {})
            slip = table["slip"].get(row["object"], {}).get(condition, {})
            rows.append(
                {
                    "variation": name,
                    "baseline": baseline,
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
