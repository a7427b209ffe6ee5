"""Sessions that teach the reader: their sound, what is changed of it, and the truth of their windows.

A session is simulated once, and kept as its sound between drivers on and off with labels every millisecond.
Noise, a fault, and a wrong pitch last: each is drawn for a session, not for a window, since a network with
memory would average over changes from window to window.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Flags, Indices, Signal, StringParams
from monochord.core.units import Samples, Seconds
from monochord.datasets import FAULTS, Fault
from monochord.dsp import NOISES, loop, mixed, noise_loop
from monochord.lab import Assignment, Deviation, Rendering, render
from monochord.perception.reader import KINDS, SpectrumAnalyser
from monochord.perception.tuning import HIGHEST, LOWEST, force_scale, tension_estimator
from monochord.physics.sensors import load_sensor, with_length
from monochord.physics.theory import open_frequency

RATE, SIZE, HOP = 44100, 4410, 882
"""Frames of a second, of a window, and between the windows of a session: 20 ms."""
LABEL_RATE, MILLISECOND_FRAMES = 1000, 441
"""Labels of a second; a session begins at a multiple of so many frames, which are ten labels."""
SETTLING: Seconds = 0.35
"""Time after drivers on at which a session's sound begins."""
ORDINARY, DETUNED = KINDS.index("ordinary"), KINDS.index("detuned")
TWO_TOUCHES, DRIVER_DEAD = KINDS.index("two touches"), KINDS.index("driver dead")
MASKED = -1
"""Kind or contact of a window that nothing is learned of."""
NOISY_SHARE, RATIOS, WHOLE_SHARE, FADE = 0.4, (0.0, 30.0), 0.5, 0.05
"""Share of sessions with noise, its signal-to-noise ratios in dB, how many of these have it throughout, and
the fade in s of the others'."""
FAULTY_SHARE, DETUNED_SHARE, DETUNED_RANGE = 0.12, 0.05, (0.025, 0.1)
"""Shares of ordinary sessions with a fault from some time on, and read at a wrong pitch; its distance."""
FOLLOWED_SHARE, PITCH_STD, UNTUNED_SHARE, UNTUNED = 0.5, 0.0015, 0.15, (-0.008, 0.015)
"""Share of sessions read at the pitch that a live stream follows; of the others, the error of a measured
pitch, the share with a larger one, and its range."""
STRETCH: Seconds = 0.7
"""Length of a piece of noise; eight of them make a loop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A session's sound (2, n) in full scale, its labels every millisecond, and what is said `about` it."""

    sound: Audio
    labels: dict[str, Audio]
    about: dict[str, Any]

    @property
    def windows(self) -> int:
        """Number of windows, `HOP` apart."""
        return max((self.sound.shape[1] - SIZE) // HOP + 1, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What is true of windows (n,).

    `contact` is 1 touched throughout, 0 untouched throughout, else `MASKED`; `place` the position over the
    length of a single touch; `force` in N on the design's string; `slip` 1 sliding throughout, 0 nowhere;
    `kind` an index of `KINDS` or `MASKED`; `placed` whether the density can be told. NaN stands where there
    is nothing to learn.
    """

    contact: Audio
    place: Audio
    force: Audio
    slip: Audio
    kind: Indices
    placed: Flags


def sound_file(session: Assignment, folder: Path) -> Path:
    """Return the file of a session in a folder."""
    return folder / f"{session.plan.name}.{session.name}.npz"


def record(session: Assignment, folder: Path) -> None:
    """Simulate a session into its file, unless it is there."""
    file = sound_file(session, folder)
    if file.exists():
        return
    rendering, sensor, design = render(session), session.sensor(), session.design()
    times = {event.text: event.time for event in rendering.events if event.kind == "drivers"}
    begin = -(-round((times["on"] + SETTLING) * RATE) // MILLISECOND_FRAMES) * MILLISECOND_FRAMES
    end = round(times["off"] * RATE)
    sound = rendering.microphones[:, begin:end]
    first = begin * LABEL_RATE // RATE
    scale = max(float(np.abs(sound).max()), 1.0e-6) / 32000.0
    string = sensor.string
    about = {
        "plan": session.plan.name,
        "group": session.group.name,
        "build": session.build or 0,
        "mount": session.mount,
        "dead_from": _dead_from(rendering, begin),
        "fault": _fault(session.deviation),
        "length": string.length,
        "measured": sensor.measured_length or string.length,
        "tension": (string.tension + sensor.drift) * _at_design(string, design.string),
    }
    labels = {name: values[first:].astype(np.float32) for name, values in rendering.labels.items()}
    save_arrays(
        file,
        sound=np.round(sound / scale).astype(np.int16),
        scale=np.array(scale),
        about=np.array(json.dumps(about)),
        **{f"label_{name}": values for name, values in labels.items()},
    )


def _at_design(string: StringParams, design: StringParams) -> float:
    """Return the tension that gives the design's wire and length the same pitch, over the string's."""
    shorter = design.length / string.length
    return shorter**2 * design.linear_density / string.linear_density


def _dead_from(rendering: Rendering, begin: Samples) -> Seconds | None:
    """Return the time after frame `begin` from which a driver is dead; None if both are alive."""
    deaths = [event.time for event in rendering.events if event.kind == "fault"]
    return max(min(deaths) - begin / RATE, 0.0) if deaths else None


def _fault(deviation: Deviation) -> str:
    """Return the kind of the windows of a session with other microphones; empty for none."""
    if deviation.dead_microphone:
        return f"microphone {deviation.dead_microphone} dead"
    return "microphones swapped" if deviation.swapped else ""


def save_arrays(file: Path, **arrays: NDArray[Any]) -> None:
    """Write arrays to an npz file, which is whole as soon as it is there."""
    part = file.with_suffix(".part")
    with part.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)
    part.replace(file)


def recording_of(file: Path) -> Recording:
    """Return a recorded session."""
    with np.load(file) as arrays:
        sound = arrays["sound"].astype(np.float32) * np.float32(arrays["scale"])
        labels = {name[6:]: arrays[name] for name in arrays.files if name.startswith("label_")}
        return Recording(sound=sound, labels=labels, about=json.loads(str(arrays["about"])))


@dataclass(frozen=True, slots=True, kw_only=True)
class Changed:
    """A recording as it is learned: changed sound, the string it is read at, and the truth of its windows."""

    recording: Recording
    sound: Audio
    string: StringParams
    truth: Truth

    def analyser(self) -> SpectrumAnalyser:
        """Return the analyser of its windows."""
        return SpectrumAnalyser.of(Signal(sample_rate=RATE, channels=2, string=self.string), SIZE)

    def window(self, number: int) -> Audio:
        """Return a window (2, `SIZE`)."""
        return self.sound[:, number * HOP : number * HOP + SIZE]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """A session's file, and a number of random changes; none leaves it as it is, read as a stream would."""

    file: Path
    take: int | None

    def within(self, folder: Path) -> Path:
        """Return the file in a folder for what is made of it."""
        return folder / f"{self.file.stem}.{'plain' if self.take is None else self.take}.npz"


def changed(variant: Variant, seed: int) -> Changed:
    """Return a recorded session with random noise, fault, and pitch, which only variant and seed decide."""
    recording, design = recording_of(variant.file), load_sensor("prototype").string
    about, plain = recording.about, variant.take is None
    random = np.random.default_rng((seed, crc32(f"{variant.file.stem} {variant.take}".encode())))
    sound, frames = recording.sound, recording.sound.shape[1]
    if not plain and random.random() < NOISY_SHARE:
        sound = _noisy(sound, random)
    chance, fault, since, wrong = 1.0 if plain else random.random(), about["fault"], 0, 0.0
    if recording.labels["contacts"].max() <= 1.0 and about["dead_from"] is None and not fault:
        if chance < FAULTY_SHARE:
            fault, since = FAULTS[random.integers(len(FAULTS))], int(random.uniform(0.0, 0.9) * frames)
            own = int(random.integers(2**31))
            faulty = Fault(kind=fault)(sound[np.newaxis, :, since:], [own], seed=seed, sample_rate=RATE)
            sound = np.concatenate((sound[:, :since], faulty[0]), axis=1)
        elif chance < FAULTY_SHARE + DETUNED_SHARE:
            wrong = float(random.choice((-1.0, 1.0)) * random.uniform(*DETUNED_RANGE))
    # What a tuner measures: other than the string's own pitch where magnets and drivers pull at it.
    tension = tension_estimator(None)(recording.sound, RATE, design, None) or about["tension"]
    length = about["measured"]
    tuned = replace(design, length=length, tension=tension * (length / design.length) ** 2)
    off = open_frequency(tuned) / open_frequency(design) - 1.0
    followed = with_length(design, length) if LOWEST <= off <= HIGHEST else tuned
    read, chance = followed, 0.0 if plain else random.random()
    if wrong:
        read = _at_pitch(tuned, wrong)
    elif chance > FOLLOWED_SHARE:
        large = chance > 1.0 - UNTUNED_SHARE
        read = _at_pitch(tuned, random.uniform(*UNTUNED) if large else random.normal(0.0, PITCH_STD))
    truth = _truth(recording, force_scale(followed, design))
    last = np.arange(recording.windows) * HOP + SIZE
    kind, placed = truth.kind.copy(), truth.placed.copy()
    if fault:
        kind[last > since] = MASKED
        kind[last - SIZE >= since] = KINDS.index(fault)
        placed[last > since] = False
    if wrong:
        kind[:], placed[:] = DETUNED, False
    return Changed(
        recording=recording,
        sound=np.ascontiguousarray(sound, np.float32),
        string=read,
        truth=replace(truth, kind=kind, placed=placed),
    )


def _at_pitch(string: StringParams, error: float) -> StringParams:
    return replace(string, tension=string.tension * (1.0 + error) ** 2)


def _truth(recording: Recording, scale: float) -> Truth:
    """Return the truth of a recording's windows; forces are divided by `scale`."""
    step, size = HOP * LABEL_RATE // RATE, SIZE * LABEL_RATE // RATE
    count = recording.windows

    def windows(values: Audio) -> Audio:
        padded = np.pad(values, (0, max(step * count + size - len(values), 0)), mode="edge")
        return np.lib.stride_tricks.sliding_window_view(padded, size)[: step * count : step]

    labels, things = recording.labels, windows(recording.labels["contacts"])
    least, most = things.min(axis=1), things.max(axis=1)
    contact = np.where(least > 0.0, 1.0, np.where(most <= 0.0, 0.0, MASKED)).astype(np.float32)
    single = (least == 1.0) & (most == 1.0)
    untouched = contact == 0.0
    slip = windows(labels["slip"])
    sliding, still = (slip > 0.0).all(axis=1), (slip <= 0.0).all(axis=1)
    place = windows(labels["position"]).mean(axis=1) / recording.about["length"]
    force = windows(labels["force"]).mean(axis=1) / scale
    kind = np.full(count, MASKED)
    kind[untouched | single] = ORDINARY
    dead_from = recording.about["dead_from"]
    if dead_from is not None:
        begin = np.arange(count) * HOP / RATE
        kind[begin + SIZE / RATE > dead_from] = MASKED  # without a touch, it cannot be told
        kind[single & (begin >= dead_from)] = DRIVER_DEAD
    kind[least >= 2.0] = TWO_TOUCHES
    return Truth(
        contact=contact,
        place=np.where(single, place, np.nan).astype(np.float32),
        force=np.where(single, force, np.nan).astype(np.float32),
        slip=np.where(single & sliding, 1.0, np.where(single & still, 0.0, np.nan)).astype(np.float32),
        kind=kind,
        placed=(single & np.isfinite(place)) | untouched,
    )


def _noisy(sound: Audio, random: np.random.Generator) -> Audio:
    """Return sound (2, n) with noise throughout or in a part of it."""
    frames, kinds = sound.shape[1], (*NOISES, "music")
    kind, ratio = kinds[random.integers(len(kinds))], random.uniform(*RATIOS)
    if kind == "music":
        music = loop(int(random.integers(64)), sample_rate=RATE).astype(np.float64)
        at = int(random.integers(music.size)) + np.arange(frames)
        noise = np.broadcast_to(np.take(music, at, mode="wrap"), sound.shape)
    elif kind == "hum":
        noise = NOISES[kind](random, sound.shape, float(RATE), mains=float(random.choice((50.0, 60.0))))  # pyright: ignore[reportCallIssue]
    else:
        stretch = noise_loop(NOISES[kind], random, (2, round(STRETCH * RATE)), float(RATE))
        noise = np.take(stretch, np.arange(frames), axis=1, mode="wrap")
    added = mixed(sound.astype(np.float64), noise, ratio) - sound
    if random.random() >= WHOLE_SHARE:
        first, last = np.sort(random.uniform(0.0, frames / RATE, 2))
        time = np.arange(frames) / RATE
        added *= np.clip(np.minimum(time - first, last - time) / FADE, 0.0, 1.0)
    return (sound + added).astype(np.float32)
