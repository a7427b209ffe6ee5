"""Trains the networks that read modes: one for positions, and one for the lines of a window.

Makes the networks of `monochord.perception.closed_form`, in some twenty minutes on two cores, from datasets
that take half an hour:

    monochord collect studies/plans/modes.toml --out sessions
    monochord build sessions --split build --skip --out modes
    monochord collect studies/plans/modes_2.toml --out more-sessions
    monochord build more-sessions --split build --skip --out modes_2
    python -m studies.mode_networks modes modes_2 --judge builds

It takes touched windows of the training part, lists the hypotheses of each, and raises the probability of
those that put the touch where it is. Every window counts twice, once as it is and once with its ends swapped.
A network that learned from one half of the builds estimates how probable places are, which is among the
evidence; the ranking learns from the other half, and so how far to trust it on builds that it has not seen.
Some get noise, some are cut in half, and the string's pitch is known to some per mille only, as live. The
network is scored on the validation part, without noise, and on the datasets that are to judge it. The builds
that models are trained on are not among those that it learns from: what it misreads there is then what it
misreads on any build, and a model learns how far to trust it. Test parts are not looked at.

Windows of another kind are added: of every string that has a preset, clamped ideally, with no sound but two
sustained lines, their multiples, and hiss. They stand for sensors that sound cleaner than those in datasets.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, TypeAlias

import click
import numpy as np
from numpy.typing import NDArray
from studies._command import main
from studies._place_network import Cells, exported, probabilities_of, train_places

from monochord.core.errors import InputError
from monochord.core.types import Audio, Flags, Floats, Indices, StringParams
from monochord.datasets import Augmentation, Dataset, Split, open_dataset
from monochord.dsp import NOISES
from monochord.perception.closed_form import (
    COMMON_MEASURES,
    MAX_DEVIATION,
    MAX_MODE_1,
    PLACE_MEASURES,
    PLACES,
    POSITION,
    SEGMENT_MEASURES,
    TRAINED_RISE,
    PlaceNetwork,
    Ranking,
    SpectrumAnalyser,
    cells_of,
    density,
    find_hypotheses,
    measure_hypotheses,
    measure_places,
    most_probable,
    probabilities,
    prominences,
    string_model,
)
from monochord.perception.training import torch_library
from monochord.physics.strings import load_string, string_names
from monochord.physics.theory import open_frequency

READ_FROM = Path("src/monochord/perception/closed_form")
"""The package's file of both networks, in the repository."""
RANKING_FILE, PLACES_FILE = "mode_ranking.safetensors", "place_density.safetensors"
HIDDEN = (64, 32)
EPOCHS, BATCH, RATE, DECAY = 8, 256, 3.0e-3, 0.1
WINDOWS = 80
"""Windows per session."""
RIGHT, RIGHT_BESIDE_BEST = 0.015, 0.0035
"""Distance from the touch for a correct hypothesis, and beyond the nearest one, over the length.
"""
PITCH_STD, UNTUNED_SHARE, UNTUNED = 0.0015, 0.25, (-0.008, 0.015)
"""Standard deviation of the known pitch; share of windows with a detuned string, and its deviation."""
NOISY_SHARE, RATIOS, HALF_SHARE = 0.4, (5.0, 30.0), 0.2
"""Share of windows with noise and the ratios in dB; share of half-length windows."""


