"""What designs can tell at best, and what an estimator reaches on the twin: random ones, and three tensions.

Makes `docs/results/design_bounds.json` and, with ``--out``, `docs/figures/design_bounds.png`, in some
15 minutes of computing: ``python -m studies.design_bounds --json docs/results/design_bounds.json``.

Part one, designs: gauge, tension and length are drawn, `monochord.design` makes the sensor, and each is built
once in the world `plausible`; every draw of twenty has another build. One bolted object touches every build;
an estimator learns from 150 known touches, and is scored on 60 others. The bound is of an estimator that
knows build, object and mount, and whose lines repeat as they do on the twin. Part two, tensions: the
prototype's string at 20, 40 and 65 N. Twelve builds teach an estimator, and six score it, each with a bolted
object of its own; builds and objects are the same at each tension. The bound is of a mount known by its class
and a contact known to 30 %.

The estimator takes the strongest line of either microphone, tells their modes by the known touches, and
corrects the place and the tension that follow by a Gaussian process. It answers every window.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np
from scipy.stats import spearmanr
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Matern, WhiteKernel
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from studies._command import lines_of, main, progress_bar

import monochord as mc
from monochord.core.errors import InputError
from monochord.core.types import Audio, Contact, Floats, StringParams
from monochord.figures import style
from monochord.perception.tuning import tension_estimator
from monochord.physics.theory import inharmonicity, open_frequency, split_frequencies
from monochord.physics.twin import hold, plausible_touch

RATE, SIZE = 44100, 4410
FORCES = 0.1, 2.0
GAUGES = tuple(round(25.4e-6 * each, 7) for each in (8, 9, 10, 11, 12, 13, 14, 16))
TENSIONS, LENGTHS = (20.0, 110.0), (0.16, 0.40)
"""Of the random designs: evenly over the logarithm in N, evenly in m."""
GAP = 4e-3
"""Between string and pole in m: wide enough for slack strings."""
KNOWN_TOUCHES, TEST_TOUCHES = 150, 60
COMPARED = 20.0, 40.0, 65.0
TRAINING, UNSEEN, PER_BUILD = 12, 6, 40
"""Builds that teach and that score, and touches of each."""
REPEATED = 8
"""Every so many touches another window follows at once, for how well lines repeat."""
CALIBRATED = {
    "mount": "known",
    "contact_share": 0.0,
    "line_std": 1e-5,
    "open_std": 1e-5,
    "end_std": 1e-6,
}
"""What is known to an estimator that is calibrated on one build by one object: its lines repeat to 1e-5."""
UNKNOWN_OBJECT = {"mount": "bolted", "contact_share": 0.3}
FAR_OFF = 5e-3
"""Error of position in m from which the modes were taken for others."""
PADDING, SAME, CLEAR, MAX_MODE = 4, 0.05, 0.05, 16
"""Bins of a spectrum over those of its window; distance of logarithms within which lines are alike, and that
within which a known touch explains a line; highest mode."""
MIN_PAIRS, OUTLIER = 2, 10.0
"""Fewest known touches of a pair of modes that counts; most residual over the median of one that counts."""
CENTRAL = 68.27
"""Percentile of absolute errors that is a standard deviation of normal ones."""
DRAWS = 2000
SEED, BUILD = 35, 900
"""Seeds of the random designs, and of the build of each: they differ by what was designed alone."""
ARRAYS = "position", "force", "peaks", "repeats"
PEAKS, MULTIPLE, HIGHEST = 8, 2e-3, 10e3
"""Peaks of a microphone; share within which a line is a multiple of another; highest line in Hz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Take:
    """Touches of a build: truths (n,), peaks of both microphones (n, 2, `PEAKS`, 2), how far lines repeat.

    `string` is as a ruler and its untouched sound have it.
    """

    string: StringParams
    position: Floats
    force: Floats
    peaks: Floats
    repeats: Floats

    @property
    def lines(self) -> Floats:
        """A line of each segment in Hz, (n, 2)."""
        return pairs_of(self.peaks)

    def part(self, rows: slice) -> "Take":
        """Return some of the touches."""
        return replace(self, position=self.position[rows], force=self.force[rows], peaks=self.peaks[rows])


