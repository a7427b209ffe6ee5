"""Drops of three objects between two strings, caught by a reflex that hears slip.

Makes what `docs/how-to/simulate-a-robot.md` says of the grasp, in some two minutes:
``python -m studies.grasp_by_slip``.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from studies._command import measure

from monochord.benchmarks.base import Benchmark, Row
from monochord.core.errors import InputError
from monochord.sim.grasp import OBJECTS, GraspScene, grasp, slip_reflex

THRESHOLDS = {"ideal": 0.2, "plausible": 0.5}
"""Of the reflex: noise and tolerances raise the estimate of slip where nothing slides."""
ALLOWED = 1.5
"""Largest final grip, in times the least that holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspBySlip(Benchmark):
    """How many objects of unknown weight and friction the reflex catches within 15 mm, and how hard it grips.

    Beside it, a grip of 0.6 N without the reflex, with which it begins.

    Parameters
    ----------
    episodes
        Number of drops; objects take turns.
    first
        Seed of the first drop; the reflex was chosen on the drops 1000 to 1020.
    world
        ``ideal`` or ``plausible``.
    """

    episodes: int = 50
    first: int = 2000
    world: str = "ideal"

    def __post_init__(self) -> None:
        if not 3 <= self.episodes <= 10_000:
            raise InputError(f"{self.episodes} episodes", "3 to 10000")
        if self.world not in THRESHOLDS:
            raise InputError(f"world '{self.world}'", "ideal or plausible")

    def run(self) -> Iterator[Row]:
        """Run all episodes, and count."""
        scene = GraspScene(world="plausible" if self.world == "plausible" else "ideal")
        names = list(OBJECTS)
        turns = [(seed, names[seed % len(names)]) for seed in range(self.first, self.first + self.episodes)]
        threshold = THRESHOLDS[self.world]
        ends = [(name, grasp(scene, slip_reflex(threshold=threshold), seed, name)) for seed, name in turns]
        alone = sum(grasp(scene, lambda _: 0.6, seed, name).caught for seed, name in turns)
        for kind in ("all", *names):
            of_kind = [end for name, end in ends if kind in ("all", name)]
            caught = [end for end in of_kind if end.caught]
            grips = [end.grip / end.needed for end in caught]
            yield Row(name=f"{kind}: drops", value=len(of_kind), unit="1")
            yield Row(name=f"{kind}: caught within 15 mm", value=len(caught), unit="1")
            yield Row(
                name=f"{kind}: median drop",
                value=1e3 * float(np.median([e.drop for e in of_kind])),
                unit="mm",
            )
            if grips:
                yield Row(
                    name=f"{kind}: median final grip over needed", value=float(np.median(grips)), unit="1"
                )
                yield Row(
                    name=f"{kind}: caught, grip at most {ALLOWED:g}",
                    value=sum(g <= ALLOWED for g in grips),
                    unit="1",
                )
                yield Row(name=f"{kind}: largest final grip over needed", value=max(grips), unit="1")
        yield Row(name="all: caught by 0.6 N without the reflex", value=alone, unit="1")


if __name__ == "__main__":
    measure(GraspBySlip)
