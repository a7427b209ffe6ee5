"""Training of the reader's network in torch, and its export to the package's format."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from studies._reader_sessions import DRIVER_DEAD, ORDINARY, Variant, changed, save_arrays

from monochord.core.types import Audio, Floats, Indices
from monochord.perception.reader import (
    BASIS,
    CELLS,
    CHANNELS,
    FIRST,
    KINDS,
    PARTIALS,
    POSITIONS,
    STRIDE,
    ReaderNetwork,
    segments,
    spectrum_cells,
)
from monochord.perception.training import torch_library

Cells: TypeAlias = NDArray[np.uint8]

PLACED = (ORDINARY, DRIVER_DEAD)
"""Kinds with one position that can be told."""
QUIETEST = 1.0e-3
"""Rms in full scale below which a window is silent."""
WIDTH = 0.006
"""Standard deviation of a label, over the length: neighbouring positions are nearly right."""
SWAPPED = [1, 0, 3, 2]
"""Channels of the same touch with both ends of the string swapped."""
RESPONSE, KNOTS = 0.08, 6
"""Standard deviation of a microphone's response, in levels, at this many points along the axis: 6 dB."""
MASKS, WIDEST = 3, 60
"""Number of dropped bands of a window, and cells of the widest."""
KEPT = 1 + len(POSITIONS) + len(KINDS)
"""Outputs of the network that the package has."""
LINES, COMBS, OVERVIEW, HIDDEN, PLACE, DROPPED = 12, 16, (16, 8), 64, (24, 16), 0.3
"""Channels of lines, combs, overview, hidden layer and places, and the share of the hidden ones that is
dropped."""
OVERVIEW_STRIDES = 4, 2
"""Cells from one output of the overview's convolutions to the next."""
NAMES = {
    "convolution_1.bias": "bias_1",
    "convolution_2.bias": "bias_2",
    "comb.bias": "comb_bias",
    "overview_1.bias": "overview_bias_1",
    "overview_2.bias": "overview_bias_2",
    "hidden.bias": "hidden_bias",
    "place_hidden.bias": "place_bias",
    "along.bias": "along_bias",
    "last.bias": "last_bias",
}
"""Names of the package's arrays for those of biases."""
BATCH, RATE, DECAY, LONGEST_GRADIENT = 256, 3.0e-3, 0.05, 1.0
KIND_WEIGHT, SLIP_WEIGHT, PRESS_WEIGHT = 0.5, 0.5, 0.3
LINEAR_FORCE = 2.5
"""Force in N up to which networks state it linearly, and above which its logarithm."""
SPREADS = (-5.0, 3.0)
"""Range of the logarithm of the force's spread."""
PRESSES = 3
"""Outputs beside density and kinds: force, log spread of the force, and logit of slip."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Examples:
    """Windows (n,) as the network learns them; positions are over the length, NaN of untouched windows.

    `force` and `slip` are as in `studies._reader_sessions.Truth`.
    """

    cells: Cells
    position: Floats
    kind: Indices
    force: Audio
    slip: Audio

    @classmethod
    def joined(cls, parts: list["Examples"]) -> "Examples":
        """Return the windows of all parts."""
        return cls(**{own.name: np.concatenate([getattr(p, own.name) for p in parts]) for own in fields(cls)})


def read_examples(files: Sequence[Path]) -> Examples:
    """Return the examples of all files."""
    parts = list[Examples]()
    for file in files:
        with np.load(file) as arrays:
            parts.append(Examples(**arrays))
    return Examples.joined(parts)


def write_examples(variant: Variant, *, folder: Path, count: int, seed: int) -> None:
    """Write examples of a session into a folder, unless they are there.

    They are of `count` random touched windows, and of a third as many untouched ones.
    """
    target = variant.within(folder)
    if target.exists():
        return
    session = changed(variant, seed)
    truth, random = session.truth, np.random.default_rng((seed, *target.stem.encode()))
    usable = truth.placed | ((truth.kind >= 0) & ~np.isin(truth.kind, PLACED))
    chosen = list[Indices]()
    for contact, most in ((1.0, count), (0.0, count // 3)):
        rows = np.flatnonzero((truth.contact == contact) & usable)
        chosen.append(random.choice(rows, min(most, len(rows)), replace=False))
    rows = np.sort(np.concatenate(chosen))
    loud = [np.sqrt(np.mean(np.square(session.window(row)))) > QUIETEST for row in rows.tolist()]
    rows = rows[np.array(loud, bool)]
    analyser = session.analyser()
    cells = np.empty((len(rows), CHANNELS, CELLS), np.uint8)
    for k, row in enumerate(rows.tolist()):
        cells[k] = np.round(255.0 * spectrum_cells(analyser, analyser.analyse(session.window(row))))
    # Without a touch a silent driver cannot be told.
    kind = np.where(truth.kind[rows] < 0, ORDINARY, truth.kind[rows])
    position = np.where(truth.contact[rows] == 1.0, truth.place[rows], np.nan)
    known = truth.placed[rows]
    save_arrays(
        target,
        cells=cells,
        position=position.astype(np.float64),
        kind=kind,
        force=np.where(known, truth.force[rows], np.nan),
        slip=np.where(known, truth.slip[rows], np.nan),
    )


def train_network(
    examples: Examples,
    *,
    epochs: int,
    seed: int,
    report: Callable[[int, float], None],
) -> ReaderNetwork:
    """Return the reader's network, trained on examples; `report` is called with each epoch and its loss."""
    torch: Any = torch_library()
    torch.manual_seed(seed)
    module = _module(torch)
    cells, kind = torch.from_numpy(examples.cells), torch.from_numpy(examples.kind)
    position = torch.tensor(examples.position, dtype=torch.float32)
    is_placed = torch.tensor(np.isin(examples.kind, PLACED))
    count = torch.bincount(kind, minlength=len(KINDS)).clamp(min=1)
    weight = (count[ORDINARY] / count) ** 0.5
    optimiser = torch.optim.AdamW(module.parameters(), RATE, weight_decay=DECAY)
    steps = epochs * -(-len(kind) // BATCH) + 1
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps, pct_start=0.1)
    mirror = torch.arange(len(KINDS))
    mirror[[1, 2]] = mirror[[2, 1]]  # the microphone that is dead
    for epoch in range(epochs):
        module.train()
        total = 0.0
        for rows in torch.randperm(len(kind)).split(BATCH):
            swapped = torch.rand(len(rows)) < 0.5
            inputs = cells[rows].float() / 255.0
            inputs = torch.where(swapped[:, None, None], inputs[:, SWAPPED], inputs)
            inputs = _varied(torch, inputs.roll(int(torch.randint(-1, 2, ())), 2))
            where, odd, pressed = module(inputs, swapped)
            place = torch.where(swapped, 1.0 - position[rows], position[rows])
            misplaced = -(_expected(torch, place) * torch.log_softmax(where, 1)).sum(1)[is_placed[rows]]
            of_kind = torch.where(swapped, mirror[kind[rows]], kind[rows])
            loss = misplaced.mean() + KIND_WEIGHT * torch.nn.functional.cross_entropy(odd, of_kind, weight)
            # The package leaves these outputs out; what they are read from, the memory gets.
            loss = loss + press_loss(
                torch, pressed, examples.force[rows.numpy()], examples.slip[rows.numpy()]
            )
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(module.parameters(), LONGEST_GRADIENT)
            optimiser.step()
            schedule.step()
            total += float(loss.detach()) * len(rows)
        report(epoch + 1, total / len(kind))
    return _exported(module.eval())


