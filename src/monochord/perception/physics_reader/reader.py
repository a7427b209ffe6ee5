"""From the explanations of a window to contact, place and force, each with the error of what is left out."""

from dataclasses import dataclass
from math import hypot, inf, pi
from typing import NamedTuple

import numpy as np

from monochord.core.types import Audio, Floats, StringParams
from monochord.core.units import Hertz, Metres, Newtons
from monochord.perception.physics_reader.explanations import (
    HARDEST,
    LINE_1,
    LINE_2,
    MODE_1,
    MODE_2,
    PITCH_STD,
    PLACE,
    RATIO,
    SCORE,
    SOFTEST,
    OpenString,
    distortion_of,
    explanations_of,
    ratio_prior,
    untouched_evidence,
)
from monochord.perception.physics_reader.lines import FREQUENCY, POWER, STD, window_lines
from monochord.physics.theory import (
    TensionLaw,
    bending_stiffness,
    open_frequency,
    support_shortening,
    tension_from_force,
)

LOWEST, HIGHEST = 0.8, 16000.0
"""Lowest frequency of a line as a share of the open one, and highest in Hz."""
SAME_PLACE = 0.01
"""Share of the length within which explanations are of one place."""
UNKNOWN_PITCH_STD = 1.0e-2
"""Standard deviation of r while the open pitch has not been measured: 17 cents."""
DRIVER_STD, MOUNT_STD = 1.0e-3, 2.0e-3
"""Standard deviations of each driven line as a share: what drivers pull it by, and what a mount that
resonates moves it by, which counts for the place alone."""
BOTH_LEAD = 4.0
"""Largest lead in log evidence of one line over two lines at the same place, which then stand for it."""
RULER_STD = 2.5e-3
"""Standard deviation of the length as a share: 0.5 mm of 200, as a ruler tells it."""
WIDTH: Metres = 3.0e-4
"""Mean width of a contact, which shortens both segments together by it."""
STIFFENING = 0.5
"""Power of the press with which a contact's stiffness grows: 1/3 of Hertz's, 1 of rough surfaces."""
PRESSES, GIVES = 24, 24
"""Parts of the same probability in which force and stiffness are drawn."""


