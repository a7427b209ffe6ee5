"""Position on real recorded strings with music and speech added.

Makes what `docs/how-to/strings.md` says of music and speech, and its figure, in some ten minutes, from the
recordings
that MONOCHORD_REALSTRINGS names: ``python -m studies.interference``.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from studies._command import measure
from studies._takes import (
    POSITION_TOLERANCE,
    Interferer,
    Protocol,
    Reference,
    calibrated_strings,
    errors_under,
    located,
    position_errors,
)

from monochord.benchmarks.base import Benchmark, Row
from monochord.core.types import Floats
from monochord.core.units import Metres
from monochord.evaluation import interference_recordings
from monochord.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = "os^vDPX<>"
GUITARS = ("green", "shiny")
"""The guitars as the recordings' file names call them; a figure numbers them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interference(Benchmark):
    """Position errors on plucked takes of known fret with real music and speech added.

    For each interference recording and each signal-to-noise ratio: the answered share, and the share of the
    estimates within 5 mm, beside autocorrelation, which always answers. The open note is clean.

    Parameters
    ----------
    ratios
        Signal-to-noise ratios in dB.
    per
        Reference of the ratio: every single "window", or the whole "take" from its onset, so that a plucked
        string's later, decayed windows have a lower ratio.
    seed
        Random seed of where in its recording each take's interference begins.
    """

    ratios: tuple[float, ...] = (20.0, 10.0, 5.0, 0.0)
    per: Reference = "window"
    seed: int = 0

    def run(self) -> Iterator[Row]:
        """Yield, for each interference and ratio, the share answered and the share within 5 mm."""
        protocol = Protocol()
        for name, sound in interference_recordings().items():
            for ratio in self.ratios:
                interferer = Interferer(sound=sound, ratio=ratio, per=self.per)
                yield from _rows(f"{name} {ratio:g} dB", *errors_under(interferer, protocol, self.seed))


def _rows(name: str, errors: Floats, plain: Floats) -> Iterator[Row]:
    answered = np.isfinite(errors)
    yield Row(name=f"{name}: answered", value=100.0 * float(answered.mean()), unit="%")
    yield Row(
        name=f"{name}: within 5 mm",
        value=100.0 * float((np.abs(errors[answered]) <= POSITION_TOLERANCE).mean()),
        unit="%",
        baseline="plain autocorrelation",
        baseline_value=100.0 * float((np.abs(plain) <= POSITION_TOLERANCE).mean()),
    )


def drawn(ratios: tuple[float, ...] = (20.0, 15.0, 10.0, 5.0, 0.0), seed: int = 0) -> "Figure":
    """Return a figure of position errors on real plucked strings, with and without interference.

    A: every answered 0.1 s window against its fret, one mark a string, calibrated by the string's open note
    alone. B: share of the answers within 5 mm against the signal-to-noise ratio, with the share answered, and
    plain autocorrelation, which never abstains.
    """
    page = style.canvas(80.0)
    errors, curves = page.subplots(1, 2)
    style.dress(errors, "A", "recorded strings, open string known", "fret position x (mm)", "error (mm)")
    style.dress(curves, "B", "interference mixed in", "signal-to-noise ratio (dB)", "share (%)")
    _draw_errors(errors)
    for number, (name, sound) in enumerate(interference_recordings().items()):
        errors_at = [errors_under(Interferer(sound=sound, ratio=ratio), Protocol(), seed) for ratio in ratios]
        _draw_curves(curves, ratios, errors_at, SOUND_NAMES.get(name, name), style.SEGMENTS[number % 2])
    curves.set_ylim(40.0, 101.0)
    curves.invert_xaxis()
    curves.set_xticks(ratios)
    curves.legend(fontsize=style.TICK - 1.0, frameon=False, loc="lower left", labelcolor=style.INK)
    errors.legend(
        fontsize=style.TICK - 1.0, frameon=False, ncols=2, loc="lower left", labelcolor=style.INK,
        handletextpad=0.2, columnspacing=0.8,
    )  # fmt: skip
    return page


SOUND_NAMES = {"198_209_0000": "speech", "Kevin_MacLeod_Vibe_Ace": "music"}


def string_errors() -> dict[str, list[tuple[Metres, Floats]]]:
    """Return, for every string, each fretted take's position and its windows' errors, both in m."""
    protocol = Protocol()
    return {
        name: [
            (take.position, position_errors(take, located(take, calibration, protocol))) for take in fretted
        ]
        for name, calibration, fretted in calibrated_strings(protocol)
    }


def _draw_errors(axes: "Axes") -> None:
    axes.axhspan(-1e3 * POSITION_TOLERANCE, 1e3 * POSITION_TOLERANCE, color="#EEEEEE", lw=0.0)
    axes.axhline(0.0, color=style.INK, lw=0.6)
    for mark, (name, takes) in zip(cycle(MARKS), sorted(string_errors().items()), strict=False):
        x = np.concatenate([np.full(e.size, 1e3 * p) for p, e in takes])
        y = 1e3 * np.concatenate([e for _, e in takes])
        guitar, _, string = name.partition(" ")
        number = GUITARS.index(guitar.partition("_")[0])
        colour, label = style.SEGMENTS[number], f"guitar {number + 1}, {string.partition('(')[0]}"
        axes.plot(x, y, mark, ms=2.6, mfc="none", mew=0.6, color=colour, alpha=0.8, label=label)
    axes.set_ylim(-8.5, 6.0)


def _draw_curves(
    axes: "Axes", ratios: tuple[float, ...], errors: list[tuple[Floats, Floats]], name: str, colour: str
) -> None:
    answered = [100.0 * np.isfinite(own).mean() for own, _ in errors]
    within = [100.0 * (np.abs(own[np.isfinite(own)]) <= POSITION_TOLERANCE).mean() for own, _ in errors]
    plain = [100.0 * (np.abs(baseline) <= POSITION_TOLERANCE).mean() for _, baseline in errors]
    axes.plot(ratios, within, "o-", ms=3.0, lw=1.4, color=colour, label=f"{name}: answers within 5 mm")
    axes.plot(ratios, answered, "-", lw=0.8, color=colour, alpha=0.6, label=f"{name}: answered")
    axes.plot(ratios, plain, "s:", ms=2.5, lw=0.9, color=colour, alpha=0.8, label=f"{name}: autocorrelation")


if __name__ == "__main__":
    measure(Interference)
