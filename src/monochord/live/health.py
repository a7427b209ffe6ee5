"""The sensor's health at run time, in sentences with remedies.

A fold over the windows of a stream: each window yields findings, and a lasting finding becomes a note.
Findings come from the reasons for which a model abstains, the tuning that an estimator follows, the stream's
counters, and from levels and hum measured here, so that a dead microphone is reported with any estimator.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from monochord.core.clipping import LOUD_SHARE
from monochord.core.clock import MIN_CLOCK_STEP, mistaken_rates
from monochord.core.inputs import Inputs, InputState
from monochord.core.ranges import Checked, NonNegative
from monochord.core.reasons import (
    ABSTAINING,
    CLIPPING,
    CLOCK_SET,
    FOLLOWED,
    NO_MICROPHONE,
    NO_SOUND,
    NOT_FOLLOWED,
    RECONNECTED,
    SETTLING,
    SOUND_LOST,
    STILL,
    WINDOWS_SKIPPED,
    XRUNS,
    Finding,
    Level,
    Reason,
)
from monochord.core.silence import SILENT_LEVEL
from monochord.core.types import Estimates, StreamHealth, Window
from monochord.core.units import Seconds
from monochord.live.filter import CONTACT, FilterState
from monochord.perception.watching import Condition

RINGING_LEVEL, PROMINENCE = 5.6e-3, 40.0
"""Root mean square (-45 dB) and prominence of the strongest tone below which a string does not ring.

