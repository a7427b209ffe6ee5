"""The networks of the study `one_reader`, in torch, and their training."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from studies._place_network import SWAPPED, varied

from monochord.core.types import Floats, Indices
from monochord.perception.closed_form import CELLS, CHANNELS, DILATIONS, STRIDES
from monochord.perception.training import torch_library

POSITIONS = np.linspace(0.0, 1.0, 201)
"""Positions over the length whose probabilities the network gives."""
WIDTH = 0.006
"""Standard deviation of a label, over the length: neighbouring positions are nearly right."""
CHANNELS_OUT, TAPS, HIDDEN, DROPPED = (16, 24, 32, 40, 8), (9, 5, 5, 3, 1), 96, 0.3
BATCH, RATE, DECAY = 512, 3.0e-3, 0.1
HEAD_EPOCHS, HEAD_RATE, HEAD_DECAY, HEAD_HIDDEN = 40, 1.0e-3, 0.5, 128
KIND_WEIGHT = 0.5
TOLERANCE = 0.025
"""Largest error of a position, over the length, that counts as right."""
MIN_SPREAD = 0.02

Cells: TypeAlias = NDArray[np.uint8]


class Outputs(NamedTuple):
    """Probabilities for windows (n,): no touch (n,), positions (n, 201) and kinds (n, k)."""

    untouched: Floats
    density: Floats
    kind: Floats


class Estimates(NamedTuple):
    """What the heads say of windows, (n,) each.

    `contact` and `slip` are probabilities, `within` that of a right position; `shift` is to be added to the
    refined position, over the length, and `force` is in N.
    """

    contact: Floats
    slip: Floats
    force: Floats
    within: Floats
    shift: Floats


Heads: TypeAlias = Callable[[Floats], Estimates]


def train_network(
    cells: Cells, contact: Floats, position: Floats, kind: Indices, kinds: int, *, epochs: int, seed: int
) -> Any:
    """Return the network for windows (n,) with cells (n, 4, cells); of untouched ones `position` is NaN."""
    torch: Any = torch_library()
    torch.manual_seed(seed)
    network = _network(torch, kinds)
    seen, place = torch.from_numpy(cells), torch.tensor(position, dtype=torch.float32)
    touched, of_kind = torch.tensor(contact > 0.5), torch.tensor(kind)
    # A dead microphone or two touches have no one place that can be told.
    has_place = torch.tensor(np.isin(kind, (0, kinds - 1, kinds - 2)))
    count = torch.bincount(of_kind, minlength=kinds).clamp(min=1)
    weight = (count[0] / count) ** 0.5
    optimiser = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
    steps = epochs * -(-len(cells) // BATCH) + 1
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps, pct_start=0.1)
    mirror = torch.arange(kinds)
    mirror[[1, 2]] = mirror[[2, 1]]  # the microphone that is dead
    for epoch in range(epochs):
        network.train()
        total = 0.0
        for rows in torch.randperm(len(cells)).split(BATCH):
            swapped = torch.rand(len(rows)) < 0.5
            inputs = seen[rows].float() / 255.0
            inputs = torch.where(swapped[:, None, None], inputs[:, SWAPPED], inputs)
            inputs = varied(torch, inputs.roll(int(torch.randint(-1, 2, ())), 2))
            where, odd = network(inputs, swapped)
            own = torch.where(swapped, 1.0 - place[rows], place[rows])
            expected = _expected(torch, own, touched[rows])
            misplaced = -(expected * torch.log_softmax(where, 1)).sum(1)[has_place[rows]]
            kind_now = torch.where(swapped, mirror[of_kind[rows]], of_kind[rows])
            loss = misplaced.mean() + KIND_WEIGHT * torch.nn.functional.cross_entropy(odd, kind_now, weight)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += float(loss.detach()) * len(rows)
        print(f"epoch {epoch + 1:3d} of {epochs}  loss {total / len(cells):.3f}", flush=True)
    return network


def outputs_of(network: Any, cells: Cells) -> Outputs:
    """Return what the network says of windows with cells (n, 4, cells)."""
    torch: Any = torch_library()
    network.eval()
    parts = list[tuple[Floats, Floats]]()
    with torch.no_grad():
        for batch in torch.from_numpy(cells).split(4096):
            where, odd = network(batch.float() / 255.0, torch.zeros(len(batch), dtype=torch.bool))
            parts.append((torch.softmax(where, 1).double().numpy(), torch.softmax(odd, 1).double().numpy()))
    where, odd = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Outputs(where[:, 0], where[:, 1:], odd)


def densest(density: Floats) -> tuple[Floats, Floats]:
    """Return the densest position (n,) of densities (n, 201), and the probability of its five cells.

    >>> place, mass = densest(np.eye(201)[[40]])
    >>> place.round(3).tolist(), mass.tolist()
    ([0.2], [1.0])
    """
    padded = np.pad(density, ((0, 0), (2, 2)))
    near = sum(padded[:, k : k + density.shape[1]] for k in range(5))
    best = np.asarray(near).argmax(axis=1)
    cells = np.clip(best[:, np.newaxis] + np.arange(-2, 3), 0, density.shape[1] - 1)
    mass = np.take_along_axis(density, cells, 1)
    place = (mass * POSITIONS[cells]).sum(axis=1) / mass.sum(axis=1)
    return place, np.asarray(near)[np.arange(len(best)), best]


def train_heads(measures: Floats, refined: Floats, labels: Mapping[str, Floats], *, seed: int) -> Heads:
    """Return heads for windows with measures (n, d), refined positions (n,) over the length, and labels.

    The labels (n,) are `contact`, `position`, `force` and `slip`, and `kind`, 0 for ordinary windows.
    """
    torch: Any = torch_library()
    torch.manual_seed(seed)
    nn = torch.nn
    mean, scale = measures.mean(axis=0), measures.std(axis=0) + 1e-3

    def scaled(rows: Floats) -> Any:
        return torch.tensor(np.clip((rows - mean) / scale, -5.0, 5.0), dtype=torch.float32)

    def head(outputs: int) -> Any:
        first = nn.Linear(measures.shape[1], HEAD_HIDDEN), nn.ReLU(), nn.Dropout(0.2)
        second = nn.Linear(HEAD_HIDDEN, HEAD_HIDDEN), nn.ReLU(), nn.Dropout(0.2)
        return nn.Sequential(*first, *second, nn.Linear(HEAD_HIDDEN, outputs))

    heads = nn.ModuleDict({"contact": head(1), "slip": head(1), "force": head(2), "place": head(3)})
    inputs = scaled(measures)
    touched = torch.tensor((labels["kind"] == 0) & (labels["contact"] > 0.5))
    ordinary = torch.tensor(labels["kind"] == 0)
    contact, slip, force, residual = (
        torch.tensor(np.nan_to_num(values), dtype=torch.float32)
        for values in (
            labels["contact"],
            labels["slip"],
            labels["force"],
            labels["position"] - refined,
        )
    )
    right = residual.abs() < TOLERANCE
    optimiser = torch.optim.AdamW(heads.parameters(), HEAD_RATE, weight_decay=HEAD_DECAY)
    steps = HEAD_EPOCHS * -(-len(inputs) // BATCH) + 1
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, HEAD_RATE, total_steps=steps)
    logistic = nn.functional.binary_cross_entropy_with_logits

    def laplace(output: Any, error: Any) -> Any:
        spread = nn.functional.softplus(output) + MIN_SPREAD
        return (error.abs() / spread + torch.log(spread)).clamp(max=20.0)

    for _ in range(HEAD_EPOCHS):
        heads.train()
        for rows in torch.randperm(len(inputs)).split(BATCH):
            told = {name: each(inputs[rows]) for name, each in heads.items()}
            now, there = touched[rows], ordinary[rows]
            place, pull = told["place"], told["force"]
            off = 200.0 * residual[rows] - place[:, 1]
            near = now & right[rows]
            losses = (
                logistic(told["contact"][there, 0], contact[rows][there]),
                logistic(told["slip"][now, 0], slip[rows][now]),
                laplace(pull[now, 1], force[rows][now] - pull[now, 0]).mean(),
                logistic(place[now, 0], right[rows][now].float()),
                0.3 * laplace(place[near, 2], off[near]).mean(),
            )
            loss: Any = sum(each for each in losses if torch.isfinite(each))
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    heads.eval()

    def estimates(rows: Floats) -> Estimates:
        with torch.no_grad():
            told = {name: each(scaled(rows)).double().numpy() for name, each in heads.items()}
        names = "contact", "slip", "place"
        contact, slip, within = (1.0 / (1.0 + np.exp(-told[name][:, 0])) for name in names)
        shift = np.clip(told["place"][:, 1] / 200.0, -0.015, 0.015)
        return Estimates(contact, slip, told["force"][:, 0], within, shift)

    return estimates


def _network(torch: Any, kinds: int) -> Any:
    nn = torch.nn

    class Network(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            layers, before = list[Any](), CHANNELS + 1
            for outputs, taps, stride, dilation in zip(CHANNELS_OUT, TAPS, STRIDES, DILATIONS, strict=True):
                pad = taps // 2 * int(dilation)
                layers += [nn.Conv1d(before, outputs, taps, int(stride), pad, int(dilation)), nn.ReLU()]
                before = outputs
            cells = -(-CELLS // int(np.prod(STRIDES)))
            hidden = nn.Linear(before * cells, HIDDEN), nn.ReLU(), nn.Dropout(DROPPED)
            self.trunk = nn.Sequential(*layers, nn.Flatten(), *hidden)
            self.where, self.odd = nn.Linear(HIDDEN, len(POSITIONS) + 1), nn.Linear(HIDDEN, kinds)

        def forward(self, cells: Any, swapped: Any) -> tuple[Any, Any]:
            flag = swapped.float()[:, None, None].expand(-1, 1, cells.shape[2])
            hidden = self.trunk(torch.cat((cells, flag), 1))
            return self.where(hidden), self.odd(hidden)

    return Network()


def _expected(torch: Any, place: Any, touched: Any) -> Any:
    """Return the distribution (n, 1 + 201) that is expected of windows: no touch, or about a position."""
    grid = torch.tensor(POSITIONS, dtype=torch.float32)
    near = torch.exp(-0.5 * ((grid - place[:, None]) / WIDTH) ** 2)
    near = torch.where(touched[:, None], torch.nan_to_num(near / near.sum(1, keepdim=True)), 0.0)
    return torch.cat(((~touched).float()[:, None], near), 1)
