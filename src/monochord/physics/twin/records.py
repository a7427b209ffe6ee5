"""The data that the twin's kernel runs on: records with named fields, the bank of modes, and tuned constants.

A record is declared as a class, so that types and documentation stand beside the field; `dtype_of` makes the
NumPy dtype that the kernel, compiled or not, reads and writes by the same names. Nothing here loads a
compiler.

The modes are not a record but a flat array, row after row of `size` numbers, one a mode. That is measured:
with a field for each row, each row has a base address of its own, the compiler unrolls the loops over modes
differently, and sums differ in their last bit. The modes of the press direction (normal) stand in the first
half of a row, those across it (tangential) in the second, each half padded with modes at rest.
"""

from functools import cache
from typing import Any, NamedTuple, TypeAlias, get_type_hints

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Floats

Integers = NDArray[np.int64]
Flags = NDArray[np.uint8]
Records: TypeAlias = Any
"""An array of records; an element has the attributes of its class, which no type checker can see."""


class Constants:
    """A sensor's numbers, with `step` the time step in s and `length`, `tension` (nominal) in m and N."""

    step: float
    length: float
    tension: float
    mass: float
    """Modal mass mu L / 2 in kg."""
    tension_gain: float
    """pi^2 / (4 L) in 1/m: half the force on a mode of unit weight and displacement a newton of tension."""
    tension_per_stretch: float
    """E A pi^2 / (4 L^2) in N/m^2, a newton for each unit of the stretch sum; zero for the linear law."""
    axial_stiffness: float
    """E A in N."""
    tension_per_force: float
    """k_T of the linear law."""
    drift: float
    drift_rate: float
    """Of the tension from its nominal value, in N and N/s."""
    frame_acceleration: float
    """In m/s^2 at full scale of the outside sound."""
    stretch_tolerance: float
    """Relative change of the stretch sum at which the iteration for the tension ends."""
    oversampling: int
    """Steps a frame."""
    seed: int
    linear_law: int
    """1 for the linear tension law, 0 for the geometric one."""


class DriverParameters:
    """An EBow: the band filter's g = tan(pi f / rate), k = 1 / Q and scale 1 / (1 + g (g + k))."""

    g: float
    k: float
    gain: float
    """Over the limit, in s/m."""
    limit: float
    """In N."""
    scale: float
    on: float
    """Where its switch is going, 0 or 1."""


class DriverState:
    """The band filter's two states, its last output, and how far the driver is switched on, 0 to 1."""

    first: float
    second: float
    output: float
    gate: float


class PickupParameters:
    """Mixing (`own`), gain to full scale a newton, share of air-borne sound, preamplifier and noise."""

    own_1: float
    own_2: float
    gain_1: float
    gain_2: float
    low_cut: float
    """g / (1 + g) of the one-pole high-pass."""
    g: float
    k: float
    """Of the two-pole low-pass."""
    noise: float
    """Of the converter, rms."""
    air_1: float
    air_2: float
    scale: float
    """1 / (1 + g (g + k)) of the low-pass."""


class PreampState:
    """Of one channel: the state of the high-pass and the two of the low-pass."""

    low_cut: float
    first: float
    second: float


class TouchParameters:
    """An object: contact stiffness k1 delta + k2 delta^(3/2), Hunt-Crossley's beta, friction, surface."""

    k1: float
    k2: float
    beta: float
    tangential_ratio: float
    """Tangential over normal stiffness (Mindlin)."""
    static_friction: float
    kinetic_friction: float
    stribeck_speed: float
    roughness: float
    roughness_length: float
    rolls: float
    """1 where the object rolls as its position moves, 0 where it slides."""
    keys: int
    """Keys of its motion; the rest of its row is padding."""


class LayerParameters:
    """A rough layer between object and string, u = u0 log(1 + f / F0)."""

    thickness: float
    """u0 in m; zero for none."""
    load: float
    """F0 in N."""


class MountParameters:
    """What holds an object: compliances in m/N at the place where it touches."""

    spring: float
    """Of all that follows a force without delay."""
    static: float
    """Of the modes and the spring, under a lasting force."""
    modal: float
    """Of the modes over a step: what a newton held over it moves the object."""


class MountOscillator:
    """A mode of object, gripper and frame where the object touches: its propagator, and its state."""

    mass: float
    square: float
    """Modal mass in kg, and omega^2."""
    q_q: float
    q_v: float
    v_q: float
    v_v: float
    q_force: float
    v_force: float
    """New q and v a unit of q, v and held force."""
    q: float
    v: float
    """How far the object has given way to the string, in m, and its speed."""
    v_free: float
    """Its speed after the step, without a force in it."""