In 12 simulated builds in each world with the drivers off, tones are at most 15 dB above the noise. A ringing
string's tones are at least 22 dB above it when touched, by any material, and 58 dB when not.
"""
HUM_SHARE = 0.5
"""Share of the power in mains frequency and its first harmonics above which a window is mostly hum."""
LEVELS_EVERY: Seconds = 0.1
"""Shortest time between checks of levels, in s."""
MIN_DEVIATION = 0.005
"""Smallest relative pitch deviation worth a note, 9 cents, beyond two standard errors of the pitch."""
MIN_INFO_TIME: Seconds = 0.5
"""An info note shorter than this, such as a settling touch, is not shown; in s."""
WORST_FIRST: tuple[Level, ...] = ("error", "warning", "info")


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """A message to the user about the sensor.

    `key` is stable, for programs; `sentence` states the problem and `remedy` the fix. `since` is its start,
    in seconds since the stream began. An ``error`` makes estimates abstain or be wrong, a ``warning`` costs
    some estimates, an ``info`` explains.
    """

    key: str
    level: Level
    sentence: str
    remedy: str
    since: Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthSettings(Checked):
    """When a finding becomes a note; all values in s.

    A note appears once its finding has lasted for `appear`, and is cleared after `clear` without it.
    """

    appear: NonNegative[Seconds] = 0.5
    clear: NonNegative[Seconds] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LastingFinding:
    """A finding over time: when it was first and last seen."""

    finding: Finding
    first: Seconds
    last: Seconds


NO_LASTING: Mapping[str, LastingFinding] = MappingProxyType({})
NO_FINDINGS: Mapping[str, Finding] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthState:
    """The health state of one stream, passed in and out; it starts as ``HealthState()``.

    `looked` is when levels were last measured, `from_levels` the findings from that, and `inputs` what two
    channels carry where the estimator does not tell. `stream` and `skipped` are the counters after the
    previous window. `start` is the first frame of the last window.
    """

    start: int = -1
    lasting: Mapping[str, LastingFinding] = field(default_factory=lambda: NO_LASTING)
    from_levels: Mapping[str, Finding] = field(default_factory=lambda: NO_FINDINGS)
    looked: Seconds = -math.inf
    stream: StreamHealth = field(default_factory=StreamHealth)
    skipped: int = 0
    inputs: InputState = field(default_factory=InputState)


def step(
    state: HealthState,
    window: Window,
    estimates: Estimates,
    stream: StreamHealth,
    skipped: int,
    followed: FilterState,
    condition: Condition | None,
    settings: HealthSettings,
) -> tuple[HealthState, tuple[Note, ...]]:
    """Return the state after a window, and the notes for the user, oldest first.

    A window that does not begin after the previous one starts a new stream. `skipped` counts the windows
    skipped so far because the reader was late. `followed` is the filter's state after the window, `condition`
    the estimator's knowledge of the string, None where it has none.

    Examples
    --------
    >>> state, settings, notes = HealthState(), HealthSettings(), ()
    >>> for k in range(20):
    ...     samples = np.zeros((2, 4410), np.float32)
    ...     window = Window(samples=samples, start=4410 * k, sample_rate=44100)
    ...     state, notes = step(state, window, {}, StreamHealth(), 0, FilterState(), None, settings)
    >>> [(note.key, note.since) for note in notes]
    [('silence', 0.0)]
    """
    if state.start < 0 or window.start <= state.start:
        state = HealthState(stream=stream, skipped=skipped)
    now = window.start / window.sample_rate
    from_levels, looked, inputs = state.from_levels, state.looked, state.inputs
    if now - looked >= LEVELS_EVERY - 1e-9 and not window.has_gap:
        told = None if condition is None else condition.inputs
        if told is None:
            inputs = _inputs(inputs, window)
        from_levels, looked = _level_findings(window, inputs.inputs if told is None else told), now
    findings = dict(from_levels) if not stream.away else {}
    if STILL.key not in findings:  # of noise alone a model may say anything
        _add_reasons(findings, estimates)
        if condition is not None and condition.deviation is not None:
            _add_deviation(findings, condition)
    _add_counted(findings, state, stream, skipped)
    onset = followed.onset
    if not math.isnan(onset) and followed.time - onset < window.duration - 1e-9:
        findings[SETTLING.key] = SETTLING
    lasting = state.lasting
    if SOUND_LOST.key in findings and XRUNS.key in lasting:  # it says that nothing was lost
        lasting = {key: each for key, each in lasting.items() if key != XRUNS.key}
    if findings or lasting:
        lasting = _lasting(lasting, findings, now, settings)
    state = HealthState(
        start=window.start,
        lasting=lasting,
        from_levels=from_levels,
        looked=looked,
        inputs=inputs,
        stream=stream,
        skipped=skipped,
    )
    return state, _notes(lasting, settings) if lasting else ()


def shown_notes(notes: Iterable[Note], now: Seconds) -> list[Note]:
    """Return the notes to show to a person at time `now`: no brief infos, worst first, then as given.

    >>> note = Note(key="settling", level="info", sentence="It settles.", remedy="", since=1.0)
    >>> [len(shown_notes([note], now)) for now in (1.1, 1.5)]
    [0, 1]
    """
    shown = [note for note in notes if note.level != "info" or now - note.since >= MIN_INFO_TIME - 1e-9]
    return sorted(shown, key=lambda note: WORST_FIRST.index(note.level))


def warm_up(window: Window) -> None:
    """Load and compile everything that would delay the first window."""
    from monochord.dsp.microphones import compile_looks  # noqa: PLC0415 (loads numba)

    compile_looks()
    _level_findings(window, _inputs(InputState(), window).inputs)


def _lasting(
    before: Mapping[str, LastingFinding],
    findings: Mapping[str, Finding],
    now: Seconds,
    settings: HealthSettings,
) -> Mapping[str, LastingFinding]:
    """Return findings over time after a window that shows some of them."""
    lasting = dict[str, LastingFinding]()
    for key, each in before.items():
        clear = settings.clear if each.finding.clear is None else each.finding.clear
        if key in findings:
            lasting[key] = LastingFinding(finding=findings[key], first=each.first, last=now)
        elif now - each.last <= clear and clear > 0.0:
            lasting[key] = each
    for key, finding in findings.items():
        if key not in lasting:
            lasting[key] = LastingFinding(finding=finding, first=now, last=now)
    return lasting


def _notes(lasting: Mapping[str, LastingFinding], settings: HealthSettings) -> tuple[Note, ...]:
    notes = [
        Note(
            key=key,
            level=each.finding.level,
            sentence=each.finding.sentence,
            remedy=each.finding.remedy,
            since=each.first,
        )
        for key, each in lasting.items()
        if each.last - each.first >= _appear(each.finding, settings) - 1e-9
    ]
    return tuple(sorted(notes, key=lambda note: note.since))


def _appear(finding: Finding, settings: HealthSettings) -> Seconds:
    return settings.appear if finding.appear is None else finding.appear


def _add_reasons(findings: dict[str, Finding], estimates: Estimates) -> None:
    """Add the reason where all estimates of a window except contact abstain for one reason."""
    text = ""
    for name, each in estimates.items():
        if name == CONTACT and each.valid:
            continue
        if each.valid or (text and each.reason != text):
            return
        text = each.reason
    reason = Reason.of(text)
    finding = reason.finding
    if finding is None or (reason is Reason.SILENCE and NO_MICROPHONE.key in findings):
        return
    if finding is ABSTAINING:
        finding = finding.with_detail(text.partition(": ")[0])
    findings[finding.key] = finding


def _add_deviation(findings: dict[str, Finding], condition: Condition) -> None:
    """Add a finding where the string's tuning deviates from its nominal pitch."""
    off, measured = condition.deviation or 0.0, condition.open_frequency
    error = measured.std / measured.value if measured.valid else 0.0
    if abs(off) < MIN_DEVIATION + 2.0 * error:
        return
    side = "above" if off > 0.0 else "below"
    finding = FOLLOWED if condition.follows else NOT_FOLLOWED
    finding = finding.with_detail(100.0 * abs(off), 1200.0 * abs(math.log2(1.0 + off)), side)
    mistaken = mistaken_rates(1.0 + off)
    if mistaken:
        rate = "If it is not, sound of {} Hz is stated as {} Hz.".format(*mistaken)
        finding = replace(finding, remedy=f"{finding.remedy} {rate}")
    if not condition.follows:
        findings.pop(ABSTAINING.key, None)
    findings[finding.key] = finding


