"""Features of a dataset's windows, computed once and cached on disk.

Several processes share the work on a large dataset: each computes a part and stores it in the cache. The
cache key consists of the feature's name and options, the window, the dataset's checksum, the added noise and
the requested rows. It also contains a fingerprint: the features of three probe windows. So a feature whose
code changed is computed again. A damaged file is computed again too: each file ends with the SHA-256 of its
array.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.config import to_tree
from monochord.core.errors import InputError
from monochord.core.files import replacing
from monochord.core.types import Audio, Indices, Progress, Signal, StringParams
from monochord.core.units import Samples
from monochord.core.workers import run_all
from monochord.datasets.augment import Augmentation
from monochord.datasets.faults import Fault
from monochord.datasets.hearing import heard
from monochord.datasets.manifest import FILE, file_checksum
from monochord.datasets.store import Dataset
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor, RecurrentExtractor
from monochord.perception.model.probe import probed
from monochord.perception.training.scratch import release
from monochord.perception.tuning.sessions import at_length_of, retuned_strings

CHUNK = 2048
"""Rows in a file: the unit of work of a process, and the largest loss after a kill."""
MIN_FILES_FOR_WORKERS = 8
"""Number of files from which starting several processes pays off."""
BATCH = 64
MAX_PREPARED = 64
"""Most extractors of retuned strings held at once."""
SEAL, MAX_HEADER = 32, 1024
"""Number of bytes of the SHA-256 after the array, and largest number of bytes before it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AddedNoise:
    """Noise or a fault that is added to one copy of the windows."""

    augmentation: Augmentation | Fault
    copy: int
    seed: int = 0
    sample_rate: int = 44100

    def added(self, windows: Audio, rows: Indices) -> Audio:
        """Return windows (n, channels, frames) from these rows (n,) of the dataset, with the noise added."""
        return self.augmentation(windows, rows, seed=self.seed, epoch=self.copy, sample_rate=self.sample_rate)

    def key(self) -> dict[str, Any]:
        """Return everything that determines the noise, as plain values."""
        about = to_tree(self.augmentation)
        about.pop("copies", None)  # on whose number no copy depends
        return {**about, "copy": self.copy, "seed": self.seed, "sample_rate": self.sample_rate}


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetFeature:
    """A feature of a dataset, with the name and options of the feature.

    `retuned` holds the strings, by session number, of sessions whose string is not tuned as designed, and
    `prepare` returns a string's extractor; `extractor` serves all other sessions. `workers` and `cluster` are
    passed to `monochord.core.workers.run_all`. If neither is given, fewer than `MIN_FILES_FOR_WORKERS` files
    are computed in this process.
    """

    dataset: Dataset
    signal: Signal
    name: str
    options: dict[str, object]
    extractor: Extractor
    folder: Path
    prepare: Callable[[StringParams], Extractor]
    retuned: Mapping[int, StringParams] = field(default_factory=dict[int, StringParams])
    workers: int | None = None
    cluster: str = ""

    def __reduce__(self) -> tuple[Any, ...]:
        """Have another process prepare the feature for itself."""
        return DatasetFeature.prepared, (self.dataset, self.signal, self.name, self.options, self.folder)

    @classmethod
    def prepared(
        cls,
        dataset: Dataset,
        signal: Signal,
        name: str,
        options: dict[str, Any],
        folder: Path,
        *,
        workers: int | None = None,
        cluster: str = "",
    ) -> "DatasetFeature":
        """Return the feature of a dataset, relative to the tuning of each session's string.

        Raises `InputError` if the feature is unknown, or refuses an option or the signal.
        """
        feature, size, design = FEATURES.build(name, options), dataset.manifest.window, signal.string
        retuned = retuned_strings(dataset, design) if design else {}
        strings = {number: at_length_of(string, design) for number, string in retuned.items() if design}

        @lru_cache(MAX_PREPARED)
        def prepare(string: StringParams) -> Extractor:
            return feature.prepare(replace(signal, string=string, design=design), size)

        return cls(
            dataset=dataset,
            signal=signal,
            name=name,
            options=options,
            extractor=feature.prepare(signal, size),
            folder=folder,
            prepare=prepare,
            retuned={number: string for number, string in strings.items() if string != design},
            workers=workers,
            cluster=cluster,
        )

    def of(
        self,
        rows: Indices,
        noise: AddedNoise | None = None,
        progress: Progress = lambda *_: None,
        out: Audio | None = None,
    ) -> Audio:
        """Return the features (k, columns) float32 of k windows; cached rows are read from disk.

        With `out` (k, columns), such as from `scratch.empty`, they are put there, one file in memory at a
        time. Raises `InputError` if the feature gives values that are not finite, or a shape that does not
        match its columns.
        """
        place = self.folder / self._key(rows, noise)
        what = self.name if noise is None else f"{self.name}, with noise {noise.copy}"
        chunks = {
            place / f"{number:04d}.npy": rows[first : first + CHUNK]
            for number, first in enumerate(range(0, len(rows), CHUNK))
        }
        absent = [(file, some) for file, some in chunks.items() if not file.exists()]
        workers = self.workers or (1 if len(absent) < MIN_FILES_FOR_WORKERS else None)
        work = partial(_compute, self, noise)
        done = len(rows) - sum(len(some) for _, some in absent)
        progress(what, done, len(rows))
        for (_, some), _ in run_all(absent, work, workers=workers, cluster=self.cluster):
            done += len(some)
            progress(what, done, len(rows))
        result = np.empty((len(rows), len(self.extractor.columns)), np.float32) if out is None else out
        for first, (file, some) in zip(range(0, len(rows), CHUNK), chunks.items(), strict=True):
            result[first : first + CHUNK] = self._chunk(file, some, noise)
            release(result)
        return result

    def _chunk(self, file: Path, rows: Indices, noise: AddedNoise | None) -> Audio:
        shape = (len(rows), len(self.extractor.columns))
        cached = _cached(file, shape)
        if cached is not None:
            return cached
        result = np.empty(shape, np.float32)
        if isinstance(self.extractor, RecurrentExtractor):
            result[:] = self._streamed(rows, noise)
        else:
            for first in range(0, len(rows), BATCH):
                some = rows[first : first + BATCH]
                result[first : first + BATCH] = self._features(self._windows(some, noise), some)
        if not np.isfinite(result).all():
            given = f"feature '{self.name}' with values that are not finite"
            raise InputError(given, "finite rows", "correct the feature")
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as part:  # another run may have written the same
            part.write_bytes(_sealed(result))
        return result

    def _windows(self, rows: Indices, noise: AddedNoise | None) -> Audio:
        """Return windows (n, channels, size), with the noise added."""
        windows = self.dataset.batch(rows)
        return windows if noise is None else noise.added(windows, rows)

    def _streamed(self, rows: Indices, noise: AddedNoise | None) -> Audio:
        """Return the features (k, columns) of windows (k,), each after those before it in its session."""
        dataset, result = self.dataset, np.empty((len(rows), len(self.extractor.columns)), np.float32)
        session, rate = dataset.session[rows], dataset.manifest.sample_rate
        for number in np.unique(session).tolist():
            string = self.retuned.get(number)
            extractor = self.extractor if string is None else self.prepare(string)
            assert isinstance(extractor, RecurrentExtractor)
            members, memory = np.flatnonzero(session == number), extractor.begin()
            part = dataset.manifest.parts[number]
            stream = np.arange(part.first, rows[members].max() + 1)
            stream = stream[dataset.usable[stream] | np.isin(stream, rows[members])]
            at = dict(zip(rows[members].tolist(), members.tolist(), strict=True))
            for row, window in heard(dataset, stream.tolist(), extractor.tick):
                samples, time = window.samples, window.start / rate
                if noise is not None:
                    samples = noise.added(samples[np.newaxis], np.array([row]))[0]
                memory, values = extractor.step(memory, extractor.analyser.analyse(samples), time)
                if row in at:  # its own window is the last
                    result[at[row]] = values
        return result

    def _features(self, windows: Audio, rows: Indices) -> Audio:
        """Return the feature of windows (n, channels, size), each by the extractor of its session."""
        session = self.dataset.session[rows]
        numbers = np.unique(session).tolist()
        if not any(number in self.retuned for number in numbers):
            return self.extractor(windows)
        result = np.empty((len(rows), len(self.extractor.columns)), np.float32)
        for number in numbers:
            chosen, string = session == number, self.retuned.get(number)
            extractor = self.extractor if string is None else self.prepare(string)
            result[chosen] = extractor(windows[chosen])
        return result

    def _key(self, rows: Indices, noise: AddedNoise | None) -> str:
        about = {
            "feature": self.name,
            "options": to_tree(self.options),
            "columns": list(self.extractor.columns),
            "does": fingerprint(self.extractor, self.dataset.manifest.channels, self.dataset.manifest.window),
            "window": self.dataset.manifest.window,
            "dataset": file_checksum(self.dataset.path / FILE),
            "noise": None if noise is None else noise.key(),
            **({"own": sorted(self.retuned)} if self.retuned else {}),
            **({"tick": self.extractor.tick} if isinstance(self.extractor, RecurrentExtractor) else {}),
            "rows": hashlib.sha256(np.ascontiguousarray(rows, np.int64).tobytes()).hexdigest(),
        }
        return hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()[:32]


