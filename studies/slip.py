"""Detection of sliding by speed, and the underlying stick and slip, both simulated.

Makes `docs/figures/twin_slip.png` in some five minutes on two cores:
``python -m studies.slip --out docs/figures/twin_slip.png``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from studies._command import draw
from studies._sliding import RATE, Separation, Sliding, separations

from monochord.core.config import to_tree
from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Metres, MetresPerSecond, Newtons, Seconds
from monochord.figures import style
from monochord.figures.base import Measured
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

MARKS = "os^v"
MEAN: Seconds = 0.002
STATES = ("none", "stick", "creep", "slide")
SHADES = ("#FFFFFF", "#C9DDEB", "#7FB2D3", style.SEGMENTS[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Drag:
    """A touch dragged across the string, (n,) each, in s, m and N.

    State is 0 none, 1 stick, 2 creep, 3 slide.
    """

    time: Floats
    object: Floats
    string: Floats
    force: Floats
    state: Floats
    slip: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip(Measured):
    """Sliding against rest by two simple features of 0.1 s windows, and one touch that sticks and slips.

    A: area under the curve of hits against false alarms by sliding speed, with 95 % intervals over runs;
    0.5 is chance, 1 is always; in quiet, and with pink noise. B to D: a touch dragged slowly across:
    friction's state with the slip label where the string is quiet, the displacements of object and string,
    the friction force. A quiet string sticks and slips; a ringing one is shaken loose sooner, and so it
    gives way more often and by less (its friction is averaged over 2 ms here).

    Parameters
    ----------
    sensor, material
        Presets, or paths of TOML files.
    speeds
        Speeds across the string, in m/s.
    runs
        Touches at each speed, each with its own position, force and surface; 2 to 1000.
    lowest, highest
        Range of the forces, in N.
    seed
        Random seed.
    noise
        Level of the pink noise, in dB of full scale; a touched string sounds at some -20 dB.
    position, force, speed, seconds
        The touch of B to D: position in m, force in N, speed in m/s, and the time shown in s.
    """

    sensor: str = "prototype"
    material: str = "plastic"
    speeds: tuple[MetresPerSecond, ...] = (0.002, 0.005, 0.01, 0.02, 0.03, 0.1)
    runs: int = 60
    lowest: Newtons = 0.2
    highest: Newtons = 2.0
    seed: int = 0
    noise: float = -45.0
    position: Metres = 0.08
    force: Newtons = 1.0
    speed: MetresPerSecond = 0.005
    seconds: Seconds = 0.25

    def __post_init__(self) -> None:
        if not self.speeds or not all(0.0 < speed <= 0.5 for speed in self.speeds):
            raise InputError(f"speeds {list(self.speeds)} m/s", "one or more, above 0 to 0.5 m/s")
        if not 2 <= self.runs <= 1000:
            raise InputError(f"runs {self.runs}", "2 to 1000")
        if not 0.05 <= self.seconds <= 10.0:
            raise InputError(f"seconds {self.seconds:g}", "0.05 to 10 s")

    def numbers(self) -> dict[str, Any]:
        """Return the areas under the curve with their intervals and counts."""
        return {
            "simulated": True,
            "areas": [to_tree(one) for one in self._areas(None)],
            "areas in noise": [to_tree(one) for one in self._areas(self.noise)],
        }

    def draw(self) -> Canvas:
        """Simulate all touches and draw the curve beside the slow drag."""
        page = style.canvas(92.0)
        panels = page.subplot_mosaic([["A", "B"], ["A", "C"], ["A", "D"]], height_ratios=[0.55, 1.0, 1.0])
        title = f"simulated, {self.material.replace('_', ' ')}, {self.lowest:g} to {self.highest:g} N"
        style.dress(panels["A"], "A", title, "sliding speed (mm/s)", "area under the curve")
        _draw_areas(panels["A"], self._areas(None), "-", "")
        _draw_areas(panels["A"], self._areas(self.noise), "--", f", noise of {self.noise:g} dB")
        _dress_areas(panels["A"], self.speeds)
        quiet, ringing = self.dragged(drivers=False), self.dragged(drivers=True)
        slow = f"simulated, {1e3 * self.speed:g} mm/s across, {self.force:g} N"
        style.dress(panels["B"], "B", slow, "", "")
        style.dress(panels["C"], "C", "", "", "displacement (\N{MICRO SIGN}m)")
        style.dress(panels["D"], "D", "", "time (ms)", "friction (N)")
        _draw_states(panels["B"], quiet)
        time, size = 1e3 * quiet.time, round(MEAN * RATE)
        mean = np.convolve(ringing.force, np.full(size, 1.0 / size), mode="same")
        panels["C"].plot(time, 1e6 * quiet.object, color=style.PALE, lw=1.0, label="object")
        for dragged, force, colour, label in (
            (quiet, quiet.force, style.SEGMENTS[0], "string, drivers off"),
            (ringing, mean, style.SEGMENTS[1], "string, drivers on"),
        ):
            panels["C"].plot(time, 1e6 * dragged.string, color=colour, lw=0.8, label=label)
            panels["D"].plot(time[size:-size], force[size:-size], color=colour, lw=0.8)
        top = 1e6 * max(quiet.string.max(), ringing.string.max())
        panels["C"].set_ylim(0.0, 1.25 * top)
        panels["C"].legend(
            fontsize=style.TICK, frameon=False, loc="lower right", ncols=3, labelcolor=style.INK,
            handlelength=1.2, columnspacing=1.0,
        )  # fmt: skip
        for name in "BC":
            panels[name].sharex(panels["D"])
            panels[name].tick_params(labelbottom=False)
        panels["D"].set_xlim(0.0, 1e3 * self.seconds)
        page.align_ylabels([panels["C"], panels["D"]])
        return page

    def dragged(self, *, drivers: bool) -> Drag:
        """Return the touch of B to D, frame by frame from the first contact, with the drivers on or off."""
        from monochord.physics.twin import Scene, advance, begin, hold  # noqa: PLC0415

        touch = hold(self.position, self.force, load_material(self.material), across=self.speed)
        scene = Scene(touches=(touch,), drivers=(drivers, drivers))
        twin = begin(load_sensor(self.sensor), scene, seed=self.seed)
        rows: list[tuple[float, ...]] = []
        for frame in range(round(self.seconds * RATE)):
            take, twin = advance(twin, 1)
            time = (frame + 1) / RATE
            rows.append((
                time, self.speed * time, twin.state.contact["string_across"][0, 0],
                twin.state.solution["force_across"][0, 0],
                take.labels.friction[0, 0], take.labels.slip[0, 0],
            ))  # fmt: skip
        time, mover, string, force, state, slip = np.array(rows).T
        return Drag(time=time, object=mover, string=string, force=force, state=state, slip=slip)

    def _areas(self, noise: float | None) -> list[Separation]:
        study = Sliding(
            sensor=load_sensor(self.sensor), material=load_material(self.material), runs=self.runs,
            seed=self.seed, forces=(self.lowest, self.highest), noise=noise,
        )  # fmt: skip
        return separations(study, self.speeds)


def _draw_areas(axes: Axes, areas: list[Separation], line: str, where: str) -> None:
    for number, feature in enumerate(dict.fromkeys(one.feature for one in areas)):
        own = [one for one in areas if one.feature == feature]
        speeds, colour = [1e3 * one.speed for one in own], style.SEGMENTS[number % 2]
        axes.fill_between(
            speeds, [one.low for one in own], [one.high for one in own], color=colour, alpha=0.14, lw=0.0
        )
        axes.plot(
            speeds, [one.area for one in own], MARKS[number] + line, ms=3.5, lw=1.2, color=colour,
            label=feature + where, mfc=colour if line == "-" else "white",
        )  # fmt: skip


def _dress_areas(axes: Axes, speeds: tuple[MetresPerSecond, ...]) -> None:
    axes.axhline(0.5, color=style.PALE, lw=0.8, ls=":", label="chance")
    axes.set_xscale("log")
    ticks = sorted(1e3 * speed for speed in speeds)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_ylim(0.2, 1.02)
    axes.legend(fontsize=style.TICK, frameon=False, loc="lower right", labelcolor=style.INK)


def _draw_states(axes: Axes, dragged: Drag) -> None:
    from matplotlib.colors import ListedColormap  # noqa: PLC0415
    from matplotlib.patches import Patch  # noqa: PLC0415

    strip = np.array([3.0 * dragged.slip, dragged.state])
    span = (0.0, 1e3 * float(dragged.time[-1]), 0.0, 2.0)
    axes.imshow(
        strip, aspect="auto", interpolation="nearest", extent=span, cmap=ListedColormap(SHADES), vmin=-0.5,
        vmax=3.5,
    )  # fmt: skip
    legend = axes.legend(
        handles=[Patch(color=SHADES[state], label=STATES[state]) for state in (1, 2, 3)],
        fontsize=style.TICK, frameon=False, ncols=3, loc="upper right", bbox_to_anchor=(1.0, -0.02),
        labelcolor=style.INK, handlelength=1.0, columnspacing=1.0,
    )  # fmt: skip
    legend.set_in_layout(False)  # it fits between the panels
    axes.set_yticks([0.5, 1.5], ["state", "slip"])
    axes.tick_params(length=0.0)


if __name__ == "__main__":
    draw(Slip)
