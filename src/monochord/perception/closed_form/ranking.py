"""Which hypothesis is right: a small network, trained across builds, over their measures.

The network gives each hypothesis of a window a score; a softmax over the window makes it a probability.
`monochord.perception.training.mode_ranking` trains it and writes `mode_ranking.safetensors` beside this file.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np

from monochord.core.types import Floats
from monochord.perception.closed_form.hypotheses import MEASURES

FILE = Path(__file__).with_name("mode_ranking.safetensors")
MAX_DEVIATION = 6.0
"""Standard deviations of the training beyond which a measure is taken for that many."""


class Ranking(NamedTuple):
    """A network of two hidden layers (ReLU): what scales its inputs, and weights (inputs, outputs)."""

    mean: Floats
    scale: Floats
    weight_1: Floats
    bias_1: Floats
    weight_2: Floats
    bias_2: Floats
    weight_3: Floats


@cache
def mode_ranking() -> Ranking:
    """Return the network of the package, read once.

    Examples
    --------
    >>> len(mode_ranking().mean) == MEASURES
    True
    """
    return read_ranking(FILE)


def read_ranking(file: Path) -> Ranking:
    """Return the network in a file."""
    from safetensors.numpy import load  # noqa: PLC0415

    arrays = load(file.read_bytes())
    ranking = Ranking(*(np.ascontiguousarray(arrays[name], float) for name in Ranking._fields))
    if ranking.mean.shape != (MEASURES,):
        raise ValueError(f"{file.name} is of {len(ranking.mean)} measures, not {MEASURES}: train it again")
    return ranking


@numba.njit(cache=True, error_model="numpy")
def probabilities(measures: Floats, ranking: Ranking) -> Floats:
    """Return the probability (n,) of each hypothesis of a window from their measures (n, `MEASURES`)."""
    scores = np.empty(measures.shape[0])
    first, second = np.empty(ranking.bias_1.size), np.empty(ranking.bias_2.size)
    for k in range(measures.shape[0]):
        first[:] = ranking.bias_1
        for i in range(ranking.mean.size):
            value = (measures[k, i] - ranking.mean[i]) / ranking.scale[i]
            value = min(max(value, -MAX_DEVIATION), MAX_DEVIATION)
            for h in range(first.size):
                first[h] += value * ranking.weight_1[i, h]
        second[:] = ranking.bias_2
        for i in range(first.size):
            if first[i] > 0.0:
                for h in range(second.size):
                    second[h] += first[i] * ranking.weight_2[i, h]
        scores[k] = 0.0
        for h in range(second.size):
            scores[k] += max(second[h], 0.0) * ranking.weight_3[h, 0]
    likelihoods = np.exp(scores - scores.max())
    return likelihoods / likelihoods.sum()
