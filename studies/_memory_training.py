"""Training of the reader's memory in torch: a recurrent network over windows, and its export.

It learns from whole sessions: of each of `LANES` sessions at a time it gets the next windows, with the state
that the windows before have left, so that it knows rests and releases of any length as it will meet them.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from studies._reader_sessions import HOP, MASKED, ORDINARY, RATE, Variant, changed, save_arrays
from studies._reader_training import KIND_WEIGHT, LINEAR_FORCE, PRESSES, press_loss

from monochord.core.types import Audio, Floats, Indices
from monochord.perception.reader import (
    BANDS,
    COLUMNS,
    KINDS,
    POSITIONS,
    Reader,
    ReaderNetwork,
)
from monochord.perception.training import torch_library

Half: TypeAlias = NDArray[np.float16]
DENSITY = 1 + len(POSITIONS)
"""Outputs of the density: no touch, then every position."""
FOLDED = 1 + (len(POSITIONS) + 1) // 2
"""Inputs of the density: no touch, then positions by twos; the last is alone."""
PARTS = {
    "density": slice(0, FOLDED),
    "kinds": slice(FOLDED, FOLDED + len(KINDS)),
    "measures": slice(FOLDED + len(KINDS), FOLDED + len(KINDS) + len(COLUMNS)),
    "gaps": slice(FOLDED + len(KINDS) + len(COLUMNS), FOLDED + len(KINDS) + len(COLUMNS) + 3 * BANDS),
    "hidden": slice(FOLDED + len(KINDS) + len(COLUMNS) + 3 * BANDS, None),
}
"""Where a window's inputs come from."""
OUTPUTS = DENSITY + len(KINDS) + PRESSES + 2
"""Density, kinds, force, log spread of the force, and logits: of slip, of the trust in the density that is
held, and of its renewal."""
FORCE, _, SLIP, TRUST, RENEWAL = range(OUTPUTS - 5, OUTPUTS)
LARGEST = 6.0
"""Largest input after scaling."""
ENTERED, HIDDEN = (160, 96), 128
SHORTEST, LONGEST = HOP / RATE, 1.0
"""Range in s of the time between two windows; a longer one counts as `LONGEST`."""
WIDTH = 0.006
"""Standard deviation of a position's label, over the length."""
LANES, STEPS = 64, 80
"""Sessions at a time, and windows of each between two updates."""
STRIDES, STRIDE_SHARES = (1, 2, 3, 5), (0.4, 0.3, 0.2, 0.1)
"""Hops of 20 ms between windows, and how often."""
SKIP_SHARE, MAX_SKIP = 0.15, 50
"""Share of stretches with a gap among their windows, and its most hops."""
FRESH_SHARE, LATE_SHARE = 0.02, 0.2
"""Share of stretches that begin without memory, and of sessions that begin at a random time."""
NOISE, GAIN_STD = 0.03, 0.15
"""Deviation of inputs after scaling, save positions, and of each microphone's gain in decades of power."""
DROPPED = {"density": 0.03, "kinds": 0.02, "measures": 0.03, "gaps": 0.06, "hidden": 0.03}
"""Share of stretches without a part of the inputs."""
LEARNING, CONTINUING, DECAY, WARMING, LONGEST_GRADIENT = 2.0e-3, 1.0e-3, 1.0e-2, 100, 1.0
"""Largest rate of learning from random weights, and from given ones; and of AdamW."""
EXACT = [PARTS["measures"].start + COLUMNS.index(name) for name in ("place", "position")]
"""Inputs that get no noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Windows (n,) of sessions one after another, as the memory learns them.

    `inputs` (n, inputs) are not scaled, and `density` (n, `DENSITY`) is the window's own, its logarithm; the
    truth is as in `studies._reader_sessions.Truth`. `session` (n,) counts sessions.
    """

    inputs: Half
    density: Half
    contact: Audio
    place: Audio
    force: Audio
    slip: Audio
    kind: NDArray[np.int8]
    placed: NDArray[np.bool_]
    session: NDArray[np.int32]

    @classmethod
    def joined(cls, parts: Sequence["Rows"]) -> "Rows":
        """Return the windows of all parts, sessions counted anew."""
        names = [own.name for own in fields(cls) if own.name != "session"]
        number = np.repeat(np.arange(len(parts), dtype=np.int32), [len(part.contact) for part in parts])
        return cls(
            session=number, **{name: np.concatenate([getattr(p, name) for p in parts]) for name in names}
        )


