"""Plans: groups of sessions over a grid of positions, forces and radii, as strict data."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError, did_you_mean
from monochord.core.ranges import Checked, Pair, PartialShare, Share, Whole, refuse_unordered
from monochord.core.units import Hertz, Metres, MetresPerSecond, Newtons, Seconds
from monochord.lab.deviation import MAX_TUNING, NONE, Deviation
from monochord.lab.objects import DRAWN, evenly
from monochord.physics.materials import load_material
from monochord.physics.setup import MountKind
from monochord.physics.twin.world import ALL, Effects, World

Amount: TypeAlias = Annotated[int, Meta(ge=1, le=100000)]
MAX_TOUCHES = 1_000_000
"""Most touches of a group and radius, which take a month."""
MAX_OBLIQUE = 2.0
"""Largest sideways motion of a press, as a share of its depth."""
MAX_FORCE: Newtons = 10.0
"""Hardest press of a plan."""
MAX_DELAY: Seconds = 1.0
"""Largest delay of a stream in s: the search range of the tap alignment."""
NO_RANGES = ("grid", "radii", "builds", "days")
"""Fields of a group whose several values are no range."""
SOUNDS = ("synthetic", "drawn", "synthetic speech")
"""Ambient sounds that are synthesised."""
Duration: TypeAlias = Annotated[Seconds, Meta(ge=0.01, le=60.0)]
Distance: TypeAlias = Annotated[Metres, Meta(ge=0.0, le=1.0)]
Ratio: TypeAlias = Annotated[float, Meta(ge=-60.0, le=120.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Group(Checked):
    """Sessions of one protocol over one grid.

    Parameters
    ----------
    name
        Name of the group; its sessions are called NAME_000 and so on.
    protocol
        "hold": press, hold, release. "slide": press, then slide along or across the string, stroke by stroke.
        "brush": brief touches, mostly transitions. "tap": sharp touches that last `hold` from the first
        contact to the last. "hover": come close, stay, and go again, without pressing.
    sessions
        Number for each radius; the grid is shuffled and distributed among them.
    grid
        Number of positions and of forces; each cell is one touch, at a random point of the cell.
    places
        Range along the string in m; by default the sensor's.
    forces
        Range in N of the force with which the design's string at rest answers: it defines the depths.
    material
        Material of the object, a preset's name or file; "drawn", "drawn_smooth" or "drawn_soft" for one that
        is drawn for each session, see `monochord.lab.objects`.
    radii
        Radii of the object where it touches, in m; by default that of its material.
    design
        "drawn" for a design that is drawn for each session, see `monochord.lab.designs`; by default the
        plan's sensor.
    second
        Distance in m at which a second object of the same kind touches the string at the same time, towards
        the further end; 0 for none. A range draws distance and direction of each touch, and its share of the
        first one's force. While both press there is no position label.
    in_turn
        Range in s of how much later the second object comes than the first; it goes earlier or later by as
        much. The objects' holds and pauses have to be longer. By default they come and go together.
    rolls
        Whether objects roll where they move along the string; the strokes of "slide" are then all along it.
        By default they slide.
    oblique
        Range of a press's sideways motion, as a share of its depth: it loads the touch sideways.
    mount
        Class of the objects' mounts in the world "plausible": "bolted", "light" or "soft"; by default it is
        drawn for each build and object.
    approach
        Who moves the object: a "robot", straight down to a position and a depth, or a "hand", which comes
        down faster, in steps, or beside the position, and whose press wavers. For the protocol "hold".
    world
        "ideal" or "plausible", see `monochord.physics.twin.world`; by default the plan's.
    deviation
        What deviates of its sensors and objects; by default the plan's.
    builds
        Seeds of the builds of the sessions, in turn; by default the plan's.
    first_build
        Seed of the first session's build, where each session has a different build: later sessions have
        consecutive seeds. Instead of `builds`.
    days
        Seeds of the days of the sessions, in turn, once through all builds; day 0 is the day on which the
        sensor was tuned.
    hold
        Duration of each touch, or of each stroke, in s; a range draws each, evenly in its logarithm.
    pause
        Time in the air after each touch, in s; a range draws each, evenly in its logarithm.
    again
        Range in s of the time after which a released touch is followed by another one, at the same place or,
        for half of them, at another one of `places`. By default each touch stands alone.
    swing
        Range in N/s of the rate at which the force of "hold" rises and falls between the touch's force and
        another one of `forces`, a quarter of that range away or more. By default it is constant.
    steps
        Range in s of the time between two commands of the robot's controller: the force of `swing` goes in
        steps, each of them over a tenth of that time or more. By default it goes evenly.
    smooth
        Whether the force of `swing` goes as a sine does, and by less than a quarter of that range too. By
        default it goes at one rate.
    rise
        Range in s of how long a press of "hold" takes from the first contact to its force, as of an object
        that is led by force; a range draws each, evenly in its logarithm. By default the robot presses at its
        own speed.
    creep
        Range in m/s of the speed across the string at which an object that is held still, or rests after a
        stroke, gives way: below the 0.5 mm/s of a slip. By default it stands.
    vibrato
        Range in m by which a touch of "hold" swings along the string to either side, at `VIBRATO_RATES` of
        `monochord.lab.schedule`, within `places`. It slides or, with `rolls`, rolls.
    on_touched
        Range in s of the time from the first touch's contact until the drivers come on, which so lock on to a
        touched string. By default they come on before it.
    driver_dies
        Range of the share of the time with drivers on after which one of them, drawn, stops for good.
    detuned
        Range of the relative change of the pitch to which the string is tuned, drawn for each session.
    strokes
        Number of strokes of a touch of "slide", each with its own speed and, after the first, force.
    speeds
        Range of the strokes' speeds in m/s.
    dwell
        Range in s of how long the object rests where each stroke ends. By default the next one follows, or
        the release.
    lifted
        Clearance offset in m with which the motion is repeated without contact; 0 for contact.
    clearances
        Range in m of the height of "hover" above the string at rest.
    like
        Name of a group whose motions are repeated, `sessions` of them in total, evenly chosen; its grid and
        protocol then apply, and its strokes' direction. Whether objects roll is set by each group.
    music
        Ambient sound while the drivers are on: "synthetic" for the loop of `monochord.dsp.music`, one for all
        sessions, "drawn" for a loop of the session's own, "synthetic speech" for `monochord.dsp.speech`, or a
        sound file. It pauses for the taps.
    snr
        Ratio of the untouched string's sound to the music, in dB; a range draws it for each session.
    motors
        Sound of the robot's motors and gripper in the frame, loud while they move and faint at rest, and now
        and then of a motor that moves nothing at the string: "synthetic" or nothing.
    motor_snr
        Ratio of the untouched string's sound to that of moving motors, in dB; a range draws it for each
        session.
    """

    name: str
    protocol: Literal["hold", "slide", "brush", "tap", "hover"] = "hold"
    sessions: Amount = 1
    grid: Pair[Amount] = (8, 4)
    places: Pair[Annotated[Metres, Meta(gt=0.0)]] | None = None
    forces: Pair[Annotated[Newtons, Meta(gt=0.0, le=MAX_FORCE)]] = (0.1, 2.0)
    material: str = "plastic"
    radii: tuple[Metres, ...] = ()
    design: Literal["", "drawn"] = ""
    second: Distance | Pair[Distance] = 0.0
    in_turn: Pair[Duration] | None = None
    rolls: bool = False
    oblique: Pair[Annotated[float, Meta(ge=0.0, le=MAX_OBLIQUE)]] = (0.0, 0.0)
    mount: MountKind = ""
    approach: Literal["robot", "hand"] = "robot"
    world: World | None = None
    deviation: Deviation | None = None
    builds: tuple[Whole, ...] = ()
    first_build: Whole | None = None
    days: tuple[Annotated[int, Meta(ge=0, le=36500)], ...] = (0,)
    hold: Duration | Pair[Duration] = 1.0
    pause: Duration | Pair[Duration] | None = None
    again: Pair[Duration] | None = None
    swing: Pair[Annotated[float, Meta(gt=0.0, le=100.0)]] | None = None
    steps: Pair[Annotated[Seconds, Meta(ge=0.002, le=0.1)]] | None = None
    smooth: bool = False
    rise: Pair[Duration] | None = None
    creep: Pair[Annotated[MetresPerSecond, Meta(gt=0.0, le=4e-4)]] | None = None
    vibrato: Pair[Annotated[Metres, Meta(gt=0.0, le=0.01)]] | None = None
    on_touched: Pair[Annotated[Seconds, Meta(ge=-1.0, le=10.0)]] | None = None
    driver_dies: Pair[Share] | None = None
    detuned: Pair[Annotated[float, Meta(ge=-MAX_TUNING, le=MAX_TUNING)]] | None = None
    strokes: Amount = 4
    speeds: Pair[Annotated[MetresPerSecond, Meta(gt=0.0, le=0.4)]] = (0.001, 0.03)
    dwell: Pair[Duration] | None = None
    lifted: Annotated[Metres, Meta(ge=0.0, le=0.05)] = 0.0
    clearances: Pair[Annotated[Metres, Meta(gt=0.0)]] = (0.05e-3, 0.5e-3)
    like: str = ""
    music: str = ""
    snr: Ratio | Pair[Ratio] = 10.0
    motors: Literal["", "synthetic"] = ""
    motor_snr: Ratio | Pair[Ratio] = 30.0

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.name):
            raise InputError(f"group '{self.name}'", "lower-case letters, digits and _")
        ranges = {name: getattr(self, name) for name in self.__slots__ if name not in NO_RANGES}
        pairs = {name: value for name, value in ranges.items() if isinstance(value, tuple)}
        refuse_unordered(f"group {self.name}", **pairs)
        if self.grid[0] * self.grid[1] > MAX_TOUCHES:
            raise InputError(f"group {self.name}: grid {self.grid}", f"{MAX_TOUCHES} touches at most")
        if self.builds and self.first_build is not None:
            raise InputError(f"group {self.name}: builds and first_build", "only one of them")
        if self.approach == "hand" and self.protocol != "hold":
            raise InputError(f"group {self.name}: a hand and protocol {self.protocol}", "protocol hold")
        if not self.days:
            raise InputError(f"group {self.name} without days", "one day or more")
        self._refuse_other_protocols()
        if isinstance(self.second, tuple) and (self.second[0] <= 0.0 or self.again):
            raise InputError(f"group {self.name}: second {self.second}", "distances above 0, and no again")
        if self.in_turn is not None:
            self._refuse_crossing(self.in_turn[1])

    def _refuse_other_protocols(self) -> None:
        """Raise `InputError` for stories that the group's protocol does not have."""
        held = self.again or self.swing or self.vibrato or self.rise
        if held and not self._held:
            given = f"group {self.name}: again, swing, vibrato or rise of {self.protocol} by {self.approach}"
            raise InputError(given, "protocol hold by robot")
        if (self.steps or self.smooth) and not self.swing:
            raise InputError(f"group {self.name}: steps or smooth without swing", "both")
        if self.steps and self.smooth:
            raise InputError(f"group {self.name}: steps and smooth", "one of them")
        if self.creep and (self.swing or self.vibrato or not (self.dwell or self._held)):
            raise InputError(f"group {self.name}: creep of what moves", "a still hold by robot, or a dwell")
        if self.dwell and self.protocol != "slide":
            raise InputError(f"group {self.name}: dwell of {self.protocol}", "protocol slide")

    @property
    def _held(self) -> bool:
        return (self.protocol, self.approach) == ("hold", "robot")

    def _refuse_crossing(self, longest: Seconds) -> None:
        """Raise `InputError` unless the second object may come and go by `longest` beside the first."""
        pause = 0.0 if self.pause is None else ends(self.pause)[0]
        if not isinstance(self.second, tuple):
            raise InputError(f"group {self.name}: in_turn", "a range of distances of a second object")
        if ends(self.hold)[0] < 2.0 * longest or pause < 2.0 * longest:
            given = f"group {self.name}: in_turn up to {longest:g} s"
            raise InputError(given, "holds and pauses of twice that or more")

    @property
    def total(self) -> int:
        """Number of its sessions."""
        return self.sessions if self.like else self.sessions * max(1, len(self.radii))


