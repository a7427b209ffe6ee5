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
    with pytest.raises(DeviceError, match="XML") as caught:
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


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (b"not XML", "its settings are not XML"),
        (b"<a><cfgcpt>1</cfgcpt></a>", "no 'cfgcpf'; is it a Net F/T"),
        (settings("0"), "setting cfgcpf is '0', not a number from"),
        (settings("nan"), "setting cfgcpf is 'nan'"),
        (settings("many"), "setting cfgcpf is 'many'"),
        (settings(force_unit="stone"), r"unit 'stone' \(scfgfu\): known are n, kn"),
        (b"<!DOCTYPE a [<!ENTITY b 'c'>]><a/>", "XML entities"),
    ],
)
def test_settings_that_make_no_sense_are_refused_in_one_line(text: bytes, line: str) -> None:
    with pytest.raises(DeviceError, match=line) as caught:
        read_calibration(text, "box")
    assert "\n" not in str(caught.value)