def random_design(random: np.random.Generator) -> Any:
    """Return a design of random gauge, tension and length that holds, does not squeal and has its lines."""
    while True:
        gauge, length = float(random.choice(GAUGES)), round(float(random.uniform(*LENGTHS)), 3)
        tension = round(float(np.exp(random.uniform(*np.log(TENSIONS)))), 1)
        try:
            wishes = {"gauge": gauge, "tension": tension, "length": length, "range": round(length - 0.1, 3)}
            made = mc.design(**wishes, gap=GAP, model="none")
        except InputError:
            continue  # the wire breaks
        if all(word.startswith(("force", "position")) for word in made.chosen.lacks):
            return made


def bolted(count: int, first: int = 0) -> list[int]:
    """Return seeds whose object of plastic is bolted."""
    plastic, seeds, seed = mc.load_material("plastic"), list[int](), first
    while len(seeds) < count:
        if plausible_touch(hold(0.08, 1.0, plastic), seed).mount.kind == "bolted":
            seeds.append(seed)
        seed += 1
    return seeds


def take_of(made: Any, *, build: int, object_seed: int, touches: int) -> Take:
    """Return a build of a design that one object touches at random, each touch until it has settled."""
    random = np.random.default_rng(build)
    twin = mc.VirtualSensor(made.sensor, seed=object_seed, build=build, day=build, world="plausible")
    rest = twin.advance(1.0)[0][:, -6 * SIZE :]
    string = replace(made.sensor.string, length=twin.sensor.measured_length or made.sensor.string.length)
    tension = tension_estimator(None)(rest, RATE, string, None)
    string = string if tension is None else replace(string, tension=tension)
    low, high = twin.sensor.range
    truths, peaks, repeats = list[tuple[float, float]](), list[Floats](), list[Floats]()
    lowest = 0.8 * open_frequency(string)
    for number in range(touches):
        twin.press(random.uniform(low, high), random.uniform(*FORCES), material="plastic")
        twin.advance(0.11 + made.chosen.settling)
        sound, labels = twin.advance(SIZE / RATE)
        truths.append((float(np.nanmean(labels["position"])), float(np.nanmean(labels["force"]))))
        peaks.append(peaks_of(sound, lowest))
        if number % REPEATED == 0:
            again = peaks_of(twin.advance(SIZE / RATE)[0], lowest)
            one, two = pairs_of(np.array([peaks[-1], again]))
            repeats.append(np.log(two / one))
        twin.release()
        twin.advance(0.12)
    position, force = np.array(truths).T
    return Take(
        string=string, position=position, force=force, peaks=np.array(peaks), repeats=np.array(repeats)
    )


def peaks_of(sound: Audio, lowest: float) -> Floats:
    """Return the strongest peaks of each microphone that are louder there, (2, `PEAKS`, 2): Hz and power.

    >>> t = np.arange(SIZE) / RATE
    >>> one, two = (np.sin(2.0 * np.pi * f * t) for f in (1312.3, 1644.7))
    >>> peaks_of(np.array([one + 0.2 * two, 0.2 * one + two]), 800.0)[:, 0, 0].round(1)
    array([1312.3, 1644.7])
    """
    size = PADDING * sound.shape[1]
    centred = sound - sound.mean(axis=1, keepdims=True)
    power = np.abs(np.fft.rfft(centred * np.hanning(sound.shape[1]), size)) ** 2 + 1e-30
    first, last = int(lowest * size / RATE), int(HIGHEST * size / RATE)
    peaks = np.zeros((2, PEAKS, 2))
    for channel, own in enumerate(power):
        reach = np.max([np.roll(own, shift) for shift in range(-2 * PADDING, 2 * PADDING + 1)], axis=0)
        at = np.flatnonzero((own >= reach) & (own > power[1 - channel]))
        at = at[(at > first) & (at < last)]
        at = at[np.argsort(-own[at])][:PEAKS]
        below, level, above = (np.log(own[at + shift]) for shift in (-1, 0, 1))
        shift = 0.5 * (below - above) / (below - 2.0 * level + above)
        peaks[channel, : len(at)] = np.column_stack([(at + shift) * RATE / size, own[at]])
    return peaks


