"""Splits windows into training, validation and test parts.

Neighbouring windows contain the same touch, and overlapping windows the same samples. So whole groups are
assigned:

- **session**: whole sessions, each kind (object; mostly static, sliding or untouched) by the same shares.
  Held-out objects or sessions (by name patterns) belong to the test only, beside other sessions.
- **object**: held-out objects belong to the test only: those in `held_out`, else enough to reach the
  requested share. The sessions of the other objects are assigned to training and validation.
- **day**, **build**: whole days, or whole builds of a sensor. With `held_out` (patterns of session names),
  the days or builds of these sessions form the test, and the others are assigned to training and
  validation.
- **time**: each session is cut into three stretches, in random order, with a guard gap between them. A cut
  is moved to a time without contact, if one is close, so that no touch is on both sides.

Shuffled single windows are refused: the test would contain touches used for training.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Literal, TypeAlias, get_args

import numpy as np

from monochord.core.config import from_tree, load_json
from monochord.core.errors import InputError, did_you_mean
from monochord.core.files import write_text
from monochord.core.notebook import lines
from monochord.core.ranges import NonNegative, Seed, Share, checked
from monochord.core.types import Indices
from monochord.core.units import Samples, Seconds
from monochord.datasets._strategies import (
    PARTS,
    by_group,
    by_time,
    is_held_out,
    is_pattern,
    refuse_strange,
)
from monochord.datasets.manifest import MAX_WINDOWS
from monochord.datasets.store import Dataset

By: TypeAlias = Literal["session", "object", "time", "day", "build"]
SPLIT_FILE = "split.json"
"""Path of the split below a dataset's folder."""
MORE = "record more, or split by time"
SHARES = (0.7, 0.15, 0.15)
"""Default shares of the windows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """Row numbers of the windows in each part, and how they were assigned.

    `parts` maps "train", "validation" and "test" to rows (k,) in rising order. `guard` is the smallest
    distance in frames between samples of different parts in a split by time. `left_out` counts windows in no
    part. `dataset` is the checksum of the dataset's manifest.
    """

    by: By
    parts: Mapping[str, Indices]
    seed: int = 0
    fractions: tuple[Share, Share, Share] = SHARES
    guard: Samples = 0
    held_out: tuple[str, ...] = ()
    left_out: int = 0
    dataset: str = ""
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])

    def __repr__(self) -> str:
        parts = ", ".join(f"{name} {len(rows)}" for name, rows in self.parts.items())
        held_out = ", ".join(self.held_out)
        return lines(
            f"Split: by {self.by}", [("windows", parts), ("held out", held_out), ("seed", str(self.seed))]
        )

    @property
    def train(self) -> Indices:
        """Rows (k,) to train on."""
        return self.parts["train"]

    @property
    def validation(self) -> Indices:
        """Rows (k,) for model selection."""
        return self.parts["validation"]

    @property
    def test(self) -> Indices:
        """Rows (k,) to test on."""
        return self.parts["test"]

    def write(self, file: Path) -> None:
        """Write the split as JSON, with rows as runs [first, last + 1] to keep a large split small."""
        tree = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "parts"}
        tree["counts"] = {name: len(rows) for name, rows in self.parts.items()}
        tree["parts"] = {name: _runs(rows) for name, rows in self.parts.items()}
        write_text(file, json.dumps(tree, indent=1) + "\n")

    @classmethod
    def read(cls, file: Path) -> "Split":
        """Read a file from `write`, or one of your own: ``by`` and the runs of ``parts`` are enough.

        Raises `InputError` where the file is missing, invalid, or of a refused strategy.
        """
        remedy = "split the dataset again, with monochord build"
        tree = load_json(file, remedy)
        if not isinstance(tree, dict):
            raise InputError(f"split {file} (damaged)", "a file from monochord build", remedy)
        if isinstance(tree.get("by"), str):
            refuse_impossible(tree["by"])
        written = from_tree(_SplitFile, tree, f"split {file}")
        strange = [name for name in written.parts if name not in PARTS]
        if strange:
            given = f"split {file} with a part '{strange[0]}'"
            raise InputError(given, ", ".join(PARTS), did_you_mean(strange[0], PARTS))
        runs = [run for runs in written.parts.values() for run in runs]
        count = sum(last - first for first, last in runs)
        if not all(0 <= first <= last for first, last in runs) or count > MAX_WINDOWS:
            given = f"split {file} (damaged: invalid runs of rows)"
            raise InputError(given, f"rising runs of {MAX_WINDOWS} rows at most", remedy)
        kept = {each.name: getattr(written, each.name) for each in fields(cls) if each.name != "parts"}
        return cls(parts={name: _rows(written.parts.get(name, ())) for name in PARTS}, **kept)


@dataclass(frozen=True, slots=True, kw_only=True)
class _SplitFile:
    """A split as written to its file: parts as runs [first, last + 1]."""

    by: By
    parts: dict[str, tuple[tuple[int, int], ...]]
    seed: int = 0
    fractions: tuple[Share, Share, Share] = SHARES
    guard: Samples = 0
    held_out: tuple[str, ...] = ()
    left_out: int = 0
    dataset: str = ""
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    counts: dict[str, int] = field(default_factory=dict[str, int])


@checked
def split_dataset(
    dataset: Dataset,
    *,
    by: str = "session",
    fractions: tuple[Share, Share, Share] = SHARES,
    seed: Seed = 0,
    held_out: Sequence[str] = (),
    guard: NonNegative[Seconds] | None = None,
) -> Split:
    """Split a dataset; the module describes each strategy.

    Parameters
    ----------
    dataset
        The dataset.
    by
        "session", "object", "time", "day" or "build".
    fractions
        Shares of windows for training, validation and test, with sum 1. A share of 0 leaves a part empty.
    seed
        Random seed; equal seeds give equal splits.
    held_out
        Objects that belong to the test only, where `by` is "session" or "object". By session, also patterns
        of session names, such as ``music*``; the other sessions are assigned to all parts, so that the test
        also contains familiar conditions. By day or build, patterns only.
    guard
        Smallest distance between samples of two parts in s, where `by` is "time"; at least a window and a
        hop, which is the default.

    Raises
    ------
    InputError
        If `by` would shuffle single windows, the shares or names are invalid, or there are too few groups.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> folder, twin = mkdtemp(), ["groups=[{name='hold', grid=[2, 1], hold=0.3}]"]
    >>> data = mc.build(mc.collect("quick", folder, settings=twin), f"{folder}/dataset")
    >>> split = mc.split_dataset(data.dataset, by="time", seed=7)
    >>> split.seed, mc.audit(data, split).clean
    (7, True)
    """
    refuse_impossible(by, fractions, held_out)
    size, hop, rate = dataset.manifest.window, dataset.manifest.hop, dataset.manifest.sample_rate
    smallest = size + hop
    gap = smallest if guard is None else round(guard * rate)
    if gap < smallest:
        raise InputError(
            f"guard gap of {gap / rate:g} s", f"a window and a hop, {smallest / rate:g} s, or more"
        )
    rng = np.random.default_rng(seed)
    if by == "time":
        part_of, groups = by_time(dataset, fractions, gap, rng), dict[str, tuple[str, ...]]()
    else:
        names, part = by_group(dataset, by, fractions, held_out, rng)
        part_of = part[dataset.session]
        groups = {
            each: tuple(sorted({name for name, at in zip(names, part, strict=True) if at == number}))
            for number, each in enumerate(PARTS)
        }
    parts = {name: np.flatnonzero(part_of == number) for number, name in enumerate(PARTS)}
    for name, share in zip(PARTS, fractions, strict=True):
        if share > 0.0 and not parts[name].size:
            raise InputError(f"split by {by} with an empty {name} part", _requirement(by), MORE)
    return Split(
        by=by,  # pyright: ignore[reportArgumentType]
        parts=parts,
        seed=seed,
        fractions=fractions,
        guard=gap if by == "time" else 0,
        held_out=tuple(held_out),
        left_out=int((part_of < 0).sum()),
        dataset=dataset.checksum,
        groups=groups,
    )


def refuse_impossible(
    by: str, fractions: tuple[Share, Share, Share] = SHARES, held_out: Sequence[str] = ()
) -> None:
    """Raise `InputError` for a split that is invalid for any dataset.

    >>> refuse_impossible("session")
    """
    strategies = get_args(By)
    if by in ("window", "windows", "random", "shuffle"):
        raise InputError(
            f"split by {by}",
            ", ".join(strategies),
            "neighbouring windows contain the same touch, so a shuffled split tests on training data",
        )
    if by not in strategies:
        raise InputError(f"split by {by}", ", ".join(strategies), did_you_mean(by, strategies))
    if min(fractions) < 0.0 or abs(sum(fractions) - 1.0) > 1e-6 or fractions[0] <= 0.0:
        given = "shares " + ", ".join(f"{share:g}" for share in fractions)
        raise InputError(given, "three shares of 0 or more with sum 1, the first above 0")
    patterns = [name for name in held_out if is_pattern(name)]
    if len(patterns) < len(held_out) and by not in ("session", "object"):
        raise InputError(f"held-out objects in a split by {by}", "a split by session or object")
    if patterns and by not in ("session", "day", "build"):
        given = f"held-out sessions '{patterns[0]}' in a split by {by}"
        raise InputError(given, "a split by session, day or build")


def refuse_too_few(
    by: str,
    objects: Sequence[str],
    days: Sequence[int | None],
    held_out: Sequence[str] = (),
    names: Sequence[str] = (),
    builds: Sequence[int | None] = (),
) -> None:
    """Raise `InputError` where there are too few sessions with these objects, days, names and builds.

    It checks names only, before a build; `split_dataset` may still find an empty part.

    >>> refuse_too_few("object", ["wood", "wood", "steel"], [0, 0, 0], ["steel"])
    """
    names = names or [""] * len(objects)
    refuse_strange(objects, held_out, names)
    builds = builds or [None] * len(objects)
    for kind, numbers in (("day", days), ("build", builds)):
        if by == kind and None in numbers:
            given = f"sessions without a {kind} in a split by {kind}"
            raise InputError(given, f"sessions that state their {kind}", "split by session")
    known = [body for body, name in zip(objects, names, strict=True) if not is_held_out(body, name, held_out)]
    enough = {
        "session": len(known) >= (2 if held_out else 3),
        "object": len(known) >= 2 and len(set(objects)) >= 2,
        "day": len(set(days)) >= 3,
        "build": len(set(builds)) >= 3,
        "time": True,
    }
    if not enough[by]:
        groups = {"session": range(len(objects)), "object": objects, "day": days, "build": builds}[by]
        count = len(set(groups))
        raise InputError(f"split by {by} of {count} {by}{'' if count == 1 else 's'}", _requirement(by), MORE)


def _requirement(by: str) -> str:
    """Return the requirement of a split as text."""
    return {"object": "2 objects or more, in 3 sessions or more"}.get(by, f"3 {by}s or more")


def _runs(rows: Indices) -> list[list[int]]:
    if not rows.size:
        return []
    ends = np.flatnonzero(np.diff(rows) != 1)
    firsts, lasts = rows[np.r_[0, ends + 1]], rows[np.r_[ends, len(rows) - 1]]
    return [[int(first), int(last) + 1] for first, last in zip(firsts, lasts, strict=True)]


def _rows(runs: Sequence[tuple[int, int]]) -> Indices:
    return np.concatenate([np.zeros(0, np.int64), *(np.arange(first, stop) for first, stop in runs)])
