"""A session over time: sound, force, pose and labels."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from msgspec import Meta

from monochord.core.curves import thinned
from monochord.core.printable import printable
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.figures import _style
from monochord.figures.base import Figure
from monochord.sessions import AudioTrack, SessionReader, read_session

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

MIN_LEVEL = -100.0
"""Level in dB relative to full scale at which silence is drawn."""
MAX_EVENTS = 30
"""Event kinds with more events than this are not drawn; they would hide the curves."""
ROW = 38.0
"""Height of a panel in mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionFigure(Figure):
    """Draw a session over time: levels of the microphones, normal force, pose, and its labels.

    Lost audio is marked in the levels; vertical lines are events of infrequent kinds.

    Parameters
    ----------
    path
        The session file.
    step
        Length in s of the stretches for one level.
    """

    path: Path
    step: Annotated[Seconds, Meta(gt=0.0)] = 0.02

    def draw(self) -> Canvas:
        """Read the session and draw a panel for each stream."""
        session = read_session(Path(self.path))
        panels = [_levels]
        panels += [_force] if "wrench" in session.streams else []
        panels += [_place, _height] if "pose" in session.streams else []
        panels += [_labels] if session.labels.columns else []
        page = _style.canvas(ROW * len(panels) + 8.0)
        rows = page.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        kinds = Counter(event.kind for event in session.events)
        rare = [event.time for event in session.events if kinds[event.kind] <= MAX_EVENTS]
        for letter, axes, panel in zip("ABCDE", rows, panels, strict=False):
            panel(axes, session, self.step)
            for time in rare:
                axes.axvline(time, color=_style.PALE, linewidth=0.5, zorder=0)
            _style.dress(axes, letter, "", "", axes.get_ylabel())
        about = session.description
        title = f"{about.name}, simulated" if about.simulated else about.name
        title = printable(title)
        rows[0].set_title(title, parse_math=False, fontsize=_style.LABEL, color=_style.INK, pad=4)
        rows[-1].set_xlabel(
            "time since the start of the session (s)", fontsize=_style.LABEL, color=_style.INK
        )
        return page


def levels(track: AudioTrack, step: Seconds) -> tuple[Floats, Floats]:
    """Return times (k,) and root-mean-square levels (channels, k) in dB relative to full scale.

    >>> none, ones = np.zeros(0), np.ones((1, 100), np.float32)
    >>> anchors = {"anchor_frame": none, "anchor_time": none, "device_frame": none.astype(np.int64)}
    >>> track = AudioTrack(samples=ones, sample_rate=100, **anchors)
    >>> levels(track, 0.5)
    (array([0.25, 0.75]), array([[0., 0.]]))
    """
    size = max(round(step * track.sample_rate), 1)
    count = track.samples.shape[1] // size
    parts = track.samples[:, : count * size].reshape(track.samples.shape[0], count, size)
    with np.errstate(invalid="ignore"):  # what is not a number has no level, and is not drawn
        mean = np.mean(np.square(parts, dtype=np.float64), axis=2)
    decibels = 10.0 * np.log10(np.maximum(mean, 10.0 ** (MIN_LEVEL / 10.0)))
    return np.asarray(track.time((np.arange(count) + 0.5) * size)), decibels


def _levels(axes: Axes, session: SessionReader, step: Seconds) -> None:
    track = session.audio
    time, decibels = levels(track, step)
    for number, level in enumerate(decibels):
        colour = _style.SEGMENTS[number % 2]
        axes.plot(time, level, linewidth=0.7, color=colour, label=f"microphone {number + 1}")
    for number, (first, stop) in enumerate(track.gaps):
        lost = "lost" if not number else None
        axes.axvspan(float(track.time(first)), float(track.time(stop)), color="red", alpha=0.4, label=lost)
    axes.set_ylabel("level (dB of full scale)")
    _key(axes)


def _force(axes: Axes, session: SessionReader, step: Seconds) -> None:  # noqa: ARG001
    track = session.readings("wrench")
    axes.plot(*thinned(track.time, track.column("fz")), linewidth=0.7, color=_style.INK, label="measured")
    labels = session.labels
    if "force" in labels.columns:
        known = np.nan_to_num(labels.columns["force"])
        axes.plot(*thinned(labels.time, known), linewidth=0.7, color=_style.SEGMENTS[1], label="true")
    axes.set_ylabel("normal force (N)")
    _key(axes)


def _place(axes: Axes, session: SessionReader, step: Seconds) -> None:  # noqa: ARG001
    _pose(axes, session, ("x", "y"))
    axes.set_ylabel("pose x, y (mm)")


def _height(axes: Axes, session: SessionReader, step: Seconds) -> None:  # noqa: ARG001
    _pose(axes, session, ("z",))
    axes.set_ylabel("pose z (mm)")


def _pose(axes: Axes, session: SessionReader, columns: tuple[str, ...]) -> None:
    track = session.readings("pose")
    for name, colour in zip(columns, _style.SEGMENTS, strict=False):
        time, place = thinned(track.time, track.column(name))
        axes.plot(time, 1e3 * place, linewidth=0.7, color=colour, label=name)
    _key(axes)


def _labels(axes: Axes, session: SessionReader, step: Seconds) -> None:  # noqa: ARG001
    labels = session.labels
    for name, colour in (("contact", _style.PALE), ("slip", _style.SEGMENTS[1])):
        if name in labels.columns:
            on = np.nan_to_num(labels.columns[name]) > 0.5
            axes.fill_between(
                labels.time, 0, 1, where=on.tolist(), step="post", color=colour, alpha=0.4, lw=0,
                transform=axes.get_xaxis_transform(), label=name,
            )  # fmt: skip
    if "position" in labels.columns:
        position = 1e3 * labels.columns["position"]
        axes.plot(labels.time, position, linewidth=1.2, color=_style.SEGMENTS[0], label="position")
    axes.set_ylabel("position x (mm)")
    _key(axes)


def _key(axes: Axes) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            fontsize=_style.TICK, frameon=False, ncols=4, labelcolor=_style.INK,
            loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.1,
        )  # fmt: skip
