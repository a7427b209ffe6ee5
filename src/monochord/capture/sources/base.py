"""The contract of a source: frozen options, opened into a stream of blocks."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass

from monochord.core.errors import InputError
from monochord.core.ranges import Checked
from monochord.core.types import Block, Contact, Signal, StreamHealth, Truth
from monochord.core.units import Metres, Newtons, Samples, Seconds

MAX_CHANNELS = 64
"""Largest number of channels: two microphones for each of 32 strings."""
MIN_RATE, MAX_RATE = 16_000, 192_000
"""Range of sample rates in Hz: a string's partials need 16 kHz, and interfaces offer up to 192 kHz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlSetting:
    """A source's setting that can change at run time: name, choices, current value."""

    name: str
    choices: tuple[str, ...]
    value: str


class Controls(ABC):
    """Controls of a running source, usable from any thread: touch its string and change its settings.

    Simulated strings have controls, real ones do not. Positions are measured from pickup 1.
    """

    @property
    @abstractmethod
    def positions(self) -> tuple[Metres, Metres]:
        """Range of touch positions, in m."""

    @property
    @abstractmethod
    def forces(self) -> tuple[Newtons, Newtons]:
        """Range of touch forces, in N."""

    @property
    @abstractmethod
    def settings(self) -> tuple[ControlSetting, ...]:
        """Current settings that can be changed."""

    @abstractmethod
    def touch(self, contact: Contact) -> None:
        """Touch the string, or move the touching object there; values out of range are clipped.

        `slip_velocity` is the object's speed across the string in m/s.
        """

    @abstractmethod
    def release(self) -> None:
        """Lift the object off the string."""

    @abstractmethod
    def change(self, name: str, value: str) -> None:
        """Change a setting; raises `InputError` for an unknown setting or value."""


class Stream(ABC):
    """An open source. Iterating yields blocks in order until the source ends.

    Frame indices never go back: ``block.start == previous end + block.dropped``. Lost frames are counted in
    `health` and marked on the next block; a stream never invents samples. `close` (or leaving the context)
    may be called from another thread and ends the iteration.

    Examples
    --------
    >>> import numpy as np
    >>> from monochord import Block, Signal, Stream
    >>> class Silence(Stream):
    ...     @property
    ...     def signal(self) -> Signal:
    ...         return Signal(sample_rate=44100, channels=2)
    ...
    ...     def __iter__(self) -> Iterator[Block]:
    ...         for start in range(0, 44100, 441):
    ...             yield Block(samples=np.zeros((2, 441), np.float32), start=start)
    >>> sum(block.samples.shape[1] for block in Silence())
    44100
    """

    @property
    @abstractmethod
    def signal(self) -> Signal:
        """Rate, channels and, where known, the string."""

    @abstractmethod
    def __iter__(self) -> Iterator[Block]:
        """Yield blocks; waits where the device is slower than the reader."""

    def in_time(self) -> Iterator[Block]:
        """Yield blocks; while a device is absent, yield the lost frames as blocks without samples."""
        return iter(self)

    def close(self) -> None:  # noqa: B027
        """End the iteration, from any thread; a stream that never waits need not override it."""

    @property
    def pending(self) -> Samples:
        """Frames captured but not yet yielded: the reader's backlog. Zero for a file."""
        return 0

    @property
    def delay(self) -> Seconds:
        """How long a frame waits for later ones before it is yielded, in s; part of the latency."""
        return 0.0

    @property
    def paced(self) -> bool:
        """Whether a clock sets the pace, so that a late reader loses windows."""
        return False

    @property
    def health(self) -> StreamHealth:
        """Counters so far."""
        return StreamHealth()

    @property
    def controls(self) -> Controls | None:
        """Controls of a simulated string; None where there are none."""
        return None

    @property
    def simulated(self) -> bool:
        """Whether the source says that its sound is simulated; what a device plays says nothing of it."""
        return self.controls is not None

    def truth(self, start: Samples, stop: Samples) -> Truth:  # noqa: ARG002
        """Return the true labels over [start, stop); empty on real hardware."""
        return {}


class Source(Checked, ABC):
    """Options of a source, as a frozen keyword-only dataclass whose first field is the input.

    The command line's INPUT argument sets that first field. `open` raises `InputError` for invalid options or
    an unusable file, and `DeviceError` for a missing device or server.

    Examples
    --------
    >>> from contextlib import contextmanager
    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> import monochord as mc
    >>> class Silence(mc.Stream):
    ...     signal = mc.Signal(sample_rate=44100, channels=2)
    ...
    ...     def __iter__(self) -> Iterator[mc.Block]:
    ...         yield mc.Block(samples=np.zeros((2, 8820), np.float32), start=0)
    >>> @dataclass(frozen=True, slots=True, kw_only=True)
    ... class Quiet(mc.Source):
    ...     @contextmanager
    ...     def open(self) -> Iterator[mc.Stream]:
    ...         yield Silence()
    >>> [update.contact.reason for update in mc.listen(Quiet(), hop=0.1)]
    ['silence', 'silence']
    """

    @abstractmethod
    def open(self) -> AbstractContextManager[Stream]:
        """Open the source; leaving the context releases the device or file."""


def refuse_other_channels(channels: int) -> None:
    """Raise `InputError` for no channels, or more than `MAX_CHANNELS`."""
    if not 1 <= channels <= MAX_CHANNELS:
        raise InputError(f"{channels} channels", f"1 or 2, or up to {MAX_CHANNELS} for several strings")


def refuse_other_rates(sample_rate: float, what: str, remedy: str) -> None:
    """Raise `InputError` for a sample rate below 16 kHz or above 192 kHz."""
    if not MIN_RATE <= sample_rate <= MAX_RATE:
        raise InputError(f"{what} at {sample_rate:g} Hz", f"{MIN_RATE} to {MAX_RATE} Hz", remedy)