def probabilities(outputs: NDArray[Any]) -> NDArray[Any]:
    """Return probabilities (n, k) from their logits."""
    shares = np.exp(outputs - outputs.max(axis=1, keepdims=True))
    return shares / shares.sum(axis=1, keepdims=True)


def scaled_inputs(inputs: NDArray[Any], mean: Audio, scale: Audio) -> Audio:
    """Return inputs (n, inputs) as the memory gets them; those that are not numbers become zero."""
    values = np.nan_to_num((inputs - mean) / scale, nan=0.0, posinf=LARGEST, neginf=-LARGEST)
    return np.clip(values, -LARGEST, LARGEST).astype(np.float32)


def elapsed_input(hops: NDArray[Any]) -> Audio:
    """Return the memory's input for the time since the window before, in hops of 20 ms."""
    return np.log2(np.clip(hops, 1.0, LONGEST / SHORTEST)).astype(np.float32)


def stated_force(outputs: NDArray[Any]) -> NDArray[Any]:
    """Return forces in N from the network's outputs for them."""
    return np.where(outputs < LINEAR_FORCE, outputs, LINEAR_FORCE * np.exp(outputs / LINEAR_FORCE - 1.0))


def peaks(density: NDArray[Any]) -> tuple[Floats, Floats]:
    """Return the densest position (n,) over the length, and the probability within three positions of it.

    `density` (n, `DENSITY`) are probabilities.
    """
    places = density[:, 1:]
    best = places.argmax(axis=1)
    near = np.clip(best[:, np.newaxis] + np.arange(-3, 4), 0, places.shape[1] - 1)
    own = np.take_along_axis(places, near, axis=1)
    own *= np.diff(near, axis=1, prepend=-1) > 0
    mass = own.sum(axis=1)
    return (own * POSITIONS[near]).sum(axis=1) / np.maximum(mass, 1.0e-12), mass


def write_rows(variant: Variant, *, network: ReaderNetwork, folder: Path, seed: int) -> None:
    """Write the rows of a session into a folder, unless they are there."""
    target = variant.within(folder)
    if target.exists():
        return
    session = changed(variant, seed)
    analyser, truth = session.analyser(), session.truth
    reader = replace(Reader.of(analyser), network=network)
    windows = (analyser.analyse(session.window(k)) for k in range(session.recording.windows))
    told = [reader.inputs(window)[:2] for window in windows]
    save_arrays(
        target,
        inputs=np.array([inputs for inputs, _ in told], np.float16),
        density=np.array([density for _, density in told], np.float16),
        contact=truth.contact,
        place=truth.place,
        force=truth.force,
        slip=truth.slip,
        kind=truth.kind.astype(np.int8),
        placed=truth.placed,
    )


def read_rows(file: Path) -> Rows:
    """Return the rows of a session."""
    with np.load(file) as arrays:
        own = {name: arrays[name] for name in arrays.files}
    return Rows(session=np.zeros(len(own["contact"]), np.int32), **own)


