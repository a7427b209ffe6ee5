"""Many virtual sensors at once, as a simulation with many environments needs them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, overload

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from monochord.core.errors import InputError
from monochord.core.ranges import Seed, checked
from monochord.core.shapes import numbers
from monochord.core.types import Audio, Floats
from monochord.core.units import Seconds
from monochord.physics.setup import Sensor
from monochord.physics.twin.virtual_sensor import (
    MAX_SECONDS,
    Snapshot,
    VirtualSensor,
    advance_together,
    lead_together,
)
from monochord.physics.twin.world import World


class VirtualSensors(Sequence[VirtualSensor]):
    """Several virtual sensors whose time advances together, on all cores, as for many environments at once.

    Each is a `VirtualSensor` and gives the sound that it gives alone, to the last bit; it can be touched, led
    and read by its number. All sound is simulated.

    Parameters
    ----------
    sensor, day, world, sample_rate, objects
        As of `VirtualSensor`.
    count
        Number of sensors.
    seed, build
        Of the first sensor; each next one has the next number. Without `build` all are the design itself.
    cores
        Number of cores to use; by default all that this process may use.

    Raises
    ------
    InputError
        As `VirtualSensor` does, or for a count below 1.

    Examples
    --------
    >>> sensors = VirtualSensors(count=2, objects=["plastic"])
    >>> sensors.lead(0.01, position=np.array([[[0.08]], [[0.09]]]), force=1.0)
    >>> sound, labels = sensors.advance(0.1)
    >>> sound.shape, labels["position"][:, -1].round(3).tolist()
    ((2, 2, 4410), [0.08, 0.09])
    """

    @checked
    def __init__(
        self,
        sensor: str | Path | Sensor = "prototype",
        *,
        count: Annotated[int, Meta(ge=1)],
        seed: Seed = 0,
        build: Seed | None = None,
        day: Seed | None = None,
        world: World = "ideal",
        sample_rate: Annotated[int, "Hz", Meta(ge=16_000, le=192_000)] = 44100,
        objects: Sequence[str | Path] = (),
        cores: Annotated[int, Meta(ge=1)] | None = None,
    ) -> None:
        self._cores = cores
        self._sensors = tuple(
            VirtualSensor(
                sensor,
                seed=seed + number,
                build=None if build is None else build + number,
                day=day,
                world=world,
                sample_rate=sample_rate,
                objects=objects,
            )
            for number in range(count)
        )

    def __len__(self) -> int:
        return len(self._sensors)

    @overload
    def __getitem__(self, index: int) -> VirtualSensor: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[VirtualSensor]: ...
    def __getitem__(self, index: int | slice) -> VirtualSensor | Sequence[VirtualSensor]:
        return self._sensors[index]

    @checked
    def lead(
        self,
        step: Annotated[Seconds, Meta(gt=0.0, le=MAX_SECONDS)],
        *,
        position: ArrayLike,
        force: ArrayLike = 0.0,
        clearance: ArrayLike = 0.0,
        across: ArrayLike = 0.0,
    ) -> None:
        """Lead the objects of all sensors, as `VirtualSensor.lead` those of one.

        Every value is (sensors, objects, k), or broadcasts to it.
        """
        values = {"position": position, "force": force, "clearance": clearance, "across": across}
        arrays = {name: numbers(value, float, name) for name, value in values.items()}
        for name, array in arrays.items():
            if array.ndim > 3 or (array.ndim == 3 and len(array) not in (1, len(self))):
                given = f"{name} of the shape {array.shape}"
                raise InputError(given, f"({len(self)}, objects, k), or what broadcasts to it")
        given = arrays.values()
        rows = [[a if a.ndim < 3 else a[number % len(a)] for a in given] for number in range(len(self))]
        lead_together(self, step, rows)

    def snapshot(self) -> tuple[Snapshot, ...]:
        """Return the present states of all sensors, for `restore`."""
        return tuple(each.snapshot() for each in self)

    @checked
    def restore(self, snapshots: Sequence[Snapshot]) -> None:
        """Go back to snapshots, one of each sensor."""
        if len(snapshots) != len(self):
            raise InputError(f"{len(snapshots)} snapshots", f"{len(self)}, one of each sensor")
        for each, snapshot in zip(self, snapshots, strict=True):
            each.restore(snapshot)

    @checked
    def advance(
        self, seconds: Annotated[Seconds, Meta(ge=0.0, le=MAX_SECONDS)]
    ) -> tuple[Audio, dict[str, Floats]]:
        """Advance time, and return the sound (sensors, 2, n) and its ground truth, (sensors, n) by name."""
        sounds, labels = zip(*advance_together(self._sensors, seconds, self._cores), strict=True)
        return np.stack(sounds), {name: np.stack([each[name] for each in labels]) for name in labels[0]}