class TurningState:
    """How a touch resists the turning of the string; see `monochord.physics.twin.turning`."""

    half: float
    """Half of the distance between its edges, in m; zero for a point."""
    arm: float
    """Moment over force and turn, in m: the radius of what rolls."""
    stiffness: float
    """With the modes beyond the bank in series, in N m/rad, as of the last control update."""
    deflection: float
    slope: float
    """Its turn, and the slope of the bank's string where it touches, in rad."""
    turned: float
    compliance: float
    cross: float
    """The slope after a step without this touch, in rad; how it yields to it, in rad/(N m) and rad/N."""
    unloaded: float
    gain: float
    """The moment without a force, in N m, and what a newton adds to it, in m."""
    moment: float


class CoilEffects:
    """A driver's asymmetry and its magnet, and where the string is over it."""

    bias: float
    rest: float
    scale: float
    """b, tanh b, and 1 / (1 - tanh^2 b)."""
    pull: float
    """Negative stiffness of the magnet, in N/m."""
    place: float
    place_before: float
    """Of the string at the drive coil, along the driver's angle, now and a step ago, in m."""
    drive: float
    """Force of the drive, without the magnet, in N."""


class ChainParameters:
    """What the ends, the chain of amplifiers and the scheme's coordinates add."""

    second: float
    third: float
    """Coefficients of x^2 and x^3 of the stage before the converter."""
    feed_own: float
    feed_other: float
    """Full scale a newton of drive, in the pickup at the driver's end and in the other."""
    hum_1: float
    hum_2: float
    hum_step: float
    """Of each channel over that of the table, and cycles a frame."""
    normal: float
    across: float
    """Share of a residual end force that the pickups feel, of the press direction and of that across it."""
    offset: float
    """Where the scheme's string begins before the real one, which its yielding end lengthens, in m."""
    tension_per_force: float
    """Of a press, beside the geometric law, in N/N."""
    pressed: float
    """Tension in N that it makes, as of the last control update."""


class KeyRecord:
    """A key of a touch's motion: s, m, N, m above the string at rest, m/s across it."""

    time: float
    position: float
    force: float
    clearance: float
    across: float


class Motion:
    """What a touch's keys prescribe at one instant, and the depth of the surface that follows, in m."""

    position: float
    force: float
    clearance: float
    across: float
    depth: float


class ContactState:
    """What a touch remembers from step to step."""

    s: float
    eta: float
    """Root of the compression, and approach of surface and modal string, in sqrt(m) and m."""
    z: float
    z_along: float
    """Deflection of the bristles across and along the string, in m."""
    force_along: float
    """Friction along the string, in N."""
    sliding_speed: float
    """Speed of object against string in the last step, in m/s: Stribeck's speed."""
    string_across: float
    """Where the string stands across the press direction, in m."""
    path_across: float
    path_along: float
    """How far the contact has moved over the object by sliding, in m."""
    rolled: float
    """How far it has moved by rolling, in m."""
    height: float
    """Of the rough surface where it touches, in m."""
    residual_compliance: float
    """Of the modes beyond the bank, in m/N."""
    bristle_stiffness: float
    bristle_damping: float
    """In N/m; damping over the time step."""
    force: float
    """Normal force in the last step, in N."""
    time_off: float
    """Since it last pressed, in s."""
    mean_force: float
    speed_across: float
    speed_along: float
    """Sliding speeds as labelled, in m/s."""
    friction: float
    """NONE, STICK, CREEP or SLIDE."""
    touching: float
    """Whether the last frame's label said contact."""
    lag_across: float
    lag_along: float
    smooth_across: float
    smooth_along: float
    """The path slid after one pole and after two, in m."""
    mark_across: float
    mark_along: float
    """The mark that the smooth path drags along at a distance of `SLIP_PLAY`, in m."""
    read_across: float
    read_along: float
    """Where the height was last read, in m."""


class ContactSolution:
    """What a step solves for one touch, and what it starts from."""

    force: float
    force_across: float
    force_along: float
    s: float
    eta: float
    z: float
    z_along: float
    slid_across: float
    slid_along: float
    """Motion of object against string over the step, in m."""
    friction: float
    string_across: float
    free_height: float
    free_across: float
    """Where the string would be without this touch's forces, in m."""
    surface: float
    """Where the object's surface is, in m."""
    speed_along: float
    """Of the object along the string as it slides, in m/s."""
    rolled: float
    """How far it rolls in this step, in m."""


