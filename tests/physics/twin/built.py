"""The sensor that the twin's tests share, and twins made simpler than any real one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from monochord.core.types import Floats, StringParams
from monochord.physics.materials import load_material
from monochord.physics.strings import load_string
from monochord.physics.theory import Losses, static_compliance
from monochord.physics.twin import (
    ContactLaw,
    Ebow,
    End,
    Key,
    Mount,
    Pickups,
    Scene,
    Sensor,
    Touch,
    Twin,
    advance,
    begin,
    hold,
    stream,
)
from monochord.physics.twin import records as layout
from monochord.physics.twin.ends import lengthened
from monochord.physics.twin.rate import RatePlan, mode_frequencies, touch_weights
from monochord.physics.twin.records import rows

STRING = load_string("prototype").string
COILS = (Ebow(sense=0.02, drive=0.03, gain=0.05), Ebow(sense=0.18, drive=0.17, gain=0.05))
SENSOR = Sensor(name="built", string=STRING, drivers=COILS, range=(0.05, 0.15))
NONE = Losses(air_viscosity=0.0, air_density=0.0, viscoelastic=0.0, thermoelastic=0.0, support=0.0)
QUIET = Pickups(hiss=0.0, own=(1.0, 1.0), angle=0.0, gain=(1.0, 1.0), low=1.0, high=20000.0)
PLASTIC, FOAM = load_material("plastic"), load_material("foam")
RATE = 44100
RIGID, HERTZ = Mount(), ContactLaw()
AT = 0.077
"""Where the string rests on a spring, in m."""


def flexible(length: float = 0.2) -> Sensor:
    """A string without stiffness, stretch or losses, felt by pickups that add nothing."""
    string = StringParams(length=length, linear_density=4e-4, tension=65.0)
    return replace(SENSOR, string=string, losses=NONE, pickups=QUIET)


def key(time: float, position: float, force: float = 0.0, clearance: float = 0.0, across: float = 0.0) -> Key:
    return Key(time=time, position=position, force=force, clearance=clearance, across=across)


def touch(*keys: Key, rolls: bool = True) -> Touch:
    return Touch(material=PLASTIC, motion=keys, rolls=rolls)


def inside(twin: Twin, name: str) -> Any:
    """An array of the kernel's parameters or state, of one sensor."""
    owners = twin.parameters, twin.state, twin.plausible
    return next(getattr(owner, name)[0] for owner in owners if hasattr(owner, name))


def modes(twin: Twin) -> Floats:
    """The bank, a row a line."""
    return inside(twin, "bank").reshape(rows(len(twin.scene.touches)), -1)


def changed(twin: Twin, **arrays: Any) -> Twin:
    """The same twin with other arrays, by their names; the modes are tuned again."""
    memory = arrays.pop("memory", inside(twin, "memory")).copy()
    memory["tuned_tension"] = 0.0
    batches = {name: np.array(array) for name, array in (arrays | {"memory": memory}).items()}
    batches = {name: (a.ravel() if name == "bank" else a)[None] for name, a in batches.items()}
    fixed = {name: batches.pop(name) for name in twin.parameters._fields if name in batches}
    return replace(twin, parameters=twin.parameters._replace(**fixed), state=twin.state._replace(**batches))


def with_touch(twin: Twin, **values: float) -> Twin:
    """The same twin with other parameters of its touches."""
    touches = inside(twin, "touches").copy()
    for name, value in values.items():
        touches[name] = value
    return changed(twin, touches=touches)


def planned(patch: pytest.MonkeyPatch, oversampling: int, count: int = 16, beta: float = 0.44) -> None:
    """Let every twin that begins have these steps a frame and modes."""
    plan = RatePlan(oversampling=oversampling, count=count, beta=beta, error=0.0)

    def given(*_: Any, **__: Any) -> RatePlan:
        return plan

    patch.setattr(stream, "plan", given)


def waiting(twin: Twin) -> Twin:
    """The same twin, whose only touch is from the start where it will be after the first control update."""
    after = advance(twin, 32)[1]
    ahead, contact = inside(twin, "ahead").copy(), inside(twin, "contact").copy()
    ahead["depth"] = inside(after, "ahead")["depth"]
    contact["eta"] = ahead["depth"] - float(modes(after)[layout.SHAPE] @ modes(twin)[layout.Q])
    return changed(twin, ahead=ahead, contact=contact)


def sprung(
    stiffness: float,
    *,
    hertz: bool = False,
    finer: int | None = None,
    force: float = 1.0,
    mount: Mount = RIGID,
    law: ContactLaw = HERTZ,
    ends: tuple[End, End] = (End(), End()),
) -> Twin:
    """A flexible string that rests on a spring without width, at rest but for a slight stir."""
    quiet = replace(QUIET, low=500.0)  # which the static press does not pass
    sensor = replace(flexible(), pickups=quiet, ends=ends)
    string = lengthened(sensor).string
    pressed = replace(hold(AT, force, PLASTIC), mount=mount, law=law)
    twin = begin(sensor, Scene(touches=(pressed,), drivers=(False, False)), oversampling=finer)
    plan, half = twin.plan, modes(twin).shape[1] // 2
    omega = mode_frequencies(string, plan.count)
    weights = np.zeros((1, half))
    weights[0, : plan.count] = np.sqrt(touch_weights(omega, 1.0 / (RATE * plan.oversampling), plan.beta))
    places = np.linspace(0.0, string.length, 513)[1:-1]
    table = np.zeros((1, 513))
    table[0, 1:-1] = static_compliance(string, places)
    # f = k2 delta^1.5 has the tangent K = 1.5 k2 s, s = sqrt(delta), where k2 s^3 = F.
    s = np.sqrt(1.5 * force / stiffness)
    springs = {"k1": 0.0, "k2": stiffness / (1.5 * s)} if hertz else {"k1": stiffness, "k2": 0.0}
    damped = modes(twin).copy()
    damped[layout.DECAY] = 300.0
    twin = with_touch(
        changed(twin, weights=weights, compliance=table, bank=damped), beta=0.0, roughness=0.0, **springs
    )
    twin = advance(twin, 345 * layout.CONTROL_PERIOD)[1]  # to a control update, which tunes it again
    stirred = modes(twin).copy()
    stirred[layout.DECAY] = 0.0
    stirred[layout.V, : plan.count] += 1e-4 / np.arange(1, plan.count + 1) * np.cos(np.arange(plan.count))
    return changed(twin, bank=stirred)


def partials_off(twin: Twin, true: Floats) -> Floats:
    sound = advance(twin, RATE)[0].microphones.astype(np.float64)
    sound -= sound.mean(axis=1, keepdims=True)
    both = sound[0] + 0.37 * sound[1]
    return np.array([cents(frequency(both, f), f) for f in true])


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
