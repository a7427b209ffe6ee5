import numpy as np
import pytest

from monochord.errors import DeviceError
from monochord.instruments._rdt import read_calibration

SETTINGS = """<?xml version="1.0"?><netft xmlns="urn:x"><prodname>Box</prodname><setserial>FT1</setserial>
<cfgcpf>{force}</cfgcpf><scfgfu>{force_unit}</scfgfu><cfgcpt>1000</cfgcpt><scfgtu>{torque_unit}</scfgtu></netft>"""


def settings(force: str = "1000000", force_unit: str = "N", torque_unit: str = "Nm") -> bytes:
    return SETTINGS.format(force=force, force_unit=force_unit, torque_unit=torque_unit).encode()


def test_counts_get_the_scale_of_the_settings() -> None:
    calibration = read_calibration(settings(), "box")
    assert np.allclose(calibration.scale, [1e-6] * 3 + [1e-3] * 3)
    assert calibration.rate == calibration.internal_rate == 7000.0
    assert calibration.details["setserial"] == "FT1"


def test_other_units_become_si() -> None:
    calibration = read_calibration(settings("1", "lbf", "lbf-in"), "box")
    assert np.allclose(calibration.scale[[0, 3]], [4.4482216, 0.1129848e-3])
    assert read_calibration(settings("1", "kN", "N-mm"), "box").scale[0] == 1000.0


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (b"not XML", "its settings are not XML"),
        (b"<a><cfgcpt>1</cfgcpt></a>", "no 'cfgcpf'; is it a Net F/T"),
        (settings("0"), "setting cfgcpf is '0', not a number above 0"),
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
