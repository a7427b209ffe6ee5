"""What the reader owes to its memory, to physics' measures and to the number of builds.

    python -m studies.memory_ablation FOLDER --out FILE

FOLDER is that of `python -m studies.bundled_model`, whose rows are read again. Each variant of the memory is
trained for the same number of updates, and scored on builds that no network has heard. Simulated.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import click
import numpy as np
from studies._command import lines_of, main, progress_bar
from studies._memory_figures import ALL, figures
from studies._memory_training import PARTS, Rows, read_rows, train_memory
from studies._reader_sessions import HOP, RATE, Variant, sound_file
from studies.bundled_model import PLANS, READER, group_weights, planned, share_of

PHYSICS = ("measures", "gaps")
"""Inputs that physics measures."""
SHOWN = {
    "contact": ("contact", 100.0, ".2f"),
    "released": ("released, told so", 100.0, ".1f"),
    "answered": ("answered", 100.0, ".1f"),
    "right": ("of these right", 100.0, ".2f"),
    "wrong": ("wrong", 100.0, ".2f"),
    "force_n": ("force N", 1.0, ".3f"),
    "slip": ("slip, area", 1.0, ".3f"),
}
"""Columns of the table: key, heading, factor and form."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ablation:
    """A variant: windows that are remembered (0: all), inputs that it lacks, and share of the builds."""

    name: str
    horizon: int = 0
    without: tuple[str, ...] = ()
    share: float = 1.0


def variants(builds: int) -> list[Ablation]:
    """Return the variants for a number of builds."""
    fewer = [each for each in (300, 1000) if each < builds]
    return [
        Ablation(name="a window alone", horizon=1),
        Ablation(name=f"{16 * HOP / RATE:.2f} s", horizon=16),
        Ablation(name=f"{80 * HOP / RATE:.1f} s", horizon=80),
        Ablation(name="no limit"),
        Ablation(name="without physics", without=PHYSICS),
        *(Ablation(name=f"{each} builds", share=each / builds) for each in fewer),
    ]


@click.command()
@click.argument("folder", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("--out", type=click.Path(path_type=Path), required=True, help="JSON file of the figures.")
@click.option("--updates", default=2000, show_default=True, help="Updates of each variant.")
@click.option("--sessions", default=100_000, help="Most sessions: as many as `bundled_model` was told.")
@click.option("--seed", default=0, show_default=True, help="Random seed.")
def command(folder: Path, out: Path, updates: int, sessions: int, seed: int) -> None:
    """Train and score each variant on the rows in FOLDER."""
    work, sounds = planned(PLANS, seed)[:sessions], folder / "sounds"
    rows_folder = folder / f"rows_{crc32((folder / 'windows.safetensors').read_bytes()):08x}"
    heard = [one for one in work if share_of(one.build or 0, seed) < READER]
    unheard = [one for one in work if share_of(one.build or 0, seed) >= READER]
    tests = [read_rows(Variant(file=sound_file(one, sounds), take=0).within(rows_folder)) for one in unheard]
    result = dict[str, Any]()
    for variant in variants(len({one.build for one in heard})):
        own = heard[: round(variant.share * len(heard))]
        files = [Variant(file=sound_file(one, sounds), take=0).within(rows_folder) for one in own]
        rows = without(Rows.joined([read_rows(file) for file in files]), variant.without)
        weight = group_weights([one.group.name for one in own], rows)
        with progress_bar(variant.name) as progress:
            arrays = train_memory(
                rows,
                weight,
                updates=updates,
                seed=seed,
                report=lambda done, _, name=variant.name, move=progress: move(name, done, updates),
                horizon=variant.horizon,
            )
        told = figures(
            arrays,
            [without(each, variant.without) for each in tests],
            [one.group.name for one in unheard],
            variant.horizon,
        )
        result[variant.name] = {"memory": told[ALL]["memory"], "groups": told}
        print(*_table(result), sep="\n", flush=True)
    about = {"simulated": True, "updates": updates, "sessions": [len(heard), len(unheard)]}
    out.write_text(json.dumps(about | {"variants": result}, indent=1) + "\n")


def without(rows: Rows, parts: Sequence[str]) -> Rows:
    """Return rows with some parts of their inputs at zero."""
    inputs = rows.inputs.copy() if parts else rows.inputs
    for part in parts:
        inputs[:, PARTS[part]] = np.float16(0.0)
    return replace(rows, inputs=inputs)


def _table(result: dict[str, Any]) -> list[str]:
    lines = [
        [name, *(format(factor * own["memory"][key], form) for key, (_, factor, form) in SHOWN.items())]
        for name, own in result.items()
    ]
    return lines_of(("variant", *(heading for heading, _, _ in SHOWN.values())), lines)


if __name__ == "__main__":
    main(command)
