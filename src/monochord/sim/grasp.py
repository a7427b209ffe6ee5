"""A gripper of two strings that holds an object whose weight and friction it does not know.

The table under the object sinks; the grip at first is too weak, so that the object slides through the fingers
until the grip is raised. `GraspScene` is the scene, and `slip_reflex` a controller of it that raises the grip
where the strings hear slip. All sound is simulated.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Seed, checked
from monochord.core.units import Metres, MetresPerSecond, Newtons, Seconds
from monochord.live.listen import listen
from monochord.live.update import Update
from monochord.perception.model import Model, load
from monochord.physics.twin.world import World
from monochord.sim._mujoco import mujoco
from monochord.sim.mujoco import Strings, add_string

__all__ = ["OBJECTS", "Grasp", "GraspScene", "GraspedObject", "grasp", "slip_reflex"]

TIMESTEP: Seconds = 1e-3
PERIOD: Seconds = 0.02
"""Of a step: two updates of each string."""
STRING: Metres = 0.2
OPEN: Metres = 0.012
"""Distance of each string from the object at the beginning."""
MAX_GRIP: Newtons = 6.0
FIRST_GRIP: Newtons = 0.3
"""With which the fingers close."""
CLOSED: Seconds = 0.6
"""The fingers have closed, and the grip is the controller's."""
SETTLED: Seconds = 1.05
"""From when on the reflex grips harder: closing has sounded long enough ago."""
PAUSE: Seconds = 0.09
"""Between two changes of the reflex: a window."""
SINKS: Seconds = 1.2
"""When the table begins to sink."""
SINKING: MetresPerSecond = 0.025
END: Seconds = 3.6
CAUGHT: Metres = 0.015
"""An object that sank by no more is caught."""
HALF_HEIGHT: Metres = 0.05
STRINGS = ("left", "right")


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspedObject:
    """An upright cylinder: its radius in m, its material as the strings feel it, ranges of mass and friction.

    Mass is in kg; friction is the coefficient of its geom. Each episode draws both.
    """

    radius: Metres
    material: str
    mass: tuple[float, float]
    friction: tuple[float, float]


OBJECTS = {
    "bottle": GraspedObject(radius=0.020, material="plastic", mass=(0.04, 0.08), friction=(0.25, 0.40)),
    "dowel": GraspedObject(radius=0.010, material="wood", mass=(0.03, 0.07), friction=(0.30, 0.45)),
    "tube": GraspedObject(radius=0.015, material="metal_tube", mass=(0.05, 0.10), friction=(0.25, 0.40)),
}
"""Objects of the scene by name."""


class Grasp(NamedTuple):
    """The scene after a step: what the strings say, and what is true.

    `updates` has the latest update of each string, left and right. `time` is in s, `grip` the force of each
    finger in N, `drop` how far the object has sunk in m, and `needed` the least grip that holds it, in N.
    """

    updates: tuple[Update, Update]
    time: Seconds
    grip: Newtons
    drop: Metres
    needed: Newtons

    @property
    def ended(self) -> bool:
        """Whether the episode is over: after 3.6 s, or where the object has left the fingers."""
        return self.time >= END - 1e-9 or self.drop > HALF_HEIGHT

    @property
    def caught(self) -> bool:
        """Whether the object has sunk by 15 mm at most."""
        return self.drop <= CAUGHT


Controller: TypeAlias = Callable[[Grasp], Newtons]


