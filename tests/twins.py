"""The sound of a virtual sensor that is touched and let go."""

from typing import Any

import numpy as np

from monochord.core.types import Audio, Floats
from monochord.physics.twin.virtual_sensor import VirtualSensor

Step = float | tuple[float, float] | None
"""Seconds that pass, the position and the force of a press, or None as it is let go."""


def sound_of(twin: VirtualSensor, *steps: Step, **press: Any) -> tuple[Audio, dict[str, Floats]]:
    """Return sound and truth of a twin over steps; `press` are further arguments of each press."""
    parts: list[tuple[Audio, dict[str, Floats]]] = []
    for step in steps:
        if step is None:
            twin.release()
        elif isinstance(step, tuple):
            twin.press(*step, **press)
        else:
            parts.append(twin.advance(step))
    truth = {name: np.concatenate([labels[name] for _, labels in parts]) for name in parts[0][1]}
    return np.concatenate([sound for sound, _ in parts], axis=1), truth
