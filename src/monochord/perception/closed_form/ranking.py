"""Which hypothesis is right: a small network, trained across builds, over their measures.

The network gives each hypothesis of a window a score; a softmax over the window makes it a probability.
`python -m studies.mode_networks` trains it and writes `mode_ranking.safetensors` beside this file.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel
from monochord.core.types import Floats
from monochord.perception.closed_form.hypotheses import MEASURES
from monochord.perception.closed_form.weights import Weights, read_weights

FILE = Path(__file__).with_name("mode_ranking.safetensors")
MAX_DEVIATION = 6.0
"""Standard deviations of the training beyond which a measure is taken for that many."""


class Ranking(NamedTuple):
    """A network of two hidden layers (ReLU): what scales its inputs, and weights (inputs, outputs)."""

    mean: Weights
    scale: Weights
    weight_1: Weights
    bias_1: Weights
    weight_2: Weights
    bias_2: Weights
    weight_3: Weights


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
    ranking = Ranking(*read_weights(file, Ranking._fields))
    if ranking.mean.shape != (MEASURES,):
        raise ValueError(f"{file.name} is of {len(ranking.mean)} measures, not {MEASURES}: train it again")
    return ranking


@kernel()
def probabilities(measures: Floats, ranking: Ranking) -> Floats:
    """Return the probability (n,) of each hypothesis of a window from their measures (n, `MEASURES`)."""
    scores = np.empty(measures.shape[0])
    scaled = np.empty_like(ranking.mean)
    for k in range(measures.shape[0]):
        for i in range(scaled.size):
            value = (measures[k, i] - ranking.mean[i]) / ranking.scale[i]
            scaled[i] = min(max(value, -MAX_DEVIATION), MAX_DEVIATION)
        first, second = ranking.bias_1.copy(), ranking.bias_2.copy()
        for i in range(scaled.size):
            entered = scaled[i]
            for h in range(first.size):
                first[h] += entered * ranking.weight_1[i, h]
        for i in range(first.size):
            entered = first[i]
            if entered > 0.0:
                for h in range(second.size):
                    second[h] += entered * ranking.weight_2[i, h]
        score = 0.0
        for h in range(second.size):
            score += max(second[h], 0.0) * ranking.weight_3[h, 0]
        scores[k] = score
    likelihoods = np.exp(scores - scores.max())
    return likelihoods / likelihoods.sum()
