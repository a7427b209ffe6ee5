"""Any numbers as JSON datagrams: a thermometer, a motor's current, a force sensor of another make."""

import math
import re
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated

from msgspec import Meta

from monochord.capture.address import listening
from monochord.capture.instruments._json_feed import JsonConnection, Stamped
from monochord.capture.instruments.base import Instrument
from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Feed
from monochord.core.units import Hertz

MAX_VALUE = 1e18
"""A larger value is faulty: no measurement is so large in SI units."""
STANDARD_COLUMNS = MappingProxyType({"wrench": WRENCH, "pose": POSE})


@dataclass(frozen=True, slots=True, kw_only=True)
class Udp(Instrument):
    """Named numbers sent to `address`, each datagram a JSON object.

    A datagram is ``{"stamp": 1.5, "sequence": 7, "values": {"temperature": 293.1}}``: seconds of the
    sender's clock, its count, and values by column; stamp and sequence are optional. A column that is
    missing is unknown (NaN), a name that is no column is ignored, of a repeated name the last value counts. A
    datagram that cannot be read counts as faulty, and so does a value beyond 1e18.

    Parameters
    ----------
    address
        Address to bind: ``HOST:PORT``, or ``PORT`` for this machine alone.
    stream
        Name of the stream in a session: lower-case letters, digits and ``_``.
    columns
        Names of the values.
    units
        Their units in SI, one each; none if unknown.
    rate
        Expected readings a second; 0 if unknown.
    """

    address: str = "127.0.0.1:9872"
    stream: str = "numbers"
    columns: tuple[str, ...] = ("value",)
    units: tuple[str, ...] = ()
    rate: Annotated[Hertz, Meta(ge=0.0, le=100e3)] = 0.0

    @contextmanager
    def open(self) -> Generator["JsonConnection[_Numbers]"]:
        """Listen; raises `DeviceError` if the port is taken. A missing sender is no error."""
        feed = self._feed()
        with listening(self.address) as sock:
            yield JsonConnection(sock, feed, _Numbers, self._values)

    def _values(self, message: "_Numbers") -> tuple[float, ...] | None:
        values = tuple(message.values.get(column, math.nan) for column in self.columns)
        return None if any(abs(value) > MAX_VALUE for value in values) else values

    def _feed(self) -> Feed:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.stream):
            raise InputError(f"stream '{self.stream}'", "small letters, digits and _, a letter first")
        columns = self.columns
        if not columns or not all(columns) or len(set(columns)) < len(columns):
            raise InputError(f"columns {', '.join(columns) or 'none'}", "one name or more, all different")
        if self.stream in STANDARD_COLUMNS and columns != STANDARD_COLUMNS[self.stream]:
            raise InputError(
                f"columns of the stream '{self.stream}'", ", ".join(STANDARD_COLUMNS[self.stream])
            )
        if self.units and len(self.units) != len(columns):
            raise InputError(f"{len(self.units)} units for {len(columns)} columns", "one each, or none")
        return Feed(
            stream=self.stream,
            columns=columns,
            units=self.units or ("",) * len(columns),
            rate=self.rate,
            ticks=1e9,
            details=MappingProxyType({"address": self.address}),
        )


class _Numbers(Stamped, kw_only=True):
    values: dict[str, float]
