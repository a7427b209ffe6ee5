"""Turns changes of a recording into events: those that a reader of the session needs to know."""

from collections.abc import Iterator, Mapping

from monochord.capture.recording.counters import FeedState, RecordingState
from monochord.core.clock import MIN_CLOCK_STEP
from monochord.core.inputs import Inputs
from monochord.core.reasons import Reason
from monochord.core.units import Seconds
from monochord.sessions import Event

EVENT_INTERVAL: Seconds = 1.0
"""Shortest time between events of one kind and stream, in s; changes in between are counted together."""
MIN_ONE: Seconds = 1.0
"""How long two channels are not two microphones before a notice, in s."""
ONE_MICROPHONE = "one_microphone"
"""Kind of the notice about two channels that are not two microphones."""
MIN_BLOCKED: Seconds = 0.25
"""Waiting time for the disk from which it is reported, in s."""


class RecordingWatch:
    """Compares each state of a recording with the previous one, and reports problems and recoveries."""

    def __init__(self, disk_warning: Seconds) -> None:
        self._disk_warning = disk_warning
        self._totals: dict[tuple[str, str], float] = {}
        self._next: dict[tuple[str, str], Seconds] = {}
        self._silent: dict[str, Seconds] = {}
        self._quiet: set[int] = set()
        self._inputs, self._inputs_since = Inputs.UNKNOWN, 0.0
        self._offsets: Mapping[str, Seconds] = {}
        self._disk_low = self._implausible = self._inputs_said = False

    def look(self, now: RecordingState, *, last: bool = False) -> list[Event]:
        """Return the new notices; with `last`, also pending counts."""
        notices = [
            *self._audio(now, last=last),
            *(notice for feed in now.feeds for notice in self._feed(feed, now.time, last=last)),
            *self._disk(now, last=last),
        ]
        return [notice for notice in notices if notice]

    def clocks(self, time: Seconds, offsets: Mapping[str, Seconds]) -> list[Event]:
        """Return a notice for each clock that was set since the last call."""
        before, self._offsets = self._offsets, dict(offsets)
        steps = {name: offset - before[name] for name, offset in offsets.items() if name in before}
        return [
            Event(
                time=time,
                kind="clock_step",
                text=f"clock {name} was set by {step:+.3f} s",
                data={"clock": name, "seconds": step},
            )
            for name, step in steps.items()
            if abs(step) > MIN_CLOCK_STEP
        ]

    def _audio(self, now: RecordingState, *, last: bool) -> Iterator[Event | None]:
        def rise(kind: str, total: float) -> float:
            return self._rise(kind, "audio", total, now.time, last=last)

        if gaps := rise("gap", now.gaps):
            frames = self._since("gap frames", "audio", now.dropped)
            text = f"audio: {_counted(frames, 'frame')} lost in {_counted(gaps, 'gap')}"
            yield _about("audio", now.time, "gap", text, frames=frames, gaps=gaps)
        if count := rise("xrun", now.health.xruns):
            yield _about("audio", now.time, "xrun", f"audio: {_counted(count, 'xrun')}", count=count)
        if count := rise("reconnect", now.health.reconnects):
            yield _about("audio", now.time, "reconnect", "audio: connected again", count=count)
        yield self._silence("audio", now.silent, now.time)
        if now.implausible_age and not self._implausible:
            age = now.implausible_age
            text = f"audio: the device states an impossible time, {age:+.3f} s ago, for the latest block"
            yield _about("audio", now.time, "clock_doubt", text, seconds=age)
        self._implausible = bool(now.implausible_age)
        if shift := rise("uncounted", now.time_shift):
            text = f"audio: its times shifted by {shift:+.3f} s against its frames, without counted losses"
            yield _about("audio", now.time, "uncounted", text, seconds=shift)
        yield from self._sound(now)
        yield self._one_microphone(now)
        clipped = sum(level.clipped for level in now.levels)
        if count := rise("clipping", clipped):
            microphones = ", ".join(f"{k + 1}" for k, level in enumerate(now.levels) if level.clipping)
            text = f"audio: {_counted(count, 'sample')} clipped, microphone {microphones}"
            yield _about("audio", now.time, "clipping", text, samples=count)
        if count := rise("nan", sum(level.not_numbers for level in now.levels)):
            text = f"audio: {count:.0f} samples that are not numbers"
            yield _about("audio", now.time, "nan", text, samples=count)

    def _sound(self, now: RecordingState) -> Iterator[Event]:
        """Yield a notice where a microphone falls silent, and where it recovers."""
        before, self._quiet = self._quiet, {k + 1 for k, level in enumerate(now.levels) if level.is_silent}
        for kind, numbers, more in (
            ("silence", self._quiet - before, f"; {Reason.SILENCE.remedy}"),
            ("sound", before - self._quiet, ""),
        ):
            if numbers:
                microphones = ", ".join(map(str, sorted(numbers)))
                text = f"audio: {kind}, microphone {microphones}{more}"
                data = {"stream": "audio", "microphones": microphones}
                yield Event(time=now.time, kind=kind, text=text, data=data)

    def _one_microphone(self, now: RecordingState) -> Event | None:
        """Return a notice once two channels have not been two microphones for a while.

        A microphone that picks up nothing at all has a notice of its own.
        """
        reason = Reason.NONE if any(level.is_silent for level in now.levels) else now.inputs.reason
        if now.inputs is not self._inputs:
            self._inputs, self._inputs_since, self._inputs_said = now.inputs, now.time, False
        if not reason or self._inputs_said or now.time - self._inputs_since < MIN_ONE:
            return None
        self._inputs_said = True
        return Event(time=now.time, kind=ONE_MICROPHONE, text=f"audio: {reason}", data={"stream": "audio"})

    def _feed(self, feed: FeedState, time: Seconds, *, last: bool) -> Iterator[Event | None]:
        name, health = feed.name, feed.health
        yield self._silence(name, feed.silent, time)
        for kind, total, words in (
            ("missing", health.missing, "{} missing"),
            ("out_of_order", health.out_of_order, "{} out of order"),
            ("reconnect", health.reconnects, "connected again"),
            ("fault", max(feed.faulty, health.faulty), f"{{}} with faults, status {feed.status:#010x}"),
        ):
            if count := self._rise(kind, name, total, time, last=last):
                readings = _counted(count, "reading")
                more: dict[str, float] = {"status": feed.status} if kind == "fault" else {}
                yield _about(name, time, kind, f"{name}: {words.format(readings)}", count=count, **more)

    def _disk(self, now: RecordingState, *, last: bool) -> Iterator[Event]:
        low = now.elapsed > 1.0 and now.space.left < self._disk_warning
        if low and not self._disk_low:
            left, free = now.space.left, 1e-6 * now.space.free
            text = f"disk: space for {left:.0f} s, {free:.0f} MB free"
            yield Event(time=now.time, kind="disk_low", text=text, data={"seconds": left, "megabytes": free})
        self._disk_low = low
        if now.blocked - self._totals.get(("disk_slow", "disk"), 0.0) > MIN_BLOCKED and (
            seconds := self._rise("disk_slow", "disk", now.blocked, now.time, last=last)
        ):
            text = f"disk: too slow, capture waited {seconds:.2f} s"
            yield Event(time=now.time, kind="disk_slow", text=text, data={"seconds": seconds})

    def _silence(self, name: str, silent: Seconds, time: Seconds) -> Event | None:
        """Return a notice where a stream falls silent or recovers."""
        since = self._silent.get(name)
        if silent and since is None:
            self._silent[name] = time - silent
            return _about(name, time, "silent", f"{name}: silent for {silent:.1f} s", seconds=silent)
        if not silent and since is not None:
            del self._silent[name]
            away = time - since
            return _about(name, time, "back", f"{name}: back after {away:.1f} s", seconds=away)
        return None

    def _rise(self, kind: str, name: str, total: float, time: Seconds, *, last: bool) -> float:
        """Return the increase of a count since its last event, 0 if another event would be too soon."""
        if not last and time < self._next.get((kind, name), -1.0):
            return 0.0
        rise = self._since(kind, name, total)
        if rise:
            self._next[kind, name] = time + EVENT_INTERVAL
        return rise

    def _since(self, kind: str, name: str, total: float) -> float:
        rise = total - self._totals.get((kind, name), 0.0)
        self._totals[kind, name] = total
        return rise


def _about(stream: str, time: Seconds, kind: str, text: str, **data: float) -> Event:
    return Event(time=time, kind=kind, text=text, data={"stream": stream, **data})


def _counted(number: float, noun: str) -> str:
    return f"{number:.0f} {noun}{'' if number == 1 else 's'}"
