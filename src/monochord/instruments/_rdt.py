"""Raw Data Transfer, the protocol of an ATI Net F/T: its packets, and the settings that give them a scale."""

import struct
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from types import MappingProxyType

import numpy as np

from monochord.errors import DeviceError
from monochord.types import Floats
from monochord.units import Hertz, Seconds

RDT_PORT = 49152
SETTINGS = "/netftapi2.xml"
INTERNAL_RATE = 7000.0

STOP, STREAM, RESET_LATCH, BIAS = 0x0000, 0x0002, 0x0041, 0x0042
HEADER = 0x1234

RECORD = np.dtype([("rdt", ">u4"), ("ft", ">u4"), ("status", ">u4"), ("counts", ">i4", 6)])
"""A reply: number in this stream, number of the internal sample, status word, Fx Fy Fz Tx Ty Tz in counts."""

LONGEST_SETTINGS = 1 << 20
NEWTONS = MappingProxyType(
    {"n": 1.0, "kn": 1e3, "lbf": 4.4482216152605, "klbf": 4448.2216152605, "kgf": 9.80665}
)
NEWTON_METRES = MappingProxyType(
    {
        "nm": 1.0,
        "nmm": 1e-3,
        "knm": 1e3,
        "lbfin": 0.1129848290276,
        "lbfft": 1.3558179483314,
        "kgfcm": 0.0980665,
    }
)
KEPT = (
    "prodname",
    "setserial",
    "cfgnam",
    "cfgcalsel",
    "calsn",
    "comrdtrate",
    "runrate",
    "scfgfu",
    "scfgtu",
    "cfgcpf",
    "cfgcpt",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """What gives a device's counts their scale.

    `scale` (6,) is in N and N m a count, `rate` that of its records and `internal_rate` that of the samples
    inside; `details` are its settings as it words them.
    """

    scale: Floats
    rate: Hertz
    internal_rate: Hertz
    details: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


def request(command: int, count: int = 0) -> bytes:
    """Return the datagram of a command; `count` is how many records to stream, 0 for no end."""
    return struct.pack(">HHI", HEADER, command, count)


def fetch_calibration(host: str, port: int, timeout: Seconds) -> Calibration:
    """Read a device's settings over HTTP; raises `DeviceError` where there are none that make sense."""
    place = f"http://{host}:{port}{SETTINGS}"
    try:
        with closing(HTTPConnection(host, port, timeout=timeout)) as connection:
            connection.request("GET", SETTINGS)
            reply = connection.getresponse()
            text = reply.read(LONGEST_SETTINGS)
    except (OSError, HTTPException) as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise DeviceError(f"Net F/T at {host}: {place}: {reason}; is it on, and at this address?") from error
    if reply.status != HTTPStatus.OK:
        raise DeviceError(f"Net F/T at {host}: {place} answers {reply.status}; is it a Net F/T?")
    return read_calibration(text, f"Net F/T at {host}")


def read_calibration(text: bytes, device: str) -> Calibration:
    """Return the calibration that ``netftapi2.xml`` tells; raises `DeviceError` where it makes no sense."""
    try:
        if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
            raise DeviceError(f"{device}: its settings declare XML entities; no Net F/T does")
        elements = ET.fromstring(text).iter()  # noqa: S314  (no entities)
    except ET.ParseError as error:
        raise DeviceError(f"{device}: its settings are not XML ({error})") from error
    found = {e.tag.rpartition("}")[2].lower(): (e.text or "").strip() for e in elements}
    force = _per_unit(found, device, "cfgcpf", "scfgfu", NEWTONS)
    torque = _per_unit(found, device, "cfgcpt", "scfgtu", NEWTON_METRES)
    return Calibration(
        scale=np.array([force] * 3 + [torque] * 3),
        rate=_number(found, device, "comrdtrate", INTERNAL_RATE),
        internal_rate=_number(found, device, "runrate", INTERNAL_RATE),
        details=MappingProxyType({name: found[name] for name in KEPT if found.get(name)}),
    )


def _per_unit(
    found: Mapping[str, str], device: str, counts: str, unit: str, units: Mapping[str, float]
) -> float:
    """Return SI units a count."""
    if counts not in found:
        raise DeviceError(f"{device}: its settings have no '{counts}'; is it a Net F/T?")
    word = found.get(unit, "")
    plain = "".join(filter(str.isalpha, word)).lower() or next(iter(units))
    if plain not in units:
        raise DeviceError(f"{device}: unit '{word}' ({unit}): known are {', '.join(units)}")
    return units[plain] / _number(found, device, counts, 0.0)


def _number(found: Mapping[str, str], device: str, name: str, default: float) -> float:
    text = found.get(name) or str(default)
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0.0 < number < np.inf:
        raise DeviceError(f"{device}: setting {name} is '{text}', not a number above 0")
    return number
