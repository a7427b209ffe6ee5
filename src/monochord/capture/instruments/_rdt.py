"""Raw Data Transfer, the ATI Net F/T protocol: its packets, and the settings that scale them."""

import socket
import struct
import time
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from types import MappingProxyType
from typing import Any

import numpy as np

from monochord.core.errors import DeviceError
from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds

RDT_PORT = 49152
SETTINGS = "/netftapi2.xml"
INTERNAL_RATE = 7000.0

STOP, STREAM, RESET_LATCH, BIAS = 0x0000, 0x0002, 0x0041, 0x0042
HEADER = 0x1234

RECORD = np.dtype([("rdt", ">u4"), ("ft", ">u4"), ("status", ">u4"), ("counts", ">i4", 6)])
"""A record: RDT sequence, F/T sequence, status word, Fx Fy Fz Tx Ty Tz in counts."""

LONGEST_SETTINGS = 1 << 20
LONGEST_DETAIL = 100
COUNTS_PER_UNIT = (1e-6, 1e15)
RATES = (1e-2, 1e6)
"""Valid ranges of a device's settings, in counts per unit and Hz; values outside would overflow.
"""
QUOTED = 40
NEWTONS = MappingProxyType(
    {
        "lbf": 4.4482216152605,
        "n": 1.0,
        "klbf": 4448.2216152605,
        "kn": 1e3,
        "kgf": 9.80665,
        "gf": 9.80665e-3,
    }
)
NEWTON_METRES = MappingProxyType(
    {
        "lbfin": 0.1129848290276,
        "lbfft": 1.3558179483314,
        "nm": 1.0,
        "nmm": 1e-3,
        "kgfcm": 0.0980665,
        "knm": 1e3,
    }
)
"""SI units by the letters of a unit's word.

A device's unit codes number them in this order from 1, as in ATI's Net F/T manual 9620-05 (configurations
page, and the reply to "Read Calibration Info").
"""
DETAILS = (
    "prodname",
    "setserial",
    "cfgnam",
    "cfgcalsel",
    "calsn",
    "comrdtrate",
    "runrate",
    "scfgfu",
    "scfgtu",
    "cfgfu",
    "cfgtu",
    "cfgcpf",
    "cfgcpt",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CountScale:
    """The scale of a device's counts.

    `scale` (6,) is in N and N m per count, `rate` is the rate of records and `internal_rate` that of internal
    samples; `details` are the device's settings in its own words.
    """

    scale: Floats
    rate: Hertz
    internal_rate: Hertz
    details: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


def request(command: int, count: int = 0) -> bytes:
    """Return the datagram of a command; `count` is the number of records to stream, 0 for no limit."""
    return struct.pack(">HHI", HEADER, command, count)


def fetch_calibration(host: str, place: str, port: int, deadline: Seconds) -> CountScale:
    """Read a device's settings over HTTP from its IPv4 address `place`, before a monotonic deadline.

    Raises `DeviceError` where no valid settings arrive in time.
    """
    page = f"http://{host}:{port}{SETTINGS}"
    begin = time.monotonic()
    try:
        with closing(_HttpConnection(place, port, deadline)) as connection:
            connection.request("GET", SETTINGS)
            with connection.getresponse() as reply:
                text = reply.read(LONGEST_SETTINGS + 1) if reply.status == HTTPStatus.OK else b""
    except TimeoutError as error:
        line = f"Net F/T at {host}: {page}: no complete reply within {deadline - begin:.2g} s"
        raise DeviceError(f"{line}; is it on, and at this address?") from error
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise DeviceError(f"Net F/T at {host}: {page}: {reason}; is it on, and at this address?") from error
    except (HTTPException, ValueError) as error:
        line = f"Net F/T at {host}: {page} does not answer in HTTP ({_quoted(str(error))}); is it a Net F/T?"
        raise DeviceError(line) from error
    if reply.status != HTTPStatus.OK:
        raise DeviceError(f"Net F/T at {host}: {page} answers HTTP status {reply.status}; is it a Net F/T?")
    return read_calibration(text, f"Net F/T at {host}")


class _HttpConnection(HTTPConnection):
    """An HTTP connection that ends at a monotonic deadline, however slow the other end is."""

    def __init__(self, place: str, port: int, deadline: Seconds) -> None:
        super().__init__(place, port)
        self._deadline = deadline

    def connect(self) -> None:
        self.sock = _HurriedSocket(self._deadline)
        self.sock.connect((self.host, self.port))


class _HurriedSocket(socket.socket):
    """A TCP socket on which each wait ends at a monotonic deadline."""

    def __init__(self, deadline: Seconds) -> None:
        super().__init__(socket.AF_INET, socket.SOCK_STREAM)
        self._deadline = deadline

    def connect(self, address: Any) -> None:
        self._hurry()
        super().connect(address)

    def recv_into(self, buffer: Any, nbytes: int = 0, flags: int = 0) -> int:
        self._hurry()
        return super().recv_into(buffer, nbytes, flags)

    def _hurry(self) -> None:
        left = self._deadline - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        self.settimeout(left)


def read_calibration(text: bytes, device: str) -> CountScale:
    """Return the calibration in ``netftapi2.xml``; raises `DeviceError` where it is invalid.

    The text is decoded as UTF-8, else Latin-1, whatever encoding it declares, so that the checks see exactly
    the parsed text.
    """
    if len(text) > LONGEST_SETTINGS:
        raise DeviceError(f"{device}: its settings exceed {LONGEST_SETTINGS} bytes; is it a Net F/T?")
    try:
        plain = text.decode("utf-8-sig")
    except UnicodeDecodeError:
        plain = text.decode("latin-1")
    # From a NUL expat takes it that a text is UTF-16, whatever it was said to be.
    if any(mark in plain for mark in ("\0", "<!DOCTYPE", "<!ENTITY")):
        raise DeviceError(
            f"{device}: its settings hold a NUL, a document type or XML entities, unlike those of a Net F/T"
        )
    try:
        elements = ET.fromstring(plain).iter()  # noqa: S314  (no entities)  # nosec B314
    except (ET.ParseError, ValueError) as error:
        given = f"{device}: its settings are not XML, but begin with {_quoted(plain)}"
        raise DeviceError(f"{given}; is it a Net F/T?") from error
    settings = {e.tag.rpartition("}")[2].lower(): (e.text or "").strip() for e in elements}
    force = _per_unit(settings, device, "cfgcpf", "cfgfu", NEWTONS)
    torque = _per_unit(settings, device, "cfgcpt", "cfgtu", NEWTON_METRES)
    return CountScale(
        scale=np.array([force] * 3 + [torque] * 3),
        rate=_number(settings, device, "comrdtrate", INTERNAL_RATE, RATES),
        internal_rate=_number(settings, device, "runrate", INTERNAL_RATE, RATES),
        details=MappingProxyType(
            {name: settings[name][:LONGEST_DETAIL] for name in DETAILS if settings.get(name)}
        ),
    )


def _per_unit(
    settings: Mapping[str, str], device: str, counts: str, unit: str, units: Mapping[str, float]
) -> float:
    """Return SI units per count, from a unit's code or its word (the same setting with an ``s`` before it).

    Raises `DeviceError` where both are missing, or where code and word name different units.
    """
    if counts not in settings:
        raise DeviceError(f"{device}: its settings have no '{counts}'; is it a Net F/T?")
    code, word = settings.get(unit, ""), settings.get(f"s{unit}", "")
    coded = dict(zip(map(str, range(1, len(units) + 1)), units, strict=True))
    named = "".join(filter(str.isalpha, word)).lower()
    if not code and not word:
        raise DeviceError(f"{device}: its settings name no unit ('{unit}' or 's{unit}'); set one on its page")
    if word and named not in units:
        raise DeviceError(f"{device}: unit {_quoted(word)} (s{unit}): known are {', '.join(units)}")
    if code and code not in coded:
        known = ", ".join(f"{number} {name}" for number, name in coded.items())
        raise DeviceError(f"{device}: unit {_quoted(code)} ({unit}): known are {known}")
    if code and word and coded[code] != named:
        given = f"{_quoted(word)} (s{unit}), but code {code} ({unit}), which is {coded[code]}"
        raise DeviceError(f"{device}: unit {given}; set it again on its page")
    return units[named or coded[code]] / _number(settings, device, counts, 0.0, COUNTS_PER_UNIT)


def _number(
    settings: Mapping[str, str], device: str, name: str, default: float, allowed: tuple[float, float]
) -> float:
    text = settings.get(name) or str(default)
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    lowest, highest = allowed
    if not lowest <= number <= highest:
        raise DeviceError(
            f"{device}: setting {name} is {_quoted(text)}, not a number from {lowest:g} to {highest:g}"
        )
    return number


def _quoted(text: str) -> str:
    """Return the first characters of a device's answer, quoted, with everything but plain ASCII escaped."""
    return ascii(text[:QUOTED]) + ("..." if len(text) > QUOTED else "")
