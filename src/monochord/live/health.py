"""The sensor's health at run time, in sentences with remedies.

A fold over the windows of a stream: each window yields findings, and a lasting finding becomes a note.
Findings come from the reasons for which a model abstains, the tuning that an estimator follows, the stream's
counters, and from levels and hum measured here, so that a dead microphone is reported with any estimator.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np

from monochord.core.clock import MIN_CLOCK_STEP, mistaken_rates
from monochord.core.inputs import Inputs, InputState
from monochord.core.ranges import Checked, NonNegative
from monochord.core.silence import SILENT_LEVEL
from monochord.core.types import OUTSIDE_RANGE, UNHEARD, Estimates, StreamHealth, Window
from monochord.core.units import Seconds
from monochord.live.filter import CONTACT, FilterState
from monochord.perception.estimators.base import Condition

Level: TypeAlias = Literal["info", "warning", "error"]
CLIPPED_PEAK, CLIPPED_SHARE = 0.98, 2.0e-3
"""Peak in full scale, and share of samples at the peak, from which a channel counts as clipped."""
RINGING_LEVEL, PROMINENCE = 5.6e-3, 40.0
"""Root mean square (-45 dB) and prominence of the strongest tone below which a string does not ring.

In 12 simulated builds in each world with the drivers off, tones are at most 15 dB above the noise. A ringing
string's tones are at least 22 dB above it when touched, by any material, and 58 dB when not.
"""
HUM_SHARE = 0.5
"""Share of the power in mains frequency and its first harmonics above which a window is mostly hum."""
MIN_DEVIATION = 0.005
"""Smallest relative pitch deviation worth a note: 9 cents."""
REPORT_TIME: Seconds = 10.0
"""How long lost frames and skipped windows stay reported after the last one, in s."""


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

    A note appears once its finding has lasted for `appear`, and is cleared after `clear` without it. Levels
    are checked at most once every `look`.
    """

    appear: NonNegative[Seconds] = 0.5
    clear: NonNegative[Seconds] = 1.0
    look: NonNegative[Seconds] = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A problem seen in a window; `appear` and `clear`, in s, override the settings unless None."""

    level: Level
    sentence: str
    remedy: str
    appear: Seconds | None = None
    clear: Seconds | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Lasting:
    """A finding over time: when it was first and last seen."""

    finding: Finding
    first: Seconds
    last: Seconds


NO_LASTING: Mapping[str, Lasting] = MappingProxyType({})
NO_FINDINGS: Mapping[str, Finding] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthState:
    """The health state of one stream, passed in and out; it starts as ``HealthState()``.

    `looked` is when levels were last measured, `from_levels` the findings from that, and `inputs` what two
    channels carry. `stream` and
    `skipped` are the counters after the previous window. `start` is the first frame of the last window.
    """

    start: int = -1
    lasting: Mapping[str, Lasting] = field(default_factory=lambda: NO_LASTING)
    from_levels: Mapping[str, Finding] = field(default_factory=lambda: NO_FINDINGS)
    looked: Seconds = -math.inf
    stream: StreamHealth = field(default_factory=StreamHealth)
    skipped: int = 0
    inputs: InputState = field(default_factory=InputState)


def _finding(level: Level, sentence: str, remedy: str) -> Finding:
    return Finding(level=level, sentence=sentence, remedy=remedy)


SILENT = _finding(
    "error",
    "Neither microphone picks up sound.",
    "Check that the microphones are connected and powered, and that the right inputs are chosen.",
)
STILL = _finding(
    "error",
    "The string does not ring: nothing drives it, or it is broken.",
    "Check that it is intact and nothing soft damps it; check the drivers' switches, batteries and height.",
)
ONE_DRIVER = _finding(
    "error", "One driver seems silent.", "Check the battery, the switch and the height of each driver."
)
CLIPPING = _finding(
    "warning",
    "The sound is clipped.",
    "Turn down the preamplifier gain until no peak reaches 0 dB.",
)
HUMMING = _finding(
    "error",
    "Hum of the mains is louder than the string.",
    "Check the ground and the shield of the cables, and keep them away from power supplies.",
)
SWAPPED = _finding(
    "error",
    "The microphones seem swapped, or one driver is silent.",
    "Check that both drivers run; if so, swap the inputs: positions count from microphone 1.",
)
DEAD = tuple(
    _finding(
        "error",
        f"Microphone {number} picks up no sound.",
        f"Check the cable, the battery and the gain of microphone {number}.",
    )
    for number in (1, 2)
)
ONE_MICROPHONE = _finding(
    "error",
    "Both channels carry the same sound: there is one microphone.",
    "Choose the inputs of both microphones, and turn off mono in the mixer or the recorder.",
)
UNLIKE_INPUTS = _finding(
    "error",
    "The channels share no sound: they are of two clocks, rates or recordings.",
    "Record both microphones with one interface, as two channels of one stream.",
)
TWO_TOUCHES = _finding(
    "warning", "Two things seem to touch the string.", "Touch it with one object at a time."
)
OUTSIDE = _finding(
    "info",
    "The touch is outside the sensing range: only contact is estimated.",
    "Touch the string inside the range. If the touch is already inside, check that both drivers run.",
)
NO_UNTOUCHED = _finding(
    "warning",
    "The untouched string was not heard yet, so no touch is estimated.",
    "Leave the string untouched for a second. If it is untouched, it is out of tune: run monochord tune.",
)
TWO_STRINGS = _finding(
    "error",
    "Two strings sound at once.",
    "Use separate inputs for each sensor; keep another string's sound away from these microphones.",
)
SOFT_TOUCH = _finding(
    "warning", "Something very soft seems to touch the string.", "Touch it with something harder than foam."
)
OUT_OF_TUNE = _finding(
    "error",
    "The string seems out of tune.",
    "Leave it untouched for a second, so that its pitch is measured, or run monochord tune.",
)
NOT_NUMBERS = _finding(
    "error", "The samples are not numbers.", "Check the audio driver, and what else writes to these inputs."
)
SETTLING = Finding(
    level="info",
    sentence="The sound of a new touch is still settling.",
    remedy="Wait for a tenth of a second.",
    appear=0.0,
    clear=0.0,
)
REASONS: Mapping[str, tuple[str, Finding]] = MappingProxyType(
    {
        Inputs.SECOND.reason: ("microphone_1_dead", DEAD[0]),
        Inputs.FIRST.reason: ("microphone_2_dead", DEAD[1]),
        Inputs.SAME.reason: ("one_microphone", ONE_MICROPHONE),
        Inputs.APART.reason: ("unlike_inputs", UNLIKE_INPUTS),
        "the microphones seem swapped": ("microphones_swapped", SWAPPED),
        "mostly clipped": ("clipping", CLIPPING),
        "clipped": ("clipping", CLIPPING),
        "hum louder than the string": ("hum", HUMMING),
        "two things seem to touch": ("two_touches", TWO_TOUCHES),
        OUTSIDE_RANGE: ("outside_range", OUTSIDE),
        UNHEARD: ("untouched_missing", NO_UNTOUCHED),
        "two strings sound at once": ("two_strings", TWO_STRINGS),
        "something very soft seems to touch": ("soft_touch", SOFT_TOUCH),
        "one driver seems silent": ("driver_silent", ONE_DRIVER),
        "the string seems out of tune: run monochord tune": ("out_of_tune", OUT_OF_TUNE),
        "silence": ("string_still", STILL),
        "samples that are not numbers": ("not_numbers", NOT_NUMBERS),
    }
)
"""Key and finding for each abstention reason of the closed form and the bundled models."""
EXPLAINED = ("", "no contact", "gap", "too uncertain", "not estimated")
"""Abstention reasons that are not sensor problems, or that counters report."""


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

    Parameters
    ----------
    state
        The state before the window. A window that does not begin after the previous one starts a new stream.
    window, estimates
        The window and its estimates.
    stream, skipped
        The stream's counters, and the number of windows skipped so far because the reader was late.
    followed
        The filter's state after the window.
    condition
        The estimator's knowledge of the string, None where it has none.
    settings
        When findings become notes.

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
    if now - looked >= settings.look - 1e-9 and not window.has_gap:
        inputs = _inputs(inputs, window)
        from_levels, looked = _level_findings(window, inputs.inputs), now
    findings = dict(from_levels) if not stream.away else {}
    if "string_still" not in findings:  # of noise alone a model may say anything
        _add_reasons(findings, estimates)
        if condition is not None and condition.deviation is not None:
            _add_deviation(findings, condition)
    _add_counted(findings, state, stream, skipped)
    onset = followed.onset
    if not math.isnan(onset) and followed.time - onset < window.duration - 1e-9:
        findings["settling"] = SETTLING
    lasting = state.lasting
    if "sound_lost" in findings and "xruns" in lasting:  # it says that nothing was lost
        lasting = {key: each for key, each in lasting.items() if key != "xruns"}
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


def warm_up(window: Window) -> None:
    """Load and compile everything that would delay the first window."""
    _level_findings(window, _inputs(InputState(), window).inputs)


def _lasting(
    before: Mapping[str, Lasting], findings: Mapping[str, Finding], now: Seconds, settings: HealthSettings
) -> Mapping[str, Lasting]:
    """Return findings over time after a window that shows some of them."""
    lasting = dict[str, Lasting]()
    for key, each in before.items():
        clear = settings.clear if each.finding.clear is None else each.finding.clear
        if key in findings:
            lasting[key] = Lasting(finding=findings[key], first=each.first, last=now)
        elif now - each.last <= clear and clear > 0.0:
            lasting[key] = each
    for key, finding in findings.items():
        if key not in lasting:
            lasting[key] = Lasting(finding=finding, first=now, last=now)
    return lasting


def _notes(lasting: Mapping[str, Lasting], settings: HealthSettings) -> tuple[Note, ...]:
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
    reason = ""
    for name, each in estimates.items():
        if name == CONTACT and each.valid:
            continue
        if each.valid or (reason and each.reason != reason):
            return
        reason = each.reason
    if reason in EXPLAINED or (reason == "silence" and "silence" in findings):
        return
    key, finding = REASONS.get(reason, ("abstaining", None))
    if finding is None:
        text = f"No estimates: {reason.partition(': ')[0]}."
        finding = Finding(
            level="error", sentence=text, remedy="Fix the stated cause, or run monochord doctor.", clear=0.2
        )
    findings[key] = finding


def _add_deviation(findings: dict[str, Finding], condition: Condition) -> None:
    """Add a finding where the string's tuning deviates from its nominal pitch."""
    off = condition.deviation or 0.0
    if abs(off) < MIN_DEVIATION:
        return
    side = "above" if off > 0.0 else "below"
    text = (
        f"The string sounds {100.0 * abs(off):.1f} % ({1200.0 * abs(math.log2(1.0 + off)):.0f} cents) {side}"
    )
    mistaken = mistaken_rates(1.0 + off)
    rate = "If it is not, sound of {} Hz is stated as {} Hz.".format(*mistaken) if mistaken else ""
    if condition.follows:
        sentence = f"{text} its known pitch; estimates follow it."
        remedy = f"To keep it, run monochord tune. {rate}".rstrip()
        findings["detuned"] = _finding("info", sentence, remedy)
    else:
        findings.pop("abstaining", None)
        sentence = f"{text} what can be estimated from."
        remedy = f"Tune it, then run monochord tune. {rate}".rstrip()
        findings["detuned"] = _finding("error", sentence, remedy)