def ends(value: float | Pair[float]) -> Pair[float]:
    """Return the smallest and largest value of a number or a range.

    >>> ends(1.0), ends((0.5, 2.0))
    ((1.0, 1.0), (0.5, 2.0))
    """
    return value if isinstance(value, tuple) else (value, value)


def drawn(value: float | Pair[float], random: np.random.Generator) -> float:
    """Return a number unchanged, or draw one from a range above 0, log-uniformly.

    >>> drawn(1.0, np.random.default_rng(0)), 0.5 <= drawn((0.5, 2.0), np.random.default_rng(0)) <= 2.0
    (1.0, True)
    """
    return evenly(random)(*value) if isinstance(value, tuple) else value


@dataclass(frozen=True, slots=True, kw_only=True)
class Delays(Checked):
    """Smallest and largest delay of each stream in s: each session draws its own, to be estimated."""

    audio: Pair[Annotated[Seconds, Meta(ge=0.0, le=MAX_DELAY)]] = (0.0, 0.0)
    wrench: Pair[Annotated[Seconds, Meta(ge=0.0, le=MAX_DELAY)]] = (0.0, 0.0)
    pose: Pair[Annotated[Seconds, Meta(ge=0.0, le=MAX_DELAY)]] = (0.0, 0.0)

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        refuse_unordered("delays", audio=self.audio, wrench=self.wrench, pose=self.pose)


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSensor(Checked):
    """The errors of a force/torque sensor, after an ATI Gamma; all assumed.

    `noise` is the rms of a reading's force in N, `torque_noise` of its torque in N m; `bandwidth` in Hz is
    that of the sensor with the object on it, above which it attenuates the string's vibration; `drift` the
    largest drift of its zero, in N/s; `crosstalk` the share of a normal force in the lateral forces; `lever`
    its height above the touching point in m. A reading is lost with probability `lost`, and delayed by
    `jitter` in s on average, beyond the session's delay.
    """

    noise: Annotated[Newtons, Meta(ge=0.0)] = 0.010
    torque_noise: Annotated[float, Meta(ge=0.0)] = 5e-4
    bandwidth: Annotated[Hertz, Meta(ge=50.0, le=5000.0)] = 1000.0
    drift: Annotated[float, Meta(ge=0.0)] = 1e-4
    crosstalk: tuple[float, float] = (0.008, -0.005)
    lever: Metres = 0.06
    lost: PartialShare = 1e-4
    jitter: Annotated[Seconds, Meta(ge=0.0, le=0.1)] = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementErrors(Checked):
    """Errors of a robot and its force sensor that labels do not show: standard deviations.

    `tool` is the error of the tool's centre along the string in a session, and `repeat` that of each touch,
    in m; `gain` is the relative error of the force sensor in a session. Assumed, from typical tool
    calibration.
    """

    tool: Annotated[Metres, Meta(ge=0.0, le=0.01)] = 0.0
    repeat: Annotated[Metres, Meta(ge=0.0, le=0.01)] = 0.0
    gain: Annotated[float, Meta(ge=0.0, le=0.3)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan(Checked):
    """A whole collection: one sensor, its instruments, and groups of sessions.

    Parameters
    ----------
    name
        Its name, by default its file's.
    title, source, notes
        Description, origin and assumptions.
    sensor
        A preset's name or file.
    build
        Seed of a build of that design within its tolerances; by default the design itself.
    world
        "ideal", or "plausible" for what a real build brings besides, see `monochord.physics.twin.world`.
    effects
        The effects of the plausible world, each a switch.
    deviation
        What deviates of every sensor and object beside that, as set by hand.
    epoch
        Begin of day 0, in s since 1970: sessions do not contain the time at which they were made.
    sample_rate, force_rate, pose_rate, label_rate
        Rates of microphones, force/torque sensor, robot and labels, in Hz.
    delays
        Delays of the streams.
    force_sensor
        Errors of the force/torque sensor.
    pose_noise
        Noise of the robot's encoders, in m rms.
    errors
        Errors of pose and force that no reading shows.
    groups
        The groups of sessions.
    """

    name: str
    title: str = ""
    source: str = ""
    notes: str = ""
    sensor: str = "prototype"
    build: int | None = None
    world: World = "ideal"
    effects: Effects = ALL
    deviation: Deviation = NONE
    epoch: Annotated[int, Meta(ge=0, le=2**31 - 10**8)] = 1_767_225_600
    sample_rate: Annotated[int, Meta(ge=16000, le=192000)] = 44100
    force_rate: Annotated[Hertz, Meta(ge=100.0, le=10000.0)] = 1000.0
    pose_rate: Annotated[Hertz, Meta(ge=10.0, le=1000.0)] = 250.0
    label_rate: Annotated[Hertz, Meta(ge=10.0, le=1000.0)] = 1000.0
    delays: Delays = Delays()
    force_sensor: ForceSensor = ForceSensor()
    pose_noise: Annotated[Metres, Meta(ge=0.0, le=0.01)] = 2e-5
    errors: MeasurementErrors = MeasurementErrors()
    groups: tuple[Group, ...]

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        names = [group.name for group in self.groups]
        if not names or len(set(names)) < len(names):
            raise InputError(f"groups {', '.join(names) or 'none'}", "one or more, with different names")
        for material in dict.fromkeys(group.material for group in self.groups):
            if material not in DRAWN:
                load_material(material)
        for group in self.groups:
            if group.music not in ("", *SOUNDS) and not Path(group.music).is_file():
                given = f"group {group.name}: music '{group.music}'"
                raise InputError(given, f"{', '.join(SOUNDS)}, or a sound file")
            if group.like and self.group(group.like).like:
                raise InputError(f"group {group.name} like {group.like}", "a group without like")

    def group(self, name: str) -> Group:
        """Return a group by its name; raises `InputError` for an unknown name."""
        for group in self.groups:
            if group.name == name:
                return group
        names = [group.name for group in self.groups]
        raise InputError(f"group '{name}'", ", ".join(names), did_you_mean(name, names))