def pairs_of(peaks: Floats) -> Floats:
    """Return a line of each segment (n, 2) from `peaks_of` windows (n, 2, `PEAKS`, 2).

    The louder microphone has its strongest peak, the other its strongest that is no multiple of that: loud
    drivers sound harmonics at both ends.
    """
    lines = np.empty((len(peaks), 2))
    for row, window in enumerate(peaks):
        loud = int(window[:, 0, 1].argmax())
        anchor = max(float(window[loud, 0, 0]), 1.0)
        other = window[1 - loud]
        share = other[:, 0] / anchor
        multiple = np.abs(share - np.rint(share)) < MULTIPLE * np.maximum(share, 1.0)
        free = np.flatnonzero((other[:, 1] > 0.0) & ~multiple)
        quiet = float(other[free[0] if len(free) else 0, 0])
        lines[row] = (anchor, quiet) if loud == 0 else (quiet, anchor)
    return np.maximum(lines, 1.0)


class PairOfLines:
    """Estimates position and force from one line of each segment, after known touches."""

    def __init__(self, known: Sequence[Take]) -> None:
        parts = [_modes_of(take) for take in known]
        places, modes = (np.concatenate(each) for each in zip(*parts, strict=True))
        _, own, count = np.unique(modes, axis=0, return_inverse=True, return_counts=True)
        sure = np.isfinite(places).all(axis=1) & (count[own] >= MIN_PAIRS)
        self._classes, self._class = np.unique(modes[sure], axis=0, return_inverse=True)
        self._places = places[sure]
        x = np.concatenate([take.position / take.string.length for take in known])[sure]
        force = np.concatenate([take.force for take in known])[sure]
        inputs = _inputs(self._places, modes[sure])
        off = x - inputs[:, 0]
        self._position = _without_outliers(_fitted(inputs, off), inputs, off)
        self._force = _without_outliers(_fitted(inputs, force), inputs, force)

    def __call__(self, take: Take) -> tuple[Floats, Floats]:
        """Return the estimates of position in m and force in N, (n,) each."""
        lines = take.lines
        places, modes = np.empty_like(lines), np.empty_like(lines)
        for row, line in enumerate(lines):
            each = _fundamentals(take.string, line, self._classes)
            off = np.square((each[self._class] - self._places) / SAME).sum(axis=1)
            near = np.bincount(self._class, np.exp(-0.5 * off), len(self._classes))
            best = int(near.argmax()) if near.max() > 1e-6 else int(self._class[off.argmin()])
            places[row], modes[row] = each[best], self._classes[best]
        inputs = _inputs(places, modes)
        x = np.clip(inputs[:, 0] + self._position.predict(inputs), 0.0, 1.0)
        return take.string.length * x, np.clip(self._force.predict(inputs), 0.0, 1.2 * FORCES[1])


def _fundamentals(string: StringParams, lines: Floats, modes: Floats) -> Floats:
    """Return logarithms of fundamentals without stiffness over the open pitch, of lines and modes (n, 2)."""
    own = plain = lines / modes
    for _ in range(3):
        length = string.length * own[:, ::-1] / own.sum(axis=1, keepdims=True)
        own = plain / np.sqrt(1.0 + inharmonicity(string, 1.0) * np.square(modes / length))
    return np.log(own / open_frequency(string))


def _modes_of(take: Take) -> tuple[Floats, Floats]:
    """Return known touches' fundamentals as of `_fundamentals` (n, 2), NaN if unclear, and their modes."""
    pairs = zip(take.position, take.force, strict=True)
    expected = np.array([split_frequencies(take.string, x, force, "geometric") for x, force in pairs])
    length = np.column_stack([take.position, take.string.length - take.position])
    number = np.arange(1.0, MAX_MODE + 1.0)[:, None, None]
    partials = number * np.sqrt(1.0 + inharmonicity(take.string, 1.0) * np.square(number / length))
    lines = take.lines
    off = np.abs(np.log(lines / expected / partials))
    places = _fundamentals(take.string, lines, modes := off.argmin(axis=0) + 1.0)
    return np.where((off.min(axis=0) < CLEAR).all(axis=1)[:, None], places, np.nan), modes


def _inputs(places: Floats, modes: Floats) -> Floats:
    """Return the place over the length, the rise of the tension, and both modes, (n, 4)."""
    one, two = np.exp(places).T
    return np.column_stack([two / (one + two), np.square(one * two / (one + two)) - 1.0, modes])


