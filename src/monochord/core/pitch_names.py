"""Names of pitches: notes with their octave in equal temperament, A4 = 440 Hz, and the deviation in cents."""

import math
import re
from unicodedata import normalize

from monochord.core.errors import InputError
from monochord.core.units import Hertz

A4: Hertz = 440.0
NAMES = ("C", "C#", "D", "D#", "E", "F", "F#", "G", "G#", "A", "A#", "B")
EXPECTED = "a note with its octave, such as E4, F#3, Bb2 or E4+12 (cents), or a number of Hz above 0"
_NOTE = re.compile(r"([A-G])([#♯b♭]{0,2})(-?\d)(?:([+-]\d+(?:\.\d+)?)(?:cents?|ct|c)?)?", re.IGNORECASE)
_HERTZ = re.compile(r"(.+?)(?:hz)?", re.IGNORECASE)
_MIDI_OF_A4 = 69


def pitch(value: str | float) -> Hertz:
    """Return the frequency in Hz of a note's name, or of a number of Hz.

    A name has a letter, sharps (``#``) or flats (``b``), the octave of scientific pitch notation (middle C is
    C4), and where needed the deviation in cents: ``"E4"``, ``"F#3"``, ``"B♭2"``, ``"E4+12"``. A number may be
    text. Raises `InputError` for anything else, and unless the frequency is finite and above zero.

    >>> [round(pitch(each), 2) for each in ("E2", "B♭3", "A4-50", "110 Hz", 98)]
    [82.41, 233.08, 427.47, 110.0, 98.0]
    >>> pitch("E")
    Traceback (most recent call last):
    monochord.core.errors.InputError: pitch 'E': expected a note ...; did you mean E2, E3 or E4?
    """
    text = "".join(normalize("NFKC", str(value)).replace("\N{MINUS SIGN}", "-").split())
    if note := _NOTE.fullmatch(text):
        letter, signs, octave, deviation = note.groups()
        shift = sum(1 if each in "#♯" else -1 for each in signs)
        semitone = NAMES.index(letter.upper()) + shift + 12 * (int(octave) + 1) - _MIDI_OF_A4
        return A4 * 2.0 ** ((semitone + float(deviation or 0.0) / 100.0) / 12.0)
    number = _HERTZ.fullmatch(text)
    try:
        frequency = float(number[1]) if number else math.nan
    except ValueError:
        frequency = math.nan
    if not 0.0 < frequency < math.inf:
        remedy = f"did you mean {text}2, {text}3 or {text}4?" if _NOTE.fullmatch(f"{text}4") else ""
        raise InputError(f"pitch '{value}'", EXPECTED, remedy)
    return frequency


def pitch_name(frequency: Hertz, *, cents: bool = True) -> str:
    """Return the nearest note with its octave and, with `cents`, the deviation, as `pitch` reads it.

    >>> pitch_name(442.0), pitch_name(82.0), pitch_name(82.0, cents=False)
    ('A4+8', 'E2-9', 'E2')
    """
    semitone = 12.0 * math.log2(frequency / A4) + _MIDI_OF_A4
    nearest = round(semitone)
    name = f"{NAMES[nearest % 12]}{nearest // 12 - 1}"
    return f"{name}{round(100.0 * (semitone - nearest)):+d}" if cents else name