class SensorState:
    """What the whole sensor remembers."""

    tuned_tension: float
    """The tension that the propagators hold, in N."""
    stretch: float
    """Sum over modes of stretch weight times q^2, in m^2."""
    short_level_1: float
    short_level_2: float
    long_level_1: float
    long_level_2: float
    """Mean power of each channel over `SHORT_LEVEL_TIME` and `LONG_LEVEL_TIME`."""
    steady_time: float
    """How long the two have agreed, in s."""
    settled: float
    coil_speed_1: float
    coil_speed_2: float
    """Of the string at the sense coils, in m/s."""
    residual_slope: float
    """Change of the solved stretch sum with its guess."""
    end_force_1: float
    end_force_2: float
    """At nominal tension, in N."""
    max_q_tension: float
    """Largest entry of the row `Q_TENSION`."""
    touches_changed: float
    """1 where touches must be prepared afresh at the next control update."""
    iterations: float
    """Of the stretch, in all."""


@cache
def dtype_of(record: type) -> np.dtype[Any]:
    """Return the dtype of a record's class; its elements have the fields as attributes.

    >>> dtype_of(PreampState).names
    ('low_cut', 'first', 'second')
    """
    kinds = {float: "f8", int: "i8"}
    fields = [(name, kinds[kind]) for name, kind in get_type_hints(record).items()]
    return np.dtype((np.record, np.dtype(fields, align=True)))


def record_of(kind: type, **fields: float) -> Records:
    """Return one record, each field given by its name."""
    record = np.zeros((), dtype_of(kind))
    record[()] = tuple(fields[name] for name in record.dtype.names or ())
    return record


class Parameters(NamedTuple):
    """What does not change while the twin runs.

    Batched, with an axis of sensors in front of every field, it is what a `Twin` holds and what the kernel is
    called with; the kernel's parts see one sensor.
    """

    constants: Records
    """`Constants`."""
    drivers: Records
    """(2,) `DriverParameters`."""
    pickup: Records
    """`PickupParameters`."""
    sound: Audio
    """(n,) from outside, n 0 for none."""
    touches: Records
    """(touches,) `TouchParameters`."""
    keys: Records
    """(touches, keys) `KeyRecord`."""
    weights: Floats
    """(touches, size / 2): of each mode at the touch."""
    compliance: Floats
    """(touches, places): static compliance along the string in m/N, from end to end."""


class State(NamedTuple):
    """What changes; batched like `Parameters`."""

    bank: Floats
    """(rows size,): the modes; see the rows below."""
    contact: Records
    """(touches,) `ContactState`."""
    motion: Records
    """(touches,) `Motion` at the last control update."""
    ahead: Records
    """(touches,) `Motion` at the next."""
    drivers: Records
    """(2,) `DriverState`."""
    preamps: Records
    """(2,) `PreampState`."""
    memory: Records
    """`SensorState`."""
    solution: Records
    """(touches,) `ContactSolution`."""
    mutual: Floats
    """(2, touches, touches): compliance between touches over a step, normal and tangential, in m/N; that of a
    touch with itself includes its mount's."""


class Plausible(NamedTuple):
    """What the world `plausible` adds to a sensor and its touches: parameters and state; batched likewise.

    It is None for an ideal twin, and the kernel is compiled anew for it: to the last bit, an ideal twin is
    what it would be if none of this were here.
    """

    layers: Records
    """(touches,) `LayerParameters`."""
    mounts: Records
    """(touches,) `MountParameters`."""
    mount_modes: Records
    """(touches, `setup.MAX_MOUNT_MODES`) `MountOscillator`; those that an object lacks stay at rest."""
    coils: Records
    """(2,) `CoilEffects`."""
    chain: Records
    """`ChainParameters`."""
    hum: Floats
    """(n,): a cycle of the mains, of unit rms."""
    end_shares: Floats
    """(touches, 2, places): of a touch's force, what the modes beyond the bank bring to each end."""
    turnings: Records
    """(touches,) `TurningState`."""
    slopes: Floats
    """(touches, 2, size / 2): the modes' slopes at the touch in rad/m, and their change a step."""
    slope_weights: Floats
    """(touches, size / 2): of each mode's slope."""
    slope_compliance: Floats
    """(touches, places): static turn of the string by a moment, from end to end, in rad/(N m)."""
    turned: Floats
    """(2, touches, touches): how height and slope at a touch yield to the moment of another, over a step."""