def memory_module(torch: Any, inputs: int) -> Any:
    """Return the network of so many inputs, with random weights."""
    nn = torch.nn

    class Memory(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            first, second = ENTERED
            self.enter_1, self.enter_2 = nn.Linear(inputs, first), nn.Linear(first, second)
            self.gates = nn.GRU(second + 1, HIDDEN, batch_first=True)
            self.summary, self.last = nn.Linear(second + HIDDEN, second), nn.Linear(second, OUTPUTS)

        def forward(self, inputs: Any, density: Any, elapsed: Any, state: Any = None) -> tuple[Any, Any]:
            """Return outputs and the state: of the recurrent unit, and the density that is held."""
            state, own = (None, density[:, 0]) if state is None else state
            entered = torch.relu(self.enter_2(torch.relu(self.enter_1(inputs))))
            hidden, state = self.gates(torch.cat((entered, elapsed[..., None]), -1), state)
            summary = torch.relu(self.summary(torch.cat((entered, hidden), -1)))
            outputs = self.last(summary)
            weight = 2.0 * torch.sigmoid(outputs[..., TRUST:RENEWAL])
            renewal = torch.sigmoid(outputs[..., RENEWAL:])
            steps = list[Any]()
            for step in range(density.shape[1]):
                own = torch.lerp(own, density[:, step], renewal[:, step])
                steps.append(own)
            told = outputs[..., :DENSITY] + weight * torch.stack(steps, 1)
            return torch.cat((told, outputs[..., DENSITY:]), -1), (state, own)

    return Memory()


def memory_arrays(module: Any, mean: Audio, scale: Audio) -> dict[str, Audio]:
    """Return the arrays of a trained network by name, matrices as (inputs, outputs)."""

    def array(tensor: Any) -> Audio:
        return np.ascontiguousarray(tensor.detach().numpy().T, np.float32).copy()

    arrays = {"input_mean": mean.astype(np.float32), "input_scale": scale.astype(np.float32)}
    for name, layer in (("enter_1", module.enter_1), ("enter_2", module.enter_2)):
        arrays[name], arrays[name.replace("_", "_bias_")] = array(layer.weight), array(layer.bias)
    gates = module.gates
    arrays |= {
        "gates_input": array(gates.weight_ih_l0),
        "gates_input_bias": array(gates.bias_ih_l0),
        "gates_hidden": array(gates.weight_hh_l0),
        "gates_hidden_bias": array(gates.bias_hh_l0),
        "summary": array(module.summary.weight),
        "summary_bias": array(module.summary.bias),
        "memory_last": array(module.last.weight),
        "memory_last_bias": array(module.last.bias),
    }
    return arrays


def load_memory(torch: Any, module: Any, arrays: Mapping[str, Audio]) -> None:
    """Give a module the arrays of a trained network."""
    gates = module.gates
    own = {
        "enter_1": module.enter_1.weight,
        "enter_bias_1": module.enter_1.bias,
        "enter_2": module.enter_2.weight,
        "enter_bias_2": module.enter_2.bias,
        "gates_input": gates.weight_ih_l0,
        "gates_input_bias": gates.bias_ih_l0,
        "gates_hidden": gates.weight_hh_l0,
        "gates_hidden_bias": gates.bias_hh_l0,
        "summary": module.summary.weight,
        "summary_bias": module.summary.bias,
        "memory_last": module.last.weight,
        "memory_last_bias": module.last.bias,
    }
    with torch.no_grad():
        for name, tensor in own.items():
            tensor.copy_(torch.from_numpy(arrays[name].T.copy()))


@dataclass(frozen=True, slots=True)
class _Stretch:
    """The next windows of all lanes: rows (lanes, steps), time, lanes without memory, and what counts."""

    rows: Indices
    elapsed: Audio
    fresh: NDArray[np.bool_]
    counts: NDArray[np.bool_]


def _stretches(session: NDArray[np.int32], weight: Floats, random: np.random.Generator) -> Iterator[_Stretch]:
    """Yield stretches of sessions, chosen with a weight (sessions,), without end."""
    begins = np.searchsorted(session, np.arange(len(weight)))
    ends = np.append(begins[1:], len(session))
    chance = weight / weight.sum()
    at, end = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    while True:
        rows, elapsed = np.empty((LANES, STEPS), np.int64), np.empty((LANES, STEPS), np.float32)
        fresh = random.random(LANES) < FRESH_SHARE
        for lane in range(LANES):
            hops = np.full(STEPS, random.choice(STRIDES, p=STRIDE_SHARES))
            if random.random() < SKIP_SHARE:
                hops[random.integers(STEPS)] = random.integers(2, MAX_SKIP + 1)
            if at[lane] >= end[lane]:
                own = int(random.choice(len(chance), p=chance))
                at[lane], end[lane], fresh[lane] = begins[own], ends[own], True
                if random.random() < LATE_SHARE:
                    at[lane] += random.integers(max((ends[own] - begins[own]) // 2, 1))
            if fresh[lane]:
                hops[0] = 0
                first = at[lane]
            else:
                first = at[lane] - 1  # the window before
            rows[lane] = first + np.cumsum(hops)
            elapsed[lane] = elapsed_input(hops)
            at[lane] = rows[lane, -1] + 1
        counts = rows < end[:, np.newaxis]
        yield _Stretch(np.minimum(rows, end[:, np.newaxis] - 1), elapsed, fresh, counts)


def train_memory(
    rows: Rows,
    weight: Floats,
    *,
    updates: int,
    seed: int,
    report: Callable[[int, float], None],
    start: Mapping[str, Audio] | None = None,
    horizon: int = 0,
) -> dict[str, Audio]:
    """Return the arrays of the memory, trained on rows of sessions that are chosen with a weight (sessions,).

    `report` is called with the number of updates and the mean loss since. It begins with random weights, or
    with those of `start`. It remembers no more windows than its
    horizon, a divisor of `STEPS`; 0 for no limit.
    """
    torch: Any = torch_library()
    torch.manual_seed(seed)
    random, module = np.random.default_rng(seed), memory_module(torch, rows.inputs.shape[1])
    sample = rows.inputs[:: max(len(rows.inputs) // 200_000, 1)].astype(np.float32)
    mean, scale = np.nanmean(sample, axis=0), np.nanstd(sample, axis=0) + np.float32(1.0e-3)
    learning = LEARNING
    if start is not None:
        load_memory(torch, module, start)
        learning = CONTINUING
        mean, scale = start["input_mean"], start["input_scale"]
    kinds = np.bincount(rows.kind[rows.kind >= 0], minlength=len(KINDS)).clip(min=1)
    of_kind = torch.tensor(np.sqrt(kinds[ORDINARY] / kinds).clip(max=10.0), dtype=torch.float32)
    optimiser = torch.optim.AdamW(module.parameters(), learning, weight_decay=DECAY)
    state, held, total = torch.zeros(1, LANES, HIDDEN), torch.zeros(LANES, DENSITY), 0.0
    for number, stretch in enumerate(_stretches(rows.session, weight, random), 1):
        progress = min(number / WARMING, 1.0) * 0.5 * (1.0 + math.cos(math.pi * (number - 1) / updates))
        for group in optimiser.param_groups:
            group["lr"] = learning * progress
        inputs = scaled_inputs(rows.inputs[stretch.rows.ravel()], mean, scale)
        inputs = _varied(inputs.reshape(LANES, STEPS, -1), scale, random)
        density, elapsed = rows.density[stretch.rows].astype(np.float32), stretch.elapsed
        if horizon:
            elapsed.reshape(-1, horizon)[:, 0] = 0.0
            given = (each.reshape(-1, horizon, *each.shape[2:]) for each in (inputs, density, elapsed))
            outputs, _ = module(*map(torch.from_numpy, given))
        else:
            fresh = torch.from_numpy(stretch.fresh)[:, None]
            held = torch.where(fresh, torch.from_numpy(density[:, 0]), held)
            given = map(torch.from_numpy, (inputs, density, elapsed))
            outputs, state = module(*given, (state * ~fresh, held))
            state, held = (each.detach() for each in state)
        loss = _loss(torch, outputs.reshape(LANES * STEPS, -1), rows, stretch, of_kind)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(module.parameters(), LONGEST_GRADIENT)
        optimiser.step()
        total += float(loss.detach())
        if number % 50 == 0 or number == updates:
            report(number, total / ((number - 1) % 50 + 1))
            total = 0.0
        if number == updates:
            return memory_arrays(module.eval(), mean, scale)
    raise AssertionError


def _varied(inputs: Audio, scale: Audio, random: np.random.Generator) -> Audio:
    """Return inputs (lanes, steps, inputs) with noise, other gains, and without some parts, in place."""
    exact = inputs[..., EXACT]
    inputs += np.float32(NOISE) * random.standard_normal(inputs.shape, np.float32)
    inputs[..., EXACT] = exact
    first, bands = PARTS["gaps"].start, BANDS
    for microphone in range(2):
        gain = np.float32(GAIN_STD) * random.standard_normal((len(inputs), 1, 1), np.float32)
        named = [k for k, name in enumerate(COLUMNS) if name.startswith(f"mic {microphone + 1} ")]
        own = [
            *(PARTS["measures"].start + k for k in named),
            *range(first + microphone * bands, first + (microphone + 1) * bands),
        ]
        inputs[:, :, own] += gain / scale[own]
    for name, share in DROPPED.items():
        inputs[random.random(len(inputs)) < share, :, PARTS[name]] = 0.0
    return inputs


def _loss(torch: Any, outputs: Any, rows: Rows, stretch: _Stretch, of_kind: Any) -> Any:
    functional, own, counts = torch.nn.functional, stretch.rows.ravel(), stretch.counts.ravel()

    def chosen(mask: NDArray[np.bool_]) -> Any:
        return torch.from_numpy(np.flatnonzero(mask & counts))

    contact, place = rows.contact[own], torch.from_numpy(rows.place[own])
    placed = chosen(rows.placed[own])
    touched = torch.from_numpy(contact == 1.0)[placed]
    near = torch.exp(
        -0.5 * ((torch.tensor(POSITIONS, dtype=torch.float32) - place[placed][:, None]) / WIDTH) ** 2
    )
    near = torch.where(touched[:, None], torch.nan_to_num(near / near.sum(1, keepdim=True)), 0.0)
    expected = torch.cat(((~touched).float()[:, None], near), 1)
    loss = -(expected * torch.log_softmax(outputs[placed][:, :DENSITY], 1)).sum(1).mean()
    kind = rows.kind[own].astype(np.int64)
    known = chosen(kind != MASKED)
    loss = loss + KIND_WEIGHT * functional.cross_entropy(
        outputs[known][:, DENSITY:FORCE], torch.from_numpy(kind)[known], of_kind
    )
    known = rows.placed[own] & counts
    force, slip = (np.where(known, values[own], np.float32(np.nan)) for values in (rows.force, rows.slip))
    return loss + press_loss(torch, outputs[:, FORCE:TRUST], force, slip)


def outputs_of(arrays: Mapping[str, Audio], sessions: Sequence[Rows], horizon: int = 0) -> Iterator[Audio]:
    """Yield the memory's outputs (n, `OUTPUTS`) for each session, every 20 ms from its beginning.

    With a `horizon` each window is read with that many windows or up to half of them less.
    """
    torch: Any = torch_library()
    module = memory_module(torch, len(arrays["input_mean"]))
    load_memory(torch, module, arrays)
    with torch.no_grad():
        for session in sessions:
            inputs = scaled_inputs(session.inputs, arrays["input_mean"], arrays["input_scale"])
            density, count = session.density.astype(np.float32), len(inputs)
            outputs = np.empty((count, OUTPUTS), np.float32)
            kept = max(horizon // 2, 1) if horizon else count
            for first in range(0, count, kept):
                begin, end = max(first + kept - horizon, 0) if horizon else 0, min(first + kept, count)
                given = (inputs[begin:end], density[begin:end], np.zeros(end - begin, np.float32))
                told, _ = module(*(torch.from_numpy(each)[None] for each in given))
                outputs[first:end] = told[0, first - begin :].numpy()
            yield outputs