class Reading(NamedTuple):
    """What a window may be of.

    `contact` are the log odds of a touch over none, `lead` those of the place over any other. `place` and its
    `std` in m; `ratio` is r of its best explanation, `modes` its mode numbers, 0 for a segment that does not
    sound. `strongest` is the line of most power, in Hz, and its error.
    """

    contact: float
    lead: float
    place: Metres
    std: Metres
    ratio: float
    ratio_std: float
    modes: tuple[int, int]
    strongest: tuple[Hertz, Hertz]

    @property
    def both(self) -> bool:
        """Whether both segments are read."""
        return min(self.modes) > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class PhysicsReader:
    """Reads windows of a string whose untouched pitch is that of its tension; `PhysicsReader.of` makes it."""

    string: StringParams
    sample_rate: int
    law: TensionLaw
    most_force: Newtons
    open: OpenString
    pitch_std: float

    @classmethod
    def of(
        cls,
        string: StringParams,
        sample_rate: int,
        *,
        law: TensionLaw = "linear",
        most_force: Newtons = 2.5,
        pitch_std: float = PITCH_STD,
    ) -> "PhysicsReader":
        """Return the reader of a string for presses up to `most_force`; `pitch_std` is of r."""
        most = tension_from_force(string, most_force, 0.5 * string.length, law)
        model = OpenString(
            length=string.length,
            frequency=open_frequency(string),
            stiffness=pi**2 * bending_stiffness(string) / string.tension,
            shortening=support_shortening(string),
            prior=ratio_prior(
                (most / string.tension) ** 0.5 - 1.0, softness(string), max(pitch_std, PITCH_STD)
            ),
        )
        return cls(
            string=string,
            sample_rate=sample_rate,
            law=law,
            most_force=most_force,
            open=model,
            pitch_std=pitch_std,
        )

    def read(self, window: Audio) -> Reading | None:
        """Return what a window (2, n) is of, None without a line."""
        spacing = self.sample_rate / window.shape[1]
        lines = window_lines(window, self.sample_rate, LOWEST * self.open.frequency, HIGHEST)
        if not len(lines):
            return None
        strongest = lines[lines[:, POWER].argmax()]
        distortion = distortion_of(lines, spacing, HIGHEST)
        untouched = untouched_evidence(lines, distortion, self.open)
        every = explanations_of(lines, distortion, self.open)
        nothing = Reading(-inf, 0.0, 0.0, inf, 1.0, inf, (0, 0), (strongest[0], strongest[1]))
        if not len(every):
            return nothing
        best = every[:, SCORE].max()
        mass = np.exp(every[:, SCORE] - best)
        near = np.abs(every[:, PLACE, None] - every[:, PLACE]) < SAME_PLACE * self.open.length
        place = int((near @ mass).argmax())
        own = near[place]
        row = _chosen(every[own])
        share, other = mass[own], mass[~own].sum()
        one, two = lines[int(row[LINE_1])], lines[int(row[LINE_2])]
        modes = int(row[MODE_1]), int(row[MODE_2])
        std = float(np.sqrt(np.average((every[own, PLACE] - row[PLACE]) ** 2, weights=share)))
        off_1, off_2 = (hypot(DRIVER_STD, line[STD] / line[FREQUENCY]) for line in (one, two))
        length, x = self.open.length, float(row[PLACE])
        if min(modes):
            std = hypot(std, x * (length - x) / length * hypot(off_1, off_2, 2.0**0.5 * MOUNT_STD))
            ratio_std = hypot(x * off_1, (length - x) * off_2) / length
        else:
            std, ratio_std = hypot(std, (x if modes[0] else length - x) * off_1), inf
        return nothing._replace(
            contact=float(best + np.log(mass.sum()) - untouched),
            lead=float(np.log(share.sum() / (other + 1e-12))),
            place=x,
            std=std,
            ratio=float(row[RATIO]),
            ratio_std=ratio_std,
            modes=modes,
        )

    def touch(self, reading: Reading) -> "PressedTouch":
        """Return place and press by both segments, the give of contact and mount being unknown.

        With F and K drawn from their priors, r = sqrt(T(F) / T0) + w / L - 2 T / (K L); the give moves both
        lines as if the place were nearer to the middle, by T / K (1 - 2 x / L).
        """
        string, length = self.string, self.open.length
        parts = (np.arange(PRESSES) + 0.5) / PRESSES
        forces = self.most_force * parts
        tensions = tension_from_force(string, forces, np.full(PRESSES, reading.place), self.law)
        stiffness = SOFTEST * (HARDEST / SOFTEST) ** ((np.arange(GIVES) + 0.5) / GIVES)
        lengthening = string.tension / (stiffness * forces[:, None] ** STIFFENING)
        expected = np.sqrt(tensions / string.tension)[:, None] + (WIDTH - 2.0 * lengthening) / length
        ratio_std = hypot(self.pitch_std, reading.ratio_std, WIDTH / length)
        weight = np.exp(-0.5 * np.square((reading.ratio - expected) / ratio_std)) + 1e-300
        force, force_std = _moments(np.broadcast_to(forces[:, None], weight.shape), weight)
        tension, tension_std = _moments(np.broadcast_to(tensions[:, None], weight.shape), weight)
        give, give_std = _moments(lengthening, weight)
        lever = (1.0 - 2.0 * reading.place / length) if reading.both else 0.0
        return PressedTouch(
            position=reading.place - lever * give,
            position_std=hypot(reading.std, lever * give_std, RULER_STD * reading.place),
            force=force,
            force_std=force_std,
            tension=tension,
            tension_std=hypot(tension_std, 2.0 * self.pitch_std * tension),
        )

    def tuned(self, string: StringParams, pitch_std: float) -> "PhysicsReader":
        """Return the reader of the same wire at a measured pitch, of relative error `pitch_std`."""
        return PhysicsReader.of(
            string, self.sample_rate, law=self.law, most_force=self.most_force, pitch_std=pitch_std
        )


class PressedTouch(NamedTuple):
    """Place in m, force and tension in N, each with its standard error."""

    position: Metres
    position_std: Metres
    force: Newtons
    force_std: Newtons
    tension: Newtons
    tension_std: Newtons


def softness(string: StringParams) -> float:
    """Return the share by which a contact of 1 N/m would lower both segments' lines, to first order."""
    return 2.0 * string.tension / string.length


def _chosen(every: Floats) -> Floats:
    """Return the likeliest explanation (7,) of one place (n, 7), by two lines rather than by one of them."""
    best = every[:, SCORE].argmax()
    both = np.flatnonzero((every[:, MODE_1] > 0.0) & (every[:, MODE_2] > 0.0))
    if len(both):
        other = both[every[both, SCORE].argmax()]
        if every[other, SCORE] > every[best, SCORE] - BOTH_LEAD:
            best = other
    return every[best]


def _moments(values: Floats, weight: Floats) -> tuple[float, float]:
    mean = float(np.average(values, weights=weight))
    return mean, float(np.sqrt(np.average((values - mean) ** 2, weights=weight)))
