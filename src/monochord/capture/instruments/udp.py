"""Arbitrary values as JSON datagrams: a thermometer, a motor current, another force sensor."""

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
"""Largest valid value: no measurement in SI units exceeds it."""
STANDARD_COLUMNS = MappingProxyType({"wrench": WRENCH, "pose": POSE})


@dataclass(frozen=True, slots=True, kw_only=True)
class Udp(Instrument):
    """Named values received at `address`, one JSON object per datagram.

    A datagram is ``{"stamp": 1.5, "sequence": 7, "values": {"temperature": 293.1}}``: seconds of the sender's
    clock, its count, and values by column; stamp and sequence are optional. A missing column becomes NaN, an
    unknown name is ignored, and of a repeated name the last value counts. An unreadable datagram counts as
    faulty, and so does a value beyond 1e18.

    Parameters
    ----------
    address
        Address to bind: ``HOST:PORT``, or ``PORT`` for this machine alone.
    stream
        Name of the stream in a session: lower-case letters, digits and ``_``.
    columns
        Names of the values.
    units
        SI units, one for each column; empty if unknown.
    rate
        Expected readings per second; 0 if unknown.
    """

    address: str = "127.0.0.1:9872"
    stream: str = "numbers"
    columns: tuple[str, ...] = ("value",)
    units: tuple[str, ...] = ()
    rate: Annotated[Hertz, Meta(ge=0.0, le=100e3)] = 0.0

    @contextmanager
    def open(self) -> Generator["JsonConnection[_Numbers]"]:
        """Listen; raises `DeviceError` if the port is taken. A missing sender is not an error."""
        feed = self._feed()
        with listening(self.address) as sock:
            yield JsonConnection(sock, feed, _Numbers, self._values)

    def _values(self, message: "_Numbers") -> tuple[float, ...] | None:
        values = tuple(message.values.get(column, math.nan) for column in self.columns)
        return None if any(abs(value) > MAX_VALUE for value in values) else values

    def _feed(self) -> Feed:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.stream):
            raise InputError(
                f"stream '{self.stream}'", "lower-case letters, digits and _, starting with a letter"
            )
        columns = self.columns
        if not columns or not all(columns) or len(set(columns)) < len(columns):
            raise InputError(f"columns {', '.join(columns) or 'none'}", "at least one name, all different")
        if self.stream in STANDARD_COLUMNS and columns != STANDARD_COLUMNS[self.stream]:
            raise InputError(
                f"columns of the stream '{self.stream}'", ", ".join(STANDARD_COLUMNS[self.stream])
            )
        if self.units and len(self.units) != len(columns):
            raise InputError(
                f"{len(self.units)} units for {len(columns)} columns", "one for each column, or none"
            )
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