Part: TypeAlias = Literal["train", "validation"]
Example: TypeAlias = tuple[Floats, Floats, Cells, float, int]
PURE_WINDOWS = 6000
"""Number of windows with only two sustained lines."""
STRAY_SHARE = 0.3
"""Share of them with one further weak line that belongs to neither."""
UNKNOWN_SHARE = 0.2
"""Share of windows with equally probable positions, as for a string of unknown pitch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Examples:
    """Hypotheses of touched windows, concatenated window by window.

    `measures` (hypotheses, measures), `position` (hypotheses,) over the length, `window` (hypotheses,) that
    each is of; `cells` (windows, channels, cells), what the network of places sees, `truth` (windows,) over
    the length, and `build` (windows,), of which each is.
    """

    measures: Audio
    position: Floats
    window: Indices
    cells: Cells
    truth: Floats
    build: Indices

    @property
    def first(self) -> Indices:
        """The first hypothesis of each window, and their count."""
        return np.searchsorted(self.window, np.arange(len(self.truth) + 1))

    @property
    def right(self) -> Flags:
        """Whether each hypothesis gives the correct position."""
        error = np.abs(self.position - self.truth[self.window])
        least = np.full(len(self.truth), np.inf)
        np.minimum.at(least, self.window, error)
        return (error < RIGHT) & (error < least[self.window] + RIGHT_BESIDE_BEST)


def examples_of(path: Path, part: Part, design: StringParams, *, clean: bool = False) -> Examples:
    """Return the examples of a part of a dataset; `clean` ones are whole, tuned, and without noise."""
    dataset, split = open_dataset(path), Split.read(path / "split.json")
    return joined(_examples(dataset, split.parts[part], design, clean=clean))


def joined(examples: Iterable[Example]) -> Examples:
    """Return the examples of windows: measures, hypotheses, cells, touch positions, and builds.

    Raises `InputError` where there is none.
    """
    parts = list(examples)
    if not parts:
        raise InputError("a part without a touched window of known position", "one or more", "collect more")
    count = [len(part[0]) for part in parts]
    return Examples(
        measures=np.concatenate([part[0] for part in parts]).astype(np.float32),
        position=np.concatenate([part[1] for part in parts]),
        window=np.repeat(np.arange(len(parts)), count),
        cells=np.array([part[2] for part in parts], np.float16),
        truth=np.array([part[3] for part in parts]),
        build=np.array([part[4] for part in parts]),
    )


def _examples(
    dataset: Dataset, chosen: Indices, design: StringParams, *, clean: bool, seed: int = 0
) -> Iterator[Example]:
    contact, position = dataset.label("contact"), dataset.label("position")
    random = np.random.default_rng(seed)
    noise = Augmentation(kinds=tuple(NOISES), share=NOISY_SHARE, ratios=RATIOS)
    touched = (contact == 1.0) & np.isfinite(position) & dataset.usable
    touched &= np.isin(np.arange(len(dataset)), chosen)
    rate, size, length = dataset.manifest.sample_rate, dataset.manifest.window, design.length
    for number, part in enumerate(dataset.manifest.parts):
        rows = np.flatnonzero(touched & (dataset.session == number))
        rows = np.sort(random.choice(rows, min(WINDOWS, len(rows)), replace=False))
        own = replace(design, tension=part.tension or design.tension)
        for row in rows.tolist():
            window: Audio = np.array(dataset.window(row))
            string = own
            if not clean:
                window = noise(window[np.newaxis], [row], seed=seed)[0]
                window = window[:, : size // 2] if random.random() < HALF_SHARE else window
                off = (
                    random.uniform(*UNTUNED)
                    if random.random() < UNTUNED_SHARE
                    else random.normal(0.0, PITCH_STD)
                )
                string = replace(own, tension=own.tension * (1.0 + off) ** 2)
            frames = window.shape[1]
            analyser = _unread(string, rate, frames)
            yield from _example(analyser, window, float(position[row]) / length, part.build or 0)


def _example(analyser: SpectrumAnalyser, window: Audio, truth: float, build: int) -> Iterator[Example]:
    """Yield the hypotheses of a window, if it has any."""
    (_, _, power, peaks), string, spacing = analyser.transformed(window), analyser.model, analyser.bin_spacing
    hypotheses = find_hypotheses(*peaks, string)
    if len(hypotheses):
        above = prominences(power, peaks[1])
        measures = measure_hypotheses(hypotheses, *peaks, power, above, spacing, string)
        cells = cells_of(power, peaks[1], above, spacing, string)
        yield measures, hypotheses[:, POSITION] / string.length, cells.astype(np.float16), truth, build


def pure_examples(seed: int = 0) -> Iterator[Example]:
    """Yield windows of two ideal segments for all string presets, with negative build numbers."""
    random, rate = np.random.default_rng(seed), 44100
    analysers = [
        _unread(string, rate, round(bins * rate / open_frequency(string)))
        for string in (load_string(name).string for name in string_names())
        for bins in (16.0, 40.0, 130.0)
    ]
    for number in range(PURE_WINDOWS):
        analyser = analysers[random.integers(len(analysers))]
        place, off = random.uniform(0.1, 0.9), random.uniform(-0.003, TRAINED_RISE)
        time, takes = np.arange(analyser.size) / rate, list[Floats]()
        for share in (place, 1.0 - place):
            side, mode = share * analyser.length, min(int(random.geometric(0.5)), MAX_MODE_1)
            line = analyser.partials(analyser.nominal * (1.0 + off) / share, side, mode)[-1]
            multiples = np.arange(1.0, 1.0 + random.integers(1, 5))
            multiples = multiples[multiples * line < 0.45 * rate]
            loudness = random.uniform(0.3, 1.0) * multiples ** -random.uniform(1.0, 4.0)
            phase = random.uniform(0.0, 2.0 * np.pi, multiples.size)
            takes.append(loudness @ np.sin(2.0 * np.pi * line * np.outer(multiples, time) + phase[:, None]))
        through = random.uniform(0.05, 0.5)
        window = np.array([[1.0, through], [through, 1.0]]) @ np.array(takes).reshape(2, -1)
        if random.random() < STRAY_SHARE:
            stray = np.sin(2.0 * np.pi * random.uniform(0.02, 0.4) * rate * time)
            window += 10.0 ** random.uniform(-3.0, -1.3) * np.outer(random.random(2), stray)
        window += 10.0 ** random.uniform(-7.0, -2.0) * random.standard_normal(window.shape)
        yield from _example(analyser, window.astype(np.float32), place, -1 - number)


def _unread(string: StringParams, rate: int, size: int) -> SpectrumAnalyser:
    """Return an analyser that transforms: to read modes takes the networks that are trained here."""
    return SpectrumAnalyser(string=string, sample_rate=rate, size=size, model=string_model(string))


def mirrored(measures: NDArray[Any]) -> NDArray[Any]:
    """Return the measures for the same touch with both ends of the string swapped."""
    ends = COMMON_MEASURES, COMMON_MEASURES + SEGMENT_MEASURES, PLACE_MEASURES
    both, first, second, place = np.split(measures, ends, axis=1)
    return np.concatenate((both, second, first, place), axis=1)


def together(*parts: Examples) -> Examples:
    """Return several lists of examples combined."""
    first = np.cumsum([0, *(len(part.truth) for part in parts)])
    return Examples(
        measures=np.concatenate([part.measures for part in parts]),
        position=np.concatenate([part.position for part in parts]),
        window=np.concatenate([part.window + at for part, at in zip(parts, first, strict=False)]),
        cells=np.concatenate([part.cells for part in parts]),
        truth=np.concatenate([part.truth for part in parts]),
        build=np.concatenate([part.build for part in parts]),
    )


def chosen(examples: Examples, windows: Flags) -> Examples:
    """Return the examples of some windows (windows,)."""
    rows = windows[examples.window]
    return Examples(
        measures=examples.measures[rows],
        position=examples.position[rows],
        window=(np.cumsum(windows) - 1)[examples.window[rows]],
        cells=examples.cells[windows],
        truth=examples.truth[windows],
        build=examples.build[windows],
    )


def both_ways(examples: Examples, network: Any, *, seed: int = 0) -> Audio:
    """Return the measures as they are, then with both ends swapped, with positions from a torch network."""
    unknown = np.random.default_rng(seed).random(len(examples.truth)) < UNKNOWN_SHARE
    ways = [examples.measures.copy(), mirrored(examples.measures)]
    for way, measures in enumerate(ways):
        probability = probabilities_of(network, examples.cells, swapped=way == 1)
        probability[unknown] = 1.0 / len(PLACES)
        _fill_in_places(measures, examples, probability, swapped=way == 1)
    return np.concatenate(ways)


def with_places(examples: Examples, network: PlaceNetwork) -> Examples:
    """Return examples with position measures from a network in the package."""
    measures = examples.measures.copy()
    probability = np.array([density(cells.astype(np.float32), network) for cells in examples.cells])
    _fill_in_places(measures, examples, probability)
    return replace(examples, measures=measures)


def _fill_in_places(
    measures: Audio, examples: Examples, probability: Floats, *, swapped: bool = False
) -> None:
    place = 1.0 - examples.position if swapped else examples.position
    for (begin, end), probable in zip(pairwise(examples.first), probability, strict=True):
        measure_places(measures[begin:end], place[begin:end], probable)


def train_ranking(examples: Examples, measures: Audio, *, seed: int = 0) -> Ranking:
    """Return the network trained to maximise the probability of the correct hypotheses.

    `measures` are those that `both_ways` returns.
    """
    torch: Any = torch_library()
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    mean, scale = measures.mean(axis=0, dtype=float), measures.std(axis=0, dtype=float) + 1.0e-4
    swapped = np.repeat((0.0, 1.0), len(examples.measures))  # an input of its own: drivers differ
    scaled = np.clip((measures - mean) / scale, -MAX_DEVIATION, MAX_DEVIATION)
    inputs = torch.tensor(np.column_stack((scaled, swapped)), dtype=torch.float32)
    right = torch.tensor(np.tile(examples.right, 2), dtype=torch.float32)
    first, half = examples.first, len(examples.window)
    known = np.flatnonzero(np.add.reduceat(examples.right, first[:-1]))
    # One number for each window and each of its mirrored ones.
    windows = np.concatenate((known, known + len(examples.truth)))
    starts, ends = (np.concatenate((at, at + half)).tolist() for at in (first[:-1], first[1:]))
    sizes = (inputs.shape[1], *HIDDEN)
    layers = [layer for a, b in pairwise(sizes) for layer in (torch.nn.Linear(a, b), torch.nn.ReLU())]
    network = torch.nn.Sequential(*layers, torch.nn.Linear(HIDDEN[-1], 1, bias=False))
    optimiser = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
    steps = EPOCHS * (-(-len(windows) // BATCH))
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps + 1, pct_start=0.1)
    for _ in range(EPOCHS):
        order = random.permutation(windows)
        for begin in range(0, len(order), BATCH):
            batch = order[begin : begin + BATCH]
            rows = torch.tensor(np.concatenate([np.arange(starts[w], ends[w]) for w in batch.tolist()]))
            of = torch.tensor(np.repeat(np.arange(len(batch)), np.tile(np.diff(first), 2)[batch]))
            scores = network(inputs[rows])[:, 0]
            highest = torch.full((len(batch),), -torch.inf).scatter_reduce(0, of, scores.detach(), "amax")
            likelihood = torch.exp(scores - highest[of])
            total = torch.zeros(len(batch)).index_add(0, of, likelihood)
            hit = torch.zeros(len(batch)).index_add(0, of, likelihood * right[rows])
            loss = -torch.log((hit / total).clamp_min(1.0e-7)).mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    weights = [value.detach().double().numpy() for value in network.parameters()]
    matrices = [np.ascontiguousarray(value.T) if value.ndim == 2 else value for value in weights]
    matrices[0] = matrices[0][:-1]  # what is read is never swapped
    return Ranking(mean, scale, *(value.astype(np.float32).astype(float) for value in matrices))


def places_of(examples: Examples, ranking: Ranking) -> tuple[Floats, Floats]:
    """Return each window's position (windows,), relative to the length, and its lead."""
    place, lead = np.empty(len(examples.truth)), np.empty(len(examples.truth))
    first = examples.first
    for k, (begin, end) in enumerate(pairwise(first)):
        probability = probabilities(examples.measures[begin:end].astype(float), ranking)
        best, lead[k], _ = most_probable(examples.position[begin:end], probability)
        place[k] = examples.position[begin + best]
    return place, lead