def _add_counted(
    findings: dict[str, Finding], state: HealthState, stream: StreamHealth, skipped: int
) -> None:
    """Add findings from the counters' changes since the previous window."""
    before = state.stream
    if stream.away:
        findings["no_sound"] = Finding(
            level="error",
            sentence=f"No sound comes: {stream.away}.",
            remedy="Check its cable and its power, or start it again; it is taken up once it is back.",
            appear=0.0,
            clear=0.0,
        )
    elif stream.dropped > before.dropped or stream.gaps > before.gaps:
        lost = f"{_counted(stream.dropped, 'frame')} in {_counted(stream.gaps, 'gap')}"
        findings["sound_lost"] = _reported(
            f"Sound was lost: {lost}, {_counted(stream.xruns, 'xrun')} so far.",
            "Close other programs, or use longer periods; run monochord doctor.",
        )
    elif stream.xruns > before.xruns and "sound_lost" not in state.lasting:
        # The loss that belongs to an xrun may be counted a window later or before.
        late = f"The audio system was late, {_counted(stream.xruns, 'xrun')} so far"
        findings["xruns"] = _reported(
            f"{late}; no frame is counted as lost at the last one.",
            "If they continue, close other programs, or use longer periods; run monochord doctor.",
            level="info",
        )
    if stream.reconnects > before.reconnects:
        times = _counted(stream.reconnects, "time")
        findings["reconnected"] = _reported(
            f"The audio device went away and came back, {times} so far.", "Check its cable and its power."
        )
    set_by = stream.clock_offsets.get("realtime", 0.0) - before.clock_offsets.get("realtime", 0.0)
    if before.clock_offsets and abs(set_by) > MIN_CLOCK_STEP:
        findings["clock_set"] = _reported(
            f"The clock of this computer was set by {set_by:+.3f} s.",
            "Stamps jump by that; let one service keep the clock. The stream's times are not affected.",
        )
    if skipped > state.skipped:
        findings["windows_skipped"] = _reported(
            f"Windows are skipped because the computer is late: {skipped} so far.",
            "Close other programs, or use a longer hop.",
        )


def _reported(sentence: str, remedy: str, level: Level = "warning") -> Finding:
    """Return a finding that is reported at once, and for `REPORT_TIME` after the last occurrence."""
    return Finding(level=level, sentence=sentence, remedy=remedy, appear=0.0, clear=REPORT_TIME)


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
    level, peak, extreme, hum = measured.T
    if not np.isfinite(level).all():
        return {"not_numbers": NOT_NUMBERS}
    if level.max() < SILENT_LEVEL:
        return {"silence": SILENT}
    findings = dict[str, Finding]()
    if inputs.reason:
        key, finding = REASONS[inputs.reason]
        findings[key] = finding
    if ((peak >= CLIPPED_PEAK) & (extreme >= CLIPPED_SHARE)).any():
        findings["clipping"] = CLIPPING
    if (hum > HUM_SHARE).any():
        findings["hum"] = HUMMING
    if level.max() < RINGING_LEVEL and tone_prominence(window.samples, window.sample_rate) < PROMINENCE:
        findings["string_still"] = STILL
    return findings or NO_FINDINGS
