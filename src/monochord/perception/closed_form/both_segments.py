"""Contact, position and force from both segments: all that may have made the lines of a window, weighed.

Nothing is learned. `lines` finds the lines, `explanations` lists what they may be with the evidence of each,
and `BothSegments` turns these into estimates whose errors are those of what physics leaves out: resonances of
the mount at single lines, contacts that turn, and wide ones.
"""

from dataclasses import dataclass
from math import hypot, inf, log, pi, sqrt, tanh
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monochord.core.reasons import Reason
from monochord.core.types import Audio, Estimate, Estimates, Floats, StringParams
from monochord.core.units import Hertz, Metres, Newtons
from monochord.perception.closed_form.explanations import (
    HARDEST,
    LINE_1,
    LINE_2,
    MODE_1,
    MODE_2,
    PITCH_STD,
    PLACE,
    RANGE,
    RATIO,
    RATIO_STEP,
    RATIOS,
    SCORE,
    SOFTEST,
    OpenString,
    distortion_of,
    explanations_of,
    priors,
    untouched_evidence,
)
from monochord.perception.closed_form.lines import FREQUENCY, LEVEL, OWN, POWER, STD, prominent_lines
from monochord.physics.theory import (
    TensionLaw,
    bending_stiffness,
    open_frequency,
    support_shortening,
    tension_from_force,
)

UNITS = {
    "contact": "",
    "frequency": "Hz",
    "position": "m",
    "force": "N",
    "tension": "N",
    "frequency_1": "Hz",
    "frequency_2": "Hz",
}
LOWEST, HIGHEST = 0.8, 16000.0
"""Lowest frequency of a line as a share of the open one, and highest in Hz."""
MIN_SALIENCE = 7.0
"""Least height of the strongest line over the noise, in nepers of power; noise itself reaches 2.2."""
MIN_EVIDENCE = 0.0
"""Least log evidence of the string, touched or not, over lines anywhere; of 1,400 windows of three simulators
none has less than 6, but two lines alone have 1."""
MIN_CONTACT, MIN_UNTOUCHED, MIN_LEAD = 1.5, 4.0, 2.0
"""Least log odds of contact, of none, and of a place over all others (4, 55 and 7 to 1). A touch at a node
may look untouched by 3; untouched windows of three simulators do by 4.6 and more."""
SAME_PLACE = 0.01
"""Share of the length within which explanations are of one place."""
MIN_OPPOSITION = 0.4
"""Least difference of two lines' shares at microphone 1 that are clearly of two segments; 0.9 is usual."""
BOTH_LEAD = 4.0
"""Largest lead in log evidence of one line over two lines at the same place, which then stand for it."""
UNKNOWN_PITCH_STD, ELSEWHERE = 1.0e-2, 0.01
"""Standard deviation of a pitch that has not been measured, 17 cents, and probability that it is anywhere
within `RANGE`."""
DRIVER_STD, MOUNT_STD = 1.0e-3, 2.0e-3
"""Standard deviations of each driven line as a share: what drivers pull it by, and what a mount that
resonates moves it by, which counts for the place alone."""
LENGTH_STD = 5.8e-3
"""Standard deviation of the length as a share: evenly within 1 %, as strings are built."""
WIDTH: Metres = 3.0e-4
"""Mean width of a contact, which shortens both segments together by it."""
STIFFENING = 0.5
"""Power of the press with which a contact's stiffness grows: 1/3 of Hertz's, 1 of rough surfaces."""
PARTS = 24
"""Parts of the same probability in which force and stiffness are drawn."""


