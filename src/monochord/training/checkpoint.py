"""Where training stands after an epoch, on disk, so that a run that was killed goes on as if it were not.

One safetensors file, replaced at once: a kill leaves the one before or this one, never half of one.
"""

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from monochord.errors import InputError
from monochord.types import Audio

Line = dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """`epoch` epochs are done, on data that have the checksum `data`; `history` has a line for each.

    `weights` and the optimiser's `moments` are as they stand; `best` are each head's at its best, and `score`
    and `at` tell how good that is and after which epoch.
    """

    epoch: int
    data: str
    weights: dict[str, Audio]
    moments: dict[str, Audio]
    best: dict[str, Audio]
    score: dict[str, float]
    at: dict[str, int]
    history: list[Line] = field(default_factory=list[Line])

    def write(self, file: Path) -> None:
        """Write it, replacing the one before."""
        from safetensors.numpy import save  # noqa: PLC0415

        parts = {"weights": self.weights, "moments": self.moments, "best": self.best}
        tensors = {
            f"{part}/{name}": np.asarray(array, order="C")
            for part, held in parts.items()
            for name, array in held.items()
        }
        state = {
            "epoch": self.epoch,
            "data": self.data,
            "score": self.score,
            "at": self.at,
            "history": self.history,
        }
        part = file.with_name(f".{file.name}.part")
        with part.open("wb") as stream:
            stream.write(save(tensors, metadata={"state": json.dumps(state)}))
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(part, file)  # noqa: PTH105

    @classmethod
    def read(cls, file: Path) -> "Checkpoint | None":
        """Return what stands in a file, None where there is none; raises `InputError` if it is damaged."""
        from safetensors import SafetensorError, safe_open  # noqa: PLC0415

        if not file.is_file():
            return None
        held: dict[str, dict[str, Audio]] = {"weights": {}, "moments": {}, "best": {}}
        try:
            with safe_open(file, framework="numpy") as tensors:
                state: dict[str, Any] = json.loads(tensors.metadata()["state"])
                for key in tensors.keys():  # noqa: SIM118  (it is no mapping)
                    part, _, name = key.partition("/")
                    held[part][name] = tensors.get_tensor(key)
            return cls(**held, **state)
        except (SafetensorError, OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"checkpoint {file} (damaged)", "a whole file", "remove it to begin anew"
            ) from error
