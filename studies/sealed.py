"""A sealed plan by group: several models' evaluations of one rendering, side by side. Simulated.

    monochord collect studies/plans/sealed_14.toml --out sealed_14
    monochord evaluate demo --sessions sealed_14 --skip --tuned --no-baselines --out demo
    python -m studies.sealed demo before --rows sealed_14.json

Each folder is one that `monochord evaluate --out` wrote; its name is the model's. Skipped are five sessions
whose taps a dead microphone, motors or music hide. A group's rows are of the
sessions that a plan names ``GROUP_NUMBER``, those of `TOGETHER` of several groups.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray
from studies._command import lines_of, main
from studies._rows import SummaryRow, summary_row

from monochord.core.types import Flags
from monochord.evaluation import Results, read_results, regression_rows
from monochord.live import FilterSettings

HARD, SOFT = "hard objects, held", "soft objects"
TOGETHER: Mapping[str, tuple[str, ...]] = {
    HARD: ("hold_",),
    SOFT: ("hold_felt_tip", "hold_erasing_gum", "soft_"),
    "at nodes": ("at_", "node_"),
    "music, speech and motors": ("music", "motors", "speech"),
    "all": ("",),
}
"""Beginnings of the names of groups that are one row together; a hard object is none of the soft ones."""
WORLD = "plausible"
FAR = 0.010
"""Error in m from which a place is far off."""
SLIP = FilterSettings().slip.on
"""Probability from which a window is counted as slip: where the switch turns on."""
LEAST = 20
"""Fewest windows held and slid of which an area is told: held touches slip in a few windows of hundreds."""
HEADS = (
    "told", "of these right", "answered", "<= 5 mm", "mm", "far off", "N", "1 se", "2 se",
    "held: slip", "slid: slip", "slip area",
)  # fmt: skip


@click.command()
@click.argument("reports", nargs=-1, required=True, type=click.Path(path_type=Path, exists=True))
@click.option("--rows", type=click.Path(path_type=Path), help="Also save the rows to a JSON file.")
def command(reports: tuple[Path, ...], rows: Path | None) -> None:
    """Print the figures of each group and model, and save them."""
    made = [
        row_of(name, results, model=report.name)
        for report in reports
        for name, results in groups_of(read_results(report / "results.npz"))
    ]
    names = dict.fromkeys(row["condition"] for row in made)
    ordered = [row for name in names for row in made if row["condition"] == name]
    print(*lines_of(("group", "model", *HEADS), [_line(row) for row in ordered]), sep="\n")
    if rows:
        lines = ",\n".join(json.dumps(row, allow_nan=False) for row in ordered)
        rows.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def groups_of(results: Results) -> Iterator[tuple[str, Results]]:
    """Yield names with their sessions' results: groups together, each mount, and each group of the plan."""
    session = results.of_trials("session").astype(str)
    group = np.char.rpartition(session, "_")[..., 0]
    soft = _begins(group, TOGETHER[SOFT])
    for name, beginnings in TOGETHER.items():
        rows = _begins(group, beginnings)
        yield name, results.where(rows & ~soft if name == HARD else rows)
    mount, hard = results.of_trials("mount"), _begins(group, TOGETHER[HARD]) & ~soft
    for each in sorted(set(mount[hard].tolist())):
        yield f"{HARD}, mount {each}", results.where(hard & (mount == each))
    for each in dict.fromkeys(group.tolist()):
        yield each, results.where(group == each)


def _begins(names: NDArray[Any], beginnings: tuple[str, ...]) -> Flags:
    return np.any([np.char.startswith(names, each) for each in beginnings], axis=0)


def row_of(name: str, results: Results, *, model: str) -> SummaryRow:
    """Return a group's row: that of `summary_row` with `told`, `told_right` (contact), `far_off` and slip.

    `held_slip` is the share of windows called slip among those that are held, `slid_slip` among the `slid`.
    """
    row = summary_row(results, model=model, world=WORLD, condition=name)
    truth, stated = results.label("contact"), results.estimate("contact")
    known = results.usable & np.isfinite(truth)
    told = known & np.isfinite(stated)
    error = np.abs(results.error_of("position"))
    placed = regression_rows(results, "position")
    slip, chance = results.label("slip"), results.estimate("slip")
    heard = results.usable & np.isfinite(chance)
    held, slid = ((chance > SLIP)[heard & (slip == each)] for each in (0.0, 1.0))
    if min(held.size, slid.size) < LEAST:
        row["slip_auc"] = None
    return row | {
        "told": _mean(told[known]),
        "told_right": _mean(((stated > 0.5) == (truth > 0.5))[told]),
        "far_off": _mean((error > FAR)[placed]),
        "placed": _mean(np.isfinite(error)[placed]),
        "held_slip": _mean(held),
        "slid_slip": _mean(slid),
        "slid": int(slid.size),
        "windows": len(results),
    }


def _mean(flags: Flags) -> float | None:
    return round(float(flags.mean()), 5) if len(flags) else None


def _line(row: SummaryRow) -> list[str]:
    near, placed = row["position_within_5mm"], row["placed"]
    shares = {
        "told": row["told"],
        "right": row["told_right"],
        "answered": placed,
        "near": near / placed if near is not None and placed else None,
    }
    return [
        row["condition"],
        row["model"],
        *(_percent(each) for each in shares.values()),
        _number(row["position_mae_mm"], ".2f"),
        _percent(row["far_off"]),
        _number(row["force_mae_n"], ".3f"),
        _percent(row["coverage_1se"]),
        _percent(row["coverage_2se"]),
        _percent(row["held_slip"]),
        _percent(row["slid_slip"]),
        _number(row["slip_auc"], ".3f"),
    ]


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.2f}%"


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


if __name__ == "__main__":
    main(command)