def press_loss(torch: Any, outputs: Any, force: Audio, slip: Audio) -> Any:
    """Return the loss of force and slip, from outputs (n, `PRESSES`); the truth (n,) is NaN where unknown."""
    loss, functional = torch.zeros(()), torch.nn.functional
    pressed, told = np.flatnonzero(np.isfinite(force)), np.flatnonzero(np.isfinite(slip))
    if len(pressed):
        value, spread = outputs[pressed][:, 0], outputs[pressed][:, 1].clamp(*SPREADS)
        target = torch.from_numpy(compressed_force(force[pressed]))
        loss = loss + ((value - target).abs() * torch.exp(-spread) + spread).mean()
    if len(told):
        odds, truth = outputs[told][:, 2], torch.from_numpy(slip[told])
        loss = loss + SLIP_WEIGHT * functional.binary_cross_entropy_with_logits(odds, truth)
    return loss


def compressed_force(force: Audio) -> Audio:
    """Return forces in N as networks state them."""
    large = LINEAR_FORCE * (1.0 + np.log(np.maximum(force, LINEAR_FORCE) / LINEAR_FORCE))
    return np.where(force < LINEAR_FORCE, np.maximum(force, 0.0), large).astype(np.float32)


def _module(torch: Any) -> Any:
    """Return the network with random weights; its parameters are named as the package's arrays."""
    nn, positions = torch.nn, len(POSITIONS)
    combed, places = len(PARTIALS), 2 * COMBS + len(BASIS)
    coarse = -(-CELLS // STRIDE)
    overview = -(-coarse // (OVERVIEW_STRIDES[0] * OVERVIEW_STRIDES[1]))
    partials = np.arange(FIRST, coarse)[:, np.newaxis] + PARTIALS
    partials = torch.from_numpy(np.minimum(partials, coarse).ravel())  # beyond the end are zeros
    below, above = (torch.from_numpy(each) for each in segments())
    basis = torch.from_numpy(BASIS.T.copy())

    class Module(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            # Convolutions over a row of cells with their channels beside each other: half of Conv1d's time.
            self.convolution_1 = nn.Conv2d(CHANNELS + 1, LINES, (1, 9), (1, STRIDE), (0, 4))
            self.convolution_2 = nn.Conv2d(LINES, LINES, (1, 3), 1, (0, 1))
            self.comb = nn.Linear(LINES * combed, COMBS)
            self.overview_1 = nn.Conv2d(LINES, OVERVIEW[0], (1, 5), (1, OVERVIEW_STRIDES[0]), (0, 2))
            self.overview_2 = nn.Conv2d(OVERVIEW[0], OVERVIEW[1], (1, 5), (1, OVERVIEW_STRIDES[1]), (0, 2))
            self.hidden = nn.Linear(OVERVIEW[1] * overview, HIDDEN)
            self.place = nn.Linear(places, PLACE[0], bias=False)
            self.place_hidden = nn.Linear(HIDDEN, PLACE[0])
            self.along = nn.Conv1d(*PLACE, 5, padding=2)
            self.score = nn.Linear(PLACE[1], 1, bias=False)
            self.last = nn.Linear(HIDDEN + 2 * PLACE[1], KEPT - positions + PRESSES)
            self.dropout = nn.Dropout(DROPPED)

        def forward(self, cells: Any, swapped: Any) -> tuple[Any, Any, Any]:
            """Return density (n, 1 + positions), kinds (n, kinds) and presses (n, `PRESSES`) of windows."""
            flag = swapped.float()[:, None, None].expand(-1, 1, CELLS)
            inputs = torch.cat((cells, flag), 1)[:, :, None].contiguous(memory_format=torch.channels_last)
            lines = torch.relu(self.convolution_2(torch.relu(self.convolution_1(inputs))))
            overview = torch.relu(self.overview_2(torch.relu(self.overview_1(lines)))).flatten(1)
            hidden = self.dropout(torch.relu(self.hidden(overview)))
            rows = torch.nn.functional.pad(lines[:, :, 0].transpose(1, 2), (0, 0, 0, 1))
            combs = rows.index_select(1, partials).view(len(cells), -1, LINES * combed)
            combs = torch.relu(self.comb(combs))
            both = [
                combs.index_select(1, own) * (1.0 - part)[:, None]
                + combs.index_select(1, own + 1) * part[:, None]
                for own, part in zip(below, above, strict=True)
            ]
            where = torch.where(swapped[:, None, None], basis.flip(0), basis)
            features = self.place(torch.cat((*both, where), 2)) + self.place_hidden(hidden)[:, None]
            features = torch.relu(self.along(torch.relu(features).transpose(1, 2)).transpose(1, 2))
            scores = self.score(features)[..., 0]
            mean = (torch.softmax(scores, 1)[..., None] * features).sum(1)
            last = self.last(torch.cat((hidden, mean, features.amax(1)), 1))
            kinds = 1 + len(KINDS)
            return torch.cat((last[:, :1], scores), 1), last[:, 1:kinds], last[:, kinds:]

    return Module().to(memory_format=torch.channels_last)


def _arrays(module: Any) -> dict[str, Any]:
    """Return a network's weights and biases by the names of the package's arrays."""
    named: dict[str, Any] = dict(module.named_parameters())
    return {NAMES.get(name, name.removesuffix(".weight")): own for name, own in named.items()}


def _expected(torch: Any, position: Any) -> Any:
    """Return the distribution (n, 1 + positions) expected of windows: no touch, or about a position."""
    untouched = torch.isnan(position)
    near = torch.exp(-0.5 * ((torch.tensor(POSITIONS, dtype=torch.float32) - position[:, None]) / WIDTH) ** 2)
    near = torch.where(untouched[:, None], 0.0, torch.nan_to_num(near / near.sum(1, keepdim=True)))
    return torch.cat((untouched.float()[:, None], near), 1)


def _varied(torch: Any, inputs: Any) -> Any:
    """Return inputs (windows, channels, cells) with random responses and dropped bands."""
    count, cells = len(inputs), torch.arange(CELLS)
    response = torch.nn.functional.interpolate(
        RESPONSE * torch.randn(count, 2, KNOTS), size=CELLS, mode="linear", align_corners=True
    )
    levels, prominences = inputs[:, :2], inputs[:, 2:]
    levels = torch.clamp(levels + response * (levels > 0.0), min=0.0)
    kept = torch.ones(count, CELLS, dtype=torch.bool)
    for _ in range(MASKS):
        first = torch.randint(0, CELLS, (count, 1))
        kept &= (cells < first) | (cells >= first + torch.randint(0, WIDEST, (count, 1)))
    return torch.cat((levels, prominences), 1) * kept[:, None]


def _exported(module: Any) -> ReaderNetwork:
    """Return the network in the package's format, which never swaps its input."""
    arrays = dict[str, Any]()
    for name, own in _arrays(module).items():
        array = own.detach().numpy()
        if array.ndim > 2:
            array = array.reshape(*array.shape[:2], -1)
            array = array[:, : CHANNELS if name == "convolution_1" else None].transpose(2, 1, 0)
            array = array.reshape(-1, array.shape[2])
        else:
            array = array.T
        kept = KEPT - len(POSITIONS) if name in {"last", "last_bias"} else None
        arrays[name] = np.ascontiguousarray(array[..., :kept], np.float32).copy()
    return ReaderNetwork(**arrays)