def write_network(network: Ranking | PlaceNetwork, file: Path) -> None:
    """Write a network to a file in single precision; the same network gives the same bytes."""
    from safetensors.numpy import save  # noqa: PLC0415

    file.write_bytes(save({name: value.astype(np.float32) for name, value in network._asdict().items()}))


@click.command()
@click.argument("datasets", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--judge", multiple=True, type=click.Path(path_type=Path), help="Dataset to score on; repeatable."
)
@click.option("--string", default="prototype", show_default=True, help="Sensor design of the builds.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    default=READ_FROM,
    show_default=True,
    help="Folder for both networks.",
)
def mode_networks(*, datasets: tuple[Path, ...], judge: tuple[Path, ...], string: str, out: Path) -> None:
    """Train on the training parts of DATASETS, score on other builds, and write both networks.

    Each dataset has the split that monochord build made.
    """
    design = load_string(string).string
    train = [examples_of(path, "train", design) for path in datasets]
    examples = together(*train, joined(pure_examples()))
    teaching = examples.build % 2 == 0
    seen = chosen(examples, teaching)
    witness = train_places(seen.cells, seen.truth, name="places of one half")
    judged = chosen(examples, ~teaching | (examples.build < 0))  # pure lines are no one's to know by heart
    ranking = train_ranking(judged, both_ways(judged, witness))
    write_network(ranking, out / RANKING_FILE)
    places = exported(train_places(examples.cells, examples.truth))
    write_network(places, out / PLACES_FILE)
    for path in datasets:
        validation = with_places(examples_of(path, "validation", design, clean=True), places)
        _report(f"{path}, validation", validation, ranking, design)
    for path in judge:
        both = [examples_of(path, part, design, clean=True) for part in ("train", "validation")]
        judged = with_places(together(*both), places)
        _report(f"{path}, training and validation", judged, ranking, design)


def _report(name: str, examples: Examples, ranking: Ranking, design: StringParams) -> None:
    """Print the answered share and the accuracy, by smallest lead."""
    place, lead = places_of(examples, ranking)
    error = np.abs(place - examples.truth) * design.length * 1e3
    print(f"{name}: {len(error)} windows")
    for least in (-np.inf, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0):
        some = error[lead >= least]
        if some.size:
            within = " ".join(f"{limit} mm {np.mean(some < limit):.4f}" for limit in (5, 2, 1))
            answered = f"lead from {least:g}: {len(some) / len(error):.3f} answered"
            print(f"  {answered}, within {within}, mean {some.mean():.2f} mm")


if __name__ == "__main__":
    main(mode_networks)