def _compute(rows: DatasetFeature, noise: AddedNoise | None, job: tuple[Path, Indices]) -> None:
    """Put the feature of some windows into its file, in whatever process."""
    file, some = job
    rows._chunk(file, some, noise)  # noqa: SLF001


def fingerprint(extractor: Extractor, channels: int, size: Samples) -> str:
    """Return the SHA-256 of the features of the probe windows."""
    return hashlib.sha256(np.ascontiguousarray(probed(extractor, channels, size)).tobytes()).hexdigest()


def _sealed(rows: Audio) -> bytes:
    """Return the bytes of a .npy file with their SHA-256 behind, which NumPy does not look at."""
    out = BytesIO()
    np.save(out, rows)
    return out.getvalue() + hashlib.sha256(out.getvalue()).digest()


def _cached(file: Path, shape: tuple[int, int]) -> Audio | None:
    """Return the rows in a file, or None where it is absent, damaged or something else."""
    try:
        if file.stat().st_size > MAX_HEADER + 4 * shape[0] * shape[1] + SEAL:
            return None
        data = file.read_bytes()
        if hashlib.sha256(data[:-SEAL]).digest() != data[-SEAL:]:
            return None
        rows: Audio = np.load(BytesIO(data))
    except (OSError, ValueError, EOFError):
        return None
    return rows if rows.shape == shape and rows.dtype == np.float32 else None
