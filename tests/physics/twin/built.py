"""The sensor that the twin's tests share, and twins made simpler than any real one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from monochord.core.types import Floats, StringParams
from monochord.physics.materials import load_material
from monochord.physics.strings import load_string
from monochord.physics.theory import Losses
from monochord.physics.twin import Ebow, Key, Pickups, Sensor, Touch, Twin, advance, stream
from monochord.physics.twin import bank as layout
from monochord.physics.twin.rate import Plan

STRING = load_string("prototype").string
COILS = (Ebow(sense=0.02, drive=0.03, gain=0.05), Ebow(sense=0.18, drive=0.17, gain=0.05))
SENSOR = Sensor(name="built", string=STRING, drivers=COILS, range=(0.05, 0.15))
NONE = Losses(air_viscosity=0.0, air_density=0.0, viscoelastic=0.0, thermoelastic=0.0, support=0.0)
QUIET = Pickups(hiss=0.0, own=(1.0, 1.0), angle=0.0, gain=(1.0, 1.0), low=1.0, high=20000.0)
PLASTIC, FOAM = load_material("plastic"), load_material("foam")
RATE = 44100


def flexible(length: float = 0.2) -> Sensor:
    """A string without stiffness, stretch or losses, felt by pickups that add nothing."""
    string = StringParams(length=length, linear_density=4e-4, tension=65.0)
    return replace(SENSOR, string=string, losses=NONE, pickups=QUIET)


def key(time: float, position: float, force: float = 0.0, clearance: float = 0.0, across: float = 0.0) -> Key:
    return Key(time=time, position=position, force=force, clearance=clearance, across=across)


def touch(*keys: Key, rolls: bool = True) -> Touch:
    return Touch(material=PLASTIC, motion=keys, rolls=rolls)


def fixed(twin: Twin) -> dict[str, Floats]:
    return {name: array[0] for name, array in zip(stream.FIXED, twin.fixed, strict=True)}


def moving(twin: Twin) -> dict[str, Floats]:
    return {name: array[0] for name, array in zip(stream.MOVING, twin.moving, strict=True)}


def modes(twin: Twin) -> Floats:
    """The bank, a row a line."""
    return moving(twin)["bank"].reshape(layout.rows(len(twin.scene.touches)), -1)


def changed(twin: Twin, **arrays: Floats) -> Twin:
    """The same twin with other arrays, by their names; the modes must be tuned anew."""
    f, m = fixed(twin), moving(twin)
    m["memory"] = m["memory"].copy()
    m["memory"][0] = 0.0
    f |= {name: array for name, array in arrays.items() if name in f}
    m |= {name: array.ravel() if name == "bank" else array for name, array in arrays.items() if name in m}
    return replace(
        twin,
        fixed=tuple(np.ascontiguousarray(f[name])[None] for name in stream.FIXED),
        moving=tuple(np.ascontiguousarray(m[name])[None] for name in stream.MOVING),
    )


def with_touch(twin: Twin, **values: float) -> Twin:
    """The same twin with other parameters of its touches, by their names in the kernel."""
    from monochord.physics.twin import memory

    touches = fixed(twin)["touches"].copy()
    for name, value in values.items():
        touches[:, getattr(memory, name)] = value
    return changed(twin, touches=touches)


def planned(patch: pytest.MonkeyPatch, finer: int, count: int = 16, beta: float = 0.44) -> None:
    """Let every twin that begins have these steps a frame and modes."""
    plan = Plan(finer=finer, count=count, beta=beta, error=0.0)

    def given(*_: Any, **__: Any) -> Plan:
        return plan

    patch.setattr(stream, "plan", given)


def waiting(twin: Twin) -> Twin:
    """The same twin, whose only touch stands from the start where it will be after the first tick."""
    after = advance(twin, 32)[1]
    depth = moving(after)["ahead"][0, 4]
    below = float(modes(after)[layout.SHAPE] @ modes(twin)[layout.Q])
    ahead, contact = moving(twin)["ahead"].copy(), moving(twin)["contact"].copy()
    ahead[0, 4] = depth
    contact[0, 1] = depth - below
    return changed(twin, ahead=ahead, contact=contact)


def frequency(sound: Floats, near: float, rate: float = RATE) -> float:
    """The frequency in Hz of the partial near one that is given: how its phase goes on by half the sound."""
    half = sound.size // 2
    window = np.kaiser(half, 18.0)
    time = np.arange(sound.size) / rate
    found = near
    coarse = near + np.arange(-10.0, 10.5, 0.5)
    windowed = window * sound[:half]
    found = coarse[np.argmax([abs(windowed @ np.exp(-2j * np.pi * f * time[:half])) for f in coarse])]
    for _ in range(4):
        turned = sound * np.exp(-2j * np.pi * found * time)
        found += (
            np.angle((window @ turned[half:]) * np.conj(window @ turned[:half])) * rate / (2 * np.pi * half)
        )
    return float(found)


def cents(found: float, true: float) -> float:
    return 1200.0 * float(np.log2(found / true))