class Out(NamedTuple):
    """What is recorded and what is true, a value a frame; of labels (touches, n), `settled` (n,)."""

    microphones: Audio
    contact: Flags
    position: Audio
    force: Audio
    reaction: Audio
    slip: Flags
    across: Audio
    along: Audio
    friction: Flags
    settled: Flags


OMEGA2_TENSION, OMEGA2_BENDING, DECAY, STRETCH = range(4)
"""Rows of the bank, each mode's own: omega^2 a newton of tension, omega^2 of bending, decay rate, weight n^2
in the stretch sum."""
DRIVE_1, DRIVE_2, SENSE_1, SENSE_2, END_1, END_2, FRAME = range(4, 11)
"""Its shape: at the coils, as force on the ends in N/m, and under an acceleration of the frame in kg."""
Q_Q, Q_V, V_Q, V_V, Q_FORCE, V_FORCE, Q_TENSION, V_TENSION = range(11, 19)
"""Its propagator over a step: new q and v a unit of q, v, held force and extra tension."""
Q, V = range(19, 21)
"""Its state: displacement in m and velocity in m/s."""
FORCE, Q_FREE, V_FREE, Q_NEW, COMPLIANCE, WORK = range(21, 27)
"""Scratch of a step: modal force of the touches in N, free motion, new displacement, what a newton held over
the step adds to it in m/N, and products."""
NORMAL, TANGENTIAL = range(27, 29)
"""The modes' shapes at the touch at hand, in the half of the press direction and in that across it."""
SHAPE, SHAPE_CHANGE = range(29, 31)
"""Of the first touch, first half only: the modes' shapes there, and their change a step. Others follow in
pairs."""
ROWS_A_TOUCH = 2


def rows(touches: int) -> int:
    """Return how many rows a bank has.

    >>> rows(0), rows(2)
    (29, 33)
    """
    return SHAPE + ROWS_A_TOUCH * touches


TABLE_PLACES = 513
"""Entries of the tables along the string."""

STAGE_CLIP = 1.2
"""Full scale at which the stage before the converter clips: below, it is monotonic."""

NONE, STICK, CREEP, SLIDE = range(4)
"""States of friction."""

CONTROL_PERIOD = 32
"""Steps from one control update, which reads the touches' motion, to the next; between, they run linearly."""
MAX_STRETCH_ITERATIONS = 60
"""Of tension and touches in a step: two or three are usual, and a bracket is halved where they go astray."""
MIN_GUESS_CHANGE = 1e-10
"""Relative difference of two guesses from which the slope of the residual is taken."""
MAX_SLACK = 0.9
"""Share of the tension at which a mode would turn over in a step: an extra tension is not let fall lower."""
MAX_CONTACT_SWEEPS = 40
"""Over several touches in turn."""
FORCE_TOLERANCE = 1e-12
"""Relative change of the largest force at which several touches agree."""
CONTACT_HOLD = 0.005
"""Seconds without force after which a touch counts as off, and time constant of its mean force."""
PATH_TIME, SLIP_SPEED_TIME = 0.002, 0.003
"""Time constants in s of the two poles that remove the ringing from the path slid, and of sliding speeds."""
SLIP_SPEED = 5e-4
"""Sliding speed in m/s from which a touch counts as slipping."""
SLIP_PLAY = 2.5e-5
"""How far in m a contact wanders to either side before it counts as moving on."""
SHORT_LEVEL_TIME, LONG_LEVEL_TIME = 0.010, 0.050
"""Time constants in s of the two levels that tell whether the sound is settled."""
LEVEL_TOLERANCE, SETTLING_TIME = 0.2, 0.020
"""How far the two may differ, and for how long in s they must agree, to be settled."""
SILENT_POWER = 1e-12
"""Power, in full scale squared, that counts as none."""
RETUNING_THRESHOLD = 1e-7
"""Relative change of the tension from which propagators are tuned anew; less acts as an extra tension."""
MIN_SURFACE_MOTION = 1e-8
"""Distance over an object in m from which its height is read anew."""
MIN_BRISTLE_FORCE = 0.01
"""Press in N at which the bristles of a lighter touch are taken."""
SWITCHING_TIME = 0.005
"""Seconds that a driver takes to go on or off."""
