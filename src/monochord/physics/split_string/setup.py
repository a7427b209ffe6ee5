"""The setup of a split-string simulation: string, touch, pluck, drive, microphones and grid."""

from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Checked, Finite, InnerShare, Pair, Share
from monochord.core.types import Contact, StringParams
from monochord.core.units import Hertz, Metres, Newtons, Seconds
from monochord.physics.theory import TensionLaw

Feedback: TypeAlias = Literal["per-driver", "literal", "off"]
Damping: TypeAlias = Literal["continuous", "printed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PluckShape(Checked):
    """The shape that a string is released from, at rest: a triangle rounded by a Gaussian.

    Parameters
    ----------
    height
        Height of the triangle's tip, in m.
    place
        Position of the tip, as a fraction of the segment from the support.
    width
        Standard deviation of the rounding Gaussian, in m: the width of the plectrum.
    """

    height: Finite[Metres] = 1.0e-4
    place: InnerShare = 0.4
    width: Annotated[Metres, Meta(gt=0.0, lt=1.0)] = 5.0e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive(Checked):
    """The two drivers (EBows) and their feedback.

    The paper's Eq. 11 and 12 are ambiguous in three ways that matter; each is an option here.

    Parameters
    ----------
    amplitude
        Amplitude of the driving force. With the "normalised" profile, it is the total force of one driver in
        N; with the "printed" profile, the force in N on the node at the driver's centre. Zero: no drive.
    place
        Centre of a driver, as a fraction of its segment from the support.
    width
        Standard deviation of the Gaussian profile, in m.
    profile
        "normalised": the profile's integral along the string is one, independent of the mesh. "printed": it
        has unit peak and acts equally on every node (Eq. 11), so that twice as many nodes are driven twice as
        hard.
    start_frequencies
        In Hz, one per driver, from time zero. None: a driver is silent until it has sensed a whole window,
        and then starts with that frequency and phase, like an EBow, which generates no tone itself.
    feedback
        "per-driver": driver k follows the dominant frequency of its own segment's A_k, since the sensing coil
        sits at the string. "literal": both follow B_1 (Eq. 12), so that the driver of the quieter segment is
        detuned and its segment decays. "off": the start frequencies are constant.
    window, hop
        Length of a driver's analysis window, and the time between analyses, in s.
    pull
        Share of the phase difference between the dominant line and the driver that is corrected over the next
        hop, 0 to 1, for "per-driver". Zero is Eq. 12 alone, which any frequency satisfies: a driven line is
        its own maximum. The correction pulls the driver to the resonance, like the velocity feedback of an
        EBow.
    phase
        "accumulated": the phase is continuous when the frequency changes. "printed": sin(2 pi f(t) t) (Eq.
        11), which jumps in phase by 2 pi t times every change of frequency.
    """

    amplitude: Finite[Newtons] = 1.0e-3
    place: InnerShare = 0.25
    width: Annotated[Metres, Meta(gt=0.0, lt=1.0)] = 5.0e-3
    profile: Literal["normalised", "printed"] = "normalised"
    start_frequencies: Pair[Annotated[Hertz, Meta(gt=0.0, lt=2e4)]] | None = None
    feedback: Feedback = "per-driver"
    window: Annotated[Seconds, Meta(le=10.0)] = 0.05
    hop: Annotated[Seconds, Meta(ge=1e-3)] = 0.02
    pull: Share = 0.5
    phase: Literal["accumulated", "printed"] = "accumulated"

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.hop > self.window:
            given = f"drive window {self.window:g} s, hop {self.hop:g} s"
            raise InputError(given, "a window of at least one hop")


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitString(Checked):
    """A touched string as two independent segments, after the paper's Eq. 3-13 and its appendix.

    Segment k obeys mu y_tt = T(F) y_xx - d(F) y_t + f_drive with y = 0 at both ends; lengths are x and L - x.
    The transverse velocity at the pickup of segment k is A_k, and the microphones' signals are B = mixing A.
    All positions in a segment are counted from its support, so that the setup is symmetric.

    An untouched string (`contact` None) is one segment of length L that carries both drivers and both
    pickups, mirrored: A_1 is its velocity near the first support and A_2 near the second.

    Parameters
    ----------
    string
        The string, assumed ideally flexible, without stiffness, as in the paper.
    contact
        Position and force of the touch; a force of zero clamps without raising the tension.
    tension_law
        "linear": T0 + k_T F (Eq. 6). "geometric": the stretch of the deflected string.
    initial
        "plucked": each segment is released from `pluck` at time zero. "rest": nothing moves before the
        drivers start, which then need start frequencies.
    mixing
        Shares l1 and l2 of Eq. 5.
    pickup_place
        Position of a pickup, as a fraction of its segment.
    nodes
        Number of nodes N of each segment, ends included; spacing L_k / (N - 1).
    time_step
        Time step in s. None: 1 us as in the appendix or, if unstable, its largest stable integer fraction
        (1/2, 1/3 ... us). The modal route has neither nodes nor step, and accepts any.
    alpha
        Safety factor of the stability condition dt < alpha dxi / v.
    damping
        "continuous": the term is d / mu times the velocity (Eq. 8), and free oscillation falls by e in
        2 mu / d on any mesh. "printed": d / (mu dxi) (Eq. 10), which takes d for the damping of one node; the
        appendix's numbers then leave no oscillation.
    """

    string: StringParams
    contact: Contact | None = None
    tension_law: TensionLaw = "linear"
    initial: Literal["plucked", "rest"] = "plucked"
    pluck: PluckShape = field(default_factory=PluckShape)
    drive: Drive = field(default_factory=Drive)
    mixing: Pair[Share] = (0.85, 0.85)
    pickup_place: InnerShare = 0.25
    nodes: Annotated[int, Meta(ge=8, le=65536)] = 256
    time_step: Annotated[Seconds, Meta(ge=1e-9, le=1e-3)] | None = None
    alpha: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.95
    damping: Damping = "continuous"

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.contact is not None:
            x, force, length = self.contact.position, self.contact.force, self.string.length
            if not 0.0 < x < length:
                raise InputError(f"position {x:g} m", f"strictly between 0 and {length:g} m")
            if not 0.0 <= force < 1.0e4:
                raise InputError(f"force {force:g} N", "0 N or more, below 10 kN")
        silent = self.drive.amplitude != 0.0 and self.drive.start_frequencies is None
        if silent and (self.initial == "rest" or self.drive.feedback == "off"):
            raise InputError(
                f"initial '{self.initial}' and feedback '{self.drive.feedback}' without start frequencies",
                "drivers with an initial frequency",
                "set drive.start_frequencies, or drive.amplitude = 0",
            )
