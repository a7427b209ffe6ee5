"""Strings in MuJoCo scenes: estimates beside MuJoCo's truth, and what a string costs beside the simulation.

Makes what `docs/how-to/simulate-a-robot.md` says of both, in some three minutes:
``python -m studies.mujoco_scenes``.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from math import pi, sin
from typing import Any

import numpy as np
from studies._command import measure

import monochord as mc
from monochord.benchmarks.base import Benchmark, Row
from monochord.core.errors import InputError
from monochord.core.units import Seconds
from monochord.sim.mujoco import Strings, add_string

mujoco: Any = import_module("mujoco")
"""It ships no types."""
STIFFNESS = 800.0
"""Of the rod's position control, in N/m."""
ROD_SECONDS: Seconds = 7.4
LIFT = 3e-3
"""Height of the rod's axis over touching, in m, for each newton below 0 that is asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MujocoScenes(Benchmark):
    """Place, force and slip of a rod that presses, swings and slides; a block between two strings; the cost.

    In windows with one state of contact and slip all the time, by MuJoCo's truth: the mean absolute errors of
    a model's place and force, and how often slip and contact are decided otherwise. Processor time is
    that of a string at steps of 1 ms without a model, beside MuJoCo alone.

    Parameters
    ----------
    seeds
        Rods, each with other noise.
    model
        Name or folder of the model.
    """

    seeds: int = 4
    model: str = "demo"

    def __post_init__(self) -> None:
        if not 1 <= self.seeds <= 1000:
            raise InputError(f"{self.seeds} seeds", "1 to 1000")

    def run(self) -> Iterator[Row]:
        """Run every scene in both worlds."""
        for world in ("ideal", "plausible"):
            updates = [each for seed in range(self.seeds) for each in _rod(world, seed, self.model)]
            yield from _rod_rows(world, updates)
            yield from _block_rows(world, self.model)
        yield from _cost_rows()


def _rod(world: Any, seed: int, model: str) -> list[mc.Update]:
    """Return the updates of a rod that presses, slides across and along, lifts, and swings its force."""
    spec = _scene()
    add_string(spec, body="world", start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, -1), name="left")
    rod = spec.worldbody.add_body(name="rod", pos=(0.08, 0, 0.007 + LIFT))
    for axis, direction in (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1))):
        rod.add_joint(name=axis, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=direction, damping=5.0)
        actuator = spec.add_actuator(
            name=axis, target=axis, trntype=mujoco.mjtTrn.mjTRN_JOINT, biastype=mujoco.mjtBias.mjBIAS_AFFINE
        )
        actuator.gainprm[0], actuator.biasprm[1] = STIFFNESS, -STIFFNESS
    rod.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0, -0.05, 0, 0, 0.05, 0], size=[0.005, 0, 0], mass=0.05,
        friction=[0.3, 0.005, 0.0001],
    )  # fmt: skip
    scene = spec.compile()
    data = mujoco.MjData(scene)
    strings = Strings(scene, data, world=world, seed=seed, build=seed if world == "plausible" else None)
    updates: list[mc.Update] = []
    for update in mc.listen(strings["left"], model=model, seconds=ROD_SECONDS):
        updates.append(update)
        x, y, force = _asked(data.time)
        weight = 0.05 * 9.81
        data.ctrl[:] = x, y, -LIFT - (force - weight) / STIFFNESS if force > 0.0 else LIFT * (-force - 1.0)
    return updates


def _asked(now: Seconds) -> tuple[float, float, float]:
    """Return where the rod is to be at a time, along and across in m, and its force in N, below 0 to lift."""
    x = 0.04 if now > 4.4 else 0.02 * min(max(now - 2.0, 0.0), 1.5)
    y = 0.02 * min(max(now - 1.2, 0.0), 0.5)
    force = min(1.0, 2.5 * (now - 0.4) - 0.5) if now > 0.4 else -1.0
    if now > 3.8:
        force = max(-3.0, 1.0 - 10.0 * (now - 3.8))
    if now > 4.6:
        force = min(1.0, 5.0 * (now - 4.6) - 1.5)
    if now > 5.4:
        force = 1.0 + 0.5 * sin(4.0 * pi * (now - 5.4))
    if now > 7.0:
        force = max(-3.0, 1.0 - 10.0 * (now - 7.0))
    return x, y, force


def _rod_rows(world: str, updates: Sequence[mc.Update]) -> Iterator[Row]:
    settled = [each for each in updates if each.truth.get("transition") == 0.0]
    free = [each for each in settled if each.truth["contact"] == 0.0]
    for name, slip in (("held", 0.0), ("slid", 1.0)):
        windows = [each for each in settled if each.truth.get("slip") == slip]
        answered = [each for each in windows if each.position.valid]
        place = [abs(each.position.value - each.truth["position"]) for each in answered]
        force = [each.force.value - each.truth["force"] for each in windows if each.force.valid]
        slid = [each.decided["slip"] for each in windows if "slip" in each.decided]
        touched = [each.decided.get("contact") is True for each in windows]
        head = f"rod, {world}, {name}"
        yield Row(name=f"{head}: windows", value=len(windows), unit="1")
        yield Row(name=f"{head}: answered", value=len(answered) / len(windows), unit="1")
        yield Row(name=f"{head}: place", value=1e3 * float(np.mean(place)), unit="mm")
        yield Row(name=f"{head}: force", value=float(np.mean(np.abs(force))), unit="N")
        yield Row(name=f"{head}: bias of force", value=float(np.mean(force)), unit="N")
        yield Row(name=f"{head}: slip decided", value=float(np.mean(slid)), unit="1")
        yield Row(name=f"{head}: contact decided", value=float(np.mean(touched)), unit="1")
    wrong = float(np.mean([each.decided.get("contact") is True for each in free]))
    yield Row(name=f"rod, {world}, free: windows", value=len(free), unit="1")
    yield Row(name=f"rod, {world}, free: contact decided", value=wrong, unit="1")


def _scene() -> Any:
    spec = mujoco.MjSpec()
    spec.option.timestep = 1e-3
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
    return spec


def _block_rows(world: Any, model: str) -> Iterator[Row]:
    """Say what is told of a block of 30 mm between two strings, which lies on each with two edges."""
    spec = _scene()
    for name, y in (("left", -1), ("right", 1)):
        finger = spec.worldbody.add_body(name=name, pos=(0, y * 0.03, 0))
        finger.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, -y, 0), damping=3.0)
        add_string(spec, body=name, start=(0, 0, 0), end=(0.2, 0, 0), press=(0, y, 0), name=name)
        spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    block = spec.worldbody.add_body(name="block", pos=(0.1, 0, 0))
    block.add_freejoint()
    block.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.015, 0.015, 0.04), mass=0.03, friction=(0.5, 0.005, 1e-4)
    )
    scene = spec.compile()
    data = mujoco.MjData(scene)
    strings = Strings(scene, data, world=world)
    data.ctrl[:] = 1.0
    updates: list[mc.Update] = []
    for pair in zip(*(mc.listen(each, model=model, seconds=2.0) for each in strings.values()), strict=True):
        updates += [each for each in pair if each.time > 0.5]
    held = [each for each in updates if each.truth.get("contact") == 1.0]
    both = [each for each in held if each.truth["contacts"] > 1.9]
    yield Row(name=f"block, {world}: windows in contact", value=len(held), unit="1")
    yield Row(name=f"block, {world}: at two edges", value=len(both) / max(len(held), 1), unit="1")
    told = [each.decided.get("contact") is True for each in held]
    yield Row(name=f"block, {world}: contact decided", value=float(np.mean(told)), unit="1")
    answered = [each for each in both if each.position.valid]
    yield Row(name=f"block, {world}: place answered", value=len(answered) / max(len(both), 1), unit="1")
    for reason in sorted({each.position.reason for each in both if not each.position.valid}):
        share = float(np.mean([each.position.reason == reason for each in both]))
        yield Row(name=f"block, {world}: withheld, {reason}", value=share, unit="1")


def _cost_rows() -> Iterator[Row]:
    """Measure a second of a pressed string at steps of 1 ms, beside MuJoCo alone."""
    for world in ("ideal", "plausible"):
        spec = _scene()
        add_string(spec, body="world", start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, -1), name="left")
        ball = spec.worldbody.add_body(pos=(0.08, 0, 0.012))
        ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1), damping=1.0)
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.01, 0, 0), mass=0.1)
        scene = spec.compile()
        data = mujoco.MjData(scene)
        strings = Strings(scene, data, world=world)
        with_string = _fastest(strings.step)
        alone = mujoco.MjData(scene)
        without = _fastest(lambda data=alone, scene=scene: mujoco.mj_step(scene, data))
        yield Row(
            name=f"a string of 1 s at 1 kHz, {world}", value=1e3 * with_string, unit="ms",
            baseline="MuJoCo alone", baseline_value=1e3 * without,
        )  # fmt: skip


def _fastest(step: Callable[[], None]) -> Seconds:
    """Return the median processor time of a second of steps."""
    times: list[Seconds] = []
    for _ in range(5):
        begun = time.process_time()
        for _ in range(1000):
            step()
        times.append(time.process_time() - begun)
    return float(np.median(times))


if __name__ == "__main__":
    measure(MujocoScenes)
