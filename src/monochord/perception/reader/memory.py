"""The reader's memory of a touch: from what each window tells to what all windows until now tell.

A touch tells its place in its first 0.3 s and then fades: free partials die, both drivers hold one line, and
what is left fits several places. Likewise an untouched string whose drivers hold mode 2 sounds like a touch
at the middle. So what the network makes of a window, physics' measures and the sound between the lines enter
a gated recurrent unit, whose state is the memory, and a last layer reads all outputs anew from both. Beside
it a density of the place is held: a gate says how much of it each window's own density replaces, little
while a touch rests, all while it slides. The outputs' density is the last layer's plus the held one, weighted
by how far that is trusted.

Cho et al. (2014), Learning phrase representations using RNN encoder-decoder, EMNLP, equations 5 to 8; the
reset gate is applied after the product with the state, as cuDNN and PyTorch do.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from monochord.core.types import Audio, Floats
from monochord.core.units import Seconds
from monochord.perception.reader.network import FILE, KINDS, POSITIONS, MemoryNetwork, recalled

TICK: Seconds = 0.02
"""Time between two windows that enter the memory, as trained; windows in between are read with it, and leave
it unchanged."""
TIME_TOLERANCE: Seconds = 1e-3
"""A window enters the memory if it is this much before its time."""
MAX_ELAPSED: Seconds = 1.0
"""Longest time between two windows over which the memory lasts."""
HIDDEN = 128
"""Size of the memory."""
SUMMARY = 96
"""Number of values that the outputs are read from."""


class Memory(NamedTuple):
    """What a stream's windows until now tell.

    The state of the recurrent unit, the log density (1 + positions,) held, and when both last changed.
    """

    hidden: Audio
    held: Audio
    time: Seconds


def no_memory() -> Memory:
    """Return the memory at the beginning of a stream."""
    return Memory(np.zeros(HIDDEN, np.float32), np.zeros(0, np.float32), -math.inf)


class Recollection(NamedTuple):
    """What a window and the memory tell together.

    `logits` (1 + positions,) and `kinds` (kinds,) as the network gives them for a window alone, `outputs` of
    `OUTPUTS` (5,), and the `summary` (`SUMMARY`,) that all are read from.
    """

    logits: Floats
    kinds: Floats
    outputs: Floats
    summary: Audio


@cache
def bundled_memory() -> MemoryNetwork:
    """Return the memory's network of the package."""
    from safetensors.numpy import load  # noqa: PLC0415

    arrays = load(FILE.read_bytes())
    return MemoryNetwork(*(np.ascontiguousarray(arrays[name], np.float32) for name in MemoryNetwork._fields))


def recall(
    memory: Memory, inputs: Audio, density: Audio, time: Seconds, network: MemoryNetwork
) -> tuple[Memory, Recollection]:
    """Return the memory after a window that starts at a time in s, and what both tell.

    `inputs` and `density` are those of `memory_inputs`. A window that starts less than `TICK` after the last
    one that entered is read like any other, but does not enter. After `MAX_ELAPSED` without a window nothing
    is remembered.
    """
    since = time - memory.time
    if since > MAX_ELAPSED:
        memory = no_memory()
    elapsed = math.log2(max(since, TICK) / TICK) if math.isfinite(memory.time) else 0.0
    before = memory.held if memory.held.size else density
    hidden, held, summary, outputs = recalled(inputs, density, memory.hidden, before, elapsed, network)
    if since >= TICK - TIME_TOLERANCE:
        memory = Memory(hidden, held, time)
    kinds = 1 + len(POSITIONS)
    return memory, Recollection(
        outputs[:kinds], outputs[kinds : kinds + len(KINDS)], outputs[kinds + len(KINDS) :], summary
    )