class SegmentsReading(NamedTuple):
    """What a window may be of.

    `evidence` is the log evidence of the string over lines anywhere, and `strongest` the line of most power,
    in Hz, with its error. `contact` are the log odds of a touch over none, `lead` those of the place over any
    other. `place` and its `std` are in m; `ratio` is r of its likeliest explanation, `modes` its mode
    numbers, 0 for a segment that does not sound, and `off` the errors of its lines as shares. `is_opposed`
    says whether both segments sound, each louder at its own microphone. `detuning` is the share by which the
    string is tuned off its pitch if that is likely, else 0.
    """

    evidence: float
    strongest: tuple[Hertz, Hertz]
    contact: float = -inf
    lead: float = 0.0
    place: Metres = 0.0
    std: Metres = inf
    ratio: float = 1.0
    ratio_std: float = inf
    modes: tuple[int, int] = (0, 0)
    off: tuple[float, float] = (inf, inf)
    is_opposed: bool = False
    detuning: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BothSegments:
    """Reads windows of a string whose pitch is that of its tension; `BothSegments.of` makes it.

    `pitch_std` is the standard error of the pitch as a share, None of one that has not been measured.
    """

    string: StringParams
    sample_rate: int
    law: TensionLaw
    most_force: Newtons
    sensing_range: tuple[Metres, Metres]
    pitch_std: float | None
    model: OpenString

    @classmethod
    def of(
        cls,
        string: StringParams,
        sample_rate: int,
        *,
        law: TensionLaw,
        most_force: Newtons,
        sensing_range: tuple[Metres, Metres] | None = None,
        pitch_std: float | None = None,
    ) -> "BothSegments":
        """Return the reader of a string for presses up to `most_force`."""
        std, elsewhere = (UNKNOWN_PITCH_STD, ELSEWHERE) if pitch_std is None else (pitch_std, 0.0)
        most = tension_from_force(string, most_force, 0.5 * string.length, law)
        rise, softness = sqrt(most / string.tension) - 1.0, 2.0 * string.tension / string.length
        pitch, ratio = priors(max(std, PITCH_STD), elsewhere, rise, softness)
        model = OpenString(
            length=string.length,
            frequency=open_frequency(string),
            stiffness=pi**2 * bending_stiffness(string) / string.tension,
            shortening=support_shortening(string),
            pitch=pitch,
            ratio=ratio,
        )
        return cls(
            string=string,
            sample_rate=sample_rate,
            law=law,
            most_force=most_force,
            sensing_range=sensing_range or (0.0, string.length),
            pitch_std=pitch_std,
            model=model,
        )

    def tuned(self, string: StringParams, pitch_std: float) -> "BothSegments":
        """Return the reader of the same wire at a measured pitch, of relative error `pitch_std`."""
        return BothSegments.of(
            string,
            self.sample_rate,
            law=self.law,
            most_force=self.most_force,
            sensing_range=self.sensing_range,
            pitch_std=pitch_std,
        )

    def read(self, window: Audio) -> SegmentsReading | None:
        """Return what a window (2, n) is of, None without a clear line."""
        model, spacing = self.model, self.sample_rate / window.shape[1]
        lines = prominent_lines(window, self.sample_rate, LOWEST * model.frequency, HIGHEST)
        if not len(lines) or lines[:, LEVEL].max() < MIN_SALIENCE:
            return None
        strongest = lines[lines[:, POWER].argmax()]
        distortion = distortion_of(lines, spacing, HIGHEST)
        untouched = untouched_evidence(lines, distortion, model)
        every = explanations_of(lines, distortion, model)
        reading = SegmentsReading(
            evidence=untouched, strongest=(float(strongest[FREQUENCY]), float(strongest[STD]))
        )
        if not len(every):
            return reading
        best = every[:, SCORE].max()
        mass = np.exp(every[:, SCORE] - best)
        touched = float(best + np.log(mass.sum()))
        near = _likeliest_place(every[:, PLACE], mass, SAME_PLACE * model.length)
        share, others = mass[near], mass[~near].sum()
        row = _chosen(every[near])
        length, x = model.length, float(row[PLACE])
        one, two = (lines[int(row[column])] for column in (LINE_1, LINE_2))
        off_1, off_2 = (hypot(DRIVER_STD, line[STD] / line[FREQUENCY]) for line in (one, two))
        modes = int(row[MODE_1]), int(row[MODE_2])
        std = float(np.sqrt(np.average((every[near, PLACE] - x) ** 2, weights=share)))
        if min(modes):
            std = hypot(std, x * (length - x) / length * hypot(off_1, off_2, sqrt(2.0) * MOUNT_STD))
            ratio_std = hypot(x * off_1, (length - x) * off_2) / length
        else:
            std, ratio_std = hypot(std, (x if modes[0] else length - x) * off_1), inf
        return reading._replace(
            evidence=max(untouched, touched),
            contact=touched - untouched,
            lead=log(share.sum() / (others + 1e-12)),
            place=x,
            std=std,
            ratio=float(row[RATIO]),
            ratio_std=ratio_std,
            modes=modes,
            off=(off_1, off_2),
            is_opposed=bool(min(modes) and one[OWN] - two[OWN] > MIN_OPPOSITION),
            detuning=self._detuning(every[:, RATIO], mass),
        )

    def _detuning(self, ratio: Floats, mass: Floats) -> float:
        """Return by what share the string is tuned off its pitch if that is likely, else 0."""
        if self.pitch_std is not None:
            return 0.0
        at = np.rint((ratio - RATIOS[0]) / RATIO_STEP).astype(int)
        elsewhere = mass * 0.5 * ELSEWHERE / RANGE / np.exp(self.model.ratio[at])
        return float(ratio[elsewhere.argmax()]) - 1.0 if elsewhere.sum() > 0.5 * mass.sum() else 0.0

    def estimates(self, reading: SegmentsReading | None) -> Estimates:
        """Return the estimates that `UNITS` names from what `read` returned of a window."""
        if reading is None or reading.evidence < MIN_EVIDENCE:
            return abstain(Reason.NO_STRUCTURE)
        if -MIN_UNTOUCHED < reading.contact < MIN_CONTACT:
            return abstain(Reason.TWO_CANDIDATES)
        probability = 0.5 + 0.5 * tanh(0.5 * reading.contact)
        values = {"contact": (probability, sqrt(probability * (1.0 - probability)))}
        reason = Reason.NONE
        if reading.contact < 0.0:
            reason, values["frequency"] = Reason.NO_CONTACT, reading.strongest
        elif reading.lead < MIN_LEAD:
            reason = Reason.TWO_CANDIDATES
        else:
            touch = self._touch(reading)
            if self.sensing_range[0] <= touch["position"][0] <= self.sensing_range[1]:
                values |= self._fundamentals(reading) | touch
            else:
                reason = Reason.OUTSIDE_RANGE
        stated = {
            name: Estimate(value=each[0], std=each[1], unit=UNITS[name]) for name, each in values.items()
        }
        estimates = abstain(reason or Reason.ONE_SEGMENT) | stated
        if "force" in stated and self.law == "linear" and self.string.tension_per_force == 0.0:
            estimates["force"] = Estimate.abstain("N", Reason.CONSTANT_TENSION)
        return estimates

    def _fundamentals(self, reading: SegmentsReading) -> dict[str, tuple[Hertz, Hertz]]:
        """Return the fundamentals of the segments that sound, without stiffness; the lower is `frequency`."""
        model, short = self.model, self.model.shortening
        sides = reading.place - short, model.length - reading.place - short
        whole = reading.ratio * model.frequency * model.length
        found = {
            f"frequency_{number}": (whole / side, off * whole / side)
            for number, side, off, mode in zip((1, 2), sides, reading.off, reading.modes, strict=True)
            if mode
        }
        return found | {"frequency": min(found.values())}

    def _touch(self, reading: SegmentsReading) -> dict[str, tuple[float, float]]:
        """Return position, force and tension with their errors, the give of contact and mount being unknown.

        With F and K drawn from their priors, r = sqrt(T(F) / T0) + w / L - 2 T / (K L); the give moves both
        lines as if the place were nearer to the middle, by T / K (1 - 2 x / L). One segment alone tells
        neither.
        """
        string, length, place = self.string, self.model.length, reading.place
        if not min(reading.modes):
            return {"position": (place, hypot(reading.std, LENGTH_STD * place))}
        parts = (np.arange(PARTS) + 0.5) / PARTS
        forces = self.most_force * parts
        tensions = tension_from_force(string, forces, np.full(PARTS, place), self.law)
        stiffness = SOFTEST * (HARDEST / SOFTEST) ** parts * forces[:, None] ** STIFFENING
        lengthening = string.tension / stiffness
        expected = np.sqrt(tensions / string.tension)[:, None] + (WIDTH - 2.0 * lengthening) / length
        pitch_std = UNKNOWN_PITCH_STD if self.pitch_std is None else self.pitch_std
        std = hypot(pitch_std, reading.ratio_std, WIDTH / length)
        weight = np.exp(-0.5 * np.square((reading.ratio - expected) / std)) + 1e-300
        give, give_std = _moments(lengthening, weight)
        tension, tension_std = _moments(tensions[:, None], weight)
        lever = 1.0 - 2.0 * place / length
        position = place - lever * give
        return {
            "position": (position, hypot(reading.std, lever * give_std, LENGTH_STD * position)),
            "force": _moments(forces[:, None], weight),
            "tension": (tension, hypot(tension_std, 2.0 * pitch_std * tension)),
        }


