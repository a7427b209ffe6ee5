"""Checkpoints: the state of training after an epoch; an interrupted run resumes from it with equal results.

A checkpoint is one safetensors file, replaced atomically: after a kill, the file is whole.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path

import numpy as np

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.files import replacing, synced
from monochord.core.types import Audio

Line = dict[str, float]
REMEDY = "remove it to begin anew"


@dataclass(frozen=True, slots=True, kw_only=True)
class _State:
    """Metadata beside the tensors in the file; `sum` is the SHA-256 of those, by name."""

    epoch: int
    data: str
    sum: str
    score: dict[str, float]
    at: dict[str, int]
    history: Sequence[Mapping[str, int | float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """The state of training after `epoch` epochs on data with the checksum `data`.

    `weights` and the optimiser's `moments` belong to the last epoch. `best` holds each head's weights in its
    best epoch; `at` is this epoch and `score` its validation error, by head. `history` has a line for each
    epoch.
    """

    epoch: int
    data: str
    weights: dict[str, Audio]
    moments: dict[str, Audio]
    best: dict[str, Audio]
    score: dict[str, float]
    at: dict[str, int]
    history: list[Line] = field(default_factory=list[Line])

    @classmethod
    def none(cls, data: str) -> "Checkpoint":
        """Return the state before any epoch, without a network."""
        return cls(epoch=0, data=data, weights={}, moments={}, best={}, score={}, at={})

    def write(self, file: Path) -> None:
        """Write the checkpoint to a file, replacing the previous one."""
        from safetensors.numpy import save  # noqa: PLC0415

        parts = {"weights": self.weights, "moments": self.moments, "best": self.best}
        tensors = {
            f"{part}/{name}": np.asarray(array, order="C")
            for part, arrays in parts.items()
            for name, array in arrays.items()
        }
        state = _State(
            epoch=self.epoch,
            data=self.data,
            sum=_sum(tensors),
            score=self.score,
            at=self.at,
            history=self.history,
        )
        with replacing(file) as part, part.open("wb") as stream:
            stream.write(save(tensors, metadata={"state": json.dumps(asdict(state))}))
            stream.flush()
            synced(stream.fileno())

    @classmethod
    def read(cls, file: Path) -> "Checkpoint | None":
        """Return the checkpoint in a file, None without a file; raises `InputError` if it is damaged."""
        from safetensors import SafetensorError, safe_open  # noqa: PLC0415

        if not file.is_file():
            return None
        damaged = InputError(f"checkpoint {file} (damaged)", "a whole file", REMEDY)
        try:
            with safe_open(file, framework="numpy") as stored:
                tensors: dict[str, Audio] = {key: stored.get_tensor(key) for key in stored.keys()}  # noqa: SIM118  (no mapping)
                state = from_tree(_State, json.loads(stored.metadata()["state"]), f"checkpoint {file}")
        except InputError as error:
            raise InputError(error.given, error.expected, REMEDY) from error
        except (
            SafetensorError,
            OSError,
            ValueError,
            KeyError,
            TypeError,
            AttributeError,
            RecursionError,
        ) as error:
            raise damaged from error
        if state.sum != _sum(tensors):
            raise damaged
        parts: dict[str, dict[str, Audio]] = {"weights": {}, "moments": {}, "best": {}}
        for key, array in tensors.items():
            part, _, name = key.partition("/")
            if part not in parts or array.dtype != np.float32 or not np.isfinite(array).all():
                given = f"checkpoint {file} ({key} of {array.dtype}, or not finite)"
                raise InputError(given, "finite float32 numbers", REMEDY)
            parts[part][name] = array
        return cls(
            **parts,
            epoch=state.epoch,
            data=state.data,
            score=state.score,
            at=state.at,
            history=[dict(line) for line in state.history],
        )


def _sum(tensors: Mapping[str, Audio]) -> str:
    digest = sha256()
    for name in sorted(tensors):
        digest.update(f"{name} {tensors[name].dtype} {tensors[name].shape} ".encode())
        digest.update(np.ascontiguousarray(tensors[name]).tobytes())
    return digest.hexdigest()
