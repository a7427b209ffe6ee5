"""One network and the nearest pair of lines: how well they read touches on builds outside their training.

Makes the table "One reader" of docs/design/reader-of-modes.md, in some 45 minutes on two cores:

    python -m studies.one_reader studies/plans/builds_2.toml studies/plans/odd.toml

It renders the sessions of plans and writes none of them. The network (`studies/_reader_network.py`) sees the
spectra of both microphones over log(f / f0), and learns three fifths of the builds. For each window it gives
the probability of no touch, a density of the position along the whole string, and whether the window is
ordinary or which fault it has. The pair of lines nearest to the densest position refines it. Heads for
contact, slip, position and force learn a quarter of the builds, from the network's outputs and the pair of
lines. The other builds are judged. Two fifths of all windows have noise, 5 to 30 dB below the sound.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import click
import numpy as np
from studies._command import lines_of, main, progress_bar
from studies._reader_network import (
    POSITIONS,
    Heads,
    Outputs,
    densest,
    outputs_of,
    train_heads,
    train_network,
)
from studies._reader_windows import KINDS, Windows, windows_of

from monochord.core.types import Flags, Floats
from monochord.lab import assignments, load_plan, run_all

PAIR_REACH, PAIR_WIDTH, MAX_MODE = 0.012, 0.004, 12
"""Largest and usual distance of a pair of lines from the densest position, over the length; largest mode."""
PITCH_RANGE = 0.985, 1.06
"""Open pitch under a touch, over the string's, that a pair of lines may tell."""
CERTAIN = 0.97
"""Least probability of a position within `TOLERANCE` that is an answer."""
TOLERANCE = 5.0e-3
TRAINED, JUDGED = 0.62, 0.88
"""Share of the builds that the network learns, and where those begin that are judged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pairs:
    """The pair of lines of each window: the position (n,), the open pitch under the touch, both modes.

    All are NaN where no pair of lines is near the densest position.
    """

    position: Floats
    pitch: Floats
    mode_1: Floats
    mode_2: Floats


def nearest_pairs(windows: Windows, position: Floats) -> Pairs:
    """Return the loudest pair of lines near a position (n,) of each window, over the length.

    A line f at microphone 1 is mode n of its segment, so f / n is the segment's fundamental f1; likewise for
    f2. The position is f2 / (f1 + f2), and the open pitch under the touch f1 f2 / (f1 + f2).
    """
    fundamental, mode = [], []
    for channel, share in enumerate((position, 1.0 - position)):
        side = np.maximum(share, 0.02)[:, np.newaxis]
        line = windows.lines[:, channel]
        number = np.maximum(np.round(line * side), 1.0)
        bending = np.sqrt(1.0 + windows.stiffness[:, np.newaxis] * (number / side) ** 2)
        fundamental.append(np.where((line > 0.0) & (number <= MAX_MODE), line / (number * bending), np.nan))
        mode.append(number)
    first, second = fundamental[0][:, :, np.newaxis], fundamental[1][:, np.newaxis, :]
    place, pitch = second / (first + second), first * second / (first + second)
    off = place - position[:, np.newaxis, np.newaxis]
    fits = (np.abs(off) < PAIR_REACH) & (pitch > PITCH_RANGE[0]) & (pitch < PITCH_RANGE[1])
    loudness = np.log(windows.power + 1e-30)
    score = loudness[:, 0, :, np.newaxis] + loudness[:, 1, np.newaxis, :] - 0.5 * (off / PAIR_WIDTH) ** 2
    score = np.where(fits, score, -np.inf).reshape(len(position), -1)
    best, rows = score.argmax(axis=1), np.arange(len(position))
    one, other = np.divmod(best, windows.lines.shape[2])
    found = np.isfinite(score[rows, best])

    def chosen(values: Floats) -> Floats:
        return np.where(found, values, np.nan)

    return Pairs(
        position=chosen(place.reshape(len(position), -1)[rows, best]),
        pitch=chosen(pitch.reshape(len(position), -1)[rows, best]),
        mode_1=chosen(mode[0][rows, one]),
        mode_2=chosen(mode[1][rows, other]),
    )


def _level_near(windows: Windows, frequency: Floats) -> Floats:
    """Return log10 of the power (n, 2) of the strongest bin within one of a frequency (n,)."""
    bins = windows.spectrum.shape[2]
    nearest = np.clip(np.nan_to_num(np.round(frequency / windows.spacing)), 2, bins - 3).astype(int)
    around = np.broadcast_to((nearest[:, np.newaxis] + np.arange(-1, 2))[:, np.newaxis], (len(nearest), 2, 3))
    return np.take_along_axis(windows.spectrum, around, 2).max(axis=2).astype(float)


def measures_of(windows: Windows, outputs: Outputs) -> tuple[Floats, Floats]:
    """Return the measures (n, d) that the heads see, and the refined position (n,) over the length."""
    density = outputs.density / np.maximum(outputs.density.sum(axis=1, keepdims=True), 1e-9)
    place, mass = densest(density)
    pairs = nearest_pairs(windows, place)
    found = np.isfinite(pairs.position)
    refined = np.where(found, pairs.position, place)
    rise = np.where(found, (pairs.pitch * (1.0 + windows.pitch_error)) ** 2 - 1.0, 0.0)
    room = np.maximum(refined * (1.0 - refined), 0.02)
    mode_1, mode_2 = np.nan_to_num(pairs.mode_1), np.nan_to_num(pairs.mode_2)
    pitch = np.where(found, pairs.pitch, 1.0)
    line_1, line_2 = (
        mode_1 * pitch / np.maximum(refined, 0.02),
        mode_2 * pitch / np.maximum(1.0 - refined, 0.02),
    )
    levels = [_level_near(windows, line) for line in (line_1, line_2)]
    loudest = np.maximum(*levels).max(axis=1, keepdims=True)
    tones = (
        line_1 + line_2,
        np.abs(line_1 - line_2),
        np.abs(2.0 * line_1 - line_2),
        np.abs(2.0 * line_2 - line_1),
        *(n * line for n in (2.0, 3.0) for line in (line_1, line_2)),
    )
    far = np.abs(POSITIONS - place[:, np.newaxis]) > 0.03
    columns = [
        place,
        mass,
        -(density * np.log(density + 1e-9)).sum(axis=1),
        (density * far).max(axis=1),
        np.log(outputs.untouched + 1e-6),
        refined,
        refined - place,
        found.astype(float),
        100.0 * rise,
        10.0 * np.sqrt(np.maximum(rise, 0.0) / room),
        mode_1,
        mode_2,
        *np.concatenate(
            [each - loudest for each in (*levels, *(_level_near(windows, t) for t in tones))], 1
        ).T,
        *windows.levels.T,
        *np.log(outputs.kind + 1e-5).T,
    ]
    return np.stack(columns, axis=1), refined


def rows_of(windows: Windows, heads: Heads, measures: Floats, refined: Floats) -> Iterator[tuple[str, ...]]:
    """Yield the table: windows in the middle half of the string by mount, all others, and the untouched."""
    told = heads(measures)
    error = np.abs(refined + told.shift - windows.position) * windows.length
    touched = (windows.kind == 0) & (windows.contact == 1.0)
    inside = touched & (windows.position > 0.25) & (windows.position < 0.75)
    answered = told.within > CERTAIN
    selections: dict[str, Flags] = {
        f"{mount}, inside": inside & (windows.mount == mount) for mount in np.unique(windows.mount).tolist()
    }
    for name, rows in {**selections, "outside": touched & ~inside}.items():
        if not rows.any():
            continue
        stated = rows & answered
        right = 100.0 * np.mean(error[stated] < TOLERANCE) if stated.any() else np.nan
        yield (
            name,
            f"{rows.sum()}",
            f"{100.0 * np.mean(error[rows] < TOLERANCE):.1f} %",
            f"{100.0 * answered[rows].mean():.1f} %",
            f"{right:.2f} %",
            f"{1e3 * np.median(error[stated]) if stated.any() else np.nan:.2f}",
            f"{np.abs(told.force - windows.force)[rows].mean():.3f}",
            f"{100.0 * np.mean(told.contact[rows] > 0.5):.1f} %",
        )
    free = (windows.kind == 0) & (windows.contact == 0.0)
    dash = ("-",) * 5
    yield ("untouched", f"{free.sum()}", *dash, f"{100.0 * np.mean(told.contact[free] < 0.5):.1f} %")


HEADINGS = (
    "windows",
    "number",
    "within 5 mm",
    "answered",
    "answers within",
    "median mm",
    "force N",
    "contact",
)


@click.command()
@click.argument("plans", nargs=-1, required=True)
@click.option("--count", default=50, show_default=True, help="Touched windows of a session.")
@click.option("--epochs", default=20, show_default=True, help="Passes of the network over its windows.")
@click.option("--every", default=1, show_default=True, help="Use one session of so many.")
@click.option("--seed", default=0, show_default=True, help="Random seed.")
@click.option("--workers", type=int, help="Processes that render; by default one a core.")
def command(
    plans: tuple[str, ...], *, count: int, epochs: int, every: int, seed: int, workers: int | None
) -> None:
    """Train and judge the reader on sessions of PLANS."""
    sessions = [session for plan in plans for session in assignments(load_plan(plan), seed)[::every]]
    parts = list[Windows]()
    with progress_bar("render") as progress:
        work = partial(windows_of, count=count, seed=seed)
        for done, (_, part) in enumerate(run_all(sessions, work, workers=workers), 1):
            progress("render", done, len(sessions))
            parts += [] if part is None else [part]
    windows = Windows.joined(parts)
    builds = np.unique(windows.build)
    order = np.random.default_rng(seed).permutation(len(builds))
    share = order[np.searchsorted(builds, windows.build)] / len(builds)
    learned, headed, judged = (
        windows.of(np.flatnonzero(rows))
        for rows in (share < TRAINED, (share >= TRAINED) & (share < JUDGED), share >= JUDGED)
    )
    network = train_network(
        learned.cells, learned.contact, learned.position, learned.kind, len(KINDS), epochs=epochs, seed=seed
    )
    measures, refined = measures_of(headed, outputs_of(network, headed.cells))
    labels = {name: getattr(headed, name) for name in ("contact", "position", "force", "slip", "kind")}
    heads = train_heads(measures, refined, labels, seed=seed)
    measures, refined = measures_of(judged, outputs_of(network, judged.cells))
    print("\n".join(lines_of(HEADINGS, list(rows_of(judged, heads, measures, refined)))))


if __name__ == "__main__":
    main(command)
