"""A plot of a session's tracks over time, for notebooks."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from monochord.core.curves import thinned
from monochord.core.labels import LabelTrack
from monochord.core.notebook import panels
from monochord.core.types import Feed
from monochord.sessions.tracks import AUDIO, LABELS, AudioTrack, ReadingTrack

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOUCH = {"position": ("position (mm)", 1e3), "force": ("force (N)", 1.0)}
"""Labels to plot, with axis title and scale."""


def tracks_plot(
    audio: AudioTrack, readings: Sequence[tuple[Feed, ReadingTrack]], labels: LabelTrack
) -> "tuple[Axes, ...]":
    """Plot the sound, each stream of readings, and the touch labels, each on its own axes.

    Of a stream, only columns with the first column's unit are plotted: forces without torques.
    """
    touch = [name for name in TOUCH if name in labels.columns]
    streams = [f"{feed.stream} ({feed.units[0]})" for feed, _ in readings]
    names = [AUDIO, *streams, *(f"{LABELS}: {TOUCH[name][0]}" for name in touch)]
    axes = panels(names)
    time = audio.time(range(audio.samples.shape[1]))
    for number, row in enumerate(audio.samples, 1):
        axes[0].plot(*thinned(time, row), linewidth=0.7, label=f"microphone {number}")
    for (feed, track), panel in zip(readings, axes[1:], strict=False):
        for name, unit in zip(feed.columns, feed.units, strict=True):
            if unit == feed.units[0]:
                panel.plot(*thinned(track.time, track.column(name)), linewidth=0.7, label=name)
    for name, panel in zip(touch, axes[1 + len(readings) :], strict=True):
        panel.plot(*thinned(labels.time, TOUCH[name][1] * labels.columns[name]), linewidth=1.0)
    for panel in axes:
        if panel.get_legend_handles_labels()[0]:
            panel.legend(fontsize="x-small", ncols=4, loc="upper right")
    return axes
