"""The result of adapting a model to known touches, and its report."""

from dataclasses import dataclass

from monochord.core.units import Metres, Newtons
from monochord.perception.model.model import Model

MIN_REPORTED_SHARE = 0.01
"""Smallest share of windows with a false alarm that is reported."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadAdaptation:
    """The effect of known touches on a head, by cross-validation over touches, in the label's unit.

    `before` and `after` are mean absolute errors; `after` is the error on touches that were left out. `std`
    is the median standard error stated for them. `coverage` is the share of windows within one stated
    standard error, and `within_two` within two.

    `used` is false for an unchanged head: its touches did not help, for instance because modes were misread.
    `corrected` is false for a head without a correction, which cannot learn. `learned` is false if the
    touches were used only to measure the error.
    """

    unit: str
    touches: int
    windows: int
    before: float
    after: float
    std: float
    coverage: float
    within_two: float
    used: bool
    corrected: bool = True
    learned: bool = True

    @property
    def expected(self) -> float:
        """Expected error of the model, in the label's unit."""
        return self.after if self.used else self.before

    def line(self, name: str) -> str:
        """Return a line of the report, for the head with this name."""
        factor, unit = (1e3, "mm") if self.unit == "m" else (1.0, self.unit)
        before, after, std = (f"{factor * value:.3g} {unit}" for value in (self.before, self.after, self.std))
        stated = (
            f"({self.windows} windows), stated +-{std} (median), which covers {100 * self.coverage:.0f} %, "
            f"twice that {100 * self.within_two:.0f} %"
        )
        if not self.learned:
            return f"  {name:<10} mean error {before} on {self.touches} touches {stated}"
        if not self.corrected:
            return f"  {name:<10} mean error {before} {stated}; this head has no correction to learn"
        line = f"  {name:<10} mean error {before} before, {after} with {self.touches} touches {stated}"
        return line if self.used else f"{line}; unchanged, because the touches did not help"


@dataclass(frozen=True, slots=True, kw_only=True)
class Suggestion:
    """The next touch that would lower the variance of other touches most, by the share `gain` on average."""

    position: Metres
    force: Newtons
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Trust:
    """The range of the known touches, and the error to expect within it.

    `position` (m) and `force` (N) are the smallest and largest labels; None without labels. `errors` are mean
    absolute errors by head, in SI units. `sliding` says whether a touch slid, and `others` whether the model
    was adapted for other objects with touches of several objects.
    """

    touches: int
    position: tuple[Metres, Metres] | None
    force: tuple[Newtons, Newtons] | None
    errors: dict[str, float]
    sliding: bool
    others: bool = False

    def line(self) -> str:
        """Return the range and the errors as one sentence."""
        spans = [
            f"{factor * span[0]:.3g} to {factor * span[1]:.3g} {unit}"
            for span, factor, unit in ((self.position, 1e3, "mm"), (self.force, 1.0, "N"))
            if span is not None
        ]
        factors = {"position": (1e3, "mm"), "force": (1.0, "N")}
        errors = [
            f"{factors[name][0] * error:.2g} {factors[name][1]} of {name}"
            for name, error in self.errors.items()
            if name in factors
        ]
        which = "1 known touch lies" if self.touches == 1 else f"{self.touches} known touches lie"
        return (
            f"trust it at {' and '.join(spans)}, where the {which}: expect a mean error of "
            f"{' and '.join(errors)} there; not covered: other positions, "
            + ("forces or mounts" if self.others else "forces, objects or mounts")
            + ("" if self.sliding else ", and sliding")
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Adaptation:
    """A model adapted to known touches, the effect on each head, and the most helpful next touch.

    `mistaken` holds the shares of windows with a false alarm of the anomaly detector, by reason. The adapted
    model does not give these alarms. `learned` is false if the model was only judged; `model` is then
    unchanged. `trust` is the range of the touches. `outside` lists the positions in m of known touches
    outside `sensing_range`, which were left out.
    """

    model: Model
    heads: dict[str, HeadAdaptation]
    next_touch: Suggestion | None
    mistaken: dict[str, float]
    trust: Trust
    learned: bool = True
    sensing_range: tuple[Metres, Metres] | None = None
    outside: tuple[Metres, ...] = ()

    def lines(self) -> list[str]:
        """Return the lines of the report: touches left out, errors of heads, false alarms and next touch."""
        lines = [head.line(name) for name, head in self.heads.items()]
        lines += [f"  {name:<10} no touch with a known {name} could be used" for name in self._left_alone()]
        if self.sensing_range is not None and self.outside:
            low, high = self.sensing_range
            which = (
                "1 known touch lies" if len(self.outside) == 1 else f"{len(self.outside)} known touches lie"
            )
            places = ", ".join(f"{1e3 * place:.1f}" for place in self.outside)
            span = f"the sensing range of {1e3 * low:g} to {1e3 * high:g} mm"
            lines.append(f"{which} outside {span} (at {places} mm): left out of position and force")
        now = (
            'gave the alarm "{}" and do not give it now; was it a false alarm?'
            if self.learned
            else 'give the alarm "{}"'
        )
        lines += [
            f"  {100 * share:.0f} % of windows {now.format(why)}"
            for why, share in self.mistaken.items()
            if share >= MIN_REPORTED_SHARE
        ]
        touch = self.next_touch
        if touch is not None:
            place = f"{1e3 * touch.position:.0f} mm with {touch.force:.1f} N"
            gain = f"to lower the variance by {100 * touch.gain:.0f} %"
            lines.append(f"the touch that would help most next: {place}, {gain}")
        return [*lines, self.trust.line()]

    def _left_alone(self) -> list[str]:
        """Return the heads of a value for which no touch has a label and an answer."""
        heads = self.model.definition.heads
        return [name for name, head in heads.items() if not (head.task.is_probability or name in self.heads)]