class GraspScene:
    """Two fingers with a string each, an object on a table that sinks, and a grip that a program chooses.

    Parameters
    ----------
    world
        As of `monochord.VirtualSensor`.
    model
        A bundled model's name, a folder, or what `monochord.load` returned.
    seed
        Of the strings' noise, and in the world ``plausible`` of their builds.

    Examples
    --------
    >>> scene = GraspScene()
    >>> state = scene.reset(1, "dowel")
    >>> while state.time < 1.0:
    ...     state = scene.step(1.5)
    >>> state.caught, state.updates[0].decided["contact"]
    (True, True)
    """

    @checked
    def __init__(self, *, world: World = "ideal", model: str | Model = "demo", seed: Seed = 0) -> None:
        self._world: World = world
        self._model = load(model) if isinstance(model, str) else model
        self._seed = seed
        self._scenes: dict[str, _Scene] = {}
        self._present: _Scene | None = None
        self._updates: tuple[Iterator[Update], ...] = ()
        self.object = ""

    @checked
    def reset(self, seed: Seed = 0, name: str | None = None) -> Grasp:
        """Begin an episode with open fingers, and return its state.

        Parameters
        ----------
        seed
            Draws mass and friction, and the object where `name` names none.
        name
            Of an object in `OBJECTS`; `InputError` for another one.
        """
        rng = np.random.default_rng(seed)
        drawn = str(rng.choice(list(OBJECTS)))
        self.object = drawn if name is None else name
        if self.object not in OBJECTS:
            raise InputError(f"object '{self.object}'", f"one of {', '.join(OBJECTS)}")
        if self.object not in self._scenes:
            self._scenes[self.object] = _Scene(OBJECTS[self.object], self._world, self._seed)
        self._present = scene = self._scenes[self.object]
        scene.reset(rng)
        for each in self._updates:
            each.close()  # pyright: ignore[reportAttributeAccessIssue]  (a generator)
        self._updates = tuple(listen(scene.strings[each], self._model) for each in STRINGS)
        return self._state(FIRST_GRIP)

    @checked
    def step(self, grip: Annotated[Newtons, Meta(ge=0.0, le=MAX_GRIP)]) -> Grasp:
        """Hold with a force of each finger in N, 0 to 6, for 20 ms; before 0.6 s the fingers close by 0.3 N.

        Raises `InputError` before the first `reset`.
        """
        if self._present is None:
            raise InputError("a step before the first reset", "reset(seed) first")
        if self._present.data.time < CLOSED - 1e-9:
            grip = FIRST_GRIP
        self._present.advance(grip)
        for each in self._updates:
            next(each)
        return self._state(grip)

    def _state(self, grip: Newtons) -> Grasp:
        scene = self._present
        assert scene is not None
        left, right = (next(each) for each in self._updates)
        return Grasp((left, right), float(scene.data.time), grip, scene.drop, scene.needed)

    def picture(self, width: int = 640, height: int = 480) -> np.ndarray:
        """Return a picture of the scene, (height, width, 3) of uint8.

        Without a screen set the environment variable ``MUJOCO_GL=egl``.
        """
        if self._present is None:
            raise InputError("a picture before the first reset", "reset(seed) first")
        return self._present.picture(width, height)


class _Scene:
    """The MuJoCo scene of one object."""

    def __init__(self, grasped: GraspedObject, world: World, seed: int) -> None:
        self._grasped = grasped
        self.scene = _compiled(grasped)
        self.data: Any = mujoco.MjData(self.scene)
        self.strings = Strings(
            self.scene,
            self.data,
            world=world,
            seed=2 * seed,
            build=2 * seed if world == "plausible" else None,
            other=grasped.material,
            contacts=1,
        )
        self._body, self._geom = self.scene.body("object").id, self.scene.geom("object").id
        self._start = float(self.data.body("object").xpos[2])
        self._inertia = self.scene.body_inertia[self._body] / self.scene.body_mass[self._body]
        self._renderer: Any = None
        self.needed: Newtons = 0.0

    def reset(self, rng: np.random.Generator) -> None:
        """Open the fingers, and give the object another mass and friction."""
        mass, friction = (float(rng.uniform(*each)) for each in (self._grasped.mass, self._grasped.friction))
        self.scene.body_mass[self._body] = mass
        self.scene.body_inertia[self._body] = mass * self._inertia
        self.scene.geom_friction[self._geom, 0] = friction
        mujoco.mj_setConst(self.scene, self.data)
        mujoco.mj_resetData(self.scene, self.data)
        mujoco.mj_forward(self.scene, self.data)
        self._start = float(self.data.body("object").xpos[2])
        self.strings.restart()
        self.needed = 0.5 * mass * float(np.linalg.norm(self.scene.opt.gravity)) / friction

    @property
    def drop(self) -> Metres:
        """How far the object has sunk."""
        return max(self._start - float(self.data.body("object").xpos[2]), 0.0)

    def advance(self, grip: Newtons) -> None:
        """Run a period."""
        before = float(self.data.ctrl[0]) / 2.0
        steps = round(PERIOD / TIMESTEP)
        for number in range(steps):
            self.data.ctrl[0] = 2.0 * (before + (grip - before) * (number + 1) / steps)
            self.data.mocap_pos[0, 2] = (
                -HALF_HEIGHT - 0.01 - SINKING * max(float(self.data.time) - SINKS, 0.0)
            )
            self.strings.step()

    def picture(self, width: int, height: int) -> np.ndarray:
        """Return the scene as it looks."""
        if self._renderer is None or (self._renderer.width, self._renderer.height) != (width, height):
            self._renderer = mujoco.Renderer(self.scene, height, width)
        self._renderer.update_scene(self.data, "front")
        return self._renderer.render()


