"""YAMNet's form with weights drawn by chance, for what holds with any; and the real file if it is there."""

from itertools import pairwise

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.perception.encoders.yamnet import Convolution, Yamnet, load_yamnet

CHANNELS = (32, 64, 128, 128, 256, 256, *[512] * 6, 1024, 1024)
HALVED = (1, 4, 8, 12, 24)


def drawn(seed: int = 0) -> Yamnet:
    stream = np.random.default_rng(seed)

    def one(layer: int, *shape: int) -> Convolution:
        fan = 9 if len(shape) == 3 else shape[0]
        kernel = stream.normal(0.0, (2.0 / fan) ** 0.5, shape).astype(np.float32)
        bias = stream.normal(0.0, 0.1, shape[-1]).astype(np.float32)
        return Convolution(kernel=kernel, bias=bias, stride=2 if layer in HALVED else 1)

    layers = [one(1, 9, 32)]
    for before, after in pairwise(CHANNELS):
        layers.append(one(len(layers) + 1, 3, 3, before))
        layers.append(one(len(layers) + 1, before, after))
    kinds = stream.normal(0.0, 0.05, (1024, 521)).astype(np.float32)
    return Yamnet(convolutions=tuple(layers), kinds=kinds, kinds_bias=np.zeros(521, np.float32))


@pytest.fixture(scope="session")
def by_chance() -> Yamnet:
    return drawn()


@pytest.fixture(scope="session")
def real() -> Yamnet:
    try:
        return load_yamnet()
    except InputError as error:
        pytest.skip(str(error))
