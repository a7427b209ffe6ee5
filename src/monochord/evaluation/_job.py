"""One variation of a grid: its dataset, its training, its evaluation, and what is kept of them."""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

from monochord.core.config import Tree, to_tree
from monochord.core.errors import InputError
from monochord.core.interruption import Interruption
from monochord.datasets.build import Options, build_dataset, find_sessions
from monochord.datasets.manifest import FILE, checksum
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.evaluation._children import AblationError, Children
from monochord.evaluation.dealt import as_dealt
from monochord.evaluation.grid import SHARED, Grid, Variation

Told: TypeAlias = Callable[[str, str], None]
"""Is told the name of a variation, and what is being done with it."""
DONE = "variation.json"
"""What a variation was made by, its scores and its rows, in its folder: written last."""
ROWS, SPLIT = "rows.json", "split.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A variation `name` of a grid, made in the folder `home` of a dataset and a split, its `material`."""

    grid: Grid
    name: str
    variation: Variation
    home: Path
    children: Children
    material: tuple[Path, Path] = (Path(), Path())

    @property
    def kin(self) -> tuple[Any, ...]:
        """What variations share that compute the same features of the same windows."""
        feature = (line for line in self.variation.set if line.startswith("feature."))
        return (self.material[0], *feature)

    @property
    def made_by(self) -> Tree:
        """What it is made by, but for how it is judged."""
        grid, variation = self.grid, self.variation
        named = ("sensor",) if variation.estimator else ("sensor", "config", "set", "seed")
        tree = {name: to_tree(grid)[name] for name in named}
        tree["dataset"] = checksum(grid.dataset / FILE)
        tree["split"] = checksum(grid.split or grid.dataset / SPLIT)
        own = to_tree(replace(variation, feature="", sessions=self._sessions if variation.is_built else ()))
        return json.loads(json.dumps({"grid": tree, "variation": own}))

    @property
    def judged_by(self) -> Tree:
        """How it is judged."""
        return {"part": self.grid.part, "noise": list(self.grid.noise)}

    @property
    def held(self) -> Tree:
        """What was made of it before, empty if nothing was; refuses what was made otherwise."""
        done = self.home / DONE
        if not done.is_file():
            return {}
        held: Tree = json.loads(done.read_text(encoding="utf-8"))
        if held.get("made_by") != self.made_by:
            given = f"{self.home}, a variation of another grid"
            raise InputError(given, "a new folder, or the grid that was begun with", "name another --out")
        return held

    @property
    def is_done(self) -> bool:
        """Whether nothing is left to do."""
        return self.held.get("judged_by") == self.judged_by

    def prepared(self, base: Dataset, split: Path, wish: Interruption) -> "Job":
        """Return the job with its dataset and its split, made where they differ from the grid's.

        Raises
        ------
        AblationError
            If they cannot be made.
        """
        variation, own = self.variation, (self.home / SPLIT).absolute()
        if not variation.is_built and variation.share == 1.0:
            return replace(self, material=(base.path, split))
        try:
            dataset = self._built(base, wish) if variation.is_built else base
            as_dealt(dataset, base, Split.read(split), variation.share, self.grid.seed).write(own)
        except InputError as error:
            raise AblationError(f"variation {self.name}, dataset: {error}") from error
        return replace(self, material=(dataset.path, own))

    def carry_out(self, told: Told) -> Tree:
        """Return what is kept of it; train and judge as far as that was not done."""
        if self.is_done:
            return self.held
        judge = ["--dataset", str(self.material[0]), "--split", str(self.material[1])]
        if self.variation.estimator:
            judge += ["--estimator", self.variation.estimator, *_each("--set", self.variation.estimator_set)]
            judge += ["--sensor", self.grid.sensor] if self.grid.sensor else []
        else:
            judge = [str(self.home / "run")]
            if not self.held:
                told(self.name, "training")
                config = self.variation.config or self.grid.config
                self.children.run(self.name, "train", config, *self._settings(), "--json")
        told(self.name, "evaluation")
        rows = self.home / ROWS
        rows.unlink(missing_ok=True)
        judge += ["--part", self.grid.part, *_each("--noise", self.grid.noise)]
        judge += ["--out", str(self.home / "report"), "--rows", str(rows), "--json"]
        scores = json.loads(self.children.run(self.name, "evaluate", *judge))
        held = {"made_by": self.made_by, "judged_by": self.judged_by, "scores": scores}
        held["rows"] = json.loads(rows.read_text(encoding="utf-8"))
        (self.home / DONE).write_text(json.dumps(held) + "\n", encoding="utf-8")
        return held

    def _settings(self) -> list[str]:
        dataset, split = self.material
        settings = [f"dataset={dataset}", f"split={split}", *self.grid.set, *self.variation.set]
        settings += [f"sensor={self.grid.sensor}"] if self.grid.sensor else []
        return [*_each("--set", settings), "--out", str(self.home / "run")]

    @property
    def _sessions(self) -> tuple[str, ...]:
        return self.variation.sessions or self.grid.sessions

    def _built(self, base: Dataset, wish: Interruption) -> Dataset:
        """Return the dataset of other windows or sessions, built where no variation built it before."""
        manifest, variation = base.manifest, self.variation
        window = variation.window or manifest.window / manifest.sample_rate
        hop = variation.hop or variation.window or manifest.hop / manifest.sample_rate
        key = hashlib.sha256(json.dumps(self._sessions).encode()).hexdigest()[:8]
        folder = self.home.parent / SHARED / f"{1e3 * window:g}ms_every_{1e3 * hop:g}ms_{key}"
        if folder.exists():
            return open_dataset(folder)

        def progress(*_: object) -> None:
            if wish.requested:
                raise KeyboardInterrupt

        folder.parent.mkdir(exist_ok=True)
        return build_dataset(find_sessions(self._sessions), folder, Options(window=window, hop=hop), progress)


def _each(option: str, values: Sequence[str]) -> list[str]:
    return [word for value in values for word in (option, value)]
