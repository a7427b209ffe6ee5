"""Every reason in one table: why there is no estimate, why a check failed, why a recording ended.

People read a reason's sentence. Code asks for the member, as ``Reason.of(estimate.reason) is Reason.SILENCE``
does, so that a sentence can be reworded without losing its note or its remedy. A reason is text: it prints,
compares and serialises as its sentence, and files and messages hold the sentence.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Literal, Self, TypeAlias

from monochord.core.units import Seconds

Level: TypeAlias = Literal["info", "warning", "error"]
REPORT_TIME: Seconds = 10.0
"""How long lost frames and skipped windows stay reported after the last one, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What a window shows to be wrong with a sensor; one that lasts becomes a note on the sensor's health.

    `key` is stable, for programs. Braces in `sentence` stand for its detail. `appear` and `clear`, in s,
    override when it becomes a note and how long it stays one; None for the settings.

    >>> Finding(key="hum", level="error", sentence="{} Hz is loud.", remedy="").with_detail(50).sentence
    '50 Hz is loud.'
    """

    key: str
    level: Level
    sentence: str
    remedy: str
    appear: Seconds | None = None
    clear: Seconds | None = None

    def with_detail(self, *detail: object) -> "Finding":
        """Return the finding with its detail in the sentence."""
        return replace(self, sentence=self.sentence.format(*detail))


def _seen(key: str, level: Level, sentence: str, remedy: str) -> Finding:
    """Return a finding that becomes a note once it has lasted."""
    return Finding(key=key, level=level, sentence=sentence, remedy=remedy)


def _counted(key: str, level: Level, sentence: str, remedy: str) -> Finding:
    """Return a finding that is reported at once, and for `REPORT_TIME` after the last occurrence."""
    return Finding(key=key, level=level, sentence=sentence, remedy=remedy, appear=0.0, clear=REPORT_TIME)


ABSTAINING = Finding(
    key="abstaining",
    level="error",
    sentence="No estimates: {}.",
    remedy="Fix the stated cause, or run monochord doctor.",
    clear=0.2,
)
"""Finding of a reason without one of its own."""
SETTLING = Finding(
    key="settling",
    level="info",
    sentence="The sound of a new touch is still settling.",
    remedy="Wait for a tenth of a second.",
    appear=0.0,
    clear=0.0,
)
CLIPPING = _seen(
    "clipping",
    "warning",
    "The sound is clipped.",
    "Turn down the preamplifier gain until no peak reaches 0 dB.",
)
NO_MICROPHONE = _seen(
    "silence",
    "error",
    "Neither microphone picks up sound.",
    "Check that the microphones are connected and powered, and that the right inputs are chosen.",
)
STILL = _seen(
    "string_still",
    "error",
    "The string does not ring: nothing drives it, or it is broken.",
    "Check that it is intact and nothing soft damps it; check the drivers' switches, batteries and height.",
)
FOLLOWED = _seen(
    "detuned",
    "info",
    "The string sounds {:.1f} % ({:.0f} cents) {} its known pitch; estimates follow it.",
    "To keep it, run monochord tune.",
)
NOT_FOLLOWED = _seen(
    "detuned",
    "error",
    "The string sounds {:.1f} % ({:.0f} cents) {} what can be estimated from.",
    "Tune it, then run monochord tune.",
)
NO_SOUND = Finding(
    key="no_sound",
    level="error",
    sentence="No sound comes: {}.",
    remedy="Check its cable and its power, or start it again; it is taken up once it is back.",
    appear=0.0,
    clear=0.0,
)
SOUND_LOST = _counted(
    "sound_lost",
    "warning",
    "Sound was lost: {} in {}, {} so far.",
    "Close other programs, or use longer periods; run monochord doctor.",
)
XRUNS = _counted(
    "xruns",
    "info",
    "The audio system was late, {} so far; no frame is counted as lost at the last one.",
    "If they continue, close other programs, or use longer periods; run monochord doctor.",
)
RECONNECTED = _counted(
    "reconnected",
    "warning",
    "The audio device went away and came back, {} so far.",
    "Check its cable and its power.",
)
CLOCK_SET = _counted(
    "clock_set",
    "warning",
    "The clock of this computer was set by {:+.3f} s.",
    "Stamps jump by that; let one service keep the clock. The stream's times are not affected.",
)
WINDOWS_SKIPPED = _counted(
    "windows_skipped",
    "warning",
    "Windows are skipped because the computer is late: {} so far.",
    "Close other programs, or use a longer hop.",
)

DRIVE = (
    "check that a driver runs, that the gain is up, and that it is the right input (monochord list devices)"
)
"""Remedy for a silent input, or a string that nothing drives."""
RING = "let go of it, or touch and release it during the recording, so that its partials ring"
"""Remedy where the string sounds but its pitch cannot be found."""


@dataclass(frozen=True, slots=True)
class _Row:
    """A row of the table; see `Reason`."""

    sentence: str
    finding: Finding | None = ABSTAINING
    remedy: str = ""
    brief: bool = field(default=False, kw_only=True)


def _untuned(sentence: str, remedy: str = RING) -> _Row:
    """Return the row of a reason why a tuning cannot be measured."""
    return _Row(sentence, remedy=remedy)


def _dead(number: int) -> Finding:
    return _seen(
        f"microphone_{number}_dead",
        "error",
        f"Microphone {number} picks up no sound.",
        f"Check the cable, the battery and the gain of microphone {number}.",
    )


class Reason(StrEnum):
    """Why something cannot be stated. A member is its sentence, and has more beside it.

    Attributes
    ----------
    finding
        What all estimates of a window withheld for this reason say about the sensor; None where that is no
        trouble, or where a counter reports it.
    remedy
        What to do, as an error says it; empty where the sentence says enough.
    brief
        Whether it ends with the touch, and implies a touch.

    Examples
    --------
    >>> Reason.SILENCE == "silence", Reason.SILENCE.key, Reason.SILENCE.finding.key
    (True, 'silence', 'string_still')
    >>> reason = Reason.DETUNED.with_detail(4.12, "below", "its known pitch")
    >>> reason
    'the string sounds 4.1 % below its known pitch: run monochord tune'
    >>> Reason.of(reason) is Reason.DETUNED, Reason.of("a moth on the string").key
    (True, 'other')
    """

    finding: Finding | None
    remedy: str
    brief: bool

    def __new__(cls, row: _Row | str) -> Self:  # noqa: D102  (a member is made of its row)
        row = row if isinstance(row, _Row) else _Row(row)
        self = str.__new__(cls, row.sentence)
        self._value_ = row.sentence
        self.finding, self.remedy, self.brief = row.finding, row.remedy, row.brief
        return self

    def __repr__(self) -> str:
        return str.__repr__(self)

    NONE = _Row("", None)
    OTHER = "for a reason of its own"

    # What a window sounds like.
    GAP = _Row("gap", None, RING)
    NOT_NUMBERS = _Row(
        "samples that are not numbers",
        _seen(
            "not_numbers",
            "error",
            "The samples are not numbers.",
            "Check the audio driver, and what else writes to these inputs.",
        ),
        "check the audio driver, and what else writes to these inputs",
    )
    SILENCE = _Row(
        "silence",
        STILL,
        DRIVE,
    )
    CLIPPED = _Row("clipped", CLIPPING, RING)

    # What two channels carry.
    ONE_MICROPHONE = _Row(
        "both channels carry the same sound: there is one microphone",
        _seen(
            "one_microphone",
            "error",
            "Both channels carry the same sound: there is one microphone.",
            "Choose the inputs of both microphones, and turn off mono in the mixer or the recorder.",
        ),
    )
    MICROPHONE_1_SILENT = _Row("microphone 1 is silent", _dead(1))
    MICROPHONE_2_SILENT = _Row("microphone 2 is silent", _dead(2))
    UNLIKE_INPUTS = _Row(
        "the microphones share no sound",
        _seen(
            "unlike_inputs",
            "error",
            "The channels share no sound: they are of two clocks, rates or recordings.",
            "Record both microphones with one interface, as two channels of one stream.",
        ),
    )

    # Faults and unusual touches that the reader detects.
    MICROPHONES_SWAPPED = _Row(
        "the microphones seem swapped",
        _seen(
            "microphones_swapped",
            "error",
            "The microphones seem swapped, or one driver is silent.",
            "Check that both drivers run; if so, swap the inputs: positions count from microphone 1.",
        ),
    )
    MOSTLY_CLIPPED = _Row("mostly clipped", CLIPPING)
    HUM = _Row(
        "hum louder than the string",
        _seen(
            "hum",
            "error",
            "Hum of the mains is louder than the string.",
            "Check the ground and the shield of the cables, and keep them away from power supplies.",
        ),
    )
    TWO_STRINGS = _Row(
        "two strings sound at once",
        _seen(
            "two_strings",
            "error",
            "Two strings sound at once.",
            "Use separate inputs for each sensor; keep another string's sound away from these microphones.",
        ),
    )
    TWO_TOUCHES = _Row(
        "two things seem to touch",
        _seen(
            "two_touches",
            "warning",
            "Two things seem to touch the string.",
            "Touch it with one object at a time.",
        ),
        brief=True,
    )
    DRIVER_SILENT = _Row(
        "one driver seems silent",
        _seen(
            "driver_silent",
            "error",
            "One driver seems silent.",
            "Check the battery, the switch and the height of each driver.",
        ),
    )
    SOFT_TOUCH = _Row(
        "something very soft seems to touch",
        _seen(
            "soft_touch",
            "warning",
            "Something very soft seems to touch the string.",
            "Touch it with something harder than foam.",
        ),
        brief=True,
    )
    OUT_OF_TUNE = _Row(
        "the string seems out of tune: run monochord tune",
        _seen(
            "out_of_tune",
            "error",
            "The string seems out of tune.",
            "Leave it untouched for a second, so that its pitch is measured, or run monochord tune.",
        ),
    )

    # What an estimator withholds.
    NO_CONTACT = _Row("no contact", None)
    UNCERTAIN = _Row("too uncertain", None)
    TWO_CANDIDATES = "two candidates"
    OUTSIDE_RANGE = _Row(
        "outside the sensing range",
        _seen(
            "outside_range",
            "info",
            "The touch is outside the sensing range: only contact is estimated.",
            "Touch the string inside the range. If the touch is already inside, check that both drivers run.",
        ),
    )
    UNTOUCHED_MISSING = _Row(
        "the untouched string was not heard yet",
        _seen(
            "untouched_missing",
            "warning",
            "The untouched string was not heard yet, so no touch is estimated.",
            "Leave the string untouched for a second. If it is untouched, it is out of tune: run monochord "
            "tune.",
        ),
    )
    DETUNED = "the string sounds {:.1f} % {} {}: run monochord tune"
    NOT_ESTIMATED = _Row("not estimated", None)
    NOT_GIVEN = "no reason given"
    NOT_MEASURED = "not measured yet"

    # What the filter over time withholds.
    LOST = "lost"
    NOT_A_NUMBER = "not a number"
    NOT_TRACKED = "not tracked"
    UNDECIDED = "undecided"

    # Closed form and stopped strings.
    NO_STRUCTURE = "no harmonic structure"
    NOTE_OR_SEGMENTS = "two candidates: one note at both channels, or two segments"
    TWO_NOTES = "two candidates, {:.1f} and {:.1f} Hz"
    OTHER_NOTE = "a note of {:.1f} Hz, outside {:.1f} to {:.1f} Hz"
    VOICE = "the pitch moves as a voice's does"
    ONE_SEGMENT = "one segment alone does not tell force"
    CONSTANT_TENSION = "the string's tension does not tell force"
    UNKNOWN_DENSITY = "the string's density is not known"
    NOT_STOPPED = "the string is not stopped"

    # An untouched string whose tuning cannot be measured.
    NO_WINDOW = _untuned("no sound")
    NO_LINE = _untuned("no line stands out: nothing drives the string", DRIVE)
    NO_LASTING_LINE = _untuned("no line lasts: nothing drives the string", DRIVE)
    TOUCHED = _untuned("touched: a line at {} at one microphone only")
    FEW_WINDOWS = _untuned("fewer than {} windows of untouched sound")
    NO_PARTIAL = _untuned(
        "the strongest line, {:.1f} Hz, is not a partial of a string within {:.0f} % of {:.1f} Hz"
    )
    HUM_ALONE = _untuned("hum alone")
    UNLIKE_PARTIALS = _untuned(
        "too many lines do not fit the partials of one string within {:.0f} % of {:.1f} Hz"
    )
    TWO_READINGS = _untuned("two readings, {:.1f} and {:.1f} Hz")
    MULTIPLE_PITCH = _untuned("only partials {}, as of another string at {} times the pitch")
    ONE_SIDED_PARTIAL = _untuned(
        "partial {} at one microphone only: it may come from a touched string's segment"
    )
    ONE_TONE = _untuned("one line at {:.1f} Hz{}, no other partial: it may be a tone")
    TONES = _untuned("only partials {}, {}no partial that rings freely: they may be tones")
    NO_DECAY = "no free partial dies away"
    NO_FREE_PARTIAL = "no freely ringing partial"
    SOUND_ALONE = (
        "sound and ruler determine it to {:.0%} only: magnets and yielding ends bend the low partials"
    )

    # Why a recording ended.
    REQUESTED = "stopped by request"
    SOURCE_FAILED = "the source failed"
    SOURCE_ENDED = "the source ended"
    TIME_OVER = "the time is over"
    DISK_FULL = "the disk is full"
    FILE_FULL = "the file is as large as files may be"

    # Diagnoses of a bring-up.
    LOW = "microphone {} low"
    TOO_LOUD = "microphone {} clipped"
    MICROPHONE_DEAD = _Row(
        "microphone {} dead", remedy="check its plug, cable, phantom power or battery, and gain"
    )
    INPUT_COPIED = _Row(
        "one microphone", remedy="choose both inputs, and turn off mono in the mixer or the interface"
    )
    INPUTS_UNLIKE = _Row("unlike inputs", remedy="record both as two channels of one interface, at one rate")
    INPUTS_SWAPPED = "microphones swapped"
    UNCLEAR_TAP = "unclear tap"
    CROSSTALK = "crosstalk"
    LOST_FRAMES = "lost frames"
    WRONG_RATE = "wrong rate"
    HUMMING = "hum"
    NOISE = "noise"
    DRIVER_DEAD = "{} dead"
    DRIVER_WEAK = "{} weak"
    FEED_THROUGH = "feed-through into microphone {}"
    NO_STRING = "no string"
    WRONG_PITCH = "wrong pitch"
    OTHER_STRING = "other string"
    LOOSE_END = "loose end"
    DRIFT = "drift"

    @property
    def key(self) -> str:
        """The stable name of the reason, for programs."""
        return self.name.lower()

    def with_detail(self, *detail: object) -> "DetailedReason":
        """Return the reason with its detail, such as numbers, in the braces of the sentence."""
        return DetailedReason(self, *detail)

    @classmethod
    def of(cls, text: str) -> "Reason":
        """Return the reason that a text states, with or without a detail; `OTHER` for one of another package.

        A text read back from a file has lost its detail, and is `OTHER` where its reason has one.
        """
        return text.reason if isinstance(text, DetailedReason) else _OF_SENTENCE.get(text, cls.OTHER)


_OF_SENTENCE: dict[str, Reason] = {each.value: each for each in Reason}


class DetailedReason(str):
    """The sentence of a reason with its detail: text for people, `reason` and `detail` for code."""

    __slots__ = ("detail", "reason")
    reason: Reason
    detail: tuple[object, ...]

    def __new__(cls, reason: Reason, *detail: object) -> Self:  # noqa: D102
        self = super().__new__(cls, reason.format(*detail))
        self.reason, self.detail = reason, detail
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.reason, *self.detail)
