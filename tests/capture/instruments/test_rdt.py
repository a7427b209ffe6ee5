import re

import numpy as np
import pytest

from monochord.capture.instruments._rdt import read_calibration
from monochord.core.errors import DeviceError

SETTINGS = """<?xml version="1.0"?><netft xmlns="urn:x"><prodname>Box</prodname><setserial>FT1</setserial>
<cfgcpf>{force}</cfgcpf><scfgfu>{force_unit}</scfgfu><cfgcpt>1000</cfgcpt><scfgtu>{torque_unit}</scfgtu></netft>"""


def settings(force: str = "1000000", force_unit: str = "N", torque_unit: str = "Nm") -> bytes:
    return SETTINGS.format(force=force, force_unit=force_unit, torque_unit=torque_unit).encode()


def test_counts_get_the_scale_of_the_settings() -> None:
    calibration = read_calibration(settings(), "box")
    assert np.allclose(calibration.scale, [1e-6] * 3 + [1e-3] * 3)
    assert calibration.rate == calibration.internal_rate == 7000.0
    assert calibration.details["setserial"] == "FT1"


LAUGHS = (
    '<?xml version="1.0" encoding="{0}"?>'
    '<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;&b;"><!ENTITY d "&c;&c;">]>'
    "<a><cfgcpf>1</cfgcpf><cfgcpt>1</cfgcpt><prodname>&d;</prodname></a>"
)
OUTSIDE = LAUGHS.replace('<!ENTITY b "ha">', '<!ENTITY b SYSTEM "file:///etc/passwd">')
HIDDEN = LAUGHS.replace("<!DOCTYPE", "<?x <!-- ?><!DOCTYPE").replace("</a>", "<!-- --></a>")


@pytest.mark.parametrize("text", [LAUGHS, OUTSIDE, HIDDEN])
@pytest.mark.parametrize(
    "coding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-7", "cp037", "utf-32"]
)
def test_entities_are_refused_in_whatever_encoding(text: str, coding: str) -> None:
    named = {"utf-8-sig": "utf-8", "utf-16-le": "utf-16", "utf-16-be": "utf-16"}.get(coding, coding)
    with pytest.raises(DeviceError) as caught:
        read_calibration(text.format(named).encode(coding), "box")
    assert re.fullmatch("[ -~]{1,300}", str(caught.value))


def test_settings_with_a_mark_or_in_latin_1_are_read() -> None:
    assert read_calibration(b"\xef\xbb\xbf" + settings(), "box").scale[0] == 1e-6
    latin = settings().replace(b"Box", b"Bo\xeete")
    assert read_calibration(latin, "box").details["prodname"] == "Bo\xeete"


def test_recorded_settings_are_short() -> None:
    assert (
        len(read_calibration(settings().replace(b"Box", b"Box" * 10_000), "box").details["prodname"]) == 100
    )


def test_other_units_become_si() -> None:
    calibration = read_calibration(settings("1", "lbf", "lbf-in"), "box")
    assert np.allclose(calibration.scale[[0, 3]], [4.4482216, 0.1129848e-3])
    assert read_calibration(settings("1", "kN", "N-mm"), "box").scale[0] == 1000.0


def coded(force: str, torque: str, **words: str) -> bytes:
    """Return settings with these codes of their units, and with words if they are given."""
    told = {"cfgfu": force, "cfgtu": torque, "cfgcpf": "1000000", "cfgcpt": "1000000", **words}
    return f"<netft>{''.join(f'<{tag}>{text}</{tag}>' for tag, text in told.items())}</netft>".encode()


@pytest.mark.parametrize(
    ("force", "torque", "newtons", "newton_metres"),
    [
        ("1", "1", 4.4482216, 0.1129848),
        ("2", "3", 1.0, 1.0),
        ("3", "2", 4448.2216, 1.3558179),
        ("4", "6", 1e3, 1e3),
        ("5", "5", 9.80665, 0.0980665),
        ("6", "4", 9.80665e-3, 1e-3),
    ],
)
def test_units_are_read_by_their_codes(force: str, torque: str, newtons: float, newton_metres: float) -> None:
    expected = np.repeat([1e-6 * newtons, 1e-6 * newton_metres], 3)
    calibration = read_calibration(coded(force, torque), "box")
    assert calibration.scale == pytest.approx(expected, rel=1e-6)
    assert calibration.details["cfgfu"] == force


@pytest.mark.parametrize(
    "text",
    [
        coded("", ""),
        coded("2", ""),
        coded("0", "3"),
        coded("7", "3"),
        coded("02", "3"),
        coded("N", "3"),
        coded("1", "3", scfgfu="N"),
        coded("2", "3", scfgtu="N-mm"),
        coded("2", "3", scfgfu="2"),
        settings(force_unit=""),
        settings(torque_unit=""),
    ],
)
def test_settings_without_a_certain_unit_are_refused(text: bytes) -> None:
    with pytest.raises(DeviceError) as caught:
        read_calibration(text, "box")
    assert re.fullmatch("[ -~]{1,200}", str(caught.value))


def test_a_code_and_a_word_may_agree() -> None:
    agreeing = coded("6", "5", scfgfu="gf", scfgtu="kgf-cm")
    assert read_calibration(agreeing, "box").scale == pytest.approx(
        read_calibration(coded("6", "5"), "box").scale
    )


@pytest.mark.parametrize(
    ("text", "given"),
    [
        (b"not XML", "box"),
        (b"<a><cfgcpt>1</cfgcpt></a>", "cfgcpf"),
        (settings("0"), "'0'"),
        (settings("nan"), "'nan'"),
        (settings("many"), "'many'"),
        (settings(force_unit="stone"), "'stone'"),
    ],
)
def test_settings_that_make_no_sense_are_refused_in_one_line(text: bytes, given: str) -> None:
    with pytest.raises(DeviceError, match=given) as caught:
        read_calibration(text, "box")
    assert "\n" not in str(caught.value)
