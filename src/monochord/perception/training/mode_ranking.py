"""Trains the network that ranks what a window's lines may be (`monochord.perception.closed_form.ranking`).

    monochord collect modes --out sessions
    monochord build sessions --split build --skip --out modes
    python -m monochord.perception.training.mode_ranking modes --judge builds

It takes touched windows of the training part, lists the hypotheses of each, and raises the probability of
those that put the touch where it is. Every window counts twice, once as it is and once with its ends swapped.
Some get noise, some are cut in half, and the string's pitch is known to some per mille only, as live. The
network is scored on the validation part, without noise, and on the datasets that are to judge it. The builds
that models are trained on are not among those that it learns from: what it misreads there is then what it
misreads on any build, and a model learns how far to trust it. Test parts are not looked at.

Windows of another kind are added: of every string that has a preset, clamped ideally, with no sound but two
sustained lines, their multiples, and hiss. They stand for sensors that sound cleaner than those in datasets.
"""

import argparse
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Flags, Floats, Indices, Signal, StringParams
from monochord.datasets.augment import Augmentation
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.perception.closed_form.hypotheses import (
    COMMON_MEASURES,
    MAX_MODE_1,
    POSITION,
    SEGMENT_MEASURES,
    TRAINED_RISE,
    find_hypotheses,
    measure_hypotheses,
)
from monochord.perception.closed_form.modes import most_probable
from monochord.perception.closed_form.prominence import prominences
from monochord.perception.closed_form.ranking import FILE, MAX_DEVIATION, Ranking, probabilities
from monochord.perception.closed_form.spectrum import SpectrumAnalyser
from monochord.perception.training._torch import torch_library
from monochord.physics.strings import load_string, string_names
from monochord.physics.theory import open_frequency

HIDDEN = (64, 32)
EPOCHS, BATCH, RATE, DECAY = 8, 256, 3.0e-3, 0.1
WINDOWS = 80
"""Windows of a session."""
RIGHT, RIGHT_BESIDE_BEST = 0.015, 0.0035
"""Distance from the touch of a right hypothesis, and beyond that of the nearest: shares of the length."""
PITCH_STD, UNTUNED_SHARE, UNTUNED = 0.0015, 0.25, (-0.008, 0.015)
"""Deviation of the known pitch; share of windows whose string was not tuned, and by how much it is off."""
NOISY_SHARE, RATIOS, HALF_SHARE = 0.4, (5.0, 30.0), 0.2
"""Share of windows with noise and its ratios in dB; share of those cut in half."""


Part: TypeAlias = Literal["train", "validation"]
Example: TypeAlias = tuple[Floats, Floats, float]
PURE_WINDOWS = 6000
"""Windows of two sustained lines alone."""
STRAY_SHARE = 0.3
"""Share of them with one weak line more, of neither."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Examples:
    """Hypotheses of touched windows, those of a window one after another.

    `measures` (hypotheses, measures), `position` (hypotheses,) over the length, `window` (hypotheses,) that
    each is of; `truth` (windows,) over the length.
    """

    measures: Audio
    position: Floats
    window: Indices
    truth: Floats

    @property
    def first(self) -> Indices:
        """The first hypothesis of each window, and their count."""
        return np.searchsorted(self.window, np.arange(len(self.truth) + 1))

    @property
    def right(self) -> Flags:
        """Whether each hypothesis puts the touch where it is."""
        error = np.abs(self.position - self.truth[self.window])
        least = np.full(len(self.truth), np.inf)
        np.minimum.at(least, self.window, error)
        return (error < RIGHT) & (error < least[self.window] + RIGHT_BESIDE_BEST)


def examples_of(path: Path, part: Part, design: StringParams, *, clean: bool = False) -> Examples:
    """Return the examples of a part of a dataset; `clean` ones are whole, tuned, and without noise."""
    dataset, split = open_dataset(path), Split.read(path / "split.json")
    return joined(_examples(dataset, split.parts[part], design, clean=clean))


def joined(examples: Iterable[Example]) -> Examples:
    """Return the examples of windows: measures, places over the length, and the touch's place."""
    parts = list(examples)
    count = [len(part[0]) for part in parts]
    return Examples(
        measures=np.concatenate([part[0] for part in parts]).astype(np.float32),
        position=np.concatenate([part[1] for part in parts]),
        window=np.repeat(np.arange(len(parts)), count),
        truth=np.array([part[2] for part in parts]),
    )


