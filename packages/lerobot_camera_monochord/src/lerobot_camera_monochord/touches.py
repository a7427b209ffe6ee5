"""What a datagram says of a touch: numbers for a policy, and a column of a picture."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

NAMES = ("contact", "position", "force", "slip")
"""Quantities of a touch; position in m from pickup 1, force in N, the others probabilities."""
LATE = 100
"""Datagrams by which one may come late; a sequence that is further back is another run's."""
TOUCHED = 0.5
"""Probability of contact from which a window is touched, where nothing is decided."""
UNTOUCHED_SHADE, TOUCHED_SHADE = 32, 64
"""Brightness of a string's column; without an answer it is black, so that no answer is not no contact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """A string's touch at one window; None where there is no answer."""

    contact: float | None = None
    position: float | None = None
    position_std: float | None = None
    force: float | None = None
    slip: float | None = None
    touched: bool | None = None

    @classmethod
    def of(cls, datagram: Mapping[str, Any]) -> "Touch":
        """Return the touch of a datagram: its values over time, or else those of its window.

        Examples
        --------
        >>> touch = Touch.of({"contact": 0.9, "position": 0.08, "tracked_position": 0.081, "force": None})
        >>> touch.position, touch.force, touch.touched
        (0.081, None, True)
        """
        values = {name: _number(datagram.get(f"tracked_{name}", datagram.get(name))) for name in NAMES}
        std = _number(datagram.get("tracked_position_std", datagram.get("position_std")))
        decided, contact = datagram.get("decided_contact"), values["contact"]
        if isinstance(decided, bool):
            touched: bool | None = decided
        elif contact is not None:
            touched = contact > TOUCHED
        else:
            touched = True if values["position"] is not None else None
        return cls(**values, position_std=std, touched=touched)

    def vector(self) -> NDArray[np.float32]:
        """Return `NAMES` and for each whether it is known, 1 or 0; 0 for what is not known.

        NaN would spoil the statistics that LeRobot keeps of a dataset.

        Examples
        --------
        >>> Touch(contact=1.0, position=0.08, touched=True).vector().round(2).tolist()
        [1.0, 1.0, 0.07999999821186066, 1.0, 0.0, 0.0, 0.0, 0.0]
        """
        values = [getattr(self, name) for name in NAMES]
        pairs = [(0.0, 0.0) if value is None else (value, 1.0) for value in values]
        return np.array(pairs, np.float32).ravel()

    def column(self, height: int, length: float, force: float) -> NDArray[np.uint8]:
        """Return a column (height, 3) of a picture, pickup 1 at the top.

        The place, within its standard error, is red; its green is the force up to `force` in N, its blue the
        probability of slip.

        Examples
        --------
        >>> column = Touch(position=0.05, force=1.0, touched=True).column(4, 0.2, 2.0)
        >>> column.tolist()
        [[64, 64, 64], [255, 128, 0], [64, 64, 64], [64, 64, 64]]
        """
        shade = 0 if self.touched is None else TOUCHED_SHADE if self.touched else UNTOUCHED_SHADE
        column = np.full((height, 3), shade, np.uint8)
        if self.touched and self.position is not None:
            std = self.position_std or 0.0
            first, last = (
                min(max(math.floor(height * place / length), 0), height - 1)
                for place in (self.position - std, self.position + std)
            )
            bright = min(max((self.force or 0.0) / force, 0.0), 1.0), min(max(self.slip or 0.0, 0.0), 1.0)
            column[first : last + 1] = [255, *(round(255 * each) for each in bright)]
        return column


def _number(value: Any) -> float | None:
    """Return a finite number, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:  # of a whole number beyond any
        return None


def names(strings: Sequence[str]) -> list[str]:
    """Return the names of the vector's numbers, of several strings or of one without a name.

    Examples
    --------
    >>> names(["left"])[:4]
    ['left_contact', 'left_contact_known', 'left_position', 'left_position_known']
    """
    pairs = [name for quantity in NAMES for name in (quantity, f"{quantity}_known")]
    return [f"{string}_{name}" for string in strings for name in pairs] if strings else pairs


class Picture:
    """The strings' latest columns, the newest at the right; each string has a band of the height.

    A lost datagram leaves a black column, one that comes late is left out, and a sender that begins anew has
    an empty picture.

    Examples
    --------
    >>> picture = Picture(4, 3, length=0.2, force=2.0)
    >>> picture.add({"sequence": 0, "contact": 1.0, "position": 0.05, "force": 2.0})
    >>> picture.image[:, -1].tolist()
    [[64, 64, 64], [255, 255, 0], [64, 64, 64], [64, 64, 64]]
    """

    def __init__(
        self, height: int, width: int, *, length: float, force: float, strings: Sequence[str] = ()
    ) -> None:
        if not (min(height // max(len(strings), 1), width) >= 1 and length > 0.0 and force > 0.0):
            size = f"{height} x {width} pixels for {max(len(strings), 1)} strings"
            expected = "expected a row for each string or more, and numbers above 0"
            raise ValueError(f"{size}, length {length}, force {force}: {expected}")
        self.image = np.zeros((height, width, 3), np.uint8)
        self.strings = tuple(strings)
        self._length, self._force = length, force
        self._touches = [Touch()] * max(len(strings), 1)
        self._bands = np.array_split(np.arange(height), len(self._touches))
        self._sequence = -1
        self._time: float | None = None

    @property
    def vector(self) -> NDArray[np.float32]:
        """The numbers of the latest touch of each string, as `names` has them."""
        return np.concatenate([touch.vector() for touch in self._touches])

    def add(self, datagram: Mapping[str, Any]) -> None:
        """Add a datagram, at the right of a new picture; `image` of before stays as it is.

        Raises `ValueError` for a datagram of a string that is not among `strings`.
        """
        name = datagram.get("string", "")
        if name not in (self.strings or ("",)):
            expected = ", ".join(self.strings) or "one string, without a name"
            remedy = f"configure the camera with strings: [{name}]" if name else "leave strings out"
            raise ValueError(f"a datagram of the string '{name}': expected {expected}; {remedy}")
        sequence, time = int(_number(datagram.get("sequence")) or 0), _number(datagram.get("time"))
        ahead = sequence - self._sequence
        if sequence and -LATE < ahead <= 0:
            return
        is_same_window = time is not None and time == self._time  # of another string
        columns = -(-ahead // len(self._touches)) if ahead > 0 else self.image.shape[1]
        self._sequence, self._time = sequence, time
        image = self.image.copy() if is_same_window else _moved(self.image, columns)
        at = self.strings.index(name) if self.strings else 0
        band, self._touches[at] = self._bands[at], Touch.of(datagram)
        image[band, -1] = self._touches[at].column(len(band), self._length, self._force)
        self.image = image


def _moved(image: NDArray[np.uint8], columns: int) -> NDArray[np.uint8]:
    """Return a picture moved to the left, with black columns at its right."""
    kept = image[:, columns:]
    return np.pad(kept, ((0, 0), (0, image.shape[1] - kept.shape[1]), (0, 0)))
