"""How a touched string's spectrum depends on position and force: theory and simulation.

Makes `docs/figures/twin_trends.png` in some ten seconds: ``python -m studies.trends --set model=twin --set
string=prototype --set law=geometric --set edge=0.24 --out docs/figures/twin_trends.png``.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated

import numpy as np
from msgspec import Meta
from studies._command import draw

from monochord.core.ranges import InnerShare
from monochord.core.types import Contact, Floats, StringParams
from monochord.core.units import Hertz, Newtons
from monochord.figures import style
from monochord.figures.base import Figure
from monochord.physics.simulators import SIMULATORS, Case, Simulator
from monochord.physics.strings import load_string
from monochord.physics.theory import TensionLaw, open_frequency, split_frequencies

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure as Canvas

SETTLE, LISTEN = 0.3, 0.2  # s: what is let pass of each touch, and the window that is looked at
DEFAULT_ROUTE = "modal"
MIN_LEVEL = -60.0  # dB below the strongest line of each touch
HARMONICS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Trends(Figure):
    """Segment frequencies over position and over force, in theory and in simulated spectra.

    These are the four panels of the paper's Fig. 3 that need no hardware. A and D show Eq. 14 with its
    harmonics; B and E show spectra of the simulated microphones after the transient, with Eq. 14 dashed. The
    twin's drivers lock to a partial of each segment, often not its first, and a stiff string sounds a few
    thousandths above Eq. 14.

    Parameters
    ----------
    string
        Preset, or the path of a TOML file.
    force
        Normal force of the position sweep, in N.
    position
        Position of the force sweep, as a share of the length.
    edge
        Share of the length omitted at each end of the position sweep.
    highest_force
        End of the force sweep in N.
    highest
        Highest frequency shown, in multiples of the open string's.
    steps
        Simulated touches in each sweep.
    model, route
        Simulator of B and E, and its route, for a model with several; the modal route is exact, and the split
        string's fastest.
    law
        How force raises tension: "linear" (Eq. 6), or "geometric", the stretch of the deflected string.
    """

    string: str = "appendix"
    force: Annotated[Newtons, Meta(ge=0.0)] = 1.0
    position: InnerShare = 0.35
    edge: Annotated[float, Meta(gt=0.0, lt=0.5)] = 0.12
    highest_force: Annotated[Newtons, Meta(gt=0.0)] = 5.0
    highest: Annotated[float, Meta(gt=1.0)] = 8.0
    steps: Annotated[int, Meta(ge=2, le=1000)] = 161
    model: str = "split_string"
    route: str = "modal"
    law: TensionLaw = "linear"

    def sweeps(self, string: StringParams) -> tuple[Sweep, Sweep]:
        """Return the sweep of position and the sweep of force over a string."""
        along = np.linspace(self.edge, 1.0 - self.edge, self.steps) * string.length
        harder = np.linspace(0.0, self.highest_force, self.steps)
        return (
            Sweep(positions=along, forces=np.full(self.steps, self.force), law=self.law),
            Sweep(positions=np.full(self.steps, self.position * string.length), forces=harder, law=self.law),
        )

    def draw(self) -> Canvas:
        """Compute both sweeps and draw theory above simulation."""
        string = load_string(self.string).string
        model = simulator(self.model, self.route)
        top = self.highest * open_frequency(string)
        by_position, by_force = self.sweeps(string)
        page = style.canvas(118.0)
        (a, d), (b, e) = page.subplots(2, 2, sharex="col", sharey=True)
        here, hard = f"x/L = {self.position:g}", f"F = {self.force:g} N"
        style.dress(a, "A", f"theory, {hard}", "", "frequency (Hz)")
        style.dress(d, "D", f"theory, {here}", "", "")
        source = f"simulated, {self.model.replace('_', ' ')}"
        style.dress(b, "B", f"{source}, {hard}", "position x (mm)", "frequency (Hz)")
        style.dress(e, "E", f"{source}, {here}", "normal force F (N)", "")
        _draw_theory(a, string, by_position, 1e3 * by_position.positions)
        _draw_theory(d, string, by_force, by_force.forces)
        _draw_spectra(b, model, string, by_position, 1e3 * by_position.positions, top)
        image = _draw_spectra(e, model, string, by_force, by_force.forces, top)
        a.set_ylim(0.0, top)
        a.plot([], [], color=style.INK, lw=0.8, ls=style.THEORY, label="theory, over B and E")
        style.key(page, a)
        style.dress_bar(page.colorbar(image, ax=[b, e], pad=0.01, aspect=18), "level (dB)")
        return page


def _draw_theory(axes: Axes, string: StringParams, sweep: Sweep, over: Floats) -> None:
    fundamentals = sweep.fundamentals(string)
    for side, (f, colour) in enumerate(zip(fundamentals, style.SEGMENTS, strict=True)):
        axes.plot(over, f, color=colour, lw=1.6, label=f"$f_{side + 1}$, segment {side + 1}")
        for n in range(2, HARMONICS + 1):
            label = f"$2f_{side + 1}$ to ${HARMONICS}f_{side + 1}$" if n == 2 else None
            axes.plot(over, n * f, color=colour, lw=0.7, alpha=0.6, label=label)


def _draw_spectra(
    axes: Axes, model: Simulator, string: StringParams, sweep: Sweep, over: Floats, top: Hertz
) -> QuadMesh:
    frequencies, levels = simulated_spectra(model, string, sweep)
    edges = np.linspace(0.0, top, 241)
    rows = np.searchsorted(frequencies, edges)
    # The strongest bin of each row, so that no line falls between two rows of the picture.
    picture = np.maximum.reduceat(levels[:, : rows[-1]], rows[:-1], axis=1).T
    image = axes.pcolormesh(
        over, (edges[1:] + edges[:-1]) / 2.0, picture, cmap=style.LOUDNESS, vmin=MIN_LEVEL, vmax=0.0,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    for f, colour in zip(sweep.fundamentals(string), style.SEGMENTS, strict=True):
        axes.plot(over, f, color=colour, lw=1.0, ls=style.THEORY)
        for n in range(2, HARMONICS + 1):
            axes.plot(over, n * f, color=colour, lw=0.4, ls=style.THEORY, alpha=0.6)
    return image


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Touches along an axis: positions in m and forces in N, both (n,); one of them varies."""

    positions: Floats
    forces: Floats
    law: TensionLaw = "linear"

    def fundamentals(self, string: StringParams) -> tuple[Floats, Floats]:
        """Return the theoretical f1 and f2 in Hz for each touch, (n,) each."""
        return split_frequencies(string, self.positions, self.forces, self.law)


