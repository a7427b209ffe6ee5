"""Training of the anomaly detector: ordinary windows against windows of faults and unusual touches.

Ordinary windows are the windows that the heads learn from, clean and noisy. Anomalies come from two sources:
windows of the same sessions with simulated microphone faults, and a separate dataset that no head learns
from, with soft or double touches, a silent driver or another string. Each reason has an output, so the model
can state the reason. All kinds of anomaly have equal weight, and together they weigh as much as the ordinary
windows.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Flags, Floats, Indices, Progress, Signal
from monochord.datasets.faults import Fault
from monochord.datasets.store import Dataset, open_dataset
from monochord.perception.heads.base import CONTACT
from monochord.perception.model.anomaly import AnomalyState, Detector, score
from monochord.perception.model.definition import DETECTOR, AnomalyRecord, Definition
from monochord.perception.model.network import scaled
from monochord.perception.training._torch import torch_library
from monochord.perception.training.examples import Examples, TrainingData
from monochord.perception.training.rows import Noise, Rows
from monochord.perception.training.settings import AnomalySettings, TrainingSettings

ORDINARY = "ordinary"
"""Key of the ordinary windows' share in `AnomalyRecord.measured`."""
FAULT_SHARE = 4
"""Every so many windows, one also serves as training data with each fault."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """Windows of one kind of sound and its reason.

    `learned` (n, d) and `judged` (m, d) are the scaled features for training and validation. `session` (m,),
    `time` (m,) in s and `touched` (m,) describe the windows of validation.
    """

    name: str
    reason: str
    learned: Audio
    judged: Audio
    session: Indices
    time: Floats
    touched: Flags


def with_detector(
    definition: Definition,
    scaler: Mapping[str, Audio],
    settings: TrainingSettings,
    data: TrainingData,
    examples: tuple[Examples, Examples],
    parts: tuple[Indices, Indices],
    progress: Progress = lambda *_: None,
) -> tuple[Definition, dict[str, Audio]]:
    """Return a definition with the anomaly detector of the settings, and the detector's arrays.

    Parameters
    ----------
    definition
        The model's definition.
    scaler
        The arrays ``scaler.*`` of the model.
    settings
        Settings of the training.
    data
        Dataset and features of the training.
    examples
        Examples of training and validation.
    parts
        All windows (n,) of training and validation. They include windows in which a touch begins or ends: no
        head learns from them, but the detector must accept them as ordinary.
    progress
        Called with the progress.

    Raises
    ------
    InputError
        If the dataset of anomalies cannot be used, or has no session for any reason.
    """
    options = settings.known
    if not options.on:
        return definition, {}

    def scale(rows: Audio) -> Audio:
        return scaled(rows, scaler["scaler.mean"], scaler["scaler.scale"], definition.clip)

    learned, judged = examples
    begins = [data.feature.of(each, progress=progress) for each in (_transitions(data, p) for p in parts)]
    rows = np.concatenate([judged.rows, _transitions(data, parts[1])])
    order = np.argsort(rows)
    ordinary = Kind(
        name=ORDINARY,
        reason="",
        learned=scale(np.concatenate([learned.base.reshape(-1, learned.base.shape[-1]), begins[0]])),
        judged=scale(np.concatenate([judged.base[0], begins[1]]))[order],
        **_places(data.dataset, rows[order]),
    )
    kinds = [
        *_faults(options, settings.seed, data, examples, scale, progress),
        *_unlike(options, settings, data, judged, scale, progress),
    ]
    reasons = tuple(dict.fromkeys(kind.reason for kind in kinds))
    brief, touching = (
        {options.reasons[pattern] for pattern in patterns if pattern in options.reasons}
        for patterns in (options.brief, options.touches)
    )
    record = AnomalyRecord(
        hidden=options.hidden,
        columns=options.columns,
        reasons=reasons,
        memory=tuple(options.touch_memory if each in brief else options.memory for each in reasons),
        touched=tuple(each for each in reasons if each in touching - brief),
        brief=tuple(each for each in reasons if each in brief),
        contact_holds=tuple(each for each in reasons if each in options.contact_holds),
    )
    definition = dataclasses.replace(definition, known=record)
    torch = torch_library()
    threads = torch.get_num_threads()
    torch.set_num_threads(settings.optimiser.threads)
    try:
        weights = _fitted(definition, options, settings.seed, ordinary, kinds)
    finally:
        torch.set_num_threads(threads)
    detector = Detector.of(definition, weights)
    assert detector is not None
    scores = {kind.name: _scores(detector, kind) for kind in (ordinary, *kinds)}
    limit = float(np.quantile(scores[ORDINARY], 1.0 - options.share, method="higher"))
    measured = {name: float(np.mean(each > limit)) for name, each in scores.items() if each.size}
    record = dataclasses.replace(record, limit=limit, measured=measured)
    return dataclasses.replace(definition, known=record), weights


def _transitions(data: TrainingData, part: Indices) -> Indices:
    """Return the windows (n,) of a part in which a touch begins or ends."""
    dataset = data.dataset
    part = np.sort(part)
    return part[dataset.usable[part] & (dataset.label("transition")[part] == 1.0)]


def _faults(
    options: AnomalySettings,
    seed: int,
    data: TrainingData,
    examples: tuple[Examples, Examples],
    scale: Any,
    progress: Progress,
) -> list[Kind]:
    """Return windows of training and validation with simulated microphone faults."""
    rate, kinds = data.dataset.manifest.sample_rate, list[Kind]()
    spared = _named(data.dataset, options.spared)
    whole = [each.rows[~spared[each.rows]] for each in examples]
    rows = whole[0][::FAULT_SHARE], whole[1]
    for name, reason in options.faults.items():
        noise = Noise(augmentation=Fault(kind=name), copy=0, seed=seed, sample_rate=rate)
        parts = [scale(data.feature.of(each, noise, progress)) for each in rows]
        places = _places(data.dataset, rows[1])
        kinds.append(Kind(name=name, reason=reason, learned=parts[0], judged=parts[1], **places))
    return kinds


def _unlike(
    options: AnomalySettings,
    settings: TrainingSettings,
    data: TrainingData,
    judged: Examples,
    scale: Any,
    progress: Progress,
) -> list[Kind]:
    """Return windows of the dataset of anomalies; builds of the validation are used for validation."""
    if options.dataset is None:
        return []
    dataset, definition = open_dataset(options.dataset), data.definition
    manifest, own = dataset.manifest, data.dataset.manifest
    form = (manifest.sample_rate, manifest.channels, manifest.window)
    if form != (definition.sample_rate, definition.channels, definition.window):
        given = f"known.dataset {options.dataset} of windows {form[2]} at {form[0]} Hz"
        allowed = f"{definition.window} at {definition.sample_rate} Hz"
        raise InputError(given, allowed, "build the dataset with these settings")
    builds = {own.parts[number].build for number in np.unique(judged.session).tolist()} - {None}
    signal = Signal(sample_rate=form[0], channels=form[1], string=definition.string)
    folder = settings.cache or dataset.path / "features"
    name, feature_options = settings.feature_named()
    workers, cluster = data.feature.workers, data.feature.cluster
    rows = Rows.prepared(dataset, signal, name, feature_options, folder, workers=workers, cluster=cluster)
    kinds: list[Kind] = []
    for pattern, reason in options.reasons.items():
        own_rows = _rows_of(dataset, pattern, only_touched=pattern in options.touches)
        if not own_rows.size:
            continue
        features = scale(rows.of(own_rows, progress=progress))
        build = np.array([part.build in builds for part in manifest.parts])[dataset.session[own_rows]]
        kinds.append(
            Kind(
                name=pattern.strip("*_"),
                reason=reason,
                learned=features[~build],
                judged=features[build],
                **_places(dataset, own_rows[build]),
            )
        )
    if not kinds:
        given = f"known.dataset {options.dataset} without sessions {', '.join(options.reasons)}"
        raise InputError(given, "sessions that match a pattern", "add their patterns to known.reasons")
    return kinds


def _rows_of(dataset: Dataset, pattern: str, *, only_touched: bool) -> Indices:
    """Return the windows (n,) of sessions whose names fit a pattern."""
    counts = _named(dataset, (pattern,)) & dataset.usable
    contact = dataset.label(CONTACT)
    counts &= (contact == 1.0) if only_touched else np.isfinite(contact)
    return np.flatnonzero(counts)


def _named(dataset: Dataset, patterns: Sequence[str]) -> Flags:
    """Return which windows (n,) are of sessions whose names fit one of the patterns."""
    names = [part.name.rpartition("/")[2] for part in dataset.manifest.parts]
    fits = np.array([any(fnmatchcase(name, pattern) for pattern in patterns) for name in names])
    return fits[dataset.session]


def _fitted(
    definition: Definition, options: AnomalySettings, seed: int, ordinary: Kind, kinds: list[Kind]
) -> dict[str, Audio]:
    """Return the arrays of the detector's layers, trained on the kinds' windows."""
    torch = torch_library()
    assert definition.known is not None
    numbers = {reason: 1 + number for number, reason in enumerate(definition.known.reasons)}
    parts = [(ordinary.learned, 0, 0.5)]
    parts += [(kind.learned, numbers[kind.reason], 0.5 / len(kinds)) for kind in kinds]
    rows = torch.from_numpy(np.concatenate([part[:, definition.detector_columns] for part, _, _ in parts]))
    target = torch.from_numpy(np.concatenate([np.full(len(part), label) for part, label, _ in parts]))
    each: list[Audio] = [
        np.full(len(part), share / max(len(part), 1), np.float32) for part, _, share in parts
    ]
    weight = torch.from_numpy(np.concatenate(each) * len(rows))
    generator = torch.Generator().manual_seed(seed)
    shapes = {name: shape for name, shape in definition.shapes().items() if name.startswith(f"{DETECTOR}.")}
    arrays: dict[str, Any] = {}
    last = len(options.hidden)
    for name, shape in shapes.items():
        tensor = torch.zeros(shape)
        if name.endswith("weight") and not name.startswith(f"{DETECTOR}.{last}."):
            bound = float(np.sqrt(6.0 / shape[1]))
            tensor.uniform_(-bound, bound, generator=generator)
        arrays[name] = tensor.requires_grad_()
    optimiser = torch.optim.AdamW(list(arrays.values()), lr=options.rate, weight_decay=options.decay)
    for epoch in range(options.epochs):
        for group in optimiser.param_groups:
            group["lr"] = 0.5 * options.rate * (1.0 + np.cos(np.pi * epoch / options.epochs))
        order = torch.randperm(len(rows), generator=generator)
        for first in range(0, len(rows), options.batch):
            batch = order[first : first + options.batch]
            inputs = rows[batch]
            for number in range(last + 1):
                inputs = torch.nn.functional.linear(
                    inputs,
                    arrays[f"{DETECTOR}.{number}.weight"],
                    arrays[f"{DETECTOR}.{number}.bias"],
                )
                if number < last:
                    kept = torch.rand(inputs.shape, generator=generator) >= options.drop
                    inputs = torch.nn.functional.relu(inputs) * kept / (1.0 - options.drop)
            loss = torch.nn.functional.cross_entropy(inputs, target[batch], reduction="none")
            loss = (loss * weight[batch]).mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    return {name: tensor.detach().numpy().copy() for name, tensor in arrays.items()}


def _places(dataset: Dataset, rows: Indices) -> dict[str, Any]:
    """Return of windows (n,) their sessions, their times, and whether something touches."""
    return {
        "session": dataset.session[rows],
        "time": dataset.start[rows] / dataset.manifest.sample_rate,
        "touched": dataset.label(CONTACT)[rows] == 1.0,
    }


def _scores(detector: Detector, kind: Kind) -> Floats:
    """Return the scores (n,) of the windows of validation, each session a stream of its own."""
    scores, state, session = np.zeros(len(kind.judged)), AnomalyState(), -1
    for number, logits in enumerate(detector.logits(kind.judged)):
        if kind.session[number] != session:
            state, session = AnomalyState(), kind.session[number]
        time, touched = float(kind.time[number]), bool(kind.touched[number])
        state = detector.step(state, logits, time, touched=touched)
        scores[number] = -np.inf if state.odds is None else score(state.odds)
    return scores
