"""The split-string simulation as an audio source with true labels."""

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.capture.sources._paced_stream import PacedStream
from monochord.capture.sources._script import (
    ScriptedTouch,
    clamp_changes,
    draw_clamps,
    refuse_unlike_clamps,
)
from monochord.capture.sources.base import Source
from monochord.core.errors import InputError
from monochord.core.labels import LabelTrack, one_window_labels
from monochord.core.ranges import Count, InnerShare, NonNegative, Pair, Whole, refuse_unordered
from monochord.core.types import Audio, Contact, Floats, Signal, StringParams, Truth
from monochord.core.units import FINITE, MetresPerSecond, Newtons, Samples, Seconds
from monochord.physics.split_string import Drive, PluckShape, Ringing, SplitString, advance, begin, touch
from monochord.physics.strings import load_string
from monochord.physics.theory import mixing_matrix, open_frequency

LABEL_STEP: Samples = 32
"""Frames between labels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitStringSource(Source):
    """A simulated driven string with occasional touches: `monochord.physics.split_string`.

    Parameters
    ----------
    preset
        The string: a preset's name or a TOML file.
    speed
        Playback speed: 1 is real time, 0 as fast as the reader accepts it.
    duration
        Length in seconds; 0 without end.
    script
        Touches in order of start time, such as ``[{start = 1.0, position = 0.2, force = 0.5, seconds =
        2.0}]``; one without ``seconds`` lasts until the next. Empty: touches drawn at random.
    seed
        Random seed of the touches and of the noise; equal seeds give equal sounds.
    hold
        Mean duration of a random touch or pause, in seconds.
    forces
        Range of a random touch's normal force, in N.
    places
        Range of random touch positions, as fractions of the length.
    settle
        How long after a change of touch the truth counts as unsettled, in seconds.
    level
        Approximate velocity that the drivers sustain at a pickup, in m/s, for any string; samples are
        velocities in m/s.
    strike
        Strength of the pluck at each change of touch, in multiples of `level`. After a weak strike, the
        sounding harmonics depend on the previous ones: see the drivers' feedback.
    noise
        Standard deviation of the microphones' white noise, in sample units.
    block
        Frames per block; the last block may be shorter.
    sample_rate
        In Hz.
    """

    preset: str = "appendix"
    speed: NonNegative[float] = 1.0
    duration: NonNegative[Seconds] = 0.0
    script: tuple[ScriptedTouch, ...] = ()
    seed: Whole = 0
    hold: Annotated[Seconds, Meta(ge=0.05, le=FINITE)] = 1.5
    forces: Pair[NonNegative[Newtons]] = (0.2, 2.0)
    places: Pair[InnerShare] = (0.25, 0.75)
    settle: Seconds = 0.15
    level: NonNegative[MetresPerSecond] = 0.1
    strike: NonNegative[float] = 3.0
    noise: NonNegative[float] = 1e-4
    block: Count = 256
    sample_rate: int = 44100

    def open(self) -> "_SimulatedStream":
        """Open with the untouched string; raises `InputError` for an invalid preset or option."""
        string = load_string(self.preset).string
        self._refuse_impossible(string)
        return _SimulatedStream(self, string)

    def _refuse_impossible(self, string: StringParams) -> None:
        refuse_unordered("touches", forces=self.forces, places=self.places)
        for scripted in self.script:
            scripted.refuse_impossible(string.length)
        refuse_unlike_clamps(self.script)
        if list(self.script) != sorted(self.script, key=lambda scripted: scripted.start):
            raise InputError("script out of order", "touches in order of start time")


def _setup(string: StringParams, level: MetresPerSecond) -> SplitString:
    """Return the untouched string with a drive and a first pluck of about the given level.

    At resonance the drive balances the loss: one driver on half the string, or two on the whole, at a quarter
    of the segment, sustain 2 A / (d L) at a pickup there.
    """
    return SplitString(
        string=string,
        drive=Drive(amplitude=level * string.damping * string.length / 2.0),
        pluck=PluckShape(height=level / (2.0 * math.pi * open_frequency(string))),
    )


class _SimulatedStream(PacedStream):
    def __init__(self, options: SplitStringSource, string: StringParams) -> None:
        rate = options.sample_rate
        signal = Signal(sample_rate=rate, channels=2, string=string)
        end = round(options.duration * rate) if options.duration else math.inf
        super().__init__(signal, block=options.block, speed=options.speed, end=end)
        self._options = options
        setup = _setup(string, options.level)
        self._mixing = mixing_matrix(*setup.mixing)
        self._strike = replace(setup.pluck, height=options.strike * setup.pluck.height)
        self._ringing: Ringing = begin(setup, rate)
        advance(self._ringing, 1)  # compiles here, where nobody waits for a block
        self._random = np.random.default_rng([options.seed, 1])
        touches = options.script or draw_clamps(
            seed=options.seed,
            hold=options.hold,
            positions=(options.places[0] * string.length, options.places[1] * string.length),
            forces=options.forces,
        )
        self._changes = clamp_changes(touches, rate)
        self._change = next(self._changes, None)
        self._history: deque[tuple[Samples, Contact | None]] = deque([(0, None)], maxlen=256)

    def truth(self, start: Samples, stop: Samples) -> Truth:
        """Return the labels of the window of frames [start, stop), by the rules of `monochord.core.labels`.

        `settled` is the share of it in which the touch has not changed for `settle` seconds.
        """
        rate = self._signal.sample_rate
        frame = np.arange(start, stop, LABEL_STEP)
        changed = np.array([at for at, _ in self._history])
        rows = np.searchsorted(changed, frame, side="right") - 1
        frame, rows = frame[rows >= 0], rows[rows >= 0]
        touches = [
            (0.0, math.nan, math.nan) if contact is None else (1.0, contact.position, contact.force)
            for _, contact in self._history
        ]
        columns: dict[str, Floats] = dict(
            zip(("contact", "position", "force"), np.array(touches).T[:, rows], strict=True)
        )
        columns["settled"] = (frame - changed[rows] >= self._options.settle * rate).astype(np.float64)
        return one_window_labels(LabelTrack(time=frame / rate, columns=columns), start / rate, stop / rate)

    def _read(self, frames: Samples) -> Audio:
        """Return the next frames; touches change at their exact sample, not at a block's edge."""
        parts: list[np.ndarray] = []
        while frames:
            now = self._ringing.start
            while self._change is not None and self._change[0] <= now:
                self._ringing = touch(self._ringing, self._change[1], pluck=self._strike)
                self._history.append((now, self._change[1]))
                self._change = next(self._changes, None)
            part = frames if self._change is None else min(frames, self._change[0] - now)
            velocity, self._ringing = advance(self._ringing, part)
            parts.append(velocity)
            frames -= part
        sound = self._mixing @ np.concatenate(parts, axis=1)
        # Drawn frame by frame, so that the noise does not depend on the size of blocks either.
        sound += self._options.noise * self._random.standard_normal(sound.shape[::-1]).T
        return sound.astype(np.float32)