def _fitted(inputs: Floats, target: Floats) -> Any:
    """Return the likeliest Gaussian process of a grid, on inputs (n, 4)."""
    process: Any = GaussianProcessRegressor
    covariance: Any = Matern
    grid: list[Any] = [
        make_pipeline(
            StandardScaler(),
            process(
                covariance([along, along, modes, modes], nu=2.5) + WhiteKernel(noise),
                optimizer=None,
                normalize_y=True,
            ),
        ).fit(inputs, target)
        for along, modes, noise in product((0.6, 1.2, 2.5, 5.0), (0.15, 0.6, 3.0), (1e-4, 1e-3, 1e-2, 1e-1))
    ]
    return max(grid, key=lambda each: each[-1].log_marginal_likelihood_value_)


def _without_outliers(process: Any, inputs: Floats, target: Floats) -> Any:
    """Return a process fitted again to what it does not miss by far."""
    off = np.abs(process.predict(inputs) - target)
    near = off <= OUTLIER * max(float(np.median(off)), 1e-9)
    return process.fit(inputs[near], target[near])


@dataclass(frozen=True, slots=True, kw_only=True)
class Scored:
    """Errors of position in m and force in N of scored touches, and their bounds, (n, 2); builds (n,)."""

    errors: Floats
    bounds: Floats
    build: Floats

    def figures(self) -> dict[str, Any]:
        """Return for both quantities the error, the bound, and how many times the bound the error is.

        All are standard deviations: half the width that holds 68 % of the errors. Intervals hold 95 %, over
        builds where there are several, else over touches.
        """
        size = np.abs(self.errors)
        far = size[:, 0] > FAR_OFF
        result: dict[str, Any] = {"touches": len(size), "far_off": round(float(far.mean()), 4)}
        for column, name in enumerate(("position", "force")):
            own, times = size[:, column], size[:, column] / self.bounds[:, column]
            result[name] = {
                "error": _rounded(np.percentile(own, CENTRAL)),
                "interval": self._interval(own),
                "mean_absolute": _rounded(own.mean()),
                "bound": _rounded(np.sqrt(np.mean(self.bounds[:, column] ** 2))),
                "times_bound": _rounded(np.percentile(times, CENTRAL)),
                "times_interval": self._interval(times),
            }
        return result

    def _interval(self, values: Floats) -> list[float]:
        random = np.random.default_rng(0)
        blocks = [np.flatnonzero(self.build == each) for each in np.unique(self.build)]
        if len(blocks) == 1:
            blocks = [np.array([row]) for row in range(len(values))]
        drawn = [
            np.percentile(
                values[np.concatenate([blocks[k] for k in random.integers(len(blocks), size=len(blocks))])],
                CENTRAL,
            )
            for _ in range(DRAWS)
        ]
        return [_rounded(each) for each in np.percentile(drawn, (2.5, 97.5))]


def scored(made: Any, known: Sequence[Take], test: Sequence[Take]) -> Scored:
    """Return errors and bounds of the touches `test` after the touches `known`; `made` has the bounds."""
    estimate = PairOfLines(known)
    errors, bounds, builds = list[Floats](), list[Any](), list[int]()
    for number, take in enumerate(test):
        x, force = estimate(take)
        errors.append(np.column_stack([x - take.position, force - take.force]))
        pairs = zip(take.position.tolist(), take.force.tolist(), strict=True)
        bounds += [made.bounds(Contact(position=p, force=f)) for p, f in pairs]
        builds += [number] * len(take.position)
    return Scored(errors=np.concatenate(errors), bounds=np.array(bounds), build=np.array(builds, float))


def with_knowledge(made: Any, knowledge: Mapping[str, Any]) -> Any:
    """Return the same string's design for another knowledge of build and object."""
    string, wishes = made.chosen.string, made.wishes
    own = {"gauge": string.core_diameter, "tension": string.tension, "length": string.length}
    room = min(wishes.range, string.length - 0.0901)
    return mc.design(**own, range=room, gap=wishes.gap, model="none", **knowledge)


def of_design(made: Any, take: Take) -> dict[str, Any]:
    """Return a random design's figures."""
    known, test = take.part(slice(KNOWN_TOUCHES)), take.part(slice(KNOWN_TOUCHES, None))
    string = made.chosen.string
    return {
        "gauge": string.core_diameter,
        "tension": string.tension,
        "length": string.length,
        "cents_per_newton": _rounded(made.chosen.cents_per_newton),
        "design_force_std": _rounded(made.chosen.force_std),
        "repeats": [_rounded(each) for each in np.median(np.abs(take.repeats), axis=0)],
        **scored(with_knowledge(made, CALIBRATED), [known], [test]).figures(),
    }