def _add_counted(
    findings: dict[str, Finding], state: HealthState, stream: StreamHealth, skipped: int
) -> None:
    """Add findings from the counters' changes since the previous window."""
    before = state.stream
    if stream.away:
        findings[NO_SOUND.key] = NO_SOUND.with_detail(stream.away)
    elif stream.dropped > before.dropped or stream.gaps > before.gaps:
        findings[SOUND_LOST.key] = SOUND_LOST.with_detail(
            _counted(stream.dropped, "frame"), _counted(stream.gaps, "gap"), _counted(stream.xruns, "xrun")
        )
    elif stream.xruns > before.xruns and SOUND_LOST.key not in state.lasting:
        # The loss that belongs to an xrun may be counted a window later or before.
        findings[XRUNS.key] = XRUNS.with_detail(_counted(stream.xruns, "xrun"))
    if stream.reconnects > before.reconnects:
        findings[RECONNECTED.key] = RECONNECTED.with_detail(_counted(stream.reconnects, "time"))
    set_by = stream.clock_offsets.get("realtime", 0.0) - before.clock_offsets.get("realtime", 0.0)
    if before.clock_offsets and abs(set_by) > MIN_CLOCK_STEP:
        findings[CLOCK_SET.key] = CLOCK_SET.with_detail(set_by)
    if skipped > state.skipped:
        findings[WINDOWS_SKIPPED.key] = WINDOWS_SKIPPED.with_detail(skipped)


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _inputs(state: InputState, window: Window) -> InputState:
    """Return what two channels carry after a window."""
    from monochord.dsp.microphones import compare_inputs  # noqa: PLC0415 (loads numba)

    if len(window.samples) != 2:
        return state
    return state.after(compare_inputs(window.samples, window.sample_rate))


def _level_findings(window: Window, inputs: Inputs) -> Mapping[str, Finding]:
    """Return the findings from a window's levels, and from what two channels carry."""
    from monochord.dsp.levels import measure_levels, tone_prominence  # noqa: PLC0415 (compiled, and a sink imports this module)

    measured = measure_levels(window.samples, window.sample_rate)
    level, loud, hum = measured.T
    if not np.isfinite(level).all():
        return _by_key(Reason.NOT_NUMBERS.finding)
    if level.max() < SILENT_LEVEL:
        return _by_key(NO_MICROPHONE)
    clips = bool((loud >= LOUD_SHARE).any())
    hums = bool((hum > HUM_SHARE).any())
    is_quiet = level.max() < RINGING_LEVEL
    is_still = is_quiet and tone_prominence(window.samples, window.sample_rate) < PROMINENCE
    return _by_key(
        inputs.reason.finding,
        CLIPPING if clips else None,
        Reason.HUM.finding if hums else None,
        STILL if is_still else None,
    )


def _by_key(*findings: Finding | None) -> Mapping[str, Finding]:
    return {each.key: each for each in findings if each is not None} or NO_FINDINGS