def _examples(
    dataset: Dataset, chosen: Indices, design: StringParams, *, clean: bool, seed: int = 0
) -> Iterator[Example]:
    contact, position = dataset.label("contact"), dataset.label("position")
    random, noise = np.random.default_rng(seed), Augmentation(share=NOISY_SHARE, ratios=RATIOS, seed=seed)
    touched = (contact == 1.0) & np.isfinite(position) & dataset.usable
    touched &= np.isin(np.arange(len(dataset)), chosen)
    rate, size, length = dataset.manifest.sample_rate, dataset.manifest.window, design.length
    analysers: dict[int, SpectrumAnalyser] = {}
    for number, part in enumerate(dataset.manifest.parts):
        rows = np.flatnonzero(touched & (dataset.session == number))
        rows = np.sort(random.choice(rows, min(WINDOWS, len(rows)), replace=False))
        own = replace(design, tension=part.tension or design.tension)
        for row in rows.tolist():
            window: Audio = np.array(dataset.window(row))
            string = own
            if not clean:
                window = noise(window[np.newaxis], [row])[0]
                window = window[:, : size // 2] if random.random() < HALF_SHARE else window
                off = (
                    random.uniform(*UNTUNED)
                    if random.random() < UNTUNED_SHARE
                    else random.normal(0.0, PITCH_STD)
                )
                string = replace(own, tension=own.tension * (1.0 + off) ** 2)
            frames = window.shape[1]
            if frames not in analysers:
                signal = Signal(sample_rate=rate, channels=2, string=design)
                analysers[frames] = SpectrumAnalyser.of(signal, frames)
            analyser = analysers[frames].tuned(string)
            yield from _example(analyser, window, float(position[row]) / length)


def _example(analyser: SpectrumAnalyser, window: Audio, truth: float) -> Iterator[Example]:
    """Yield the hypotheses of a window, if it has any."""
    spectrum, string = analyser.analyse(window), analyser.model
    found = find_hypotheses(*spectrum.peaks, string)
    if len(found):
        power, above = spectrum.power, prominences(spectrum.power, spectrum.peaks[1])
        measures = measure_hypotheses(found, *spectrum.peaks, power, above, analyser.bin_spacing, string)
        yield measures, found[:, POSITION] / string.length, truth


def pure_examples(seed: int = 0) -> Iterator[Example]:
    """Yield windows of two ideal segments of the strings that have presets."""
    random, rate = np.random.default_rng(seed), 44100
    analysers: list[SpectrumAnalyser] = []
    for name in string_names():
        string = load_string(name).string
        for bins in (16.0, 40.0, 130.0):
            size = round(bins * rate / open_frequency(string))
            analysers.append(SpectrumAnalyser.of(Signal(sample_rate=rate, channels=2, string=string), size))
    for _ in range(PURE_WINDOWS):
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
        yield from _example(analyser, window.astype(np.float32), place)


def mirrored(measures: NDArray[Any]) -> NDArray[Any]:
    """Return measures as of the same touch with both ends of the string swapped."""
    both, first, second = np.split(measures, (COMMON_MEASURES, COMMON_MEASURES + SEGMENT_MEASURES), axis=1)
    return np.concatenate((both, second, first), axis=1)


def together(*parts: Examples) -> Examples:
    """Return the examples of several lists."""
    first = np.cumsum([0, *(len(part.truth) for part in parts)])
    return Examples(
        measures=np.concatenate([part.measures for part in parts]),
        position=np.concatenate([part.position for part in parts]),
        window=np.concatenate([part.window + at for part, at in zip(parts, first, strict=False)]),
        truth=np.concatenate([part.truth for part in parts]),
    )


def train_ranking(examples: Examples, *, seed: int = 0) -> Ranking:
    """Return the network that gives the right hypotheses of most windows most probability."""
    torch: Any = torch_library()
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    measures = np.concatenate((examples.measures, mirrored(examples.measures)))
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
    """Return the place (windows,) that each window is read as, over the length, and its lead."""
    place, lead = np.empty(len(examples.truth)), np.empty(len(examples.truth))
    first = examples.first
    for k, (begin, end) in enumerate(pairwise(first)):
        probability = probabilities(examples.measures[begin:end].astype(float), ranking)
        best, lead[k], _ = most_probable(examples.position[begin:end], probability)
        place[k] = examples.position[begin + best]
    return place, lead


def write_ranking(ranking: Ranking, file: Path) -> None:
    """Write the network into a file, in single precision; the same network gives the same bytes."""
    from safetensors.numpy import save  # noqa: PLC0415

    file.write_bytes(save({name: value.astype(np.float32) for name, value in ranking._asdict().items()}))


def main() -> None:
    """Train on the training parts of datasets, score on other builds, and write the network."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("datasets", nargs="+", type=Path, help="with the split that monochord build made")
    parser.add_argument("--judge", nargs="*", type=Path, default=[], help="datasets that it is scored on")
    parser.add_argument("--string", default="prototype")
    parser.add_argument("--out", type=Path, default=FILE)
    options = parser.parse_args()
    design = load_string(options.string).string
    train = [examples_of(path, "train", design) for path in options.datasets]
    ranking = train_ranking(together(*train, joined(pure_examples())))
    write_ranking(ranking, options.out)
    for path in options.datasets:
        _report(f"{path}, validation", examples_of(path, "validation", design, clean=True), ranking, design)
    for path in options.judge:
        both = [examples_of(path, part, design, clean=True) for part in ("train", "validation")]
        _report(f"{path}, training and validation", together(*both), ranking, design)


def _report(name: str, examples: Examples, ranking: Ranking, design: StringParams) -> None:
    """Print how much is answered, and how well, by the least lead."""
    place, lead = places_of(examples, ranking)
    error = np.abs(place - examples.truth) * design.length * 1e3
    sys.stdout.write(f"{name}: {len(error)} windows\n")
    for least in (-np.inf, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0):
        some = error[lead >= least]
        within = " ".join(f"{limit} mm {np.mean(some < limit):.4f}" for limit in (5, 2, 1))
        answered = f"lead from {least:g}: {len(some) / len(error):.3f} answered"
        sys.stdout.write(f"  {answered}, within {within}, mean {some.mean():.2f} mm\n")


if __name__ == "__main__":
    main()
