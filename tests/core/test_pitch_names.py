"""Names of notes are read in all the ways in which they are written, and written as they are read."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.pitch_names import pitch, pitch_name


@pytest.mark.parametrize(
    ("text", "frequency"),
    [
        ("E4", 329.6276),
        ("e4", 329.6276),
        ("E2", 82.4069),
        ("F#3", 184.9972),
        ("F♯3", 184.9972),
        ("Gb3", 184.9972),
        ("G♭3", 184.9972),
        ("b2", 123.4708),
        ("bb2", 116.5409),
        ("Cb4", 246.9417),
        ("B#3", 261.6256),
        ("C-1", 8.1758),
        ("E4+12", 329.6276 * 2 ** (12 / 1200)),
        ("E4 -7.5", 329.6276 * 2 ** (-7.5 / 1200)),
        ("E4\N{MINUS SIGN}7", 329.6276 * 2 ** (-7 / 1200)),
        ("E4 + 12 cents", 329.6276 * 2 ** (12 / 1200)),
        ("\N{FULLWIDTH LATIN CAPITAL LETTER E}4", 329.6276),
        ("110", 110.0),
        ("110.5 Hz", 110.5),
        (82.4, 82.4),
        (np.float32(110.0), 110.0),
    ],
)
def test_a_pitch_is_a_note_or_a_number_of_hertz(text: str | float, frequency: float) -> None:
    assert pitch(text) == pytest.approx(frequency, rel=1e-6)


@pytest.mark.parametrize(
    "text", ["", "E", "H2", "E44", "4E", "low", "E4+", "-110", "0", "nan", "inf", "110 m"]
)
def test_anything_else_is_refused_in_a_line(text: str) -> None:
    with pytest.raises(InputError) as caught:
        pitch(text)
    assert f"'{text}'" in caught.value.given
    assert ("E2, E3 or E4" in caught.value.remedy) == (text == "E")


def test_a_name_is_read_back_to_half_a_cent() -> None:
    for frequency in np.geomspace(20.0, 5000.0, 200).tolist():
        assert abs(1200.0 * np.log2(pitch(pitch_name(frequency)) / frequency)) <= 0.5 + 1e-9