def simulator(name: str, route: str = DEFAULT_ROUTE) -> Simulator:
    """Return a simulator; `route` is passed to simulators that have it, or where it is not the default."""
    has_routes = any(field.name == "route" for field in fields(SIMULATORS.load(name)))  # pyright: ignore[reportArgumentType]
    return SIMULATORS.build(name, {"route": route} if has_routes or route != DEFAULT_ROUTE else {})


def simulated_spectra(model: Simulator, string: StringParams, sweep: Sweep) -> tuple[Floats, Floats]:
    """Return the spectra of the simulated microphones for each touch of a sweep, after the transient.

    Parameters
    ----------
    model
        Name of the simulator.
    string
        The string.
    sweep
        The touches, each simulated separately.

    Returns
    -------
    frequencies (bins,)
        In Hz.
    levels (touches, bins)
        Power of both microphones in dB, zero at the strongest line of each touch.
    """
    spectra = [_spectrum(model, case) for case in _cases(string, sweep)]
    power = np.array([each for _, each in spectra])
    levels = 10.0 * np.log10(power / power.max(axis=1, keepdims=True) + 1e-20)
    return spectra[0][0], levels


def _cases(string: StringParams, sweep: Sweep) -> list[Case]:
    assignments = (f"tension_law={sweep.law}",)
    touches = [
        Contact(position=float(x), force=float(force))
        for x, force in zip(sweep.positions, sweep.forces, strict=True)
    ]
    return [
        Case(string=string, contact=touch, seconds=SETTLE + LISTEN, assignments=assignments)
        for touch in touches
    ]


def _spectrum(model: Simulator, case: Case) -> tuple[Floats, Floats]:
    recording = model.run(case)
    late = recording.microphones[:, round(SETTLE * recording.sample_rate) :]
    size = 4 * late.shape[1]
    power = np.abs(np.fft.rfft(late * np.hanning(late.shape[1]), size)) ** 2
    return np.arange(power.shape[1]) * (recording.sample_rate / size), np.sum(power, axis=0)


if __name__ == "__main__":
    draw(Trends)