def of_tension(made: Any, takes: Sequence[Take]) -> dict[str, Any]:
    """Return the figures of a tension: of unseen builds and objects, and what the tension costs."""
    one = made.chosen
    return {
        "tension": one.string.tension,
        "cents_per_newton": _rounded(one.cents_per_newton),
        "settling": _rounded(one.settling),
        "clearance": _rounded(one.clearance),
        "stress_share": _rounded(one.stress_share),
        "ambiguous": _rounded(made.ambiguity.share),
        "training_builds": TRAINING,
        "unseen_builds": len(takes) - TRAINING,
        **scored(with_knowledge(made, UNKNOWN_OBJECT), takes[:TRAINING], takes[TRAINING:]).figures(),
    }


def summary_of(designs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return how bounds and errors of designs compare: ranks, and bounds above an error's interval."""

    def ranks(bound: Callable[[Mapping[str, Any]], float], name: str) -> float:
        achieved = [each[name]["error"] for each in designs]
        both: Any = spearmanr([bound(each) for each in designs], achieved)
        return round(float(both.statistic), 3)

    above = {
        name: sum(each[name]["times_interval"][1] < 1.0 for each in designs) for name in ("position", "force")
    }
    return {
        "designs": len(designs),
        "bound_above": above,
        "least_times_bound": {
            name: min(each[name]["times_bound"] for each in designs) for name in ("position", "force")
        },
        "spearman_force": ranks(lambda each: each["force"]["bound"], "force"),
        "spearman_design_force_std": ranks(lambda each: each["design_force_std"], "force"),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """Takes in a folder, which are rendered once."""

    folder: Path

    def take(self, name: str, made: Any, **touched: int) -> Take:
        """Return a take by its name, rendered if it is not there."""
        file = self.folder / f"{name}.npz"
        if not file.exists():
            take = take_of(made, **touched)
            self.folder.mkdir(parents=True, exist_ok=True)
            arrays = {key: getattr(take, key) for key in ARRAYS}
            np.savez(file, length=take.string.length, tension=take.string.tension, **arrays)
        with np.load(file) as kept:
            string = replace(made.sensor.string, length=float(kept["length"]), tension=float(kept["tension"]))
            return Take(string=string, **{key: kept[key] for key in ARRAYS})


def random_designs(
    kept: Kept, count: int, draw: int, progress: Callable[[str, int, int], None]
) -> list[dict[str, Any]]:
    """Return the figures of so many random designs; each `draw` has other designs and another build."""
    random, (object_seed,) = np.random.default_rng(SEED + draw), bolted(1)
    rows = list[dict[str, Any]]()
    for number in range(count):
        made = random_design(random)
        take = kept.take(
            f"design_{draw}_{number}",
            made,
            build=BUILD + draw,
            object_seed=object_seed,
            touches=KNOWN_TOUCHES + TEST_TOUCHES,
        )
        rows.append(of_design(made, take))
        progress(f"designs, draw {draw + 1}", number + 1, count)
    return rows


def tensions(kept: Kept, progress: Callable[[str, int, int], None]) -> list[dict[str, Any]]:
    """Return the figures of the prototype's string at `COMPARED`."""
    objects, rows = bolted(TRAINING + UNSEEN, 100), list[dict[str, Any]]()
    for done, tension in enumerate(COMPARED):
        made = mc.design(gauge=0.254e-3, tension=tension, length=0.2, range=0.11, gap=GAP, model="none")
        takes = [
            kept.take(
                f"tension_{tension:.0f}_{number}",
                made,
                build=950 + number,
                object_seed=objects[number],
                touches=PER_BUILD,
            )
            for number in range(TRAINING + UNSEEN)
        ]
        rows.append(of_tension(made, takes))
        progress("tensions", done + 1, len(COMPARED))
    return rows


FILE = click.Path(path_type=Path, dir_okay=False)


@click.command(help=__doc__)
@click.option("--designs", type=click.IntRange(3), default=20, help="Random designs of a draw.")
@click.option(
    "--draws", type=click.IntRange(1), default=3, help="Draws of designs, each with a build of its own."
)
@click.option("--scratch", type=click.Path(path_type=Path, file_okay=False), default=Path("design_bounds"))
@click.option(
    "--json", "numbers", type=click.Path(path_type=Path, dir_okay=False), help="File of the figures."
)
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="PNG of the figure.")
def design_bounds(designs: int, draws: int, scratch: Path, numbers: Path | None, out: Path | None) -> None:
    """Render, learn, score and print both tables."""
    kept = Kept(folder=scratch)
    with progress_bar("design bounds") as progress:
        each_draw = [random_designs(kept, designs, draw, progress) for draw in range(draws)]
        compared = tensions(kept, progress)
    drawn, summary = [row for rows in each_draw for row in rows], [summary_of(rows) for rows in each_draw]
    result = {"simulated": True, "summary": summary, "designs": drawn, "tensions": compared}
    print(*map(json.dumps, summary), sep="\n")
    heads = ("", "mm, bound", "mm", "N, bound", "N", "times bound", "far off")
    print(*lines_of(heads, [_row(f"{_name(each)}", each) for each in (*drawn, *compared)]), sep="\n")
    if numbers is not None:
        numbers.write_text(_text_of(result), encoding="utf-8")
    if out is not None:
        _draw(result, out)


def _text_of(result: Mapping[str, Any]) -> str:
    """Return JSON with a row in each line."""
    lists = {name: ",\n".join(map(json.dumps, rows)) for name, rows in result.items() if name != "simulated"}
    parts = ['"simulated": true', *(f'"{name}": [\n{rows}\n]' for name, rows in lists.items())]
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _name(row: Mapping[str, Any]) -> str:
    if "gauge" not in row:
        return f"prototype at {row['tension']:.0f} N"
    return f"{1e3 * row['gauge']:.3f} mm, {row['tension']:.0f} N, {1e3 * row['length']:.0f} mm"


def _row(name: str, row: Mapping[str, Any]) -> tuple[str, ...]:
    x, force = row["position"], row["force"]
    cells = (1e3 * x["bound"], 1e3 * x["error"], force["bound"], force["error"], force["times_bound"])
    return (name, *(f"{each:.3g}" for each in cells), f"{row['far_off']:.1%}")


def _rounded(value: Any) -> float:
    return float(f"{float(value):.4g}")


def _draw(result: Mapping[str, Any], path: Path) -> None:
    """Draw error over bound of the random designs, and what three tensions reach."""
    drawing = style.canvas(62.0)
    axes = drawing.subplots(1, 3)
    _draw_designs(axes[0], result["designs"], "position", 1e3, "position (mm)")
    _draw_designs(axes[1], result["designs"], "force", 1.0, "force (N)")
    rows = result["tensions"]
    x = [each["tension"] for each in rows]
    error = np.array([each["force"]["error"] for each in rows])
    low, high = np.array([each["force"]["interval"] for each in rows]).T
    axes[2].errorbar(x, error, [error - low, high - error], marker="o", label="unseen builds, twin")
    axes[2].plot(x, [each["force"]["bound"] for each in rows], linestyle=style.THEORY, label="bound")
    style.dress(axes[2], "C", "", "tension (N)", "error of force (N)")
    axes[2].set_ylim(0.0, 1.4 * float(high.max()))
    axes[2].legend(fontsize=style.TICK, frameon=False)
    drawing.savefig(path, dpi=150)


def _draw_designs(axis: Any, rows: Sequence[Mapping[str, Any]], name: str, factor: float, label: str) -> None:
    bound = factor * np.array([each[name]["bound"] for each in rows])
    error = factor * np.array([each[name]["error"] for each in rows])
    low, high = factor * np.array([each[name]["interval"] for each in rows]).T
    colours = [each["tension"] for each in rows]
    axis.errorbar(bound, error, [error - low, high - error], fmt="none", ecolor="0.7", zorder=1)
    points = axis.scatter(bound, error, c=colours, cmap="viridis", zorder=2, s=18)
    ends = np.array([bound.min(), max(error.max(), bound.max())])
    axis.plot(ends, ends, color="0.5", linewidth=0.8)
    axis.set(xscale="log", yscale="log")
    style.dress(axis, "A" if name == "position" else "B", "", f"bound, {label}", f"error, {label}")
    bar = axis.figure.colorbar(points, ax=axis)
    bar.set_label("tension (N)", fontsize=style.LABEL)
    bar.ax.tick_params(labelsize=style.TICK)


if __name__ == "__main__":
    main(design_bounds)