def _compiled(grasped: GraspedObject) -> Any:
    """Return a compiled scene with an object between two strings, on a table."""
    geom, joint = mujoco.mjtGeom, mujoco.mjtJoint
    spec = mujoco.MjSpec()
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 20.0
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1440  # of pictures, at most
    spec.worldbody.add_light(pos=(0.2, -0.4, 0.6), dir=(-0.3, 0.6, -1.0))
    spec.worldbody.add_light(pos=(-0.3, -0.2, 0.4), dir=(0.5, 0.3, -0.8))
    spec.worldbody.add_camera(
        name="front", pos=(0.10, -0.25, 0.10), xyaxes=(0.93, 0.37, 0.0, -0.13, 0.33, 0.93)
    )
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=(0.94, 0.95, 0.96),
        rgb2=(0.94, 0.95, 0.96),
        width=64,
        height=64,
    )
    table = spec.worldbody.add_body(name="table", mocap=True, pos=(0, 0, -HALF_HEIGHT - 0.01))
    table.add_geom(
        type=geom.mjGEOM_CYLINDER, size=(0.03, 0.01, 0), rgba=(0.6, 0.55, 0.5, 1), contype=2, conaffinity=2
    )
    thing = spec.worldbody.add_body(name="object")
    thing.add_freejoint()
    thing.add_geom(
        name="object", type=geom.mjGEOM_CYLINDER, size=(grasped.radius, HALF_HEIGHT, 0), mass=0.05, condim=4,
        friction=(0.3, 0.005, 1e-4), rgba=(0.3, 0.5, 0.8, 0.7), contype=3, conaffinity=3,
    )  # fmt: skip
    for name, side in zip(STRINGS, (-1.0, 1.0), strict=True):
        finger = spec.worldbody.add_body(name=name, pos=(side * (grasped.radius + 0.002 + OPEN), 0, 0.01))
        finger.add_joint(name=name, type=joint.mjJNT_SLIDE, axis=(-side, 0, 0), damping=3.0)
        finger.add_geom(
            type=geom.mjGEOM_BOX, size=(0.008, 0.5 * STRING, 0.01), pos=(side * 0.015, 0, 0), mass=0.05,
            rgba=(0.35, 0.35, 0.4, 1), contype=0, conaffinity=0,
        )  # fmt: skip
        ends = ((0, -0.5 * STRING, 0), (0, 0.5 * STRING, 0))
        add_string(spec, body=name, start=ends[0], end=ends[1], press=(side, 0, 0), name=name)
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_JOINT, name1="left", name2="right", objtype=mujoco.mjtObj.mjOBJ_JOINT,
        data=[0.0, 1.0, *[0.0] * 10],
    )  # fmt: skip
    spec.add_actuator(name="grip", target="left", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    return spec.compile()


def slip_reflex(first: Newtons = 0.6, factor: float = 1.2, threshold: float = 0.2) -> Controller:
    """Return a controller that grips harder by a factor, and again after 0.1 s, while the strings hear slip.

    `first` is the grip at first, in N, and `threshold` the mean estimate of slip of both strings from which
    they hear it; 0.2 suits the world ideal, 0.5 plausible. A changed grip sounds like slip for as long as a
    window has of it, hence the pauses. Where time goes back, an episode begins, with the grip at first.
    """
    grip, raised, now = first, SETTLED, 0.0

    def control(state: Grasp) -> Newtons:
        nonlocal grip, raised, now
        if state.time <= now:
            grip, raised = first, SETTLED
        now = state.time
        slips = [each.slip.value for each in state.updates if each.slip.valid]
        if slips and np.mean(slips) > threshold and state.time - raised > PAUSE:
            grip, raised = min(grip * factor, MAX_GRIP), state.time
        return grip

    return control


def grasp(scene: GraspScene, control: Controller, seed: int = 0, name: str | None = None) -> Grasp:
    """Run an episode to its end, and return its last state."""
    state = scene.reset(seed, name)
    while not state.ended:
        state = scene.step(control(state))
    return state
