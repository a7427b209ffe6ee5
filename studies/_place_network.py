"""The position network in torch, and its training: the probability of each position, from spectra.

The network memorises builds, so its inputs are varied to make it general: microphones get different
responses, bands of the spectrum are dropped, ends are swapped, and the string's pitch is never exact.
"""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Floats
from monochord.perception.closed_form import (
    CELLS,
    CHANNELS,
    DILATIONS,
    PLACES,
    STRIDES,
    PlaceNetwork,
)
from monochord.perception.training import torch_library

CHANNELS_OUT, TAPS, HIDDEN = (16, 24, 32, 40, 8), (9, 5, 5, 3, 1), 96
"""Outputs and taps of each convolution, and units of the layer after them."""
EPOCHS, BATCH, RATE, DECAY, DROPPED = 14, 128, 3.0e-3, 0.1, 0.3
WIDTH = 0.008
"""Standard deviation of a label, relative to the length: neighbouring positions are nearly correct."""
SHIFTS = (-1, 0, 0, 0, 1)
"""Range of random shifts of a batch, in cells: the string's pitch is never exact."""
SWAPPED = [1, 0, 3, 2]
"""Channels of the same touch with both ends of the string swapped."""
RESPONSE, KNOTS = 0.08, 6
"""Standard deviation of a microphone's response, in levels, at this many points along the axis: 6 dB."""
MASKS, WIDEST = 3, 60
"""Number of dropped bands per window, and cells of the widest."""


Cells: TypeAlias = NDArray[np.float16]
"""The network's input, (windows, `CHANNELS`, `CELLS`)."""


def train_places(cells: Cells, truth: Floats, *, seed: int = 0, name: str = "places") -> Any:
    """Return the network, in torch, trained to maximise the probability of the true positions.

    Parameters
    ----------
    cells
        The network's input for each window.
    truth
        Touch positions relative to the length, (windows,).
    seed
        Random seed of weights and order.
    name
        Printed with the loss of each epoch.
    """
    torch: Any = torch_library()
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    network, places = _layers(torch), torch.tensor(PLACES, dtype=torch.float32)
    seen, touch = torch.from_numpy(cells), torch.tensor(truth, dtype=torch.float32)
    optimiser = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
    steps = EPOCHS * (-(-len(truth) // BATCH))
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps + 1, pct_start=0.1)
    for epoch in range(EPOCHS):
        total, order = 0.0, torch.from_numpy(random.permutation(len(truth)))
        for batch in order.split(BATCH):
            swapped = torch.from_numpy(random.random(len(batch)) < 0.5)
            inputs = torch.roll(seen[batch].float(), int(random.choice(SHIFTS)), 2)
            inputs = torch.where(swapped[:, None, None], inputs[:, SWAPPED], inputs)
            inputs = varied(torch, inputs)
            place = torch.where(swapped, 1.0 - touch[batch], touch[batch])
            label = torch.softmax(-0.5 * ((places - place[:, None]) / WIDTH) ** 2, 1)
            loss = -(label * _log_probabilities(torch, network, inputs, swapped)).sum(1).mean()
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 2.0)
            optimiser.step()
            schedule.step()
            total += loss.item() * len(batch)
        print(f"{name}: epoch {epoch + 1} of {EPOCHS}, loss {total / len(truth):.4f}", flush=True)
    return network.eval()


def probabilities_of(network: Any, cells: Cells, *, swapped: bool) -> Floats:
    """Return a torch network's probabilities (windows, places), for cells as they are or `swapped`."""
    torch: Any = torch_library()
    parts: list[Any] = []
    with torch.no_grad():
        for batch in torch.from_numpy(cells).split(512):
            inputs = batch.float()[:, SWAPPED] if swapped else batch.float()
            flags = torch.full((len(batch),), swapped)
            parts.append(torch.exp(_log_probabilities(torch, network, inputs, flags)).double())
    return torch.cat(parts).numpy()


def exported(network: Any) -> PlaceNetwork:
    """Return the network in the package's format, which never swaps its input."""
    arrays: list[Audio] = []
    for layer in network:
        weight = getattr(layer, "weight", None)
        if weight is not None:
            matrix = weight.detach().numpy()
            if matrix.ndim == 3:
                matrix = matrix[:, : CHANNELS if not arrays else None]
                matrix = matrix.transpose(2, 1, 0).reshape(-1, len(matrix))
            else:
                matrix = matrix.T
            arrays += [np.ascontiguousarray(matrix), layer.bias.detach().numpy()]
    return PlaceNetwork(*arrays)


def _layers(torch: Any) -> Any:
    layers, before = list[Any](), CHANNELS + 1
    for outputs, taps, stride, dilation in zip(CHANNELS_OUT, TAPS, STRIDES, DILATIONS, strict=True):
        pad = taps // 2 * dilation
        layers += [torch.nn.Conv1d(before, outputs, taps, stride, pad, dilation), torch.nn.ReLU()]
        before = outputs
    cells = -(-CELLS // int(np.prod(STRIDES)))
    layers += [torch.nn.Flatten(), torch.nn.Linear(before * cells, HIDDEN), torch.nn.ReLU()]
    return torch.nn.Sequential(*layers, torch.nn.Dropout(DROPPED), torch.nn.Linear(HIDDEN, len(PLACES)))


def varied(torch: Any, inputs: Any) -> Any:
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


def _log_probabilities(torch: Any, network: Any, inputs: Any, swapped: Any) -> Any:
    flag = swapped.float()[:, None, None].expand(-1, 1, CELLS)
    return torch.log_softmax(network(torch.cat((inputs, flag), 1)), 1)
