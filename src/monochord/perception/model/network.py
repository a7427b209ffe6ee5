"""The heads as arithmetic: from a scaled row to what each head answers, in plain NumPy."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio
from monochord.perception.model.definition import Definition

Indices = NDArray[np.int64]
Layers = tuple[tuple[Audio, Audio], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What a head's last layer says: a logit, or an amount in its own scale with the log of its spread."""

    value: float
    log_spread: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """The scaling and the layers of all heads.

    Each row is answered by itself, never in a batch, so that the same row gives the same bits wherever it
    is asked for.
    """

    scaler: tuple[Audio, Audio]
    context_scaler: tuple[Audio, Audio] | None
    clip: float
    layers: Mapping[str, Layers]
    context: Mapping[str, bool]
    seen: Mapping[str, Indices | None]

    @classmethod
    def of(cls, definition: Definition, weights: Mapping[str, Audio]) -> "Network":
        """Build it from a definition and weights of its shapes."""
        return cls(
            scaler=(weights["scaler.mean"], weights["scaler.scale"]),
            context_scaler=(weights["context.mean"], weights["context.scale"])
            if definition.widths[1]
            else None,
            clip=definition.clip,
            layers={
                name: tuple(
                    (weights[f"{name}.{number}.weight"], weights[f"{name}.{number}.bias"])
                    for number in range(len(record.task.hidden) + 1)
                )
                for name, record in definition.heads.items()
            },
            context={name: record.task.context for name, record in definition.heads.items()},
            seen={
                name: np.array(definition.seen(name)) if record.task.columns else None
                for name, record in definition.heads.items()
            },
        )

    def scaled(self, row: Audio) -> Audio:
        """Return a window's feature (d,) less its mean, in standard deviations, bounded by `clip`."""
        return scaled(row, *self.scaler, self.clip)

    def scaled_context(self, row: Audio) -> Audio:
        """Return a reference (c,) as `scaled` does; the columns of one that is absent are zeros."""
        if self.context_scaler is None:
            return row[:0]
        found = scaled(row, *self.context_scaler, self.clip)
        return found if row[-1] else np.zeros_like(found)

    def answer(self, name: str, base: Audio, context: Audio) -> Answer:
        """Return what a head says of a scaled feature and a scaled reference."""
        seen = self.seen[name]
        row = base if seen is None else base[seen]
        row = np.concatenate([row, context]) if self.context[name] and context.size else row
        layers = self.layers[name]
        for weight, bias in layers[:-1]:
            row = np.maximum(weight @ row + bias, np.float32(0.0))
        weight, bias = layers[-1]
        value, *spread = (weight @ row + bias).tolist()
        return Answer(value=value, log_spread=spread[0] if spread else 0.0)


def scaled(row: Audio, mean: Audio, scale: Audio, clip: float) -> Audio:
    """Return rows (..., d) less `mean`, divided by `scale`, and bounded by `clip` on both sides.

    >>> one, two = np.ones(1, np.float32), np.full(1, 2.0, np.float32)
    >>> scaled(np.array([[5.0], [100.0]], np.float32), one, two, 8.0).tolist()
    [[2.0], [8.0]]
    """
    return np.clip((row - mean) / scale, -clip, clip)