def abstain(reason: str) -> dict[str, Estimate]:
    """Return an abstention from each of the two-sided form's estimates."""
    return {name: Estimate.abstain(unit, reason) for name, unit in UNITS.items()}


def _likeliest_place(place: Floats, mass: Floats, reach: Metres) -> NDArray[np.bool_]:
    """Return which explanations (n,) are within `reach` of the place where they have most mass."""
    order = np.argsort(place)
    ranked, total = place[order], np.append(0.0, np.cumsum(mass[order]))
    near = total[np.searchsorted(ranked, place + reach)] - total[np.searchsorted(ranked, place - reach)]
    return np.abs(place - place[near.argmax()]) < reach


def _chosen(every: Floats) -> Floats:
    """Return the likeliest explanation (7,) of one place (n, 7), by two lines rather than by one of them."""
    best = every[every[:, SCORE].argmax()]
    both = every[np.minimum(every[:, MODE_1], every[:, MODE_2]) > 0.0]
    if len(both):
        other = both[both[:, SCORE].argmax()]
        return other if other[SCORE] > best[SCORE] - BOTH_LEAD else best
    return best


def _moments(values: Floats, weight: Floats) -> tuple[float, float]:
    """Return mean and standard deviation of values under weights that they broadcast to."""
    values = np.broadcast_to(values, weight.shape)
    mean = float(np.average(values, weights=weight))
    return mean, float(np.sqrt(np.average((values - mean) ** 2, weights=weight)))
