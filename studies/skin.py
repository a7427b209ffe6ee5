"""A skin of 8 strings on a cylinder: its wrench and covariance, computing time, and errors on the twin.

Prints its table in some forty seconds: ``python -m studies.skin``. All sound is simulated.
"""

import math
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from studies._command import measure

import monochord as mc
from monochord.benchmarks.base import Benchmark, Row
from monochord.core.ranges import Checked, Count, Seed
from monochord.core.types import Audio, Floats
from monochord.core.units import Seconds

RADIUS, LENGTH = 0.03, 0.2
RATE, WINDOW, HOP = 44100, 0.1, 0.01
HOLD: Seconds = 0.6
PAUSE: Seconds = 0.4
SETTLED: Seconds = 0.3
"""From the start of a press on, its force is constant and windows hold nothing else."""
PLACE, PLACE_STD, FORCE, FORCE_STD = 0.08, 1e-3, 1.2, 0.2
"""The touch of the Monte Carlo, in m and N."""
LEAST_STD = 1e-6
"""Standard error in N or N m below which a component of a wrench is none that the touched strings have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Skin(Benchmark):
    """Contacts and wrench of a skin on a cylinder of 60 mm, from sound to the link's frame.

    Touches press one to three strings at once, at random places and forces, on builds that no bundled model
    was trained on. Errors are those of windows in which a touch is held.

    Parameters
    ----------
    strings
        Number of strings.
    touches
        Number of simulated touches, one a second.
    draws
        Number of draws of the Monte Carlo.
    seed
        Random seed.
    world
        World of the twin.
    """

    strings: Count = 8
    touches: Count = 20
    draws: Count = 20_000
    seed: Seed = 1
    world: str = "plausible"

    def __post_init__(self) -> None:
        Checked.__post_init__(self)

    def run(self) -> Iterator[Row]:
        """Measure geometry, covariance, computing time and errors in turn."""
        skin = ring(self.strings)
        yield Row(name="adjoint, largest error", value=adjoint_error(skin), unit="N")
        stated, drawn = covariances(skin, self.draws, self.seed)
        ratios = drawn[stated > 0.0] / stated[stated > 0.0]
        yield Row(name="variances, Monte Carlo over stated, least", value=float(ratios.min()), unit="1")
        yield Row(name="variances, Monte Carlo over stated, most", value=float(ratios.max()), unit="1")
        sound, truth = touched(self.strings, self.touches, self.seed, self.world)
        yield from costs(skin, sound)
        yield from errors(skin, sound, truth)


def ring(count: int, turn: Floats | None = None, shift: Floats | None = None) -> mc.Skin:
    """Return strings along z on a cylinder, pressed towards its axis; in another frame where given."""
    turn = np.eye(3) if turn is None else turn
    shift = np.zeros(3) if shift is None else shift
    strings: dict[str, mc.SkinString] = {}
    for k in range(count):
        away = np.array([math.cos(2.0 * math.pi * k / count), math.sin(2.0 * math.pi * k / count), 0.0])
        ends = [turn @ (RADIUS * away + [0.0, 0.0, z]) + shift for z in (-0.5 * LENGTH, 0.5 * LENGTH)]
        start, end, press = (tuple(map(float, each)) for each in (*ends, turn @ -away))
        places: Any = {"start": start, "end": end, "press": press}
        strings[f"s{k + 1}"] = mc.SkinString(sensor="prototype", **places)
    return mc.Skin(link="finger", strings=strings)


def window(position: float, force: float) -> mc.Prediction:
    """Return the estimates of a window of a touched string."""
    values = {"contact": (1.0, 0.0), "position": (position, PLACE_STD), "force": (force, FORCE_STD)}
    estimates = {name: mc.Estimate(value=value, std=std, unit="") for name, (value, std) in values.items()}
    return mc.Prediction(start=0, time=0.0, estimates=estimates)


def adjoint_error(skin: mc.Skin) -> float:
    """Return the largest difference of wrenches in two frames, one seen from the other."""
    a, b = math.cos(0.7), math.sin(0.7)
    about_z, about_x = np.array([[a, -b, 0.0], [b, a, 0.0], [0.0, 0.0, 1.0]]), np.eye(3)
    about_x[1:, 1:] = about_z[:2, :2]
    turn = about_z @ about_x
    shift = np.array([0.1, -0.2, 0.3])
    worst = 0.0
    for name in skin.strings:
        told = {name: window(PLACE, FORCE)}
        here, there = (
            each.combine(told).contacts[0].wrench for each in (skin, ring(len(skin.strings), turn, shift))
        )
        force = turn @ here[:3]
        seen = np.concatenate([force, turn @ here[3:] + np.cross(shift, force)])
        worst = max(worst, float(np.abs(seen - there).max()))
    return worst


def covariances(skin: mc.Skin, draws: int, seed: int) -> tuple[Floats, Floats]:
    """Return the stated variances of a wrench, and those of many wrenches of drawn estimates."""
    random, name = np.random.default_rng(seed), list(skin.strings)[-1]
    stated = skin.combine({name: window(PLACE, FORCE)}).contacts[0].wrench_covariance
    places = PLACE + PLACE_STD * random.standard_normal(draws)
    forces = FORCE + FORCE_STD * random.standard_normal(draws)
    wrenches = [
        skin.combine({name: window(float(x), float(f))}).contacts[0].wrench
        for x, f in zip(places, forces, strict=True)
    ]
    return np.diag(stated), np.var(wrenches, axis=0)


def touched(strings: int, touches: int, seed: int, world: Any) -> tuple[Audio, dict[str, Floats]]:
    """Return the sound (strings, 2, n) of random touches, and its truth, each (strings, n)."""
    random = np.random.default_rng(seed)
    sensors = mc.VirtualSensors(count=strings, seed=seed, build=131, world=world)
    takes = [sensors.advance(1.0)]  # the untouched strings, which a model has to know
    for _ in range(touches):
        for k in random.permutation(strings)[: random.integers(1, 4)]:
            sensors[k].press(float(random.uniform(0.06, 0.14)), float(random.uniform(0.3, 2.0)))
        takes.append(sensors.advance(HOLD))
        for each in sensors:
            each.release()
        takes.append(sensors.advance(PAUSE))
    names = ("contact", "position", "force")
    truth = {name: np.concatenate([labels[name] for _, labels in takes], axis=1) for name in names}
    return np.concatenate([sound for sound, _ in takes], axis=2), truth


def costs(skin: mc.Skin, sound: Audio) -> Iterator[Row]:
    """Yield processor time an update, and the rate in real time."""
    import soundfile  # noqa: PLC0415

    array = sound.reshape(-1, sound.shape[-1])
    hop: dict[str, Any] = {"unit": "ms", "baseline": "a hop", "baseline_value": 1e3 * HOP}
    updates = skin.listen(array, sample_rate=RATE)
    next(updates)
    begun = time.process_time()
    seen = list(updates)
    heard = (time.process_time() - begun) / len(seen)
    yield Row(name="an update, processor time", value=1e3 * heard, **hop)
    begun = time.process_time()
    for each in seen:
        skin.combine(each.strings)
    alone = (time.process_time() - begun) / len(seen)
    yield Row(name="its combining alone", value=1e3 * alone, **hop)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "skin.wav")
        soundfile.write(path, array.T, RATE, subtype="FLOAT")
        live = skin.listen(path, speed=1.0, block=64, seconds=5.0)
        next(live)
        begun = time.monotonic()
        rate = len(list(live)) / (time.monotonic() - begun)
    wanted = 1.0 / HOP
    yield Row(
        name="updates in real time", value=rate, unit="1/s", baseline="asked for", baseline_value=wanted
    )


def errors(skin: mc.Skin, sound: Audio, truth: dict[str, Floats]) -> Iterator[Row]:
    """Yield what the skin states of held touches, and how far off it is."""
    names, right, whole, count = list(skin.strings), 0, 0, 0
    places, forces, torques, ratios = list[float](), list[float](), list[float](), list[float]()
    for update in skin.listen(sound.reshape(-1, sound.shape[-1]), sample_rate=RATE):
        within = (update.time - 1.0) % (HOLD + PAUSE)
        if update.time < 1.0 or not SETTLED <= within <= HOLD - WINDOW:
            continue
        middle = round((update.time + 0.5 * WINDOW) * RATE)
        is_touched = {name: truth["contact"][k, middle] > 0.0 for k, name in enumerate(names)}
        count += 1
        right += {each.string for each in update.contacts} == {each for each in names if is_touched[each]}
        wrench = np.zeros(6)
        for k, name in enumerate(names):
            if is_touched[name]:
                x, f = (float(truth[column][k, middle]) for column in ("position", "force"))
                (true,) = skin.combine({name: window(x, f)}).contacts
                wrench += true.wrench
                off = [each.point - true.point for each in update.contacts if each.string == name]
                places += [float(np.linalg.norm(each)) for each in off if np.isfinite(each).all()]
        if np.isfinite(update.wrench).all():
            whole += 1
            error, std = update.wrench - wrench, np.sqrt(np.diag(update.wrench_covariance))
            forces.append(float(np.linalg.norm(error[:3])))
            torques.append(float(np.linalg.norm(error[3:])))
            ratios += (np.abs(error[std > LEAST_STD]) / std[std > LEAST_STD]).tolist()
    yield Row(name="windows whose touched strings are right", value=100.0 * right / count, unit="%")
    yield Row(name="windows with a wrench", value=100.0 * whole / count, unit="%")
    yield Row(name="point, median error", value=1e3 * float(np.median(places)), unit="mm")
    yield Row(name="point, 95th percentile", value=1e3 * float(np.percentile(places, 95.0)), unit="mm")
    yield Row(name="force, median error", value=float(np.median(forces)), unit="N")
    yield Row(name="torque, median error", value=1e3 * float(np.median(torques)), unit="mN m")
    for count, words in ((1.0, "one standard error"), (2.0, "two")):
        share = float(np.mean(np.array(ratios) < count))
        yield Row(name=f"wrench within {words}", value=100.0 * share, unit="%")


if __name__ == "__main__":
    measure(Skin)
